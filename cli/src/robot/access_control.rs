//! `waymark robot access-control`: who may do what on a router of the operator, as zenohd wants it.

use crate::{names::name, session::Session};
use protos::Name;
use server::bus::access_control_for_router;
use std::collections::{BTreeMap, BTreeSet};

/// Whom the router knows by which certificates.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Common name in the certificate of a server that joins the router; may be given several
    /// times.
    #[arg(long = "server-certificate", value_name = "NAME", required = true)]
    servers: Vec<String>,
    /// A robot that is registered with another server; may be given several times.
    #[arg(long = "robot", value_name = "ROBOT", value_parser = name)]
    robots: Vec<String>,
    /// A map of another server; may be given several times.
    #[arg(long = "also-map", value_name = "MAP", value_parser = name)]
    maps: Vec<String>,
    /// The fleet, as in the servers' settings.
    #[arg(long, value_name = "NAME", default_value = "default", value_parser = name)]
    fleet: String,
}

/// Prints the block.
pub(super) async fn run(session: &Session, args: &Args) -> anyhow::Result<()> {
    let (here, maps) = (session.maps().robots().await?, session.maps().maps().await?);
    let robots = here.into_iter().map(|robot| robot.name).chain(args.robots.iter().cloned());
    // The certificate of a robot names the robot.
    let robots: BTreeMap<Name, BTreeSet<String>> = robots
        .map(|robot| Ok((Name::new(robot.as_str())?, BTreeSet::from([robot]))))
        .collect::<anyhow::Result<_>>()?;
    let maps: BTreeSet<String> =
        maps.into_iter().map(|map| map.name).chain(args.maps.iter().cloned()).collect();
    let block = access_control_for_router(&Name::new(args.fleet.as_str())?, &robots, &maps, &args.servers);
    let whole = serde_json::json!({ "access_control": block });
    session.show(&whole, &serde_json::to_string_pretty(&whole)?)
}
