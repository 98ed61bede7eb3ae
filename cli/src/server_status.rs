//! `waymark server`: whether a server does its work, and what is on it.

use super::{
    failure::{Class, Failure},
    screen::counted,
    session::{ServerArgs, Session},
};
use client::{
    ClientError,
    api::{BackupHealth, DatabaseCheckState, Readiness, Servers, Version},
};
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
    /// Whether the server is ready, its version, maps and robots. Exit status 0 only if everything
    /// is in order.
    Status,
    /// Whether the server does its work now: what a container or a load balancer asks. Needs no
    /// token.
    Health,
    /// The servers that share a router with this one, with their maps, and what more than one of
    /// them has.
    List,
}

/// Runs the command.
pub(crate) async fn run(args: &Args) -> anyhow::Result<()> {
    let session = args.server.session()?;
    let done = match args.verb {
        Verb::Status => status(&session).await,
        Verb::Health => health(&session).await,
        Verb::List => list(&session).await,
    };
    session.explained(done).await
}

async fn status(session: &Session) -> anyhow::Result<()> {
    let maps = session.maps();
    let version = maps.version().await?;
    let readiness = ready(session).await?;
    let (all, robots) = (maps.maps().await?, maps.robots().await?);
    let counts = Counts {
        maps: all.len() as u64,
        landmarks: all.iter().map(|m| m.landmarks).sum(),
        robots: robots.len() as u64,
        connected: robots.iter().filter(|r| r.alive).count(),
    };
    let shown = json!({ "version": version, "readiness": readiness, "maps": counts.maps, "landmarks": counts.landmarks,
        "robots": counts.robots, "robots_connected": counts.connected });
    session.show(&shown, &text(&version, &readiness, &counts))?;
    let sentence = if readiness.router.is_some() {
        "The server is degraded: it has no part in its router."
    } else if !readiness.maps_not_served.is_empty() {
        "The server is degraded: another server has one of its maps."
    } else if readiness.counts.maps_not_in_use > 0 {
        "The server is degraded: not every map is in use."
    } else if readiness.database_check.as_ref().is_some_and(|check| check.state == DatabaseCheckState::Failed)
    {
        "The server is degraded: its database is damaged."
    } else if readiness.counts.damaged_pictures > 0 {
        "The server is degraded: stored pictures are damaged."
    } else if readiness.storage.as_ref().is_some_and(|disk| disk.refused.is_some()) {
        "The server is degraded: nothing can be added, for lack of room on its disk."
    } else if readiness.status == "degraded" {
        "The server is degraded: the last scheduled backup failed."
    } else {
        return Ok(());
    };
    Err(Failure::new(Class::Failed, "degraded", sentence).into())
}

/// Its readiness, or why it is not ready.
async fn ready(session: &Session) -> anyhow::Result<Readiness> {
    match session.maps().readiness().await {
        Ok(readiness) => Ok(readiness),
        Err(ClientError::Refused { status: 503, code, detail, .. }) => {
            let sentence = format!("The server is not ready: {detail}.");
            Err(Failure::new(Class::Failed, &code, sentence).into())
        }
        Err(error) => Err(error.into()),
    }
}

async fn health(session: &Session) -> anyhow::Result<()> {
    let readiness = ready(session).await?;
    session.show(&json!({ "status": readiness.status }), &readiness.status)
}

async fn list(session: &Session) -> anyhow::Result<()> {
    let servers = session.maps().servers().await?;
    session.show(&json!(servers), &servers_text(&servers))
}

fn servers_text(servers: &Servers) -> String {
    let mut lines = Vec::new();
    for server in &servers.servers {
        let here = if server.name == servers.server { " (asked)" } else { "" };
        lines.push(format!("{}{here}: {}", server.name, counted(server.robots, "robot")));
        lines.extend(server.maps.iter().map(|map| {
            let note = if map.is_served { "" } else { ", not served to robots" };
            format!("  map {}{note}", map.name)
        }));
    }
    if !servers.is_connected {
        lines.push(format!("no connection to the router at {}", servers.router.join(", ")));
    }
    let contested =
        |(name, of): (&String, &Vec<String>), what| format!("{what} {name} is on {}", of.join(", "));
    lines.extend(servers.contested_maps.iter().map(|each| contested(each, "contested: map")));
    lines.extend(servers.contested_robots.iter().map(|each| contested(each, "on several servers: robot")));
    lines.join("\n")
}

/// What is on a server.
struct Counts {
    maps: u64,
    landmarks: u64,
    robots: u64,
    connected: usize,
}

fn text(version: &Version, readiness: &Readiness, counts: &Counts) -> String {
    let mut lines = vec![
        format!(
            "{} {} (HTTP {}, zenoh {}): {}",
            version.name, version.version, version.api, version.protocol, readiness.status
        ),
        format!("  {} with {}", counted(counts.maps, "map"), counted(counts.landmarks, "landmark")),
        format!("  {}, {} connected", counted(counts.robots, "robot"), counts.connected),
    ];
    lines.extend(readiness.router.iter().map(|why| format!("  router: {why}")));
    let not_served = readiness.maps_not_served.iter();
    lines.extend(not_served.map(|(map, why)| format!("  map {map} is not served to robots: {why}")));
    let BackupHealth { newest, failed, every_hours, .. } = &readiness.backup;
    lines.extend(newest.iter().map(|name| format!("  newest backup {name} (UTC)")));
    if newest.is_none() && *every_hours > 0 {
        lines.push("  no backup yet".to_owned());
    }
    lines.extend(failed.iter().map(|why| format!("  the last backup failed: {why}")));
    let counts = readiness.counts;
    let hidden = counts.maps_not_in_use.saturating_sub(readiness.maps_not_in_use.len() as u64);
    lines.extend((hidden > 0).then(|| format!("  {} of other tokens not in use", counted(hidden, "map"))));
    let hidden = counts.damaged_pictures.saturating_sub(readiness.damaged_pictures.len() as u64);
    lines.extend((hidden > 0).then(|| format!("  {} not named here", counted(hidden, "damaged picture"))));
    let refused = readiness.storage.iter().filter_map(|disk| disk.refused.as_ref());
    lines.extend(refused.map(|why| format!("  nothing is added: {why}")));
    if let Some(check) = &readiness.database_check {
        lines.extend(check.faults.iter().map(|fault| format!("  damage of the database: {fault}")));
        lines.extend(check.advice.iter().map(|advice| format!("  {advice}")));
    }
    let unused = readiness.maps_not_in_use.iter();
    lines.extend(unused.map(|(map, why)| format!("  map {map} is not in use: {why}")));
    let damaged = readiness.damaged_pictures.iter();
    lines.extend(damaged.map(|what| format!("  damaged picture: {what}; teach the same photograph again")));
    let panics = readiness.panics.iter().filter(|(_, n)| **n > 0);
    lines.extend(panics.map(|(at, n)| format!("  {n} faults of the program caught in {at}: see its log")));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use client::api::{DatabaseCheckBody, ReadinessCounts, ServedMap, ServerBody, StorageHealth};

    #[test]
    fn a_list_of_servers_names_what_several_have() {
        let server = |name: &str, is_served| ServerBody {
            name: name.into(),
            maps: vec![ServedMap { name: "hall".into(), is_served }],
            robots: 1,
        };
        let both = vec!["a".to_owned(), "b".to_owned()];
        let servers = Servers {
            server: "b".into(),
            is_connected: true,
            servers: vec![server("a", true), server("b", false)],
            contested_maps: [("hall".to_owned(), both.clone())].into(),
            contested_robots: [("r1".to_owned(), both)].into(),
            ..Servers::default()
        };
        let expected = "a: 1 robot\n  map hall\nb (asked): 1 robot\n  map hall, not served to robots\n\
                        contested: map hall is on a, b\non several servers: robot r1 is on a, b";
        assert_eq!(servers_text(&servers), expected);
    }

    #[test]
    fn a_status_names_maps_that_are_not_in_use_and_faults() {
        let version = |text: &str| text.to_owned();
        let version = Version {
            name: version("waymark"),
            version: version("0.1.0"),
            api: version("v1"),
            protocol: version("1"),
            server: version("hall"),
        };
        let readiness = Readiness {
            status: "degraded".into(),
            counts: ReadinessCounts { maps_not_in_use: 3, damaged_pictures: 1 },
            maps_not_in_use: [("office".to_owned(), "damaged".to_owned())].into(),
            router: Some("no connection".into()),
            maps_not_served: [("annex".to_owned(), "also on b".to_owned())].into(),
            damaged_pictures: vec!["view 3 of landmark door, map office".into()],
            backup: BackupHealth {
                every_hours: 24,
                newest: Some("20261123-140530".into()),
                newest_ms: Some(0),
                failed: Some("no space".into()),
            },
            parts_still_s: [("the outbox".to_owned(), 0)].into(),
            storage: Some(StorageHealth {
                refused: Some("the disk is full".into()),
                ..StorageHealth::default()
            }),
            database_check: Some(DatabaseCheckBody {
                state: DatabaseCheckState::Failed,
                ended_ms: Some(7),
                faults: vec!["row 3 missing from index landmarks_by_name".into()],
                advice: Some("stop the server, and restore a backup".into()),
            }),
            panics: [("a frame".to_owned(), 2), ("a write".to_owned(), 0)].into(),
        };
        let counts = Counts { maps: 1, landmarks: 2, robots: 0, connected: 0 };
        let lines = text(&version, &readiness, &counts);
        assert!(
            lines.starts_with("waymark 0.1.0 (HTTP v1, zenoh 1): degraded\n  1 map with 2 landmarks"),
            "{lines}"
        );
        assert!(lines.contains("map office is not in use: damaged"), "{lines}");
        assert!(
            lines.contains("router: no connection\n  map annex is not served to robots: also on b"),
            "{lines}"
        );
        assert!(
            lines.contains("newest backup 20261123-140530 (UTC)\n  the last backup failed: no space"),
            "{lines}"
        );
        assert!(lines.contains("  2 maps of other tokens not in use\n"), "{lines}");
        assert!(!lines.contains("not named here"), "{lines}");
        assert!(lines.contains("\n  nothing is added: the disk is full\n"), "{lines}");
        let damage = "  damage of the database: row 3 missing from index landmarks_by_name\n  stop the server, and restore";
        assert!(lines.contains(damage), "{lines}");
        assert!(lines.contains("damaged picture: view 3 of landmark door, map office; "), "{lines}");
        assert!(lines.ends_with("2 faults of the program caught in a frame: see its log"), "{lines}");
    }
}
