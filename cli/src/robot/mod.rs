//! `waymark robot`: which robots may send frames, on which map each drives, how each is.

mod access_control;
mod certificates;
mod enrol;
pub(crate) mod inputs;
mod send;

use super::{
    answers::{pose_line, trust},
    names::name,
    screen::Table,
    session::{Consent, ServerArgs, Session},
};
use client::api::{CorrectionsBody, Robot};

/// `waymark robot`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    server: ServerArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Make a robot known, or give it another map. Frames of unknown robots are refused.
    Add {
        /// Lower-case letters, digits, `_` and `-`, up to 64.
        #[arg(value_parser = name)]
        robot: String,
        /// The map it drives on.
        #[arg(long)]
        map: String,
    },
    /// List the robots: the map of each, whether it is connected, where it is and how far that is
    /// trusted.
    List,
    /// Show a robot: connection, pose, what that rests on, and which of its messages are used or
    /// refused.
    Show {
        /// The robot.
        robot: String,
    },
    /// Send photographs as a robot, over zenoh, and print the answers
    ///
    /// The same way as the frames of a driving robot. For example:
    ///   waymark robot send r1 here.jpg --camera camera.json
    #[command(verbatim_doc_comment)]
    Send(Box<send::Args>),
    /// Give a robot a certificate for the encrypted listener
    ///
    /// The private key is made here and stays here: run it on the robot's machine, or bring the
    /// folder there as a secret. Programs of the SDKs take the file robot.json of the folder. For
    /// example:
    ///   waymark robot enrol r1 --out r1
    #[command(verbatim_doc_comment)]
    Enrol(enrol::Args),
    /// List the certificates of a robot, with those that were revoked or have expired.
    Certificates {
        /// The robot.
        robot: String,
    },
    /// Revoke certificates of a robot: its messages are refused at once, and its connection is
    /// closed.
    Revoke(certificates::RevokeArgs),
    /// Print who may do what on a zenoh router that servers join, for the settings of zenohd
    ///
    /// Robots are those of the server, known by certificates with their names. For example:
    ///   waymark robot access-control --server-certificate hall-server > access.json5
    #[command(verbatim_doc_comment)]
    AccessControl(access_control::Args),
    /// Remove a robot; its frames are refused from now on.
    Remove {
        /// The robot.
        robot: String,
        #[command(flatten)]
        consent: Consent,
    },
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let done = on_server(&session, &args.verb, args.server.url()).await;
    session.explained(done).await
}

async fn on_server(session: &Session, verb: &Verb, server: &str) -> anyhow::Result<()> {
    let maps = session.maps();
    match verb {
        Verb::Add { robot, map } => {
            let known = maps.put_robot(robot, map).await?;
            session.show(&known, &format!("robot {robot} drives on {map}"))
        }
        Verb::List => {
            let all = maps.robots().await?;
            let table = |all: &[Robot]| {
                Table::of(["robot", "map", "connected", "pose", "trust"], all, |r| {
                    let pose = r.pose.as_ref();
                    [
                        r.name.clone(),
                        r.map.clone(),
                        if r.alive { "yes" } else { "no" }.to_owned(),
                        pose.map_or_else(|| "-".to_owned(), pose_line),
                        pose.map_or_else(|| "-".to_owned(), |p| trust(p.trust).to_owned()),
                    ]
                })
            };
            session.list(
                &all,
                table,
                "There is no robot yet. Make one known: waymark robot add NAME --map MAP",
            )
        }
        Verb::Show { robot } => show(session, robot).await,
        Verb::Send(args) => send::run(session, args).await,
        Verb::Enrol(args) => enrol::run(session, args, server).await,
        Verb::Certificates { robot } => certificates::list(session, robot).await,
        Verb::Revoke(args) => certificates::revoke(session, args).await,
        Verb::AccessControl(args) => access_control::run(session, args).await,
        Verb::Remove { robot, consent } => {
            maps.robot(robot).await?;
            consent.ask(&format!("Remove the robot {robot}? Its frames are refused from then on."))?;
            maps.delete_robot(robot).await?;
            session.show(&serde_json::json!({ "removed": robot }), &format!("robot {robot} removed"))
        }
    }
}

async fn show(session: &Session, name: &str) -> anyhow::Result<()> {
    let robot = session.maps().robot(name).await?;
    let corrections = session.maps().corrections(name).await?;
    if session.is_json() {
        return session.show(&serde_json::json!({ "robot": robot, "corrections": corrections }), "");
    }
    session.show(&robot, &text(&robot, &corrections))
}

/// Connection, pose, conflict and what the pose rests on, in lines.
fn text(robot: &Robot, corrections: &CorrectionsBody) -> String {
    let name = &robot.name;
    let mut lines = vec![
        format!("{name} on {}: {}", robot.map, if robot.alive { "connected" } else { "not connected" }),
        match &robot.pose {
            Some(pose) => format!("  pose   {}: {}", pose_line(pose), trust(pose.trust)),
            None => "  pose   unknown".to_owned(),
        },
    ];
    if let Some(conflict) = &robot.conflict {
        lines.push(format!(
            "  A second program uses this name: {} messages refused, the last {} ms ago.",
            conflict.refused, conflict.last_ms
        ));
    }
    if !corrections.modalities.is_empty() {
        lines.push(format!("  rests on {}", corrections.modalities.join(", ")));
    }
    if let Some(activity) = &robot.activity {
        lines.extend(inputs::lines(&activity.inputs).iter().map(|line| format!("  {line}")));
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::api::{EpochConflictBody, RobotActivity, RobotInput, RobotPose};

    #[test]
    fn a_robot_is_shown_with_its_pose_and_a_second_program_of_its_name() {
        let robot: Robot = serde_json::from_str(r#"{"name":"r1","map":"hall","alive":false}"#).unwrap();
        let nothing = CorrectionsBody::default();
        assert_eq!(text(&robot, &nothing), "r1 on hall: not connected\n  pose   unknown");
        let conflict = Some(EpochConflictBody { epoch: 1, refused: 3, last_ms: 20 });
        let pose = Some(RobotPose { x_m: 1.5, ..RobotPose::default() });
        let robot = Robot { alive: true, conflict, pose, ..robot };
        let rests = CorrectionsBody { modalities: vec!["laser".into()], ..nothing };
        let lines = text(&robot, &rests);
        assert!(lines.starts_with("r1 on hall: connected\n  pose   1.50, 0.00 m, 0 deg"), "{lines}");
        assert!(lines.contains("3 messages refused") && lines.ends_with("rests on laser"), "{lines}");
        let scans =
            RobotInput { input: "scan".into(), refused: 9, refused_in_a_row: 9, ..RobotInput::default() };
        let activity = Some(RobotActivity { inputs: vec![scans], ..RobotActivity::default() });
        let lines = text(&Robot { activity, ..robot }, &rests);
        assert!(lines.ends_with("\n  scan         0 used, 9 refused, the last 9 in a row"), "{lines}");
    }
}
