//! All that a map consists of, as one value: what is copied, exported, imported, compared and
//! published. Numbers of rows are those of the map that it was read from; a map that is written of
//! it has new ones, also inside of its models.
//!
//! Not in it: the map's name, its history, its robots, gatherings, jobs and stored answers.

mod copy;
mod numbers;
mod read;
mod write;

pub(crate) use copy::{contents_of, copy};
pub(crate) use numbers::{Numbers, in_other_map};
pub(crate) use read::read;
pub(crate) use write::{Written, write};
pub(in crate::store) use write::{distractor, landmark, model, run, settings, view};

use super::{
    landmarks::{LandmarkGeometry, ModelSummary},
    map_locations::MapLocation,
    maps::MapPipeline,
    pictures::Digest,
    underlays::UnderlayRow,
    walls::StoredWall,
};
use map::{landmark_health::LandmarkHealth, modality_stats::FusionMode};
use vision::model::LandmarkId;

/// Every statement of this folder.
#[cfg(test)]
pub(super) const EVERY: [&[(&str, &str)]; 2] = [read::ALL, write::ALL];

/// Most bytes of icons, models and statistics that are read of one map: they are in memory at once.
pub(crate) const MAX_CONTENTS_BYTES: usize = 1 << 29;

/// A map with all that is in it. Texts that are JSON are as they are stored.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MapContents {
    pub(crate) settings: MapSettings,
    /// By rising number.
    pub(crate) landmarks: Vec<LandmarkContents>,
    pub(crate) distractors: Vec<DistractorContents>,
    /// In their order.
    pub(crate) walls: Vec<StoredWall>,
    pub(crate) underlay: Option<UnderlayRow>,
    /// Oldest first.
    pub(crate) reference_runs: Vec<RunContents>,
}

/// The settings of a map.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MapSettings {
    pub(crate) pipeline: MapPipeline,
    /// JSON of its own weights and gates.
    pub(crate) learning: Option<String>,
    pub(crate) location: MapLocation,
    pub(crate) fusion_mode: FusionMode,
    /// JSON list of `map::modality_stats::NamedArea`.
    pub(crate) areas: String,
    /// JSON of `map::visibility::VisibilitySettings`; `None` for the defaults.
    pub(crate) visibility: Option<String>,
}

/// A landmark with its views and its model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LandmarkContents {
    /// In the map that it was read from; others refer to it by this number.
    pub(crate) number: LandmarkId,
    pub(crate) name: String,
    pub(crate) geometry: LandmarkGeometry,
    pub(crate) health: LandmarkHealth,
    /// JSON: what led to this health.
    pub(crate) finding: Option<String>,
    /// JSON of its own weights and gates.
    pub(crate) learning: Option<String>,
    pub(crate) created_ms: i64,
    /// By rising number.
    pub(crate) views: Vec<ViewContents>,
    pub(crate) model: Option<ModelContents>,
}

/// A quad of a picture: where it is, and its icon.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CropContents {
    /// Digest of the picture.
    pub(crate) image_sha256: Digest,
    /// Corners in the picture, px.
    pub(crate) corners_px: [[f64; 2]; 4],
    /// Side of the icon, icon px.
    pub(crate) icon_side: u32,
    /// Grey levels, row by row.
    pub(crate) icon: Vec<u8>,
    /// Picture px an icon px.
    pub(crate) icon_scale: f64,
}

/// A training view. Its picture is stored under its digest.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ViewContents {
    pub(crate) crop: CropContents,
    /// `png` or `jpeg`.
    pub(crate) image_kind: String,
    /// Width and height of the picture.
    pub(crate) size_px: [u32; 2],
    pub(crate) created_ms: i64,
    /// JSON of `landmark_placement::StoredCapture`: how it was taken.
    pub(crate) capture: Option<String>,
}

/// What was learnt of a landmark.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ModelContents {
    /// As `vision` writes it, with the landmark's number in it.
    pub(crate) bytes: Vec<u8>,
    /// Hash of the distance parameters, little-endian.
    pub(crate) params_hash: [u8; 8],
    pub(crate) summary: ModelSummary,
}

/// A quad that is no landmark, beside one in a training picture.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DistractorContents {
    pub(crate) crop: CropContents,
}

/// A reference run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RunContents {
    pub(crate) robot: String,
    pub(crate) created_ms: i64,
    pub(crate) way_m: f64,
    /// JSON: pairs of pose cell and statistics.
    pub(crate) cells: String,
}

#[cfg(test)]
pub(crate) mod tests;
