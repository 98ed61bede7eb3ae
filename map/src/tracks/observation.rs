//! What one frame shows of a quad, and what the tracker did with it.

use crate::place::LandmarkPlace;
use serde::{Deserialize, Serialize};
use vision::{
    detect::quads::Corners,
    recognise::{IconFeatures, LandmarkId},
};

/// What is known of who is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Identity {
    /// No landmark of the map, nor nearly.
    Stranger,
    /// This landmark beyond doubt.
    Landmark(LandmarkId),
    /// It may be a landmark of the map.
    Doubtful,
}

/// One quad of a frame.
#[derive(Debug, Clone)]
pub struct QuadObservation {
    /// Where in the picture.
    pub corners_px: Corners,
    /// Its icon.
    pub icon: IconFeatures,
    /// Where on the walls, if that is known.
    pub place: Option<LandmarkPlace>,
    /// Who it is.
    pub identity: Identity,
}

/// What came of a glimpse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrackOutcome {
    /// A view to keep in this track.
    Keep(u32),
    /// Followed; the track has a view like it.
    Alike,
    /// Followed, but not seen often enough yet to be kept.
    TooNew,
    /// The track has all the views it may have.
    Full,
    /// Somebody has decided on its track.
    Decided,
    /// It may be a landmark of the map, or is one whose views are not wanted.
    Known,
    /// No landmark, and only views of landmarks are wanted.
    Unwanted,
    /// It lies where a track lies and looks different.
    Unlike,
    /// Too many tracks.
    TooMany,
}
