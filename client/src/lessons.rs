//! What travels over HTTP as JSON: maps, landmarks, views, jobs, robots, problems. Shapes only, names with
//! units; unknown fields are ignored so that a newer server can say more.

use protos::v1::PoseTrust;
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
    /// Where it belongs.
    #[serde(default)]
    pub site: Option<String>,
    /// Where it belongs.
    #[serde(default)]
    pub building: Option<String>,
    /// Where it belongs.
    #[serde(default)]
    pub floor: Option<String>,
    /// Where it lies in another map.
    #[serde(default)]
    pub parent: Option<Parent>,
}

impl Map {
    /// Where it is, for people; empty where nobody has said it.
    pub fn whereabouts(&self) -> String {
        let words: Vec<&str> =
            [&self.site, &self.building, &self.floor].into_iter().flatten().map(String::as_str).collect();
        let lies = self.parent.as_ref().map(|p| format!("in {} at {:.2}, {:.2} m", p.map, p.x_m, p.y_m));
        [Some(words.join(" / ")).filter(|w| !w.is_empty()), lies]
            .into_iter()
            .flatten()
            .collect::<Vec<_>>()
            .join(", ")
    }
}

/// Where a map lies in another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parent {
    /// The other map.
    pub map: String,
    /// Its origin there.
    pub x_m: f64,
    /// Its origin there.
    pub y_m: f64,
    /// Its x axis there.
    pub theta_rad: f64,
    /// Its floor above that one's.
    #[serde(default)]
    pub level_m: f64,
    /// Over (x, y, theta), row-major.
    #[serde(default)]
    pub covariance: Option<[f64; 9]>,
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
    /// In the answer to an upload: `new`, `same` (it was there), or `alike` (a near-duplicate of this one, not stored).
    #[serde(default)]
    pub outcome: Option<String>,
}

/// Views gathered by a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gathering {
    /// Its number.
    pub id: i64,
    /// Who gathers.
    pub robot: String,
    /// The only landmark whose views are wanted.
    #[serde(default)]
    pub landmark: Option<String>,
    /// It goes on.
    pub open: bool,
    /// What became of frames and quads, by name.
    #[serde(default)]
    pub counts: std::collections::BTreeMap<String, u64>,
}

impl Gathering {
    /// Views kept.
    pub fn kept(&self) -> u64 {
        self.counts.get("kept").copied().unwrap_or_default()
    }
}

/// A thing that a robot drove past.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Its number in the gathering.
    pub number: u32,
    /// The landmark whose views these are.
    #[serde(default)]
    pub landmark: Option<String>,
    /// Numbers of its views.
    pub views: Vec<i64>,
    /// The view that stands best for all.
    #[serde(default)]
    pub best: Option<i64>,
    /// Nothing speaks against it.
    pub passes: bool,
    /// What does.
    #[serde(default)]
    pub reasons: Vec<serde_json::Value>,
    /// Where it hangs, if known.
    #[serde(default)]
    pub hangs: Option<serde_json::Value>,
}

impl Candidate {
    /// What speaks against it, in words.
    pub fn details(&self) -> Vec<String> {
        self.reasons.iter().map(|r| r["detail"].as_str().unwrap_or_default().to_owned()).collect()
    }

    /// Where it hangs, in words.
    pub fn place_text(&self) -> String {
        let Some(hangs) = &self.hangs else { return "not placed".to_owned() };
        let number = |field: &str| hangs[field].as_f64().unwrap_or_default();
        let [x, y, w, h] = ["x_m", "y_m", "width_m", "height_m"].map(number);
        format!("{w:.2} x {h:.2} m at {x:.2}, {y:.2}")
    }
}

/// A decision on a candidate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pick {
    /// Its number.
    pub candidate: u32,
    /// The landmark it becomes; `None` for views of one that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
}

/// A landmark that got views by a decision.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Grown {
    /// Its name.
    pub name: String,
    /// How many.
    pub views: u64,
}

/// What a decision came to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Accepted {
    /// The landmarks.
    pub landmarks: Vec<Grown>,
    /// Their lesson.
    #[serde(default)]
    pub job: Option<Job>,
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
    /// Its software is connected, or sent a message within the last 3 s.
    #[serde(default)]
    pub alive: bool,
    /// The start of its software that speaks for it.
    #[serde(default)]
    pub epoch: Option<u64>,
    /// A second program that uses the robot's name and is refused.
    #[serde(default)]
    pub conflict: Option<RobotConflict>,
    /// Its fused pose, if that is known.
    #[serde(default)]
    pub pose: Option<RobotPose>,
}

/// A second program under the name of a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RobotConflict {
    /// Its epoch.
    pub epoch: u64,
    /// Messages of it that were refused.
    pub refused: u64,
    /// Milliseconds since the last of them.
    pub last_ms: u64,
}

/// The fused pose of a robot on its map.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RobotPose {
    /// Metres.
    pub x_m: f64,
    /// Metres.
    pub y_m: f64,
    /// Heading.
    pub theta_rad: f64,
    /// Over (x, y, theta), row-major.
    pub covariance: [f64; 9],
    /// Since the capture of what supports it.
    pub age_ms: f64,
    /// How far it is trusted; unspecified where the server does not say, or says a word that is not known here.
    #[serde(with = "trust_word")]
    pub trust: PoseTrust,
}

mod trust_word {
    use protos::v1::PoseTrust;
    use serde::{Deserialize, Deserializer, Serializer};

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
    pub(super) fn serialize<S: Serializer>(trust: &PoseTrust, to: S) -> Result<S::Ok, S::Error> {
        protos::json::pose_trust::serialize(&i32::from(*trust), to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<PoseTrust, D::Error> {
        let word = String::deserialize(from)?;
        Ok(PoseTrust::from_str_name(&format!("POSE_TRUST_{}", word.to_uppercase())).unwrap_or_default())
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_trust_of_a_pose_is_read_and_unknown_words_are_no_fault() {
        let trust = |fields: &str| {
            let text = format!(r#"{{"name":"r1","map":"hall","pose":{{"x_m":1.0{fields}}}}}"#);
            serde_json::from_str::<Robot>(&text).unwrap().pose.unwrap().trust
        };
        assert_eq!(trust(r#","trust":"contradicted""#), PoseTrust::Contradicted);
        // A server from before there was trust, and one from after another word.
        assert_eq!(trust(""), PoseTrust::Unspecified);
        assert_eq!(trust(r#","trust":"certified""#), PoseTrust::Unspecified);
        let pose = RobotPose { trust: PoseTrust::Stale, ..RobotPose::default() };
        assert_eq!(serde_json::to_value(pose).unwrap()["trust"], "stale");
    }
}
