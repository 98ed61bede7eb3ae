//! One drive: scans and frames go to the server's code, landmarks are checked, changes of landmark
//! health put into the map. At equal times the scan comes before the frame. Compared with the
//! truth; the start pose is unknown to the server.

use super::{
    super::experiment::{
        mixed,
        robot_server::{SentFrame, Server},
    },
    body::{Body, DriveSettings},
    kidnap::{Kidnap, KidnapOutcome},
    world::{FirstMapBy, World},
};
use cli::simulated_errors::SimulatedRobotErrors;
use engine::{
    analysis::{StageTimes, analyse_frame, frame_camera},
    guided::GuidedResult,
    motion::{Corrections, RunRecording},
};
use map::{
    landmark_health::LandmarkHealth,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix2, Point2, Vector3};
use sim::{
    building::LandmarkKind,
    robot::SensorReadings,
    truth::{FrameTruth, LandmarkView, ViewState},
};
use std::collections::BTreeMap;
use vision::{
    geometry::{Corners, polygon},
    model::LandmarkId,
    pipeline::{FrameAnalysis, matched_border},
    pose::reprojection::pixel,
    recognise::Verdict,
    seen_border::FoundBy,
};

/// A name is right if its quad overlaps the landmark's true outline by this much.
const IOU_TRUE: f64 = 0.5;
/// Of a surveyed place, which is some centimetres off.
const IOU_SURVEYED: f64 = 0.3;
/// A frame shows a landmark if all of it is visible and no side is shorter than this...
const MIN_SIDE_PX: f64 = 38.0;
/// ... at up to this view angle, the paper's limit of recognition.
const MAX_VIEW_ANGLE_RAD: f64 = 1.309;
/// A cut or hidden landmark counts if at least this share of it is visible.
const MIN_SHARE: f64 = 0.25;

/// True and estimated poses at one time.
pub(super) struct Moment {
    pub(super) time_s: f64,
    pub(super) truth: Pose2,
    /// Odometry alone: from the true start, or from the start of the planned path.
    pub(super) odometry: Pose2,
    /// None before the first fix.
    pub(super) fused: Option<Pose2Covariance>,
    /// A landmark corrected it here.
    pub(super) corrected: bool,
    /// How far the true pose is to the left of the planned path; none for a scripted drive.
    pub(super) off_path_m: Option<f64>,
}

#[derive(Default)]
pub(super) struct Journey {
    pub(super) moments: Vec<Moment>,
    /// Full views of taught landmarks, and how many were rightly named.
    pub(super) shown: usize,
    pub(super) recognised: usize,
    /// Wrong names by the picture alone.
    pub(super) false_matches: usize,
    /// Wrong names by guided recognition.
    pub(super) guided_false: usize,
    /// Corners of rightly named landmarks: error (px) and squared Mahalanobis distance.
    pub(super) corners: BTreeMap<&'static str, Vec<(f64, f64)>>,
    /// Counts of right names by kind and state of the landmark.
    pub(super) named: BTreeMap<(&'static str, &'static str), Named>,
    /// Frames that showed a landmark up to the first fix, itself included; none if there never was
    /// one.
    pub(super) frames_to_fix: Option<usize>,
    /// Outcomes of fixes and scans.
    pub(super) log: Corrections,
    /// Landmarks wrongly flagged and quarantined; nothing in the corridor changes.
    pub(super) flagged: usize,
    pub(super) quarantined: usize,
    /// Outcome of kidnapping the robot, if it was.
    pub(super) kidnapped: Option<KidnapOutcome>,
    /// It came to the end of its path.
    pub(super) arrived: bool,
    /// All that the robot's fusion got.
    pub(super) recording: Option<Box<RunRecording>>,
}

/// Views of taught landmarks of one kind.
#[derive(Debug, Clone, Copy, Default, serde::Serialize)]
pub(super) struct Named {
    pub(super) shown: usize,
    /// Rightly named by the picture alone.
    pub(super) global: usize,
    /// Shown while the robot's pose was known and not contradicted.
    pub(super) shown_to_pose: usize,
    /// Of these, rightly named by the picture alone or with the pose.
    pub(super) guided: usize,
}

/// Drives the length of the corridor once.
pub(super) fn drive(world: &World, way: DriveSettings) -> anyhow::Result<Journey> {
    let mut body = Body::new(world, way);
    let wrong = SimulatedRobotErrors::of(
        body.camera(),
        world.course.first_map == FirstMapBy::Truth,
        mixed(&[way.seed, 14]),
    );
    let server = Server::new(&world.map)?;
    server.record()?;
    let mut journey = Journey::default();
    let mut kidnap = Kidnap::new(way.kidnap_m);
    let mut frames_that_show = 0;
    while let Some(seen) = body.sense() {
        let captured_ns = (seen.step.time_s * 1e9) as i64;
        let before = server.corrections();
        let odom_from_robot = kidnap.odometry(seen.step.time_s, seen.step.odom_from_robot);
        if way.laser {
            server.scan(&seen.scan, odom_from_robot, captured_ns);
        }
        let map = server.map()?;
        let mounting = wrong.extrinsics(&seen.step.robot_from_camera).ok();
        let camera = frame_camera(Some(&wrong.camera), mounting.as_ref(), &map);
        let analysis = analyse_frame(&seen.frame.image, camera, &map, &mut StageTimes::start());
        let (image, camera, mounting) = (&seen.frame.image, &wrong.camera, mounting.as_ref());
        let frame = SentFrame { image, camera, mounting, odom_from_robot, captured_ns };
        let (changes, guided) = server.frame(&map, &analysis, &frame);
        let misled = journey.guided_false;
        let shows = journey.score(world, &seen, &analysis, guided.as_ref());
        frames_that_show += usize::from(shows);
        if !changes.is_empty() {
            let of = |health| changes.iter().filter(|c| c.health == health).count();
            journey.flagged += of(LandmarkHealth::Flagged);
            journey.quarantined += of(LandmarkHealth::Quarantined);
            server.change(&map, &changes);
        }
        let fused = server.pose();
        if fused.is_some() && journey.frames_to_fix.is_none() {
            journey.frames_to_fix = Some(frames_that_show);
        }
        let misled = journey.guided_false - misled;
        let truth = seen.step.map_from_robot;
        kidnap.count_frame(seen.step.time_s, (shows, misled), (fused.as_ref(), &truth));
        journey.moments.push(Moment {
            time_s: seen.step.time_s,
            truth,
            odometry: odom_from_robot,
            fused,
            corrected: server.corrections() > before,
            off_path_m: body.off_path_m(&truth),
        });
        body.steer(&server, &odom_from_robot, &named(&analysis, guided.as_ref()))?;
    }
    journey.arrived = body.has_arrived();
    journey.kidnapped = kidnap.outcome;
    journey.log = server.log();
    journey.recording = server.recording();
    Ok(journey)
}

/// The landmarks that a frame's answer names, right or wrong.
fn named(analysis: &FrameAnalysis, guided: Option<&GuidedResult>) -> Vec<LandmarkId> {
    let by_picture = analysis.quads.iter().filter_map(|quad| match quad.recognition.as_ref()?.verdict {
        Verdict::Unique(id) => Some(id),
        _ => None,
    });
    by_picture.chain(guided.iter().flat_map(|g| &g.observations).map(|o| o.landmark)).collect()
}

impl Journey {
    /// Counts what the frame shows and the names in it; true if it shows an active landmark.
    fn score(
        &mut self,
        world: &World,
        seen: &SensorReadings,
        analysis: &FrameAnalysis,
        guided: Option<&GuidedResult>,
    ) -> bool {
        let truth = &seen.frame.truth;
        let is_there = |id: LandmarkId, found: &Corners| is_there(world, id, seen, found);
        let border = |id| exact_border(world, id, truth);
        let mut global = Vec::new();
        for quad in &analysis.quads {
            let Some(Verdict::Unique(id)) = quad.recognition.as_ref().map(|v| v.verdict) else {
                continue;
            };
            // The border that matched; the quad itself may be one around it.
            let found = quad.recognition.as_ref().and_then(|v| v.aligned_px).unwrap_or(quad.quad.corners_px);
            if is_there(id, &found) {
                global.push(world.name(id));
                let corners =
                    quad.recognition.as_ref().and_then(|v| matched_border(&quad.quad, v, &world.map.params));
                if let (Some(corners), Some(view)) = (corners, border(id)) {
                    let how = match corners.found_by {
                        FoundBy::Edges => "by the picture, detected",
                        FoundBy::Alignment => "by the picture, aligned",
                        FoundBy::Points => "by the picture, by points",
                    };
                    let corners = (corners.corners_px, corners.covariance_px2);
                    self.corners.entry(how).or_default().extend(off(&corners, view));
                }
            } else {
                let overlap = overlap(world, id, seen, &found);
                let verdict = &quad.recognition;
                tracing::info!(landmark = world.name(id), overlap, ?found, ?verdict, "a wrong name");
                self.false_matches += 1;
            }
        }
        let mut with_pose = global.clone();
        for observation in guided.iter().flat_map(|guided| &guided.observations) {
            if is_there(observation.landmark, &observation.corners_px) {
                with_pose.push(world.name(observation.landmark));
                if let Some(view) = border(observation.landmark) {
                    let group = match (observation.quad, view.state) {
                        (Some(_), _) => "detected, named by the pose",
                        (None, ViewState::Truncated) => "expected, cut",
                        (None, _) => "expected, not cut",
                    };
                    let corners = (observation.corners_px, observation.covariance_px2);
                    self.corners.entry(group).or_default().extend(off(&corners, view));
                }
            } else {
                self.guided_false += 1;
            }
        }
        let is_large =
            |v: &&LandmarkView| v.min_side_px() >= MIN_SIDE_PX && v.view_angle_rad <= MAX_VIEW_ANGLE_RAD;
        let taught = |v: &&LandmarkView| {
            v.visible_px2 >= MIN_SHARE * v.corners_px.area_px2()
                && world.map.landmarks.values().any(|info| info.name == v.name)
        };
        for view in truth.landmarks.iter().filter(taught).filter(is_large) {
            let named = self.named.entry((kind(view.kind), state(view.state))).or_default();
            named.shown += 1;
            named.global += usize::from(global.contains(&view.name.as_str()));
            if guided.is_some() {
                named.shown_to_pose += 1;
                named.guided += usize::from(with_pose.contains(&view.name.as_str()));
            }
        }
        let in_use = |v: &&LandmarkView| world.map.models.iter().any(|m| world.name(m.id) == v.name);
        let full = |v: &&LandmarkView| v.state == ViewState::Full;
        let shown: Vec<_> = truth.landmarks.iter().filter(is_large).filter(full).filter(in_use).collect();
        self.shown += shown.len();
        self.recognised += shown.iter().filter(|v| global.contains(&v.name.as_str())).count();
        !shown.is_empty()
    }
}

/// Whether a frame shows a landmark there.
fn is_there(world: &World, id: LandmarkId, seen: &SensorReadings, found: &Corners) -> bool {
    let least = if world.course.first_map.is_survey() { IOU_SURVEYED } else { IOU_TRUE };
    overlap(world, id, seen, found) >= least
}

/// Overlap of a border with a landmark's in a frame; 0 where it is not in the frame.
fn overlap(world: &World, id: LandmarkId, seen: &SensorReadings, found: &Corners) -> f64 {
    let there = if world.course.first_map.is_survey() {
        surveyed_at(world, id, seen)
    } else {
        seen.frame.truth.landmark(world.name(id)).map(|view| *view.corners_px.points())
    };
    there.map_or(0.0, |there| polygon::iou(found.points(), &there))
}

/// The landmark in a frame, where the border that was learnt is the one that the building names: a
/// survey takes what it finds, a panel of a door or the picture in a frame.
fn exact_border<'a>(world: &World, id: LandmarkId, truth: &'a FrameTruth) -> Option<&'a LandmarkView> {
    truth.landmark(world.name(id)).filter(|_| !world.course.first_map.is_survey())
}

/// Where the true pose sees a surveyed landmark, whose border the building does not name.
fn surveyed_at(world: &World, id: LandmarkId, seen: &SensorReadings) -> Option<[Point2<f64>; 4]> {
    let place = world.map.landmarks.get(&id)?.place?;
    let map_from_camera = seen.step.map_from_robot.to_isometry3() * seen.step.robot_from_camera;
    let camera_from_landmark = map_from_camera.inverse() * place.map_from_landmark();
    let (w, h) = (0.5 * place.size.width_m, 0.5 * place.size.height_m);
    let corner = |[y, z]: [f64; 2]| pixel(&camera_from_landmark, &Vector3::new(0.0, y, z), &world.camera);
    let [a, b, c, d] = [[-w, h], [w, h], [w, -h], [-w, -h]].map(corner);
    Some([a?, b?, c?, d?])
}

/// For each corner: error (px) and squared Mahalanobis distance.
fn off((corners_px, covariance_px2): &(Corners, [Matrix2<f64>; 4]), truth: &LandmarkView) -> Vec<(f64, f64)> {
    let pairs = corners_px.points().iter().zip(truth.corners_px.points()).zip(covariance_px2);
    pairs
        .map(|((found, there), covariance)| {
            let d = found - there;
            let distance2 = covariance.cholesky().map_or(f64::INFINITY, |c| d.dot(&c.solve(&d)));
            (d.norm(), distance2)
        })
        .collect()
}

fn kind(kind: LandmarkKind) -> &'static str {
    match kind {
        LandmarkKind::Poster => "posters",
        LandmarkKind::Door => "doors",
        LandmarkKind::Window => "windows",
        _ => "others",
    }
}

fn state(state: ViewState) -> &'static str {
    match state {
        ViewState::Full => "in full view",
        ViewState::Truncated => "cut by the image border",
        ViewState::Occluded => "partly hidden",
    }
}
