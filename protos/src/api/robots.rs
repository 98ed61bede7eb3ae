//! `/robots`: robots, their poses, and what became of their fixes.

use super::RobotActivity;
use crate::v1;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{IntoDeserializer, value::StringDeserializer},
};
use std::collections::BTreeMap;

/// A robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct Robot {
    /// `[a-z0-9_-]{1,64}`, unique.
    pub name: String,
    /// The map it stands on.
    pub map: String,
    /// Its software is connected, or sent a message within the last 3 s.
    pub alive: bool,
    /// The start of its software that speaks for it; absent if it is not connected.
    pub epoch: Option<u64>,
    /// A second program that uses the robot's name and is refused; shown for 10 s after its last
    /// message.
    pub conflict: Option<EpochConflictBody>,
    /// Its fused pose; absent if it is unknown, or nothing newer than 2 s supports it.
    pub pose: Option<RobotPose>,
    /// What it has done since the server started; absent before its first message.
    pub activity: Option<RobotActivity>,
}

/// A second epoch speaks under the name of a robot while the first is live.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct EpochConflictBody {
    /// The epoch that was refused last.
    pub epoch: u64,
    /// Messages refused since the conflict began.
    pub refused: u64,
    /// Milliseconds since the last of them.
    pub last_ms: u64,
}

/// A fused pose on the robot's map.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotPose {
    /// Metres, in the map.
    pub x_m: f64,
    /// Metres, in the map.
    pub y_m: f64,
    /// Heading in the map.
    pub theta_rad: f64,
    /// Over (x, y, theta), row-major.
    #[cfg_attr(feature = "openapi", schema(value_type = super::arrays::Covariance))]
    pub covariance: [f64; 9],
    /// Since the capture of the newest odometry or fix that supports it; at most 2000.
    pub age_ms: f64,
    /// How far it is trusted, as it was last published. Read as unspecified where a server does not
    /// say.
    #[serde(default, deserialize_with = "known_or_unspecified")]
    #[cfg_attr(feature = "openapi", schema(required))]
    pub trust: PoseTrust,
}

/// How far a fused pose is trusted, by the landmarks that were named without it (globally). Those
/// that were named by it (guided) say nothing of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(rename_all = "snake_case")]
pub enum PoseTrust {
    /// No frame was compared with it yet: it comes from another map, or was not published yet.
    #[default]
    Unspecified,
    /// None has agreed with it yet.
    Unsupported,
    /// They have agreed with it lately.
    Supported,
    /// The last that agreed is 30 frames or 10 m back.
    Stale,
    /// The last one contradicts it. Nothing guided corrects it meanwhile.
    Contradicted,
}

/// Words that a newer server says and that are not known here are [`PoseTrust::Unspecified`].
fn known_or_unspecified<'de, D: Deserializer<'de>>(from: D) -> Result<PoseTrust, D::Error> {
    let word: StringDeserializer<serde::de::value::Error> = String::deserialize(from)?.into_deserializer();
    Ok(PoseTrust::deserialize(word).unwrap_or_default())
}

impl From<v1::PoseTrust> for PoseTrust {
    fn from(trust: v1::PoseTrust) -> Self {
        match trust {
            v1::PoseTrust::Unspecified => Self::Unspecified,
            v1::PoseTrust::Unsupported => Self::Unsupported,
            v1::PoseTrust::Supported => Self::Supported,
            v1::PoseTrust::Stale => Self::Stale,
            v1::PoseTrust::Contradicted => Self::Contradicted,
        }
    }
}

/// Where a robot stands.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotAssignment {
    /// Name of the map.
    pub map: String,
}

/// Where a person says that a robot is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PoseByHand {
    /// Metres, in the robot's map.
    pub x_m: f64,
    /// Metres, in the robot's map.
    pub y_m: f64,
    /// Heading in the map, -2 pi to 2 pi.
    pub theta_rad: f64,
    /// Standard deviation of each coordinate; 0.5 by default, 0.01 to 10.
    #[serde(default = "sigma_m")]
    pub sigma_m: f64,
    /// Standard deviation of the heading; 0.35 by default, 0.01 to 3.15.
    #[serde(default = "sigma_rad")]
    pub sigma_rad: f64,
}

fn sigma_m() -> f64 {
    PoseByHand::SIGMA_M
}

fn sigma_rad() -> f64 {
    PoseByHand::SIGMA_RAD
}

impl PoseByHand {
    /// Standard deviation of a coordinate if nothing is said: a person who points at a map.
    pub const SIGMA_M: f64 = 0.5;
    /// That of the heading: 20 degrees.
    pub const SIGMA_RAD: f64 = 0.35;

    /// A pose as exactly as a person says it without more words.
    pub fn new(x_m: f64, y_m: f64, theta_rad: f64) -> Self {
        Self { x_m, y_m, theta_rad, sigma_m: Self::SIGMA_M, sigma_rad: Self::SIGMA_RAD }
    }
}

/// A fix, what became of it, and by how much it moved the pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CorrectionBody {
    /// Echo of the frame or scan.
    pub epoch: u64,
    /// Echo of the frame or scan, robot's clock.
    pub captured_ns: i64,
    /// The map it is a pose in.
    pub map: String,
    /// `landmarks` (named without the pose), `guided` (landmarks named by the pose), `laser` or
    /// `relocalisation`; `by_hand` when a person said where it is; `map_change` when the robot came
    /// from another map.
    pub modality: String,
    /// The landmarks it rests on, by name; empty for the laser.
    pub landmarks: Vec<String>,
    /// `started` (it gave the first pose), `applied`, `gated_out` (it contradicts the pose and was
    /// left out), `reset` (the last of several that contradict the pose and agree with one another,
    /// or a person: it replaced the pose), `excluded_by_mode` (it agrees, but reference runs have
    /// shown another modality to be better here, and the map's fusion mode leaves this one out),
    /// `too_old`, `waiting` (newer than the last odometry), `carried_over` (the pose on another
    /// map, in the frame of this one).
    pub outcome: String,
    /// Squared Mahalanobis distance of the fix from the pose before it, 3 degrees of freedom; for
    /// `applied`, `excluded_by_mode` and `gated_out`.
    pub chi2: Option<f64>,
    /// By how much it moved the pose, in the robot's frame before it: forwards, metres.
    pub along_m: Option<f64>,
    /// By how much it moved the pose to the left, metres.
    pub across_m: Option<f64>,
    /// By how much it turned the pose to the left.
    pub turn_rad: Option<f64>,
}

/// What a robot's pose rests on, and what became of its fixes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CorrectionsBody {
    /// What the pose rests on now: `odometry`, `landmarks`, `guided`, `laser`, `relocalisation`,
    /// `by_hand`; empty without a pose.
    pub modalities: Vec<String>,
    /// For each modality how many fixes came to which end. For the laser also why scans gave no
    /// fix: `no_pose` (there is none to correct), `no_walls` (the map has none), `few_points`,
    /// `poor_match` (it shows something else than the map), `gate_prior` (it contradicts the pose),
    /// `ambiguous` (several poses fit), `superseded` (a newer one came first).
    pub totals: BTreeMap<String, BTreeMap<String, u64>>,
    /// The latest 200 of each modality, oldest first; without `repeated` ones, which tell nothing
    /// new.
    pub corrections: Vec<CorrectionBody>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_trust_of_a_pose_is_read_and_unknown_words_are_no_fault() {
        let trust = |fields: &str| {
            let text = format!(
                r#"{{"x_m":1.0,"y_m":0,"theta_rad":0,"age_ms":1,"covariance":[0,0,0,0,0,0,0,0,0]{fields}}}"#
            );
            serde_json::from_str::<RobotPose>(&text).unwrap().trust
        };
        assert_eq!(trust(r#","trust":"contradicted""#), PoseTrust::Contradicted);
        // A server from before there was trust, and one from after another word.
        assert_eq!(trust(""), PoseTrust::Unspecified);
        assert_eq!(trust(r#","trust":"certified""#), PoseTrust::Unspecified);
        let pose = RobotPose { trust: PoseTrust::Stale, ..RobotPose::default() };
        assert_eq!(serde_json::to_value(pose).unwrap()["trust"], "stale");
        assert_eq!(serde_json::to_value(PoseTrust::Unspecified).unwrap(), "unspecified");
    }
}
