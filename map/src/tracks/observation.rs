//! A quad of a frame, and its outcome in the tracker.

use crate::place::LandmarkPlace;
use serde::{Deserialize, Serialize};
use vision::{geometry::Corners, model::LandmarkId, recognise::IconFeatures};

/// The identity of a quad by recognition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Identity {
    /// A distractor: no landmark of the map, nor nearly one.
    Stranger,
    /// This landmark, uniquely.
    Landmark(LandmarkId),
    /// Possibly a landmark of the map.
    Doubtful,
}

/// One quad of a frame.
#[derive(Debug, Clone)]
pub struct QuadObservation {
    /// Corners in the image, px.
    pub corners_px: Corners,
    /// Features of its icon.
    pub icon: IconFeatures,
    /// Place on the walls, if known.
    pub place: Option<LandmarkPlace>,
    /// Its identity by recognition.
    pub identity: Identity,
}

/// Outcome of a quad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrackOutcome {
    /// The view is to be stored in the track of this number.
    Keep(u32),
    /// Followed; the track has a near-duplicate of the view.
    NearDuplicate,
    /// Followed; not observed often enough yet to be stored.
    TooFewObservations,
    /// The track has [`super::MAX_TRACK_VIEWS`] views.
    Full,
    /// A person has decided on the track.
    Decided,
    /// It may be a landmark of the map, or is one whose views are not requested.
    KnownLandmark,
    /// It is no landmark, and only views of landmarks are requested.
    NotRequested,
    /// Its appearance does not match the track at its place.
    AppearanceMismatch,
    /// There are [`super::MAX_TRACKS`] tracks.
    TrackLimit,
}
