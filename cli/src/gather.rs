//! `waymark gather`: lets a robot gather views while it drives, shows its tracks, accepts or discards them.

use super::{
    screen,
    teach::{LESSON_TIMEOUT, ServerArgs, counted, show},
};
use anyhow::Context as _;
use client::{
    MapClient,
    api::{AcceptRequest, AcceptedTrackBody, Gathering, Job, NewGatheringBody, TrackSummary},
};
use std::path::{Path, PathBuf};

/// `waymark gather`.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Start: while the robot drives, views of flat four-sided objects are stored. Prints the number of the gathering.
    Start {
        /// The robot.
        #[arg(long)]
        robot: String,
        /// Only views of this landmark, which must be learnt already.
        #[arg(long)]
        landmark: Option<String>,
        /// Views of every landmark that is recognised beyond doubt, too.
        #[arg(long)]
        known: bool,
        #[command(flatten)]
        at: At,
    },
    /// Stop; the tracks wait for a decision.
    Stop {
        /// Number of the gathering.
        gathering: i64,
        #[command(flatten)]
        at: At,
    },
    /// List the gatherings of a map.
    List {
        #[command(flatten)]
        at: At,
    },
    /// Show the tracks that wait for a decision: views, place, gates.
    Show {
        /// Number of the gathering.
        gathering: i64,
        /// Write a picture of each track here, NUMBER.png.
        #[arg(long, value_name = "DIR")]
        pictures: Option<PathBuf>,
        #[command(flatten)]
        at: At,
    },
    /// Make landmarks of tracks, and learn them.
    Accept {
        /// Number of the gathering.
        gathering: i64,
        /// NUMBER=NAME of each track; NUMBER alone for views of a landmark that is known.
        #[arg(required = true, value_parser = pick)]
        picks: Vec<AcceptedTrackBody>,
        #[command(flatten)]
        at: At,
    },
    /// Discard tracks.
    Discard {
        /// Number of the gathering.
        gathering: i64,
        /// Numbers of the tracks.
        #[arg(required = true)]
        tracks: Vec<u32>,
        #[command(flatten)]
        at: At,
    },
}

/// Which map of which server.
#[derive(Debug, clap::Args)]
pub(crate) struct At {
    /// The map.
    #[arg(long)]
    map: String,
    #[command(flatten)]
    server: ServerArgs,
}

fn pick(text: &str) -> Result<AcceptedTrackBody, String> {
    let (number, name) = text.split_once('=').map_or((text, None), |(n, name)| (n, Some(name.to_owned())));
    let track = number.parse().map_err(|_e| "NUMBER=NAME, such as 3=poster".to_owned())?;
    Ok(AcceptedTrackBody { track, name })
}

fn line(g: &Gathering) -> String {
    let of = g.landmark.as_deref().unwrap_or("whatever is new");
    let state = if g.open { "open" } else { "ended" };
    format!("{}  {} with {}, of {of}: {}", g.id, state, g.robot, counted(g.counts.kept, "view"))
}

fn track_line(c: &TrackSummary) -> String {
    let views = counted(c.views.len() as u64, "view");
    let verdict = if c.passes { "passes every gate".to_owned() } else { c.details().join("; ") };
    let known = c.landmark.as_ref().map_or_else(String::new, |name| format!(" of {name}"));
    format!("{}  {views}{known}, {}: {verdict}", c.number, c.place_text())
}

/// Runs the command.
pub(crate) async fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Start { robot, landmark, known, at } => {
            let new = NewGatheringBody { robot: robot.clone(), landmark: landmark.clone(), known: *known };
            let begun = at.client()?.start_gathering(&at.map, &new).await?;
            show(&at.server, &begun, &format!("gathering {} has begun", begun.id))
        }
        Command::Stop { gathering, at } => {
            let ended = at.client()?.stop_gathering(&at.map, *gathering).await?;
            show(&at.server, &ended, &line(&ended))
        }
        Command::List { at } => {
            let all = at.client()?.gatherings(&at.map).await?;
            show(&at.server, &all, &all.iter().map(line).collect::<Vec<_>>().join("\n"))
        }
        Command::Show { gathering, pictures, at } => {
            let maps = at.client()?;
            let found = maps.tracks(&at.map, *gathering).await?;
            if let Some(folder) = pictures {
                draw(&maps, (&at.map, *gathering), &found, folder).await?;
            }
            show(&at.server, &found, &found.iter().map(track_line).collect::<Vec<_>>().join("\n"))
        }
        Command::Accept { gathering, picks, at } => accept(at, *gathering, picks).await,
        Command::Discard { gathering, tracks, at } => {
            let maps = at.client()?;
            for track in tracks {
                maps.discard_track(&at.map, *gathering, *track).await?;
            }
            show(&at.server, tracks, &format!("{} discarded", counted(tracks.len() as u64, "track")))
        }
    }
}

async fn draw(
    maps: &MapClient,
    (map, gathering): (&str, i64),
    found: &[TrackSummary],
    folder: &Path,
) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    for track in found {
        let Some(best) = track.best_view else { continue };
        let png = maps.track_icon(map, gathering, track.number, best).await?;
        let path = folder.join(format!("{}.png", track.number));
        std::fs::write(&path, png).with_context(|| path.display().to_string())?;
    }
    Ok(())
}

async fn accept(at: &At, gathering: i64, picks: &[AcceptedTrackBody]) -> anyhow::Result<()> {
    let maps = at.client()?;
    let request = AcceptRequest { tracks: picks.to_vec(), learn: true };
    let accepted = maps.accept_tracks(&at.map, gathering, &request).await?;
    let bar = screen::progress(1000, "learning");
    let job = match accepted.job.clone() {
        Some(job) => {
            let report = |job: &Job| bar.set_position((job.progress * 1000.0) as u64);
            maps.wait_for_job(job, LESSON_TIMEOUT, report).await?.message
        }
        None => String::new(),
    };
    bar.finish_and_clear();
    let names: Vec<&str> = accepted.landmarks.iter().map(|l| l.name.as_str()).collect();
    show(&at.server, &accepted, &format!("{}: {}", names.join(", "), job))
}

impl At {
    fn client(&self) -> anyhow::Result<MapClient> {
        Ok(MapClient::new(self.server.address())?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picks_are_read() {
        assert_eq!(pick("3=poster").unwrap(), AcceptedTrackBody { track: 3, name: Some("poster".into()) });
        assert_eq!(pick("12").unwrap(), AcceptedTrackBody { track: 12, name: None });
        assert!(pick("poster=3").is_err() && pick("-1=a").is_err() && pick("").is_err());
    }
}
