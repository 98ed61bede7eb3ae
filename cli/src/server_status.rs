//! `waymark server`: whether a server does its work, and what is on it.

use super::{
    failure::{Class, Failure},
    screen::counted,
    session::{ServerArgs, Session},
};
use client::ClientError;
use serde_json::json;

/// `waymark server`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    server: ServerArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    /// Whether the server is ready, its version, maps and robots. Exit status 0 only if everything is in order.
    Status,
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let Verb::Status = args.verb;
    let session = args.server.session()?;
    let done = status(&session).await;
    session.explained(done).await
}

async fn status(session: &Session) -> anyhow::Result<()> {
    let maps = session.maps();
    let version = maps.version().await?;
    let readiness = match maps.readiness().await {
        Ok(readiness) => readiness,
        Err(ClientError::Refused { status: 503, code, detail, .. }) => {
            return Err(
                Failure::new(Class::Failed, &code, format!("The server is not ready: {detail}.")).into()
            );
        }
        Err(error) => return Err(error.into()),
    };
    let (all, robots) = (maps.maps().await?, maps.robots().await?);
    let landmarks: u64 = all.iter().map(|m| m.landmarks).sum();
    let connected = robots.iter().filter(|r| r.alive).count();
    let mut lines = vec![
        format!(
            "{} {} (HTTP {}, zenoh {}): {}",
            version.name, version.version, version.api, version.protocol, readiness.status
        ),
        format!("  {} with {}", counted(all.len() as u64, "map"), counted(landmarks, "landmark")),
        format!("  {}, {connected} connected", counted(robots.len() as u64, "robot")),
    ];
    lines.extend(
        readiness.maps_not_in_use.iter().map(|(map, why)| format!("  map {map} is not in use: {why}")),
    );
    lines.extend(
        readiness
            .panics
            .iter()
            .map(|(at, n)| format!("  {n} faults of the program caught in {at}: see its log")),
    );
    let shown = json!({ "version": version, "readiness": readiness, "maps": all.len(), "landmarks": landmarks,
        "robots": robots.len(), "robots_connected": connected });
    session.show(&shown, &lines.join("\n"))?;
    if readiness.maps_not_in_use.is_empty() {
        return Ok(());
    }
    Err(Failure::new(Class::Failed, "degraded", "The server is degraded: not every map is in use.").into())
}
