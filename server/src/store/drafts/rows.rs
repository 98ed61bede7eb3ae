//! What a map consists of, row by row: a key that says what a row is, and the digest of what it
//! says. Keys are in numbers of the map that a draft is of, so rows of both can be compared.

use crate::store::{
    contents::{CropContents, LandmarkContents, MapContents, ModelContents, RunContents},
    pictures::hex,
};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use vision::model::LandmarkId;

/// SHA-256 of what a row says.
pub(super) type RowDigest = [u8; 32];
/// What rows were when a draft began, by the text of their key: in the map, in the draft.
pub(super) type Base = BTreeMap<String, (RowDigest, RowDigest)>;
/// The rows of a map.
pub(super) type Rows = BTreeMap<RowKey, RowDigest>;

/// Whose a landmark is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Owner {
    /// One that the map has, or had: its number there.
    Of(LandmarkId),
    /// One that was made in the draft: its number there.
    New(LandmarkId),
}

/// What a row is.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum RowKey {
    /// A setting of the map, by the word that differences have for it.
    Setting(&'static str),
    Walls,
    Underlay,
    /// Name, size and place.
    Landmark(Owner),
    /// By picture and corners.
    View(Owner, RowDigest),
    Model(Owner),
    /// By picture and corners.
    Distractor(RowDigest),
    /// By all that it says.
    Run(RowDigest),
}

impl RowKey {
    /// The key as it is stored.
    pub(super) fn text(&self) -> String {
        let owner = |owner: &Owner| match owner {
            Owner::Of(id) => id.0.to_string(),
            Owner::New(id) => format!("new {}", id.0),
        };
        match self {
            Self::Setting(word) => format!("setting {word}"),
            Self::Walls => "walls".to_owned(),
            Self::Underlay => "underlay".to_owned(),
            Self::Landmark(of) => format!("landmark {}", owner(of)),
            Self::View(of, crop) => format!("view {} {}", owner(of), hex(crop)),
            Self::Model(of) => format!("model {}", owner(of)),
            Self::Distractor(crop) => format!("distractor {}", hex(crop)),
            Self::Run(run) => format!("run {}", hex(run)),
        }
    }

    /// The landmark that the row belongs to.
    pub(super) fn owner(&self) -> Option<Owner> {
        match self {
            Self::Landmark(of) | Self::View(of, _) | Self::Model(of) => Some(*of),
            Self::Setting(_) | Self::Walls | Self::Underlay | Self::Distractor(_) | Self::Run(_) => None,
        }
    }
}

/// A digest of parts, each with its length.
fn digest<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> RowDigest {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hash.finalize().into()
}

/// Every column of a value, as its debugging form has it: exact, and complete when a column is
/// added.
fn digest_of(value: &impl std::fmt::Debug) -> RowDigest {
    digest([format!("{value:?}").as_bytes()])
}

/// Which quad of which picture.
pub(super) fn crop_key(crop: &CropContents) -> RowDigest {
    let corners: Vec<u8> = crop.corners_px.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    digest([&crop.image_sha256[..], &corners])
}

/// The key of a run.
pub(super) fn run_key(run: &RunContents) -> RowDigest {
    digest_of(run)
}

fn crop_digest(crop: &CropContents) -> RowDigest {
    digest([&crop_key(crop)[..], &crop.icon_side.to_le_bytes(), &crop.icon_scale.to_le_bytes(), &crop.icon])
}

fn model_digest(model: &ModelContents) -> RowDigest {
    // Whether points were asked is bookkeeping of jobs.
    let said = format!("{:?}", model.summary);
    digest([&model.bytes[..], &model.params_hash, said.as_bytes()])
}

/// Name, size, place and gates. Health is found out by robots, and is no part of what is published.
fn landmark_digest(landmark: &LandmarkContents) -> RowDigest {
    digest_of(&(&landmark.name, &landmark.geometry, &landmark.learning))
}

pub(super) fn rows(contents: &MapContents, owner: impl Fn(LandmarkId) -> Owner) -> Rows {
    let settings = &contents.settings;
    let location = &settings.location;
    let mut rows: Rows = [
        ("site", digest_of(&location.site)),
        ("building", digest_of(&location.building)),
        ("floor", digest_of(&location.floor)),
        ("parent", digest_of(&location.link)),
        ("pipeline", digest_of(&settings.pipeline)),
        ("learning", digest_of(&settings.learning)),
        ("fusion_mode", digest_of(&settings.fusion_mode)),
        ("areas", digest_of(&settings.areas)),
        ("visibility_settings", digest_of(&settings.visibility)),
    ]
    .map(|(word, digest)| (RowKey::Setting(word), digest))
    .into();
    rows.insert(RowKey::Walls, digest_of(&contents.walls));
    if let Some(underlay) = &contents.underlay {
        rows.insert(RowKey::Underlay, digest_of(underlay));
    }
    for landmark in &contents.landmarks {
        let of = owner(landmark.number);
        rows.insert(RowKey::Landmark(of), landmark_digest(landmark));
        for view in &landmark.views {
            let said = digest_of(&(&view.image_kind, view.size_px, view.created_ms, &view.capture));
            rows.insert(
                RowKey::View(of, crop_key(&view.crop)),
                digest([&said[..], &crop_digest(&view.crop)]),
            );
        }
        if let Some(model) = &landmark.model {
            rows.insert(RowKey::Model(of), model_digest(model));
        }
    }
    for distractor in &contents.distractors {
        rows.insert(RowKey::Distractor(crop_key(&distractor.crop)), crop_digest(&distractor.crop));
    }
    rows.extend(contents.reference_runs.iter().map(|run| (RowKey::Run(run_key(run)), run_key(run))));
    rows
}
