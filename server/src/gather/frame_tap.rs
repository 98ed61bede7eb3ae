//! The gatherings' side of the workers' frame tap. In: analysed frames of robots that gather. Out:
//! the same, queued and counted. Never waits.

use crate::store::gatherings::GatheringRow;
use arc_swap::ArcSwap;
use engine::{
    frame_tap::GatheredFrame,
    slots::SlotKey,
    workers::{AnsweredFrame, FrameObserver},
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

/// Frames that wait; further ones are dropped.
pub(crate) const QUEUE: usize = 8;

/// Counts of a gathering's frames and quads, stored as JSON when it ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct GatheringCounts {
    /// Frames offered.
    pub(crate) frames: u64,
    /// Of these, dropped because the queue was full.
    pub(crate) dropped: u64,
    /// Frames on another map.
    pub(crate) other_map: u64,
    /// Quads that were too small, clipped or blurred to have an icon.
    pub(crate) unusable: u64,
    /// Quads that are not flat on a wall of the map.
    pub(crate) not_on_wall: u64,
    /// Views that were stored.
    pub(crate) kept: u64,
    /// Quads that are near-duplicates of a view.
    pub(crate) near_duplicate: u64,
    /// Quads with too few observations so far.
    pub(crate) too_few_observations: u64,
    /// Quads of tracks with all the views that they may have.
    pub(crate) full: u64,
    /// Quads of tracks that were accepted or discarded.
    pub(crate) decided: u64,
    /// Quads that show a landmark, or may show one.
    pub(crate) known_landmark: u64,
    /// Quads that show no landmark, where only landmarks are wanted.
    pub(crate) not_requested: u64,
    /// Quads at the place of a track with another appearance.
    pub(crate) appearance_mismatch: u64,
    /// Quads beyond the number of tracks.
    pub(crate) track_limit: u64,
    /// Views that were not stored because a bound was reached or the disk was full.
    pub(crate) not_stored: u64,
}

impl GatheringCounts {
    pub(super) fn add(&mut self, outcome: TrackOutcome) {
        let count = match outcome {
            // Counted after the commit.
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
pub struct ActiveGathering {
    pub(super) id: i64,
    map: String,
    pub(super) landmark: Option<LandmarkId>,
    pub(super) known: bool,
    /// Workers count here: held briefly only.
    pub(super) counts: Mutex<GatheringCounts>,
    pub(super) tracker: Mutex<ViewTracker>,
    /// Tracks that were accepted or discarded since the last frame. The writer adds them here: held
    /// briefly only.
    pub(super) decided: Mutex<Vec<u32>>,
}

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The value is whole after every step under the lock.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl ActiveGathering {
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

/// The active gatherings by robot.
pub(super) type ActiveGatherings = ArcSwap<BTreeMap<String, Arc<ActiveGathering>>>;

/// A frame of a robot that gathers.
#[derive(Debug)]
pub struct OfferedFrame {
    pub(super) gathering: Arc<ActiveGathering>,
    pub(super) camera: String,
    pub(super) frame: CheckedFrame,
    pub(super) gathered: GatheredFrame,
}

/// The tap that workers hold.
#[derive(Debug, Clone)]
pub struct GatheringTap {
    pub(super) active: Arc<ActiveGatherings>,
    frames: Sender<OfferedFrame>,
}

/// The tap and the queue behind it; no robot gathers yet.
pub fn gathering_tap() -> (GatheringTap, Receiver<OfferedFrame>) {
    let (frames, received) = channel(QUEUE);
    (GatheringTap { active: Arc::default(), frames }, received)
}

impl FrameObserver for GatheringTap {
    fn gathers(&self, key: &SlotKey) -> bool {
        self.active.load().contains_key(key.robot.as_str())
    }

    fn answered(&self, answered: &AnsweredFrame<'_>) {
        if self.gathers(answered.key)
            && let Some((frame, gathered)) = GatheredFrame::of(answered)
        {
            self.offer(answered.key, frame, gathered);
        }
    }
}

impl GatheringTap {
    /// Takes a frame of a robot that gathers, or drops it.
    pub(super) fn offer(&self, key: &SlotKey, frame: CheckedFrame, gathered: GatheredFrame) {
        let active = self.active.load();
        let Some(gathering) = active.get(key.robot.as_str()) else { return };
        lock(&gathering.counts).frames += 1;
        if gathered.map.name != gathering.map {
            lock(&gathering.counts).other_map += 1;
            return;
        }
        let camera = key.camera.to_string();
        let offered = OfferedFrame { gathering: gathering.clone(), camera, frame, gathered };
        if let Err(TrySendError::Full(offered)) = self.frames.try_send(offered) {
            lock(&offered.gathering.counts).dropped += 1;
        }
    }
}
