//! Assigns the quads of each frame to tracks and decides which views to store.

use crate::tracks::{
    observation::{Identity, QuadObservation, TrackOutcome},
    params::GatherParams,
    track::{Last, MAX_TRACK_VIEWS, StoredTrack, Track, same_place},
};
use vision::{
    geometry::{Corners, polygon::iou},
    learn::near_duplicates::{ViewSummary, most_alike},
    model::LandmarkId,
    recognise::{IconFeatures, RecogniseParams},
};

/// Most tracks at once, those of a single observation included.
pub const MAX_TRACKS: usize = 256;

/// The tracks of one robot.
#[derive(Debug, Clone, Default)]
pub struct ViewTracker {
    p: GatherParams,
    tracks: Vec<Track>,
    numbers: u32,
}

impl ViewTracker {
    /// A tracker without tracks.
    pub fn new(p: GatherParams) -> Self {
        Self { p, tracks: vec![], numbers: 0 }
    }

    /// Resumes a stored track from its views in order. It is followed again by its place only,
    /// unless it is a landmark's. A number that is in use is ignored.
    pub fn resume(&mut self, stored: StoredTrack, views: impl IntoIterator<Item = (Corners, IconFeatures)>) {
        let StoredTrack { number, landmark, sightings, known, place } = stored;
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

    /// All tracks, oldest first.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Marks a track as decided by a person: no more views of the object are stored.
    pub fn close(&mut self, number: u32) {
        for track in self.tracks.iter_mut().filter(|t| t.number == number) {
            track.closed = true;
        }
    }

    /// Reserves the numbers up to this one.
    pub fn number_after(&mut self, number: u32) {
        self.numbers = self.numbers.max(number);
    }

    /// Adds the quads of one frame of `camera` and gives the outcome of each. `wanted`: landmarks
    /// whose views are requested; `distractors`: whether views of unknown objects are.
    pub fn update(
        &mut self,
        (at_ns, camera): (i64, &str),
        quads: &[QuadObservation],
        wanted: impl Fn(LandmarkId) -> bool,
        distractors: bool,
        p: &RecogniseParams,
    ) -> Vec<TrackOutcome> {
        self.clear_out(at_ns);
        let mut taken = vec![false; self.tracks.len()];
        let places = self.assigned(at_ns, camera, quads, &mut taken, p);
        quads
            .iter()
            .zip(places)
            .map(|(quad, place)| {
                let at = match (quad.identity, place) {
                    (Identity::Landmark(id), _) if wanted(id) => self.of_landmark(id),
                    (Identity::Stranger, _) if !distractors => Err(TrackOutcome::NotRequested),
                    (Identity::Stranger, Place::Nowhere) => self.begun(None),
                    (_, Place::Track(i)) => Ok(i),
                    (Identity::Stranger, Place::Occupied) => Err(TrackOutcome::AppearanceMismatch),
                    _ => Err(TrackOutcome::KnownLandmark),
                };
                at.map_or_else(|outcome| outcome, |i| self.taken(i, at_ns, camera, quad))
            })
            .collect()
    }

    /// Assigns quads to tracks: the best pairs first, each track once.
    fn assigned(
        &self,
        at_ns: i64,
        camera: &str,
        quads: &[QuadObservation],
        taken: &mut [bool],
        p: &RecogniseParams,
    ) -> Vec<Place> {
        let mut places = vec![Place::Nowhere; quads.len()];
        let mut pairs = vec![];
        for (g, quad) in quads.iter().enumerate() {
            for (t, track) in self.tracks.iter().enumerate().filter(|(_, t)| t.landmark.is_none()) {
                if !self.lies_there(track, at_ns, camera, quad) {
                    continue;
                }
                let distance = track.distance(&quad.icon, p);
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

    fn lies_there(&self, track: &Track, at_ns: i64, camera: &str, quad: &QuadObservation) -> bool {
        if let (Some(a), Some(b)) = (&track.place, &quad.place) {
            return same_place(a, b, &self.p);
        }
        // A resumed track has no last frame: appearance alone does not locate it.
        let Some(last) = &track.last else { return false };
        let gap_s = at_ns.saturating_sub(last.at_ns) as f64 * 1e-9;
        last.camera == camera
            && (0.0..=self.p.gap_s).contains(&gap_s)
            && iou(last.corners_px.points(), quad.corners_px.points()) >= self.p.min_iou
    }

    fn of_landmark(&mut self, id: LandmarkId) -> Result<usize, TrackOutcome> {
        match self.tracks.iter().position(|t| t.landmark == Some(id) && !t.closed) {
            Some(i) => Ok(i),
            None => self.begun(Some(id)),
        }
    }

    fn begun(&mut self, landmark: Option<LandmarkId>) -> Result<usize, TrackOutcome> {
        if self.tracks.len() >= MAX_TRACKS {
            return Err(TrackOutcome::TrackLimit);
        }
        self.numbers = self.numbers.saturating_add(1);
        self.tracks.push(Track::new(self.numbers, landmark));
        Ok(self.tracks.len() - 1)
    }

    fn taken(&mut self, i: usize, at_ns: i64, camera: &str, quad: &QuadObservation) -> TrackOutcome {
        let Some(track) = self.tracks.get_mut(i) else { return TrackOutcome::AppearanceMismatch };
        track.sightings = track.sightings.saturating_add(1);
        track.last = Some(Last {
            at_ns,
            camera: camera.to_owned(),
            corners_px: quad.corners_px,
            icon: quad.icon.clone(),
        });
        track.place = quad.place.or(track.place);
        if track.closed {
            return TrackOutcome::Decided;
        }
        if track.landmark.is_none() && quad.identity != Identity::Stranger {
            track.known = track.known.saturating_add(1);
            return TrackOutcome::KnownLandmark;
        }
        if track.landmark.is_none() && track.sightings < self.p.min_sightings {
            return TrackOutcome::TooFewObservations;
        }
        if track.views.len() >= MAX_TRACK_VIEWS {
            return TrackOutcome::Full;
        }
        let summary = ViewSummary::new(&quad.corners_px, &quad.icon.icon);
        let late = track.views.len() >= MAX_TRACK_VIEWS / 2;
        let needed = if late { self.p.late_novelty } else { 1.0 };
        match most_alike(&summary, &track.views, &self.p.thinning) {
            Some((_, novelty)) if novelty < needed => TrackOutcome::NearDuplicate,
            _ => {
                track.keep(summary, &quad.icon);
                TrackOutcome::Keep(track.number)
            }
        }
    }

    /// Forgets old tracks without views.
    fn clear_out(&mut self, now_ns: i64) {
        let memory_s = self.p.memory_s;
        let fresh = |t: &Track| {
            t.last.as_ref().is_some_and(|l| now_ns.saturating_sub(l.at_ns) as f64 * 1e-9 <= memory_s)
        };
        self.tracks.retain(|t| t.closed || !t.views.is_empty() || fresh(t));
    }
}

/// Position of a quad among the tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// No track is there.
    Nowhere,
    /// A track of different appearance is there.
    Occupied,
    /// It belongs to this track.
    Track(usize),
}
