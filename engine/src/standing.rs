//! What robots find out about landmarks, on its way to whoever keeps the map: moved, missing, in place again. The store
//! commits it, then the new version of the map is what every frame sees.

use map::landmark_health::{Finding, HealthChange, LandmarkHealth};
use serde_json::json;
use tokio::sync::mpsc::{Receiver, Sender, channel, error::TrySendError};
use vision::model::LandmarkId;

/// Findings that wait for the store; beyond that they are dropped, and found again.
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
    /// How far to trust it from now on.
    pub standing: LandmarkHealth,
    /// JSON: why; none for a sound one.
    pub finding: Option<String>,
}

impl LandmarkFinding {
    /// Of what a robot's watch says.
    pub fn new(map: &str, name: &str, change: &HealthChange) -> Self {
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
            map: map.to_owned(),
            landmark: change.landmark,
            name: name.to_owned(),
            standing: change.health,
            finding: finding.map(|f| f.to_string()),
        }
    }
}

/// Takes findings from workers, who never wait.
#[derive(Debug, Clone)]
pub struct FindingSender(Sender<LandmarkFinding>);

/// Both ends.
pub fn findings() -> (FindingSender, Receiver<LandmarkFinding>) {
    let (sender, receiver) = channel(QUEUE);
    (FindingSender(sender), receiver)
}

impl FindingSender {
    /// Passes one on.
    pub fn tell(&self, found: LandmarkFinding) {
        let is_quarantined = found.standing == LandmarkHealth::Quarantined;
        let follows = is_quarantined.then_some("excluded from fixes until a person decides");
        tracing::warn!(
            map = found.map,
            landmark = found.name,
            health = ?found.standing,
            finding = found.finding,
            follows,
            "landmark_health_changed"
        );
        if let Err(TrySendError::Full(found)) = self.0.try_send(found) {
            tracing::warn!(landmark = found.name, "too many findings at once: this one is dropped");
        }
    }
}
