//! What travels over HTTP as JSON: maps, landmarks, views, jobs, robots, problems. Shapes only, names with
//! units; unknown fields are ignored so that a newer server can say more.

use serde::{Deserialize, Serialize};
use vision::recognise::DistanceKind;

/// A map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Map {
    /// Its name.
    pub name: String,
    /// Grows by one with every change.
    pub version: u64,
    /// Landmarks in it, whatever their status.
    pub landmarks: u64,
    /// Which distance decides.
    pub distance: DistanceKind,
}

/// One page of a list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Page<T> {
    /// The items.
    pub items: Vec<T>,
    /// Cursor of the next page; absent on the last.
    #[serde(default)]
    pub next: Option<String>,
}

/// Metric size of a landmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Size {
    /// Width.
    pub width_m: f64,
    /// Height.
    pub height_m: f64,
}

/// Where a landmark hangs: its centre in the map frame, and the direction of its outward normal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Centre, x.
    pub x_m: f64,
    /// Centre, y.
    pub y_m: f64,
    /// Centre, above the floor.
    pub z_m: f64,
    /// Direction of the outward normal on the floor.
    pub theta_rad: f64,
}

/// A landmark.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Landmark {
    /// Its name.
    pub name: String,
    /// `empty`, `learning`, `active` or `candidate`.
    pub status: String,
    /// Why it is a candidate only.
    #[serde(default)]
    pub reasons: Vec<serde_json::Value>,
    /// Views taught.
    #[serde(default)]
    pub views: u64,
    /// Size, where known.
    #[serde(default)]
    pub size: Option<Size>,
    /// Place, where known.
    #[serde(default)]
    pub place: Option<Place>,
    /// Facts of the learnt model.
    #[serde(default)]
    pub model: Option<serde_json::Value>,
}

/// A view taught.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// Its number or name.
    pub id: serde_json::Value,
    /// Corners, TL, TR, BR, BL, in pixels.
    pub corners: [[f64; 2]; 4],
}

/// State of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobState {
    /// Waits.
    Queued,
    /// Works.
    Running,
    /// Ended well.
    Done,
    /// Ended badly; `message` says why.
    Failed,
    /// Stopped on request.
    Cancelled,
}

/// Long work at the server.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Its number or name.
    pub id: serde_json::Value,
    /// Sort of work, such as `learn`.
    #[serde(default)]
    pub kind: String,
    /// Where it stands.
    pub state: JobState,
    /// 0 to 1.
    #[serde(default)]
    pub progress: f64,
    /// What it does, or why it failed.
    #[serde(default)]
    pub message: Option<String>,
    /// What came of it.
    #[serde(default)]
    pub result: Option<serde_json::Value>,
}

impl Job {
    /// The id as it stands in addresses.
    pub fn id_text(&self) -> String {
        self.id.as_str().map_or_else(|| self.id.to_string(), str::to_owned)
    }
}

/// A robot known to the server.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Robot {
    /// Its name.
    pub name: String,
    /// The map it drives in.
    pub map: Option<String>,
}

/// An error of the server (RFC 9457).
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Problem {
    /// Short sentence.
    pub title: String,
    /// HTTP status.
    pub status: u16,
    /// Stable code.
    pub code: String,
    /// Field at fault.
    pub field: Option<String>,
    /// What happened.
    pub detail: Option<String>,
}
