//! The shapes of the API's resources, with their checks, and how rows become them.

use super::error::ApiError;
use crate::store::{
    landmarks::{self, LandmarkRow, Measures},
    maps::MapRow,
    robots::RobotRow,
    sites::Whereabouts,
};
use engine::{
    epochs::Conflict,
    live::LiveHub,
    motion::{Known, Motion},
};
use map::{
    check::OutOfRange,
    landmark_health::LandmarkHealth,
    map_links::MapLink,
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
};
use nalgebra::{Matrix3, Vector3};
use protos::{Name, v1};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::time::Instant;
use utoipa::ToSchema;
use vision::{pose::LandmarkSize, recognise::DistanceKind};

/// Which distance decides in a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Distance {
    /// The picture itself, laid on the learnt icon, must be like it, and one of the two distances must accept.
    #[default]
    Both,
    /// Bucketed correlation.
    Correlation,
    /// Partial Hausdorff distance.
    Hausdorff,
}

impl From<Distance> for DistanceKind {
    fn from(distance: Distance) -> Self {
        match distance {
            Distance::Both => Self::Both,
            Distance::Correlation => Self::Correlation,
            Distance::Hausdorff => Self::Hausdorff,
        }
    }
}

impl From<DistanceKind> for Distance {
    fn from(kind: DistanceKind) -> Self {
        match kind {
            DistanceKind::Both => Self::Both,
            DistanceKind::Correlation => Self::Correlation,
            DistanceKind::Hausdorff => Self::Hausdorff,
        }
    }
}

/// A map.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct Map {
    /// Its name.
    name: String,
    /// Counts up with every change that an answer could depend on.
    version: u64,
    /// Landmarks in it, learnt or not.
    landmarks: u64,
    /// Which distance decides.
    distance: Distance,
    /// Where it belongs.
    site: Option<String>,
    /// Where it belongs.
    building: Option<String>,
    /// Where it belongs.
    floor: Option<String>,
    /// Where it lies in another map.
    parent: Option<Parent>,
}

/// Where a map lies in another.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Parent {
    /// The map in whose frame it lies.
    pub(super) map: String,
    /// Its origin there.
    x_m: f64,
    /// Its origin there.
    y_m: f64,
    /// Its x axis there.
    theta_rad: f64,
    /// Its floor above that one's, within 1000 m.
    #[serde(default)]
    level_m: f64,
    /// Over (x, y, theta), row-major; absent for 5 cm and half a degree.
    covariance: Option<[f64; 9]>,
}

/// Standard deviations of a link that says nothing of its own.
const LINK_SIGMA: [f64; 3] = [0.05, 0.05, 0.0087];

impl Parent {
    /// Checked.
    pub(super) fn link(self) -> Result<MapLink<String>, ApiError> {
        let usual = || Matrix3::from_diagonal(&Vector3::from(LINK_SIGMA.map(|sigma| sigma * sigma)));
        let covariance = self.covariance.map_or_else(usual, |c| Matrix3::from_row_slice(&c));
        let pose = Pose2::new(self.x_m, self.y_m, self.theta_rad);
        let parent_from_map = Pose2Covariance { pose, covariance };
        let link = MapLink { parent: self.map, parent_from_map, level_m: self.level_m };
        link.check().map_err(|e| out_of_range(&e, "parent"))?;
        Ok(link)
    }
}

impl From<&MapLink<String>> for Parent {
    fn from(link: &MapLink<String>) -> Self {
        let Pose2Covariance { pose, covariance } = &link.parent_from_map;
        Self {
            map: link.parent.clone(),
            x_m: pose.x_m,
            y_m: pose.y_m,
            theta_rad: pose.theta_rad,
            level_m: link.level_m,
            covariance: Some(row_major(covariance)),
        }
    }
}

/// Nine numbers, row by row.
pub(super) fn row_major(matrix: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|i| matrix[(i / 3, i % 3)])
}

impl Map {
    /// A map and where it is.
    pub(super) fn new(row: MapRow, found: Whereabouts) -> Self {
        Self {
            name: row.name,
            version: row.version,
            landmarks: row.landmarks,
            distance: row.distance.into(),
            parent: found.link.as_ref().map(Parent::from),
            site: found.site,
            building: found.building,
            floor: found.floor,
        }
    }
}

/// Width and height of a landmark.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Size {
    /// 0.01 to 100.
    width_m: f64,
    /// 0.01 to 100.
    height_m: f64,
}

/// Where a landmark hangs, in the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct Place {
    /// Centre.
    x_m: f64,
    /// Centre.
    y_m: f64,
    /// Centre, above the floor.
    z_m: f64,
    /// Direction of the outward normal on the floor, counter-clockwise from map x; under a ceiling, where the top points.
    theta_rad: f64,
    /// Turn about the outward normal, within 0.5; 0 when the sides are vertical.
    #[serde(default, skip_serializing_if = "is_zero")]
    roll_rad: f64,
    /// Turn of the outward normal from level downwards: 0 on a wall, pi/2 under a ceiling.
    #[serde(default, skip_serializing_if = "is_zero")]
    tilt_rad: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(value: &f64) -> bool {
    value.abs() <= 0.0
}

/// Standard deviations of a place that the server found from views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub(super) struct PlaceSigma {
    /// Of the centre.
    x_m: f64,
    /// Of the centre.
    y_m: f64,
    /// Of the centre.
    z_m: f64,
    /// Of the direction.
    theta_rad: f64,
    /// Of the size.
    width_m: f64,
    /// Of the size.
    height_m: f64,
}

/// Size and place, checked. Either may be missing.
pub(super) fn measures(size: Option<Size>, place: Option<Place>) -> Result<Measures, ApiError> {
    let size = size.map(|s| LandmarkSize { width_m: s.width_m, height_m: s.height_m });
    // A place is checked with some size, a size at some place: each has its own ranges.
    let stand_in = LandmarkSize { width_m: 1.0, height_m: 1.0 };
    let centre = place.map_or(Vector3::zeros(), |p| Vector3::new(p.x_m, p.y_m, p.z_m));
    let theta_rad = place.map_or(0.0, |p| p.theta_rad);
    let (roll_rad, tilt_rad) = place.map_or((0.0, 0.0), |p| (p.roll_rad, p.tilt_rad));
    let made = LandmarkPlace::by_hand(centre, theta_rad, size.unwrap_or(stand_in), PlaceSigmas::default());
    made.and_then(|made| LandmarkPlace { roll_rad, tilt_rad, ..made }.check()).map_err(|e| {
        let outer = if matches!(e.field, "width_m" | "height_m") { "size" } else { "place" };
        out_of_range(&e, outer)
    })?;
    let place = place.map(|p| landmarks::Place {
        x_m: p.x_m,
        y_m: p.y_m,
        z_m: p.z_m,
        theta_rad: p.theta_rad,
        roll_rad: p.roll_rad,
        tilt_rad: p.tilt_rad,
        covariance: None,
    });
    Ok(Measures { size, place, size_from_views: false })
}

/// 422 for a number outside its range.
pub(super) fn out_of_range(error: &OutOfRange, outer: &str) -> ApiError {
    let code = if error.value.is_finite() { "out_of_range" } else { "not_finite" };
    ApiError::invalid(code, format!("{outer}.{}", error.field), error.to_string())
}

/// Checks the ends of a wall.
pub(super) fn wall(index: usize, a: [f64; 2], b: [f64; 2]) -> Result<[f64; 4], ApiError> {
    let ends = [a[0], a[1], b[0], b[1]];
    LaserSegment::by_hand(&ends).map(|_| ends).map_err(|e| out_of_range(&e, &format!("segments[{index}]")))
}

/// How far a landmark has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Status {
    /// Not learnt yet.
    Empty,
    /// A job is learning it.
    Learning,
    /// Learnt and matched.
    Active,
    /// Learnt, but not matched: see `reasons`.
    Candidate,
}

/// What was learnt of a landmark, in brief.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct Model {
    /// Real views it rests on.
    views: u64,
    /// Views generated from the real ones.
    generated_views: u64,
    /// ms since the Unix epoch.
    learnt_ms: i64,
    /// Thresholds and figures of the learning.
    #[serde(flatten)]
    facts: serde_json::Map<String, Value>,
}

/// How far a landmark is trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Trust {
    /// Nothing speaks against it.
    Sound,
    /// Robots find it elsewhere or not at all: see `finding`. It is still used.
    Flagged,
    /// So often that it corrects no pose until somebody sets its place or its standing.
    Quarantined,
}

impl From<LandmarkHealth> for Trust {
    fn from(standing: LandmarkHealth) -> Self {
        match standing {
            LandmarkHealth::Sound => Self::Sound,
            LandmarkHealth::Flagged => Self::Flagged,
            LandmarkHealth::Quarantined => Self::Quarantined,
        }
    }
}

impl From<Trust> for LandmarkHealth {
    fn from(trust: Trust) -> Self {
        match trust {
            Trust::Sound => Self::Sound,
            Trust::Flagged => Self::Flagged,
            Trust::Quarantined => Self::Quarantined,
        }
    }
}

/// A landmark.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct Landmark {
    /// Its name, unique in the map.
    name: String,
    /// How far it has come.
    status: Status,
    /// Why it is a candidate only.
    reasons: Vec<Value>,
    /// Real views stored.
    views: u64,
    /// Width and height, if measured.
    size: Option<Size>,
    /// Where it hangs, if known.
    place: Option<Place>,
    /// How surely, where the server found the place from views; absent for a place by hand.
    #[serde(skip_serializing_if = "Option::is_none")]
    place_sigma: Option<PlaceSigma>,
    /// What was learnt.
    model: Option<Model>,
    /// How far robots' sightings let it be trusted.
    standing: Trust,
    /// What speaks against it: `kind` `moved` with where it appears, or `missing`.
    finding: Option<Value>,
}

impl Landmark {
    /// `quarantined`: why its stored model is out of use. `learning`: whether a job has it in work.
    pub(super) fn new(mut row: LandmarkRow, quarantined: Option<String>, learning: bool) -> Self {
        if let (Some(model), Some(reason)) = (&mut row.model, quarantined) {
            model.active = false;
            model.reasons = json!([{ "gate": "stored_model", "detail": reason }]).to_string();
        }
        let status = match (&row.model, learning) {
            (_, true) => Status::Learning,
            (None, _) => Status::Empty,
            (Some(model), _) if model.active => Status::Active,
            _ => Status::Candidate,
        };
        let reasons = row.model.as_ref().map(|m| serde_json::from_str(&m.reasons).unwrap_or_default());
        let model = row.model.map(|m| Model {
            views: m.views,
            generated_views: m.generated_views,
            learnt_ms: m.learnt_ms,
            facts: serde_json::from_str(&m.facts).unwrap_or_default(),
        });
        let Measures { size, place, .. } = row.measures;
        let sigma = place.and_then(|p| p.covariance).map(|c| c.diagonal().map(f64::sqrt));
        Self {
            standing: row.standing.into(),
            finding: row.finding.and_then(|f| serde_json::from_str(&f).ok()),
            name: row.name,
            status,
            reasons: reasons.unwrap_or_default(),
            views: row.views,
            size: size.map(|s| Size { width_m: s.width_m, height_m: s.height_m }),
            place: place.map(|p| Place {
                x_m: p.x_m,
                y_m: p.y_m,
                z_m: p.z_m,
                theta_rad: p.theta_rad,
                roll_rad: p.roll_rad,
                tilt_rad: p.tilt_rad,
            }),
            place_sigma: sigma.map(|s| PlaceSigma {
                x_m: s[0],
                y_m: s[1],
                z_m: s[3],
                theta_rad: s[2],
                width_m: s[4],
                height_m: s[5],
            }),
            model,
        }
    }
}

/// A robot.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct Robot {
    /// Its name.
    pub(super) name: String,
    /// The map it stands on.
    pub(super) map: String,
    /// Its software is connected, or sent a message within the last 3 s.
    pub(super) alive: bool,
    /// The start of its software that speaks for it; absent if it is not connected.
    pub(super) epoch: Option<u64>,
    /// A second program that uses the robot's name and is refused; shown for 10 s after its last message.
    pub(super) conflict: Option<Conflict>,
    /// Its fused pose; absent if it is unknown, or nothing newer than 2 s supports it.
    pub(super) pose: Option<RobotPose>,
}

/// A fused pose on the robot's map.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub(super) struct RobotPose {
    /// Metres.
    pub(super) x_m: f64,
    /// Metres.
    pub(super) y_m: f64,
    /// Heading.
    pub(super) theta_rad: f64,
    /// Over (x, y, theta), row-major.
    pub(super) covariance: [f64; 9],
    /// Since the capture of the newest odometry or fix that supports it; at most 2000.
    pub(super) age_ms: f64,
    /// How far it is trusted, as it was last published.
    pub(super) trust: PoseTrust,
}

/// How far a fused pose is trusted, by the landmarks that were named without it (globally). Those that were named by it
/// (guided) say nothing of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum PoseTrust {
    /// No frame was compared with it yet: it comes from another map, or was not published yet.
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

impl Robot {
    /// A registered robot with what is known of it now.
    pub(super) fn new(row: RobotRow, motion: &Motion, live: &LiveHub) -> Self {
        let now = Instant::now();
        let robot = Name::new(row.name.as_str()).ok();
        let status = robot.as_ref().map(|robot| motion.epochs().status(robot, now)).unwrap_or_default();
        let known = robot.as_ref().and_then(|robot| motion.known(robot, now));
        let pose = known.filter(|known| known.map == row.map).map(|Known { fused, age, .. }| {
            let Pose2 { x_m, y_m, theta_rad } = fused.pose.pose;
            let covariance = row_major(&fused.pose.covariance);
            let trust = robot.and_then(|robot| live.trust(&robot, &row.map)).unwrap_or_default().into();
            RobotPose { x_m, y_m, theta_rad, covariance, age_ms: age.as_secs_f64() * 1e3, trust }
        });
        let (alive, epoch, conflict) = (status.alive, status.epoch, status.conflict);
        Self { name: row.name, map: row.map, alive, epoch, conflict, pose }
    }
}
