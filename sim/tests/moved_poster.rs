//! A poster was moved by a metre and the map does not know: it is found out, no other is blamed, and the pose stays
//! good. Corners come from the exact truth with noise, motion from drifting odometry; the way of a frame is the
//! server's.

use std::{collections::BTreeMap, sync::Arc};

use map::{
    extrinsics::CameraExtrinsics,
    fuse::{FixOutcome, FuseParams, Fuser},
    landmark_health::{
        HealthChange, HealthMonitor, HealthParams, LandmarkHealth, PlaceCheck, check_place, drop_unreliable,
    },
    localise::{FixResult, LandmarkObservation, LocaliseParams, robot_pose},
    place::{LandmarkPlace, PlaceSigmas},
};
use nalgebra::{Matrix2, Point2, Point3, Vector2, Vector3};
use sim::{
    building::Building,
    camera::Camera,
    corridor::CorridorParams,
    drive::{Drive, DriveParams, Step},
};
use vision::{
    geometry::Corners,
    model::LandmarkId,
    pose::{
        LandmarkPose, LandmarkSize, landmark_pose,
        reprojection::{corner_points, pixel},
    },
    random::Random,
};

const CORNER_SIGMA_PX: f64 = 0.5;

/// What a run came to.
#[derive(Debug)]
struct Run {
    /// Fixes that hold the poster, from when two others had corrected the pose, until it was flagged.
    sightings_until_flagged: Option<u32>,
    quarantined: bool,
    blamed_others: usize,
    worst_error_m: f64,
    /// What the error stays under for 95 % of the way, and its worst once two landmarks have corrected the pose.
    usual_error_m: f64,
    settled_error_m: f64,
    with_two_others: bool,
}

struct Robot {
    fuser: Fuser,
    watch: HealthMonitor,
    supporters: Vec<LandmarkId>,
    healths: BTreeMap<LandmarkId, LandmarkHealth>,
    random: Random,
}

impl Robot {
    fn new(seed: u64) -> Self {
        Self {
            fuser: Fuser::new(FuseParams::default()),
            watch: HealthMonitor::new(HealthParams::default()),
            supporters: Vec::new(),
            healths: BTreeMap::new(),
            random: Random::new(seed),
        }
    }

    /// The corners of a landmark of the building in the picture, with noise; none when it is not seen well.
    fn look(
        &mut self,
        step: &Step,
        building: &Building,
        truth: &sim::building::LandmarkTruth,
    ) -> Option<LandmarkPose> {
        let size = LandmarkSize { width_m: truth.width_m, height_m: truth.height_m };
        let map_from_camera = step.map_from_camera();
        let eye = Point2::from(map_from_camera.translation.vector.xy());
        let seen = truth.map_from_landmark.inverse()
            * Point3::new(eye.x, eye.y, truth.map_from_landmark.translation.z);
        let face = truth.map_from_landmark * Point3::new(0.03, 0.0, 0.0);
        if seen.x < 0.3
            || seen.y.abs() > 3.0 * seen.x
            || seen.coords.norm() > 5.0
            || !building.in_sight(&eye, &face.xy())
        {
            return None;
        }
        let camera = *Camera::vga().intrinsics();
        let camera_from_landmark = map_from_camera.inverse() * truth.map_from_landmark;
        let mut points = [Point2::origin(); 4];
        for (px, corner) in points.iter_mut().zip(corner_points(&size)) {
            let at = pixel(&camera_from_landmark, &corner, &camera)?;
            if at.x < 2.0 || at.y < 2.0 || at.x > 637.0 || at.y > 477.0 {
                return None;
            }
            *px = at + Vector2::new(self.random.normal(), self.random.normal()) * CORNER_SIGMA_PX;
        }
        let claimed = [Matrix2::identity() * CORNER_SIGMA_PX.powi(2); 4];
        landmark_pose(&Corners::new(points).ok()?, &claimed, size, &camera).ok()
    }

    /// The way of one frame.
    fn frame(&mut self, at_ns: i64, step: &Step, sightings: &[LandmarkObservation<'_>]) -> Vec<HealthChange> {
        let mounting = CameraExtrinsics::new(step.robot_from_camera).expect("in range");
        self.fuser.apply_odometry(at_ns, step.odom_from_robot).expect("in range");
        let used: Vec<_> = sightings
            .iter()
            .filter(|s| self.healths.get(&s.landmark) != Some(&LandmarkHealth::Quarantined))
            .copied()
            .collect();
        let Some(prior) = self.fuser.pose_at(at_ns) else {
            self.fuse(at_ns, &used, &mounting, None);
            return Vec::new();
        };
        let p = HealthParams::default();
        let judged: Vec<PlaceCheck> = used
            .iter()
            .map(|s| check_place(s, &mounting, &prior, &self.supporters, &p).expect("in range"))
            .collect();
        let kept = drop_unreliable(&used, &judged);
        let reset = self.fuse(at_ns, &kept, &mounting, Some(&prior));
        if reset {
            return self.watch.clear();
        }
        let healths = &self.healths;
        let now = |id| healths.get(&id).copied().unwrap_or_default();
        self.watch.frame(Point2::from(prior.pose.position()), &judged, &[], now)
    }

    fn fuse(
        &mut self,
        at_ns: i64,
        sightings: &[LandmarkObservation<'_>],
        mounting: &CameraExtrinsics,
        prior: Option<&map::pose2::Pose2Covariance>,
    ) -> bool {
        if sightings.is_empty() {
            return false;
        }
        let p = LocaliseParams::default();
        let mut fix = robot_pose(sightings, mounting, None, &p).expect("in range");
        if let (FixResult::Ambiguous(_), Some(prior)) = (&fix, prior) {
            fix = robot_pose(sightings, mounting, Some(prior), &p).expect("in range");
        }
        let FixResult::Fixed(fix) = fix else { return false };
        let outcome = self.fuser.apply_fix(at_ns, &fix).expect("in range");
        if matches!(outcome, FixOutcome::Started | FixOutcome::Reset) {
            self.supporters.clear();
        }
        if matches!(outcome, FixOutcome::Started | FixOutcome::Reset | FixOutcome::Applied { .. }) {
            for id in &fix.landmarks {
                if !self.supporters.contains(id) {
                    self.supporters.push(*id);
                }
            }
        }
        outcome == FixOutcome::Reset
    }
}

/// Drives three times through a corridor with four posters, of which the map has one a metre off along its wall. With
/// `hidden` that one cannot be seen at all.
fn drive(seed: u64, length_m: f64, moved: usize, hidden: bool) -> Run {
    let params = CorridorParams { length_m, posters: 4, ..CorridorParams::default() };
    let building = Arc::new(Building::corridor_with(&params, seed));
    let truths: Vec<_> = building.posters().cloned().collect();
    let by = if seed.is_multiple_of(2) { 1.0 } else { -1.0 };
    let places: Vec<LandmarkPlace> = truths
        .iter()
        .enumerate()
        .map(|(i, truth)| {
            let along = truth.map_from_landmark * Vector3::y() * if i == moved { by } else { 0.0 };
            let centre = truth.map_from_landmark.translation.vector + along;
            let normal = truth.map_from_landmark * Vector3::x();
            let size = LandmarkSize { width_m: truth.width_m, height_m: truth.height_m };
            LandmarkPlace::by_hand(centre, normal.y.atan2(normal.x), size, PlaceSigmas::default())
                .expect("in range")
        })
        .collect();
    let params = DriveParams { seed, legs: 3, ..DriveParams::default() };
    let (mut robot, moved) = (Robot::new(seed), LandmarkId(moved as u64));
    let mut run = Run {
        sightings_until_flagged: None,
        quarantined: false,
        blamed_others: 0,
        worst_error_m: 0.0,
        usual_error_m: 0.0,
        settled_error_m: 0.0,
        with_two_others: false,
    };
    let (mut sightings_so_far, mut errors) = (0, Vec::new());
    for step in Drive::new(building.clone(), &params) {
        let at_ns = (step.time_s * 1e9) as i64;
        let seen: Vec<_> = truths
            .iter()
            .enumerate()
            .filter(|(i, _)| !hidden || LandmarkId(*i as u64) != moved)
            .filter_map(|(i, truth)| Some((i, robot.look(&step, &building, truth)?)))
            .collect();
        let sightings: Vec<_> = seen
            .iter()
            .map(|(i, seen)| LandmarkObservation {
                landmark: LandmarkId(*i as u64),
                seen,
                place: &places[*i],
            })
            .collect();
        let others = robot.supporters.iter().filter(|id| **id != moved).count();
        let holds = sightings.iter().any(|s| s.landmark == moved);
        sightings_so_far += u32::from(holds && others >= 2 && run.sightings_until_flagged.is_none());
        for change in robot.frame(at_ns, &step, &sightings) {
            robot.healths.insert(change.landmark, change.health);
            if change.landmark != moved {
                run.blamed_others += usize::from(change.health != LandmarkHealth::Sound);
            } else if change.health >= LandmarkHealth::Flagged && run.sightings_until_flagged.is_none() {
                run.sightings_until_flagged = Some(sightings_so_far);
                run.with_two_others = others >= 2;
            }
        }
        run.quarantined = robot.healths.get(&moved) == Some(&LandmarkHealth::Quarantined);
        if let Some(pose) = robot.fuser.pose() {
            let error = pose.pose.pose.position() - step.map_from_robot.position();
            errors.push(error.norm());
            run.worst_error_m = run.worst_error_m.max(error.norm());
            if robot.supporters.len() >= 2 {
                run.settled_error_m = run.settled_error_m.max(error.norm());
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    run.usual_error_m = errors[errors.len() * 95 / 100];
    run
}

#[test]
fn a_moved_poster_is_found_out_and_does_no_harm() {
    for seed in 0..6 {
        for moved in [1, 2] {
            let run = drive(seed, 12.0, moved, false);
            println!("{seed} {moved} {run:?}");
            // Before two others were seen it may be any of them: then it is flagged as soon as the third agrees.
            assert!(run.sightings_until_flagged.expect("flagged") <= 5, "{seed} {moved}: {run:?}");
            assert!(run.quarantined, "{seed} {moved}: {run:?}");
            assert_eq!(run.blamed_others, 0, "{seed} {moved}: {run:?}");
            assert!(run.usual_error_m < 0.10, "{seed} {moved}: {run:?}");
            assert!(run.worst_error_m < 0.20, "{seed} {moved}: {run:?}");
        }
    }
}

#[test]
fn it_costs_no_more_than_a_poster_that_is_not_there() {
    // Over 25 m with four posters the next one is so far that odometry drifts, moved poster or none.
    for seed in 0..4 {
        let (moved, absent) = (drive(seed, 25.0, 1, false), drive(seed, 25.0, 1, true));
        println!("{seed} {moved:?}\n  {absent:?}");
        assert!(moved.quarantined && moved.blamed_others == 0, "{moved:?}");
        assert!(moved.worst_error_m < absent.worst_error_m + 0.05, "{moved:?} {absent:?}");
    }
}

#[test]
fn where_nothing_moved_nobody_is_blamed() {
    for seed in 0..4 {
        let run = drive(seed, 25.0, usize::MAX, false);
        println!("{seed} {run:?}");
        assert_eq!((run.blamed_others, run.sightings_until_flagged), (0, None), "{run:?}");
        assert!(run.worst_error_m < 0.30, "{run:?}");
    }
}
