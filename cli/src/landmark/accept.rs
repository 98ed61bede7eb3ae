//! `waymark landmark accept`: tracks that a robot has gathered become landmarks.

use super::reasons::in_use;
use crate::{failure::Failure, names, session::Session};
use client::api::{AcceptRequest, AcceptedTrackBody};

/// `waymark landmark accept`.
#[derive(Debug, clap::Args)]
pub(super) struct AcceptArgs {
    /// Number of the gathering.
    gathering: i64,
    /// NUMBER=NAME of each track; NUMBER alone for views of a landmark that is known.
    #[arg(required = true, value_name = "NUMBER[=NAME]", value_parser = pick)]
    picks: Vec<AcceptedTrackBody>,
}

fn pick(text: &str) -> Result<AcceptedTrackBody, String> {
    let (number, name) = text.split_once('=').map_or((text, None), |(n, name)| (n, Some(name)));
    let track = number.parse().map_err(|_e| "NUMBER=NAME, such as 3=poster".to_owned())?;
    Ok(AcceptedTrackBody { track, name: name.map(names::name).transpose()? })
}

pub(super) async fn run(session: &Session, map: &str, args: &AcceptArgs) -> anyhow::Result<()> {
    let maps = session.maps();
    let request = AcceptRequest { tracks: args.picks.clone(), learn: true };
    let accepted = maps.accept_tracks(map, args.gathering, &request).await?;
    if let Some(job) = accepted.job.clone() {
        session.finished(job, "learning").await?;
    }
    let (mut lines, mut failed) = (Vec::new(), Vec::new());
    for extended in &accepted.landmarks {
        let landmark = maps.landmark(map, &extended.name).await?;
        match in_use(&landmark) {
            Ok(()) => lines.push(format!("{}: active", landmark.name)),
            Err(failure) => failed.push(failure),
        }
    }
    session.show(&accepted, &lines.join("\n"))?;
    match failed.len() {
        0 => Ok(()),
        1 => Err(failed.swap_remove(0).into()),
        count => {
            let sentence = format!("{count} landmarks are not in use.");
            Err(Failure::of_several(sentence, "not_in_use", &failed).into())
        }
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
        assert!(pick("3=Window 1").unwrap_err().contains("window-1"));
    }
}
