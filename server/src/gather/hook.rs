//! The frame path's end of gathering: what a worker offers, to whom, and what is counted on the way. Never waits.

use crate::store::gatherings::GatheringRow;
use arc_swap::ArcSwap;
use engine::{
    frame_tap::{AnalysedFrame, FrameTap},
    slots::SlotKey,
};
use map::tracks::{TrackOutcome, ViewTracker};
use protos::CheckedFrame;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::sync::mpsc::{Receiver, Sender, channel, error::TrySendError};
use vision::model::LandmarkId;

/// Frames that wait to be followed; beyond that they are dropped.
pub(crate) const QUEUE: usize = 8;

/// What became of frames and quads. Stored as JSON when the gathering ends: the other words are of earlier builds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Counts {
    /// Frames offered.
    pub(crate) frames: u64,
    /// Of these, dropped because others were still being followed.
    pub(crate) dropped: u64,
    /// Frames on another map.
    #[serde(alias = "elsewhere")]
    pub(crate) other_map: u64,
    /// Quads that were too small, cut off or blurred to have an icon.
    pub(crate) unusable: u64,
    /// Quads that are not flat on a wall of the map.
    pub(crate) not_on_wall: u64,
    /// Views kept.
    pub(crate) kept: u64,
    /// Quads that repeat a stored view.
    #[serde(alias = "alike")]
    pub(crate) near_duplicate: u64,
    /// Quads not yet observed often enough.
    #[serde(alias = "too_new")]
    pub(crate) too_few_observations: u64,
    /// Quads of tracks that have all the views they may have.
    pub(crate) full: u64,
    /// Quads of tracks that were decided on.
    pub(crate) decided: u64,
    /// Quads that show a landmark, or may.
    #[serde(alias = "known")]
    pub(crate) known_landmark: u64,
    /// Quads that are no landmark, where only landmarks are wanted.
    #[serde(alias = "unwanted")]
    pub(crate) not_requested: u64,
    /// Quads at the place of a track that look different.
    #[serde(alias = "unlike")]
    pub(crate) appearance_mismatch: u64,
    /// Quads beyond the number of tracks.
    #[serde(alias = "too_many")]
    pub(crate) track_limit: u64,
    /// Views that were not stored because a bound was reached or the disk is full.
    #[serde(alias = "refused")]
    pub(crate) not_stored: u64,
}

impl Counts {
    pub(super) fn add(&mut self, outcome: TrackOutcome) {
        let count = match outcome {
            // Counted when it is committed.
            TrackOutcome::Keep(_) => return,
            TrackOutcome::NearDuplicate => &mut self.near_duplicate,
            TrackOutcome::TooFewObservations => &mut self.too_few_observations,
            TrackOutcome::Full => &mut self.full,
            TrackOutcome::Decided => &mut self.decided,
            TrackOutcome::KnownLandmark => &mut self.known_landmark,
            TrackOutcome::NotRequested => &mut self.not_requested,
            TrackOutcome::AppearanceMismatch => &mut self.appearance_mismatch,
            TrackOutcome::TrackLimit => &mut self.track_limit,
        };
        *count += 1;
    }
}

/// A robot that gathers.
#[derive(Debug)]
pub struct Session {
    pub(super) id: i64,
    map: String,
    pub(super) landmark: Option<LandmarkId>,
    pub(super) known: bool,
    /// Short holds only: workers count here.
    pub(super) counts: Mutex<Counts>,
    pub(super) tracker: Mutex<ViewTracker>,
    /// Tracks that somebody has decided on since the last frame. Short holds only: the writer tells of them here.
    pub(super) decided: Mutex<Vec<u32>>,
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // What is inside is whole after every step of ours.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Session {
    pub(super) fn new(row: &GatheringRow, tracker: ViewTracker) -> Self {
        Self {
            id: row.id,
            map: row.map.clone(),
            landmark: row.landmark_id.map(|id| LandmarkId(id as u64)),
            known: row.known,
            counts: Mutex::default(),
            tracker: Mutex::new(tracker),
            decided: Mutex::default(),
        }
    }
}

/// By robot.
pub(super) type Sessions = ArcSwap<BTreeMap<String, Arc<Session>>>;

/// A frame to follow things in.
#[derive(Debug)]
pub struct Offer {
    pub(super) session: Arc<Session>,
    pub(super) camera: String,
    pub(super) frame: CheckedFrame,
    pub(super) looked: AnalysedFrame,
}

/// The end that workers hold.
#[derive(Debug, Clone)]
pub struct Hook {
    pub(super) sessions: Arc<Sessions>,
    offers: Sender<Offer>,
}

/// Both ends, nobody gathering yet.
pub fn hook() -> (Hook, Receiver<Offer>) {
    let (offers, received) = channel(QUEUE);
    (Hook { sessions: Arc::default(), offers }, received)
}

impl FrameTap for Hook {
    fn is_wanted(&self, key: &SlotKey) -> bool {
        self.sessions.load().contains_key(key.robot.as_str())
    }

    fn offer(&self, key: &SlotKey, frame: &CheckedFrame, looked: AnalysedFrame) {
        let sessions = self.sessions.load();
        let Some(session) = sessions.get(key.robot.as_str()) else { return };
        lock(&session.counts).frames += 1;
        if looked.map.name != session.map {
            lock(&session.counts).other_map += 1;
            return;
        }
        let camera = key.camera.to_string();
        let offer = Offer { session: session.clone(), camera, frame: frame.clone(), looked };
        if let Err(TrySendError::Full(offer)) = self.offers.try_send(offer) {
            lock(&offer.session.counts).dropped += 1;
        }
    }
}
