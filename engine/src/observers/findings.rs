//! Findings about landmarks (moved, missing, in place again) on their way to whoever stores the
//! map. The store commits a finding; every frame after that sees the new version of the map.

use crate::{frame::workers::FrameObserver, snapshot::MapSnapshot};
use map::landmark_health::{Finding, HealthChange, LandmarkHealth};
use serde_json::json;
use tokio::sync::mpsc::{Receiver, Sender, channel, error::TrySendError};
use vision::model::LandmarkId;

/// Findings that wait for the store. More are dropped: later frames give them again.
const QUEUE: usize = 256;

/// A finding about a landmark of a map.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkFinding {
    /// Name of the map.
    pub map: String,
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Its name.
    pub name: String,
    /// Its health from now on.
    pub health: LandmarkHealth,
    /// The reason, as JSON; `None` for a sound landmark.
    pub finding: Option<String>,
}

impl LandmarkFinding {
    /// The finding for a change of health that a robot's frames led to.
    fn new(map: &MapSnapshot, change: &HealthChange) -> Self {
        let finding = change.finding.map(|finding| match finding {
            Finding::Moved { observed_place: at, offset_m, sightings } => json!({
                "kind": "moved", "offset_m": offset_m, "sightings": sightings,
                "observed_place": { "x_m": at.x_m, "y_m": at.y_m, "theta_rad": at.theta_rad },
            }),
            Finding::Missing { missed_frames } => {
                json!({ "kind": "missing", "missed_frames": missed_frames })
            }
        });
        Self {
            map: map.name.clone(),
            landmark: change.landmark,
            name: map.landmarks.get(&change.landmark).map_or_else(String::new, |l| l.name.clone()),
            health: change.health,
            finding: finding.map(|f| f.to_string()),
        }
    }
}

/// Takes findings from workers. Never waits.
#[derive(Debug, Clone)]
pub struct FindingSender(Sender<LandmarkFinding>);

/// A queue of findings: both ends.
pub fn findings() -> (FindingSender, Receiver<LandmarkFinding>) {
    let (sender, receiver) = channel(QUEUE);
    (FindingSender(sender), receiver)
}

impl FrameObserver for FindingSender {
    fn health_changed(&self, map: &MapSnapshot, changes: &[HealthChange]) {
        for change in changes {
            self.send(LandmarkFinding::new(map, change));
        }
    }
}

impl FindingSender {
    /// Queues a finding, or drops it if the queue is full.
    fn send(&self, found: LandmarkFinding) {
        let LandmarkFinding { map, name, health, finding, .. } = &found;
        let follows = match health {
            LandmarkHealth::Quarantined => "excluded from fixes until a person decides",
            LandmarkHealth::Flagged => "used for fixes as before; a person should check its place",
            LandmarkHealth::Sound => "used for fixes",
        };
        tracing::warn!(map, landmark = name, ?health, finding, follows, "landmark_health_changed");
        if let Err(TrySendError::Full(found)) = self.0.try_send(found) {
            tracing::warn!(
                map = found.map,
                landmark = found.name,
                follows = "a later frame gives it again",
                "landmark_finding_dropped"
            );
        }
    }
}
