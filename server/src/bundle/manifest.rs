//! `bundle.json`: what a bundle says of itself.

use super::{BundleError, Fault, MANIFEST, VERSION, refused};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

const FORMAT: &str = "waymark-map-bundle";

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    pub(super) format: String,
    pub(super) version: u32,
    /// Version of the program that wrote it.
    pub(super) program: String,
    /// Name of the map.
    pub(super) map: String,
    /// All other files, by name.
    pub(super) files: BTreeMap<String, FileDigest>,
}

/// A file of a bundle.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileDigest {
    pub(super) bytes: u64,
    /// Hexadecimal.
    pub(super) sha256: String,
}

/// What is the same in every version.
#[derive(Deserialize)]
struct Head {
    format: String,
    version: u32,
}

impl Manifest {
    pub(super) fn new(map: &str, files: BTreeMap<String, FileDigest>) -> Self {
        let program = env!("CARGO_PKG_VERSION").to_owned();
        Self { format: FORMAT.to_owned(), version: VERSION, program, map: map.to_owned(), files }
    }

    /// Reads a manifest; the version is looked at first, since a later one may have other fields.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, BundleError> {
        let not_one = |e: serde_json::Error| refused(Fault::NotABundle, MANIFEST, e.to_string());
        let head: Head = serde_json::from_slice(bytes).map_err(not_one)?;
        if head.format != FORMAT {
            return Err(refused(Fault::NotABundle, MANIFEST, format!("`format` is not {FORMAT}")));
        }
        if head.version > VERSION {
            let why = format!(
                "this is version {} of the format, and this program reads version {VERSION}: update the server, or save \
                 the map with this program's version",
                head.version
            );
            return Err(refused(Fault::NewerFormat, MANIFEST, why));
        }
        serde_json::from_slice(bytes).map_err(not_one)
    }
}
