//! `waymark gathering`: lets a robot gather training views while it drives, shows its tracks,
//! discards them.

use super::{
    screen::{Table, counted},
    session::{Consent, MapArgs, Session},
};
use anyhow::Context as _;
use client::{
    MapClient,
    api::{Gathering, NewGatheringBody, TrackSummary},
};
use std::path::{Path, PathBuf};

/// `waymark gathering`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    map: MapArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Start: while the robot drives, views of flat four-sided objects are stored.
    ///
    /// Prints the number of the gathering.
    Start {
        /// The robot.
        robot: String,
        /// Only views of this landmark, which must be learnt already.
        #[arg(long)]
        landmark: Option<String>,
        /// Views of every landmark that is recognised beyond doubt, too.
        #[arg(long)]
        include_known: bool,
    },
    /// Stop; the tracks wait for a decision.
    Stop {
        /// Number of the gathering.
        gathering: i64,
    },
    /// List the gatherings of a map.
    List,
    /// Show the tracks that wait for a decision: views, place, gates.
    Show {
        /// Number of the gathering.
        gathering: i64,
        /// Write a picture of each track here, NUMBER.png.
        #[arg(long, value_name = "DIR")]
        pictures: Option<PathBuf>,
    },
    /// Discard tracks. This cannot be undone.
    Discard {
        /// Number of the gathering.
        gathering: i64,
        /// Numbers of the tracks.
        #[arg(required = true)]
        tracks: Vec<u32>,
        #[command(flatten)]
        consent: Consent,
    },
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.map.session()?;
    let done = on_map(&session, &args.verb).await;
    session.explained(done).await
}

async fn on_map(session: &Session, verb: &Verb) -> anyhow::Result<()> {
    let (maps, map) = (session.maps(), session.map().await?);
    match verb {
        Verb::Start { robot, landmark, include_known } => {
            let new =
                NewGatheringBody { robot: robot.clone(), landmark: landmark.clone(), known: *include_known };
            let begun = maps.start_gathering(map, &new).await?;
            session.show(&begun, &format!("gathering {} has begun", begun.id))?;
            session.note(&format!(
                "  Drive {robot} past what is to be taught, then: waymark gathering stop {}",
                begun.id
            ));
            Ok(())
        }
        Verb::Stop { gathering } => {
            let ended = maps.stop_gathering(map, *gathering).await?;
            session.show(&ended, &line(&ended))?;
            session.note(&format!("  Look at it: waymark gathering show {gathering} --pictures tracks"));
            Ok(())
        }
        Verb::List => {
            let all = maps.gatherings(map).await?;
            let table = |all: &[Gathering]| {
                Table::of(["gathering", "robot", "of", "state", "views"], all, |g| {
                    [
                        g.id.to_string(),
                        g.robot.clone(),
                        g.landmark.clone().unwrap_or_else(|| "whatever is new".to_owned()),
                        if g.open { "goes on" } else { "ended" }.to_owned(),
                        g.counts.kept.to_string(),
                    ]
                })
            };
            session.list(&all, table, "Nothing was gathered yet. Begin: waymark gathering start ROBOT")
        }
        Verb::Show { gathering, pictures } => show(session, map, *gathering, pictures.as_deref()).await,
        Verb::Discard { gathering, tracks, consent } => {
            let count = counted(tracks.len() as u64, "track");
            consent.ask(&format!("Discard {count} of gathering {gathering}? This cannot be undone."))?;
            for track in tracks {
                maps.discard_track(map, *gathering, *track).await?;
            }
            session.show(tracks, &format!("{count} discarded"))
        }
    }
}

async fn show(session: &Session, map: &str, gathering: i64, pictures: Option<&Path>) -> anyhow::Result<()> {
    let found = session.maps().tracks(map, gathering).await?;
    if let Some(folder) = pictures {
        write_pictures(session.maps(), (map, gathering), &found, folder).await?;
    }
    let table = |found: &[TrackSummary]| {
        Table::of(["track", "landmark", "views", "place", "gates"], found, |t| {
            let gates = if t.passes { "passed".to_owned() } else { without_repeats(t.details()).join(" ") };
            [
                t.number.to_string(),
                t.landmark.clone().unwrap_or_else(|| "new".to_owned()),
                t.views.len().to_string(),
                t.place_text(),
                gates,
            ]
        })
    };
    session.list(&found, table, "Nothing waits for a decision.")?;
    if !found.is_empty() {
        session
            .note(&format!("  Make landmarks of them: waymark landmark accept {gathering} NUMBER=NAME..."));
    }
    Ok(())
}

/// Reasons may occur for several views of a track.
fn without_repeats(mut reasons: Vec<String>) -> Vec<String> {
    let mut known = std::collections::BTreeSet::new();
    reasons.retain(|reason| known.insert(reason.clone()));
    reasons
}

fn line(g: &Gathering) -> String {
    let of = g.landmark.as_deref().unwrap_or("whatever is new");
    let state = if g.open { "goes on" } else { "ended" };
    format!(
        "gathering {} with {}, of {of}: {state}; {} looked at, {}",
        g.id,
        g.robot,
        counted(g.counts.frames, "picture"),
        counted(g.counts.kept, "useful view")
    )
}

async fn write_pictures(
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

#[cfg(test)]
mod tests {
    use super::*;
    use client::api::GatheringCountsBody;

    #[test]
    fn a_gathering_is_shown_in_pictures_and_useful_views() {
        let counts = GatheringCountsBody { frames: 98, kept: 5, ..GatheringCountsBody::default() };
        let gathering = Gathering {
            id: 1,
            map: "office".into(),
            robot: "r1".into(),
            landmark: None,
            known: false,
            open: false,
            counts,
            created_ms: 0,
            ended_ms: Some(1),
        };
        let expected =
            "gathering 1 with r1, of whatever is new: ended; 98 pictures looked at, 5 useful views";
        assert_eq!(line(&gathering), expected);
    }

    #[test]
    fn a_reason_is_given_once() {
        let reasons = ["a", "b", "a"].map(str::to_owned).to_vec();
        assert_eq!(without_repeats(reasons), ["a", "b"]);
    }
}
