//! `waymark record` and `waymark replay`: drives as MCAP files.

pub(crate) mod record;
pub(crate) mod recorder;
pub(crate) mod replay;
mod player;
mod report;

use client::protos::Name;

/// How to reach the server over zenoh and HTTP.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Endpoints {
    /// Address of the server's HTTP interface.
    #[arg(long, env = "WAYMARK_SERVER", default_value = "http://127.0.0.1:8080")]
    pub(crate) server: String,
    /// Where the server takes messages of robots.
    #[arg(long, env = "WAYMARK_ZENOH", default_value = "tcp/127.0.0.1:7447", value_name = "ENDPOINT")]
    pub(crate) zenoh: String,
    /// The fleet of the server's settings.
    #[arg(long, default_value = "default")]
    pub(crate) fleet: Name,
}

/// Name and version of this program, as recordings name it.
pub(crate) const PROGRAM: &str = concat!("waymark ", env!("CARGO_PKG_VERSION"));
