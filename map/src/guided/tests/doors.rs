//! Twelve identical doors in a row, from image to fused pose: doors correct a right pose and do not
//! support a wrong one.

mod fix_role;

use super::*;
use crate::{
    fuse::{FixOutcome, FixRole, FuseParams, Fuser},
    localise::{Fix, FixResult, LandmarkObservation, LocaliseParams, robot_pose},
};
use vision::pose::landmark_pose;

const SECOND: i64 = 1_000_000_000;
/// Distance between two frames.
const STEP_M: f64 = 0.2;

/// Doors 1 to 12 and the poster behind them; two more posters before the first door.
fn house(spacing_m: f64) -> BTreeMap<LandmarkId, LandmarkPlace> {
    let mut places = corridor(spacing_m);
    places.insert(LandmarkId(101), on_wall(-1.5, 1.5, 0.6, 0.84));
    places.insert(LandmarkId(102), on_wall(0.0, 1.5, 0.6, 0.84));
    places
}

fn is_door(landmark: LandmarkId) -> bool {
    landmark.0 <= DOORS
}

/// Result of one frame.
struct Frame {
    trust: Trust,
    decision: Decision,
    /// A poster was in full view.
    shows_poster: bool,
    /// Right and wrong unique guided observations.
    right: usize,
    wrong: usize,
    nodes: usize,
}

struct Drive {
    map: BTreeMap<LandmarkId, LandmarkPlace>,
    real: BTreeMap<LandmarkId, LandmarkPlace>,
    real_mounting: CameraExtrinsics,
    truth: Pose2,
    odometry: Pose2,
    /// Measured over true distance.
    measured: f64,
    now_ns: i64,
    fuser: Fuser,
    schedule: Schedule,
    random: Random,
}

impl Drive {
    /// A robot at `x_m` with a pose that is `off_m` too far, with 5 cm and 1 degree.
    fn new(spacing_m: f64, x_m: f64, off_m: f64, seed: u64) -> Self {
        let (map, mut random) = (house(spacing_m), Random::new(seed));
        let real = map.iter().map(|(id, place)| (*id, drawn_place(place, &mut random))).collect();
        let truth = Pose2::new(x_m, 0.0, 0.0);
        let mut fuser = Fuser::new(FuseParams::default());
        fuser.apply_odometry(0, Pose2::default()).unwrap();
        fuser.start(&prior(Pose2::new(x_m + off_m, 0.0, 0.0), 0.05, 1.0)).unwrap();
        Self {
            real_mounting: drawn_mounting(&mounting(), &mut random),
            schedule: Schedule::new(ScheduleParams::default(), FuseParams::default()),
            odometry: Pose2::default(),
            measured: 1.0,
            now_ns: 0,
            map,
            real,
            truth,
            fuser,
            random,
        }
    }

    fn error_m(&self) -> f64 {
        (self.fuser.pose().unwrap().pose.pose.position() - self.truth.position()).norm()
    }

    fn fix(&self, shown: &[(LandmarkId, Corners)], prior: Option<&Pose2Covariance>) -> Option<FixResult> {
        let claimed = [Matrix2::identity() * CORNER_PX.powi(2); 4];
        let of = |(id, c): &(LandmarkId, Corners)| {
            landmark_pose(c, &claimed, self.map[id].size, &camera()).map(|pose| (*id, pose)).ok()
        };
        let poses: Vec<_> = shown.iter().filter_map(of).collect();
        let observations: Vec<_> = poses
            .iter()
            .map(|(id, seen)| LandmarkObservation { landmark: *id, seen, place: &self.map[id] })
            .collect();
        let all = (!observations.is_empty()).then_some(observations)?;
        Some(robot_pose(&all, &mounting(), prior, &LocaliseParams::default()).unwrap())
    }

    /// Processes the next frame, as in the engine.
    fn frame(&mut self) -> Frame {
        let motion = Pose2::new(STEP_M * self.measured, 0.0, 0.0);
        self.truth = self.truth.compose(&Pose2::new(STEP_M, 0.0, 0.0));
        self.odometry = self.odometry.compose(&motion);
        self.now_ns += SECOND / 2;
        self.fuser.apply_odometry(self.now_ns, self.odometry).unwrap();
        let before = self.fuser.pose_at(self.now_ns);
        let plan = self.schedule.plan(0, before.as_ref());
        let shown = full_views(&self.truth, &self.real, &self.real_mounting, &mut self.random);
        let mut made = Frame {
            trust: Trust::NoPose,
            decision: Decision::Keep,
            shows_poster: false,
            right: 0,
            wrong: 0,
            nodes: 0,
        };
        made.shows_poster = shown.iter().any(|(id, _)| !is_door(*id));
        let (mut guided, mut sure, mut report) = (Vec::new(), Vec::new(), GuidedReport::default());
        if let Some(before) = &before {
            let e = expectations(before, &self.map);
            sure = e
                .landmarks
                .iter()
                .filter(|l| l.is_sure && !is_door(l.landmark))
                .map(|l| l.landmark)
                .collect();
            if plan.guided {
                let observations: Vec<_> = shown.iter().map(|(id, c)| any_of(*id, *c)).collect();
                let assigned =
                    super::super::associate(&e, &observations, &AssociateParams::default()).unwrap();
                for (i, landmark) in assigned.unique() {
                    let right = landmark == shown[i].0;
                    (made.right, made.wrong) =
                        (made.right + usize::from(right), made.wrong + usize::from(!right));
                    guided.push((landmark, shown[i].1));
                }
                sure.retain(|id| guided.iter().all(|(found, _)| found != id));
                made.nodes = assigned.nodes;
                report = GuidedReport { contradictions: assigned.contradictions(), missed: !sure.is_empty() };
            }
        }
        let searched = plan.global.or_else(|| report.global_reason()).is_some();
        let posters: Vec<_> = shown.iter().copied().filter(|(id, _)| searched && !is_door(*id)).collect();
        sure.retain(|id| posters.iter().all(|(found, _)| found != id));
        let global = self.fix(&posters, None);
        made.decision = self.schedule.finish(&FrameReport {
            camera: 0,
            motion,
            prior: before.as_ref(),
            searched,
            global: global.as_ref(),
            missed: &sure,
        });
        made.trust = self.schedule.trust();
        self.apply(&made.decision, global.as_ref(), &guided, before.as_ref());
        made
    }

    fn apply(
        &mut self,
        decision: &Decision,
        global: Option<&FixResult>,
        guided: &[(LandmarkId, Corners)],
        before: Option<&Pose2Covariance>,
    ) {
        let fixed = |fix: Option<&FixResult>| match fix {
            Some(FixResult::Fixed(fix)) => Some((**fix).clone()),
            Some(FixResult::Ambiguous(_) | FixResult::Refused(_)) | None => None,
        };
        let mut give =
            |fix: Option<Fix>, role| fix.map(|fix| self.fuser.apply_fix_as(self.now_ns, &fix, role).unwrap());
        match decision {
            Decision::Keep => {}
            Decision::Use | Decision::Doubt { .. } => drop(give(fixed(global), FixRole::Independent)),
            Decision::Replace(fix) => {
                assert_eq!(give(Some((**fix).clone()), FixRole::Replacing), Some(FixOutcome::Reset));
            }
        }
        if self.schedule.guided_corrects() {
            let fix = fixed(self.fix(guided, before).as_ref());
            if let Some(fix) = fix {
                self.fuser.apply_fix_as(self.now_ns, &fix, FixRole::Guided).unwrap();
            }
        }
    }
}

/// A door has all doors as candidates, a poster only itself.
fn any_of(landmark: LandmarkId, corners: Corners) -> Observation {
    let mut made = observation(landmark, corners);
    if !is_door(landmark) {
        made.candidates = vec![Candidate { landmark, picture_nats: 30.0, prior_nats: 0.0 }];
    }
    made
}

#[test]
fn with_a_known_pose_identical_doors_are_named_rightly() {
    let mut random = Random::new(21);
    for (spacing_m, sigma_m, sigma_deg) in
        [(2.0, 0.05, 1.0), (2.0, 0.15, 1.5), (1.2, 0.05, 1.0), (1.2, 0.1, 2.0)]
    {
        let places = corridor(spacing_m);
        let (mut all, mut right, mut wrong, mut nodes) = (0, 0, 0, 0);
        let (mut distance2, mut dof) = (0.0, 0);
        for _ in 0..250 {
            let believed = Pose2::new(
                random.range(0.0, 13.0 * spacing_m),
                random.range(-0.5, 0.5),
                random.range(-0.3, 0.3),
            );
            let at = prior(believed, sigma_m, sigma_deg);
            let truth = believed.plus(&draw3(&at.covariance, &mut random));
            let real = places.iter().map(|(id, place)| (*id, drawn_place(place, &mut random))).collect();
            let seat = drawn_mounting(&mounting(), &mut random);
            let shown: Vec<_> =
                full_views(&truth, &real, &seat, &mut random).into_iter().filter(|s| is_door(s.0)).collect();
            let observations: Vec<_> = shown.iter().map(|(id, c)| observation(*id, *c)).collect();
            let e = expectations(&at, &places);
            let made = super::super::associate(&e, &observations, &AssociateParams::default()).unwrap();
            all += shown.len();
            right += made.unique().filter(|(i, id)| *id == shown[*i].0).count();
            wrong += made.unique().filter(|(i, id)| *id != shown[*i].0).count();
            nodes = nodes.max(made.nodes);
            // The joint distance of right assignments is chi2 if corners have their stated errors
            // only.
            let exact = AssociateParams { model_sigma_px: 0.0, ..AssociateParams::default() };
            let made = super::super::associate(&e, &observations, &exact).unwrap();
            if made.unique().count() == shown.len() {
                (distance2, dof) = (distance2 + made.distance2, dof + made.dof);
            }
        }
        let reduced = distance2 / dof as f64;
        println!(
            "doors every {spacing_m} m, pose to {sigma_m} m and {sigma_deg} deg: {right} of {all} right, {wrong} wrong, at most {nodes} nodes, {reduced:.2} chi2 a degree of freedom"
        );
        assert!((0.9..1.1).contains(&reduced), "{reduced}");
        assert!(all > 300 && wrong == 0, "{wrong} of {all}");
        assert!(right as f64 >= 0.95 * all as f64, "{right} of {all}");
        assert!(nodes <= 256, "{nodes}");
    }
}

#[test]
fn a_robot_with_a_right_pose_uses_every_door() {
    let mut drive = Drive::new(2.0, -6.0, 0.0, 31);
    // A scale error of 3 %: 0.7 m along the doors.
    drive.measured = 0.97;
    let (mut right, mut worst_m, mut frames) = (0, 0.0_f64, 0);
    while drive.truth.x_m < 24.0 {
        let frame = drive.frame();
        assert_eq!(frame.wrong, 0);
        assert!(
            !matches!(frame.decision, Decision::Doubt { .. } | Decision::Replace(_)),
            "{:?}",
            frame.decision
        );
        (right, frames) = (right + frame.right, frames + 1);
        worst_m = worst_m.max(drive.error_m());
    }
    println!("{frames} frames, {right} guided observations, error at most {worst_m:.3} m");
    assert!(right > frames && worst_m < 0.15, "{right} {worst_m}");
}

/// Drives with a pose that is wrong by `off_m` from between the doors until the poster has been in
/// view for a while. Frames with the poster until the pose is contradicted, and until it is right
/// again.
fn frames_to_recover(spacing_m: f64, off_m: f64, seed: u64) -> (usize, usize) {
    let mut drive = Drive::new(spacing_m, 2.5 * spacing_m, off_m, seed);
    let (mut shown, mut doubted, mut replaced, mut misled) = (0, None, None, 0);
    while drive.truth.x_m < 13.0 * spacing_m {
        let frame = drive.frame();
        shown += usize::from(frame.shows_poster);
        if replaced.is_none() {
            misled += frame.wrong;
            if matches!(frame.decision, Decision::Doubt { .. } | Decision::Replace(_)) {
                doubted = doubted.or(Some(shown));
            }
            if matches!(frame.decision, Decision::Replace(_)) {
                replaced = Some(shown);
            } else {
                assert_ne!(frame.trust, Trust::Supported, "doors support nothing");
                assert!(drive.error_m() > 0.5, "only the poster can correct it");
                let covariance = drive.fuser.pose().unwrap().pose.covariance;
                assert!(
                    covariance[(0, 0)] >= 0.0025,
                    "doors must not make a wrong pose more certain: {covariance}"
                );
            }
        } else {
            assert_eq!(frame.wrong, 0);
        }
    }
    let error_m = drive.error_m();
    println!(
        "doors every {spacing_m} m, wrong by {off_m} m: {misled} wrong doors; contradicted after {doubted:?}, replaced after {replaced:?} frames with the poster; {error_m:.3} m at the end"
    );
    assert!(error_m < 0.15, "{error_m}");
    (doubted.unwrap(), replaced.unwrap())
}

#[test]
fn a_prior_wrong_by_two_metres_is_never_supported_and_is_replaced() {
    for (seed, spacing_m) in [(41, 2.0), (42, 1.5), (43, 1.3)] {
        for off_m in [2.0, -2.0] {
            let (doubted, replaced) = frames_to_recover(spacing_m, off_m, seed);
            assert!(doubted <= 3 && replaced <= 3, "{spacing_m} {off_m}: {doubted} {replaced}");
        }
    }
}

#[test]
fn a_kidnapped_robot_is_contradicted_within_three_frames_with_a_poster() {
    for by_m in [2.0, -2.0, 4.0] {
        let mut drive = Drive::new(2.0, -6.0, 0.0, 51);
        // Two posters establish the pose, the doors correct it.
        while drive.truth.x_m < 14.0 {
            drive.frame();
        }
        assert!(drive.error_m() < 0.15);
        // Carried along the corridor by whole spacings: odometry and doors fit as before.
        drive.truth = drive.truth.compose(&Pose2::new(by_m, 0.0, 0.0));
        let (mut shown, mut doubted, mut replaced) = (0, None, None);
        while drive.truth.x_m < 26.0 && replaced.is_none() {
            let frame = drive.frame();
            shown += usize::from(frame.shows_poster);
            assert!(shown > 0 || frame.trust != Trust::Contradicted);
            if matches!(frame.decision, Decision::Doubt { .. } | Decision::Replace(_)) {
                doubted = doubted.or(Some(shown));
            }
            if matches!(frame.decision, Decision::Replace(_)) {
                replaced = Some(shown);
            }
        }
        println!("carried by {by_m} m: contradicted after {doubted:?}, replaced after {replaced:?} frames");
        assert!(doubted.is_some_and(|n| n <= 3), "{by_m}: {doubted:?}");
        assert!(replaced.is_some_and(|n| n <= 5), "{by_m}: {replaced:?}");
        for _ in 0..3 {
            drive.frame();
        }
        assert!(drive.error_m() < 0.15, "{}", drive.error_m());
    }
}

#[test]
fn a_contradicted_pose_is_no_longer_corrected_by_doors() {
    let mut drive = Drive::new(2.0, -6.0, 0.0, 52);
    while drive.truth.x_m < 2.0 {
        drive.frame();
    }
    // Carried by ten spacings, in front of the last poster: no other unique landmark is in view or
    // expected.
    drive.truth = drive.truth.compose(&Pose2::new(20.0, 0.0, 0.0));
    let (mut shown, mut doubted) = (0, None);
    for _ in 0..14 {
        let frame = drive.frame();
        shown += usize::from(frame.shows_poster);
        assert!(!matches!(frame.decision, Decision::Replace(_)), "one witness");
        if doubted.is_some() {
            let guided = frame.right + frame.wrong;
            assert_eq!((frame.trust, guided), (Trust::Contradicted, 0), "no guided recognition any more");
        }
        if matches!(frame.decision, Decision::Doubt { .. }) {
            doubted = doubted.or(Some(shown));
            assert!(!drive.schedule.guided_corrects());
        }
    }
    assert!(doubted.is_some_and(|n| n <= 3), "{doubted:?}");
}
