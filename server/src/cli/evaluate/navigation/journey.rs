//! One drive: frames are looked at as a server would (`engine/verdicts.rs`), fixes and odometry fused (`map::fuse`), and
//! all of it compared with the truth. The robot is told nothing of where it starts.

use super::world::World;
use crate::engine::verdicts::{self, AMBIGUOUS, StageTimes};
use map::{
    fuse::{FixOutcome, FuseParams, Fuser},
    localise::Fix,
    mounting::Mounting,
    pose2::{Pose2, Pose2Covariance},
};
use sim::{
    drive::DriveParams,
    robot::{Robot, RobotParams, Sighting},
    truth::{LandmarkView, ViewState},
};
use vision::{geometry::polygon, pipeline::FrameFacts, recognise::Recognition};

/// A recognition is true when its quad overlaps the landmark's true outline by this much.
const IOU_TRUE: f64 = 0.5;
/// A frame shows a landmark when all of it is seen, no side shorter than this...
const MIN_SIDE_PX: f64 = 40.0;
/// ... and no more obliquely: the paper's limit of recognition.
const MAX_VIEW_ANGLE_RAD: f64 = 1.309;
/// Farther than any corridor: the simulator starts the robot at its end.
const FAR_END_M: f64 = 1e3;

/// Where a robot was, and where it was thought to be.
pub(super) struct Moment {
    pub(super) time_s: f64,
    pub(super) truth: Pose2,
    /// Odometry alone, told the true start.
    pub(super) odometry: Pose2,
    /// None before the first fix.
    pub(super) fused: Option<Pose2Covariance>,
    /// A fix was taken here.
    pub(super) corrected: bool,
}

/// A drive.
#[derive(Default)]
pub(super) struct Journey {
    pub(super) moments: Vec<Moment>,
    /// Times that a taught landmark was shown, and how often it was rightly named.
    pub(super) shown: usize,
    pub(super) recognised: usize,
    /// Names given to something else.
    pub(super) false_matches: usize,
    /// Frames that showed a landmark up to the first fix, itself included; none if there never was one.
    pub(super) frames_to_fix: Option<usize>,
    /// Fixes that the filter did not believe.
    pub(super) gated: usize,
}

/// Drives the length of the corridor once; `back` from its far end.
pub(super) fn drive(world: &World, seed: u64, back: bool, rate_hz: f64) -> Journey {
    let start_m = if back { FAR_END_M } else { 0.0 };
    let drive = DriveParams { seed, start_m, reverse: back, rate_hz, ..DriveParams::default() };
    let robot = Robot::new(world.building.clone(), &RobotParams { drive, ..RobotParams::default() });
    let camera = *robot.camera().intrinsics();
    let mut fuser = Fuser::new(FuseParams::default());
    let mut journey = Journey::default();
    let mut frames_that_show = 0;
    for seen in robot {
        let step = &seen.step;
        let at_ns = (step.time_s * 1e9) as i64;
        // The simulator's odometry is within range: what is refused could only be forgotten.
        fuser.odometry(at_ns, step.odom_from_robot).ok();
        let facts = verdicts::look(&seen.frame.image, Some(&camera), &world.map, &mut StageTimes::start());
        frames_that_show += usize::from(journey.score(world, &seen, &facts));
        let mounting = Mounting::new(step.robot_from_camera).ok();
        let outcome = fix(world, &facts, mounting.as_ref(), fuser.pose_at(at_ns).as_ref())
            .and_then(|fix| fuser.fix(at_ns, &fix).ok());
        let corrected =
            matches!(outcome, Some(FixOutcome::Started | FixOutcome::Applied { .. } | FixOutcome::Reset));
        journey.gated += usize::from(matches!(outcome, Some(FixOutcome::GatedOut { .. })));
        let fused = fuser.pose().map(|f| f.pose);
        if fused.is_some() && journey.frames_to_fix.is_none() {
            journey.frames_to_fix = Some(frames_that_show);
        }
        journey.moments.push(Moment {
            time_s: step.time_s,
            truth: step.map_from_robot,
            odometry: step.odom_from_robot,
            fused,
            corrected,
        });
    }
    journey
}

/// As the server: our own prior only chooses between two solutions.
fn fix(
    world: &World,
    facts: &FrameFacts,
    mounting: Option<&Mounting>,
    prior: Option<&Pose2Covariance>,
) -> Option<Fix> {
    let sightings = verdicts::sightings(facts, &world.map).ok()?;
    let alone = verdicts::robot_fix(&sightings, mounting, None);
    if alone.as_ref().err() == Some(&AMBIGUOUS) && prior.is_some() {
        return verdicts::robot_fix(&sightings, mounting, prior).ok();
    }
    alone.ok()
}

impl Journey {
    /// Counts what the frame shows and what was named in it; whether it shows a landmark at all.
    fn score(&mut self, world: &World, seen: &Sighting, facts: &FrameFacts) -> bool {
        let truth = &seen.frame.truth;
        let shows = |view: &&LandmarkView| {
            view.state == ViewState::Full
                && view.min_side_px() >= MIN_SIDE_PX
                && view.view_angle_rad <= MAX_VIEW_ANGLE_RAD
                && world.map.models.iter().any(|m| world.name(m.id) == view.name)
        };
        let mut named = Vec::new();
        for quad in &facts.quads {
            let Some(Recognition::Unique(id)) = quad.verdict.as_ref().map(|v| v.recognition) else {
                continue;
            };
            let view = truth.landmark(world.name(id));
            // Where the picture was found to lie: the quad itself may be a border around it.
            let found = quad.verdict.as_ref().and_then(|v| v.aligned_px).unwrap_or(quad.quad.corners_px);
            let overlaps = |v: &LandmarkView| polygon::iou(found.points(), v.corners_px.points()) >= IOU_TRUE;
            if view.is_some_and(overlaps) {
                named.push(world.name(id));
            } else {
                self.false_matches += 1;
            }
        }
        let shown: Vec<&LandmarkView> = truth.landmarks.iter().filter(shows).collect();
        self.shown += shown.len();
        self.recognised += shown.iter().filter(|v| named.contains(&v.name.as_str())).count();
        !shown.is_empty()
    }
}
