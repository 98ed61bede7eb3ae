//! A map as one file (docs/BUNDLE.md): a zip with JSON, GeoJSON, pictures and models, which other
//! programs read without Waymark.
//!
//! [`save`] writes one of what is stored, [`load`] makes a new map of one. The same contents give
//! the same bytes: no time and no number of a row is in it but those of the data. Landmarks are
//! numbered from 1 in their order.

mod archive;
mod landmark_records;
mod load;
mod manifest;
mod map_records;
mod save;
mod unpack;

pub(crate) use load::{Request, load};
pub(crate) use save::save;

use crate::store::StoreError;

/// Version of the format. A bundle of a later one is refused.
const VERSION: u32 = 1;
/// Most files in a bundle: what a zip holds without extensions.
const MAX_FILES: usize = 60_000;
/// Largest file of records in a bundle, bytes: all of them are in memory at once.
const MAX_RECORD_BYTES: u64 = 256 << 20;

const MANIFEST: &str = "bundle.json";
const MAP: &str = "map.json";
const WALLS: &str = "walls.geojson";
const LANDMARKS: &str = "landmarks.json";
const LANDMARKS_GEOJSON: &str = "landmarks.geojson";
const VIEWS: &str = "views.json";
const DISTRACTORS: &str = "distractors.json";
const MODALITIES: &str = "modalities.json";
const VISIBILITY: &str = "visibility.json";
const UNDERLAY: &str = "underlay.json";

/// What is wrong with a bundle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// It is another kind of file, or its end is missing.
    NotABundle,
    /// Bytes are not those of their digest.
    Damaged,
    /// A later program wrote it.
    NewerFormat,
    /// The name of a file leads elsewhere, is there twice, or is none of a bundle's.
    BadPath,
    /// A file is packed, or larger than its bound.
    TooLarge,
    /// A file is missing.
    Missing,
    /// A value cannot be.
    InvalidValue,
}

impl Fault {
    /// Its code in answers.
    pub(crate) fn code(self) -> &'static str {
        match self {
            Self::NotABundle => "not_a_bundle",
            Self::Damaged => "bundle_damaged",
            Self::NewerFormat => "newer_format",
            Self::BadPath => "bad_path",
            Self::TooLarge => "too_large",
            Self::Missing => "missing",
            Self::InvalidValue => "invalid_value",
        }
    }
}

/// Why a bundle was not saved or loaded.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BundleError {
    /// The bundle is refused.
    #[error("{file}: {why}")]
    Refused {
        fault: Fault,
        /// The file in the bundle, with the path of the value in it.
        file: String,
        why: String,
    },
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The temporary file cannot be written or read.
    #[error(transparent)]
    Io(std::io::Error),
}

impl From<std::io::Error> for BundleError {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::StorageFull => Self::Store(StoreError::Full),
            _ => Self::Io(error),
        }
    }
}

fn refused(fault: Fault, file: impl Into<String>, why: impl Into<String>) -> BundleError {
    BundleError::Refused { fault, file: file.into(), why: why.into() }
}

/// A value out of its range.
fn invalid(file: &str, field: impl std::fmt::Display, why: impl std::fmt::Display) -> BundleError {
    refused(Fault::InvalidValue, format!("{file}: {field}"), format!("{why}"))
}

#[cfg(test)]
mod tests;
