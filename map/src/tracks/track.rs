//! One object followed from frame to frame, with its stored views.

use crate::{place::LandmarkPlace, pose2::wrap_rad, tracks::params::GatherParams};
use std::collections::VecDeque;
use vision::{
    geometry::Corners,
    icon::Icon,
    learn::near_duplicates::ViewSummary,
    model::LandmarkId,
    recognise::{IconFeatures, RecogniseParams, features::correlation::correlation},
};

/// Most views stored of a track.
pub const MAX_TRACK_VIEWS: usize = 40;
/// Icons of a track that a new observation is compared with: the last one, and this many spread
/// over the stored views.
pub(super) const MAX_ICONS: usize = 4;

/// One object that is followed.
#[derive(Debug, Clone)]
pub struct Track {
    /// Number of the track, from 1; never reused.
    pub number: u32,
    /// The landmark whose views these are; `None` for an unknown object.
    pub landmark: Option<LandmarkId>,
    /// Frames in which it was observed.
    pub sightings: u32,
    /// Of these, frames in which it was recognised as a landmark, or nearly.
    pub known: u32,
    pub(super) closed: bool,
    pub(super) views: Vec<ViewSummary>,
    pub(super) icons: VecDeque<IconFeatures>,
    /// Last known place on the walls.
    pub(super) place: Option<LandmarkPlace>,
    pub(super) last: Option<Last>,
}

#[derive(Debug, Clone)]
pub(super) struct Last {
    pub(super) at_ns: i64,
    pub(super) camera: String,
    pub(super) corners_px: Corners,
    pub(super) icon: IconFeatures,
}

impl Track {
    pub(super) fn new(number: u32, landmark: Option<LandmarkId>) -> Self {
        Self {
            number,
            landmark,
            sightings: 0,
            known: 0,
            closed: false,
            views: vec![],
            icons: VecDeque::new(),
            place: None,
            last: None,
        }
    }

    /// Number of stored views.
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// C^r to the nearest of its icons.
    pub(super) fn distance(&self, icon: &IconFeatures, p: &RecogniseParams) -> f64 {
        let icons = self.icons.iter().chain(self.last.as_ref().map(|l| &l.icon));
        icons
            .map(|own| correlation(&icon.buckets, &own.buckets, &p.correlation))
            .fold(f64::INFINITY, f64::min)
    }

    /// The icon of the first stored view: its border is that of the track.
    pub fn reference(&self) -> Option<&Icon> {
        self.icons.front().map(|first| &first.icon)
    }

    pub(super) fn keep(&mut self, summary: ViewSummary, icon: &IconFeatures) {
        self.views.push(summary);
        // The first views, later one at regular intervals; the reference stays.
        if self.icons.len() < MAX_ICONS {
            self.icons.push_back(icon.clone());
        } else if self.views.len().is_multiple_of(MAX_TRACK_VIEWS / MAX_ICONS) {
            self.icons.remove(1);
            self.icons.push_back(icon.clone());
        }
    }
}

/// Whether two places are the same rectangle of a wall within the limits.
pub(super) fn same_place(a: &LandmarkPlace, b: &LandmarkPlace, p: &GatherParams) -> bool {
    let longer = a.size.width_m.max(a.size.height_m).max(b.size.width_m).max(b.size.height_m);
    let apart = (a.x_m - b.x_m).hypot(a.y_m - b.y_m).hypot(a.z_m - b.z_m);
    let ratio = |x: f64, y: f64| (x / y).max(y / x);
    apart <= p.centre_share * longer
        && ratio(a.size.width_m, b.size.width_m) <= p.size_ratio
        && ratio(a.size.height_m, b.size.height_m) <= p.size_ratio
        && wrap_rad(a.theta_rad - b.theta_rad).abs() <= p.normal_rad
}

/// A track as stored, without its views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StoredTrack {
    /// Number of the track.
    pub number: u32,
    /// The landmark whose views these are; `None` for an unknown object.
    pub landmark: Option<LandmarkId>,
    /// Frames in which it was observed.
    pub sightings: u32,
    /// Of these, frames in which it was recognised as a landmark, or nearly.
    pub known: u32,
    /// Place on the walls, by its views.
    pub place: Option<LandmarkPlace>,
}
