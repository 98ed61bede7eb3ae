//! `waymark record` and `waymark replay`: drives as MCAP files.

pub(crate) mod record;
pub(crate) mod recorder;
pub(crate) mod replay;
mod bag_args;
pub(crate) mod drive_args;
mod playable;
mod player;
mod poses;
mod report;
pub(crate) mod scans;

use crate::{
    failure::{Class, Failure},
    session::ServerArgs,
};
use anyhow::Context as _;
use client::protos::Name;
use std::{fs::File, path::Path};

/// How to reach the server over HTTP and zenoh, and how results are shown.
#[derive(Debug, Clone, clap::Args)]
pub(crate) struct Endpoints {
    #[command(flatten)]
    pub(crate) server: ServerArgs,
    /// Where the server takes messages of robots.
    #[arg(
        long,
        env = "WAYMARK_ZENOH",
        help_heading = "Server",
        default_value = "tcp/127.0.0.1:7447",
        value_name = "ENDPOINT"
    )]
    pub(crate) zenoh: String,
    /// The fleet of the server's settings.
    #[arg(long, help_heading = "Server", default_value = "default")]
    pub(crate) fleet: Name,
}

/// Makes a file that must not exist.
pub(crate) fn new_file(path: &Path) -> anyhow::Result<File> {
    let cannot = || format!("cannot make {}", path.display());
    match File::create_new(path) {
        Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => {
            let exists = Failure::new(Class::Conflict, "exists", format!("{} exists.", path.display()));
            Err(exists.advise("Choose another name, or delete the file first.").into())
        }
        file => file.with_context(cannot),
    }
}

/// Name and version of this program, as recordings name it.
pub(crate) const PROGRAM: &str = concat!("waymark ", env!("CARGO_PKG_VERSION"));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_made_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.mcap");
        new_file(&path).unwrap();
        assert_eq!(Failure::of(&new_file(&path).unwrap_err()).class, Class::Conflict);
        assert_eq!(Failure::of(&new_file(&path.join("a")).unwrap_err()).class, Class::Failed);
    }
}
