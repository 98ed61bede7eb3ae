//! Views of things a robot drives past, followed from frame to frame into tracks: what lies where the track lies, by its
//! place on the wall or else in the picture just before, and looks like it. Of each track the views that say something
//! new are to be kept (`vision::learn::near_duplicates`).
//!
//! In: the quads of a frame with icon, place and what is known of their identity. Out: for each, whether to keep it and
//! in which track. Nothing is joined in doubt: a wrong view would poison the model learnt from the track, a thing that
//! is found twice is only a choice for a person.

use crate::{place::LandmarkPlace, pose2::wrap_rad};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use vision::{
    geometry::{Corners, polygon::iou},
    learn::near_duplicates::{NoveltyParams, ViewSummary, most_alike},
    model::LandmarkId,
    recognise::{IconFeatures, RecogniseParams, features::correlation::correlation},
};

/// Most tracks followed at once, those of a single glimpse included.
pub const MAX_TRACKS: usize = 256;
/// Most views kept of a track.
pub const MAX_TRACK_VIEWS: usize = 40;
/// Icons of a track that a new glimpse is compared with: the last one, and so many spread over the kept ones.
const LOOKS_KEPT: usize = 4;

/// Knobs of following.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GatherParams {
    /// Glimpses of a thing that is no landmark before the first is kept: what is seen once is mostly nothing.
    pub min_sightings: u32,
    /// A track without kept views is forgotten when it was not seen for so long, seconds.
    pub memory_s: f64,
    /// By the picture alone a thing is followed over gaps of at most so long, seconds.
    pub gap_s: f64,
    /// By the picture alone: least intersection over union of the quads.
    pub min_iou: f64,
    /// By place: centres at most so far apart, as a share of the longer side...
    pub centre_share: f64,
    /// ... sides within this ratio...
    pub size_ratio: f64,
    /// ... and normals within this angle.
    pub normal_rad: f64,
    /// Largest C^r to the icons of the track: the cap that tau of C^r has where nothing else is known
    /// (`vision::learn::LearnParams`), beyond which no painting was like another.
    pub max_correlation: f64,
    /// From half of [`MAX_TRACK_VIEWS`] on a view must be so many times farther from the others.
    pub late_novelty: f64,
    /// What is new.
    pub thinning: NoveltyParams,
}

impl Default for GatherParams {
    fn default() -> Self {
        Self {
            min_sightings: 3,
            memory_s: 5.0,
            gap_s: 1.5,
            min_iou: 0.3,
            centre_share: 0.25,
            size_ratio: 1.2,
            normal_rad: 0.26,
            max_correlation: 0.5,
            late_novelty: 2.0,
            thinning: NoveltyParams::default(),
        }
    }
}

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
pub struct Glimpse {
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
pub enum Outcome {
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

/// One thing that was followed.
#[derive(Debug, Clone)]
pub struct Track {
    /// Counts from 1, never used twice.
    pub number: u32,
    /// The landmark whose views these are; `None` for a thing that is none yet.
    pub landmark: Option<LandmarkId>,
    /// Frames in which it was followed.
    pub sightings: u32,
    /// Of these, such in which it was taken for a landmark, or nearly.
    pub known: u32,
    closed: bool,
    views: Vec<ViewSummary>,
    looks: VecDeque<IconFeatures>,
    /// Where it was on the walls when that was last known.
    place: Option<LandmarkPlace>,
    last: Option<Last>,
}

#[derive(Debug, Clone)]
struct Last {
    at_ns: i64,
    camera: String,
    corners_px: Corners,
    icon: IconFeatures,
}

impl Track {
    fn new(number: u32, landmark: Option<LandmarkId>) -> Self {
        Self {
            number,
            landmark,
            sightings: 0,
            known: 0,
            closed: false,
            views: vec![],
            looks: VecDeque::new(),
            place: None,
            last: None,
        }
    }

    /// Views kept.
    pub fn views(&self) -> usize {
        self.views.len()
    }

    /// C^r to the nearest of its icons.
    fn distance(&self, icon: &IconFeatures, p: &RecogniseParams) -> f64 {
        let icons = self.looks.iter().chain(self.last.as_ref().map(|l| &l.icon));
        icons
            .map(|own| correlation(&icon.buckets, &own.buckets, &p.correlation))
            .fold(f64::INFINITY, f64::min)
    }

    fn keep(&mut self, digest: ViewSummary, icon: &IconFeatures) {
        self.views.push(digest);
        // The first ones and, later, every so often another: what it looked like on the way.
        if self.looks.len() < LOOKS_KEPT {
            self.looks.push_back(icon.clone());
        } else if self.views.len().is_multiple_of(MAX_TRACK_VIEWS / LOOKS_KEPT) {
            self.looks.pop_front();
            self.looks.push_back(icon.clone());
        }
    }
}

/// The same rectangle of a wall, as well as one can tell.
fn same_place(a: &LandmarkPlace, b: &LandmarkPlace, p: &GatherParams) -> bool {
    let longer = a.size.width_m.max(a.size.height_m).max(b.size.width_m).max(b.size.height_m);
    let apart = (a.x_m - b.x_m).hypot(a.y_m - b.y_m).hypot(a.z_m - b.z_m);
    let ratio = |x: f64, y: f64| (x / y).max(y / x);
    apart <= p.centre_share * longer
        && ratio(a.size.width_m, b.size.width_m) <= p.size_ratio
        && ratio(a.size.height_m, b.size.height_m) <= p.size_ratio
        && wrap_rad(a.theta_rad - b.theta_rad).abs() <= p.normal_rad
}

/// A track as it was kept, without its views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kept {
    /// Its number.
    pub number: u32,
    /// The landmark whose views these are.
    pub landmark: Option<LandmarkId>,
    /// Frames in which it was followed.
    pub sightings: u32,
    /// Of these, such in which it was taken for a landmark, or nearly.
    pub known: u32,
    /// Where on the walls, by its views.
    pub place: Option<LandmarkPlace>,
}

/// Follows what one robot drives past.
#[derive(Debug, Clone, Default)]
pub struct Tracker {
    p: GatherParams,
    tracks: Vec<Track>,
    numbers: u32,
}

impl Tracker {
    /// Nothing followed yet.
    pub fn new(p: GatherParams) -> Self {
        Self { p, tracks: vec![], numbers: 0 }
    }

    /// Takes up a track that was kept elsewhere, from its views in order. From now on it is found by its place only,
    /// unless it is a landmark's. A number that is taken already is ignored.
    pub fn resume(&mut self, kept: Kept, views: impl IntoIterator<Item = (Corners, IconFeatures)>) {
        let Kept { number, landmark, sightings, known, place } = kept;
        if self.tracks.iter().any(|t| t.number == number) {
            return;
        }
        let mut track = Track { sightings, known, place, ..Track::new(number, landmark) };
        for (corners, icon) in views.into_iter().take(MAX_TRACK_VIEWS) {
            track.keep(ViewSummary::new(&corners, &icon.icon), &icon);
        }
        self.tracks.push(track);
        self.numbers = self.numbers.max(number);
    }

    /// Every track, oldest first.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Somebody has decided on a track: no more views of that thing are kept.
    pub fn close(&mut self, number: u32) {
        for track in self.tracks.iter_mut().filter(|t| t.number == number) {
            track.closed = true;
        }
    }

    /// Numbers up to this one are taken.
    pub fn number_after(&mut self, number: u32) {
        self.numbers = self.numbers.max(number);
    }

    /// The glimpses of one frame of `camera`, each answered in its place. `wanted`: views of such landmarks are kept;
    /// `strangers`: things that are no landmark are.
    pub fn follow(
        &mut self,
        (at_ns, camera): (i64, &str),
        glimpses: &[Glimpse],
        wanted: impl Fn(LandmarkId) -> bool,
        strangers: bool,
        p: &RecogniseParams,
    ) -> Vec<Outcome> {
        self.clear_out(at_ns);
        let mut taken = vec![false; self.tracks.len()];
        let places = self.assigned(at_ns, camera, glimpses, &mut taken, p);
        glimpses
            .iter()
            .zip(places)
            .map(|(glimpse, place)| {
                let at = match (glimpse.identity, place) {
                    (Identity::Landmark(id), _) if wanted(id) => self.of_landmark(id),
                    (Identity::Stranger, _) if !strangers => Err(Outcome::Unwanted),
                    (Identity::Stranger, Place::Nowhere) => self.begun(None),
                    (_, Place::Track(i)) => Ok(i),
                    (Identity::Stranger, Place::Occupied) => Err(Outcome::Unlike),
                    _ => Err(Outcome::Known),
                };
                at.map_or_else(|outcome| outcome, |i| self.taken(i, at_ns, camera, glimpse))
            })
            .collect()
    }

    /// Which track each glimpse belongs to: the best pairs first, each track once.
    fn assigned(
        &self,
        at_ns: i64,
        camera: &str,
        glimpses: &[Glimpse],
        taken: &mut [bool],
        p: &RecogniseParams,
    ) -> Vec<Place> {
        let mut places = vec![Place::Nowhere; glimpses.len()];
        let mut pairs = vec![];
        for (g, glimpse) in glimpses.iter().enumerate() {
            for (t, track) in self.tracks.iter().enumerate().filter(|(_, t)| t.landmark.is_none()) {
                if !self.lies_there(track, at_ns, camera, glimpse) {
                    continue;
                }
                let distance = track.distance(&glimpse.icon, p);
                if distance <= self.p.max_correlation {
                    pairs.push((distance, g, t));
                } else {
                    places[g] = Place::Occupied;
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for (_, g, t) in pairs {
            match places[g] {
                Place::Track(_) => {}
                _ if taken[t] => places[g] = Place::Occupied,
                _ => (taken[t], places[g]) = (true, Place::Track(t)),
            }
        }
        places
    }

    fn lies_there(&self, track: &Track, at_ns: i64, camera: &str, glimpse: &Glimpse) -> bool {
        if let (Some(a), Some(b)) = (&track.place, &glimpse.place) {
            return same_place(a, b, &self.p);
        }
        // A track taken up from elsewhere has not been seen yet: its looks alone say nothing of where it is.
        let Some(last) = &track.last else { return false };
        let gap_s = at_ns.saturating_sub(last.at_ns) as f64 * 1e-9;
        last.camera == camera
            && (0.0..=self.p.gap_s).contains(&gap_s)
            && iou(last.corners_px.points(), glimpse.corners_px.points()) >= self.p.min_iou
    }

    fn of_landmark(&mut self, id: LandmarkId) -> Result<usize, Outcome> {
        match self.tracks.iter().position(|t| t.landmark == Some(id) && !t.closed) {
            Some(i) => Ok(i),
            None => self.begun(Some(id)),
        }
    }

    fn begun(&mut self, landmark: Option<LandmarkId>) -> Result<usize, Outcome> {
        if self.tracks.len() >= MAX_TRACKS {
            return Err(Outcome::TooMany);
        }
        self.numbers = self.numbers.saturating_add(1);
        self.tracks.push(Track::new(self.numbers, landmark));
        Ok(self.tracks.len() - 1)
    }

    fn taken(&mut self, i: usize, at_ns: i64, camera: &str, glimpse: &Glimpse) -> Outcome {
        let Some(track) = self.tracks.get_mut(i) else { return Outcome::Unlike };
        track.sightings = track.sightings.saturating_add(1);
        track.last = Some(Last {
            at_ns,
            camera: camera.to_owned(),
            corners_px: glimpse.corners_px,
            icon: glimpse.icon.clone(),
        });
        track.place = glimpse.place.or(track.place);
        if track.closed {
            return Outcome::Decided;
        }
        if track.landmark.is_none() && glimpse.identity != Identity::Stranger {
            track.known = track.known.saturating_add(1);
            return Outcome::Known;
        }
        if track.landmark.is_none() && track.sightings < self.p.min_sightings {
            return Outcome::TooNew;
        }
        if track.views.len() >= MAX_TRACK_VIEWS {
            return Outcome::Full;
        }
        let digest = ViewSummary::new(&glimpse.corners_px, &glimpse.icon.icon);
        let late = track.views.len() >= MAX_TRACK_VIEWS / 2;
        let needed = if late { self.p.late_novelty } else { 1.0 };
        match most_alike(&digest, &track.views, &self.p.thinning) {
            Some((_, novelty)) if novelty < needed => Outcome::Alike,
            _ => {
                track.keep(digest, &glimpse.icon);
                Outcome::Keep(track.number)
            }
        }
    }

    /// Forgets what was a glimpse only.
    fn clear_out(&mut self, now_ns: i64) {
        let memory_s = self.p.memory_s;
        let fresh = |t: &Track| {
            t.last.as_ref().is_some_and(|l| now_ns.saturating_sub(l.at_ns) as f64 * 1e-9 <= memory_s)
        };
        self.tracks.retain(|t| t.closed || !t.views.is_empty() || fresh(t));
    }
}

/// Where a glimpse lies among the tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// Where no track is.
    Nowhere,
    /// Where a track is that looks different.
    Occupied,
    /// In this track.
    Track(usize),
}

#[cfg(test)]
mod tests;
