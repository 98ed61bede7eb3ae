//! The schedule alone: searches, support, replacement.

use super::*;
use crate::{
    fuse::FuseParams,
    localise::{AmbiguityResolvedBy, Fix, FixResult, FixSource},
};

fn fix(landmark: u64, x_m: f64) -> Fix {
    Fix {
        modality: FixSource::Landmarks,
        pose: prior(Pose2::new(x_m, 0.0, 0.0), 0.03, 0.5),
        noise: Matrix3::identity() * 1e-4,
        nuisances: Vec::new(),
        landmarks: vec![LandmarkId(landmark)],
        decided_by: AmbiguityResolvedBy::Single,
        chi2: 5.0,
        dof: 5,
    }
}

fn fixed(landmark: u64, x_m: f64) -> FixResult {
    FixResult::Fixed(Box::new(fix(landmark, x_m)))
}

/// A robot that drives 0.1 m a frame, with an exact pose.
struct Drive {
    schedule: Schedule,
    x_m: f64,
}

impl Drive {
    fn new() -> Self {
        Self { schedule: Schedule::new(ScheduleParams::default(), FuseParams::default()), x_m: 0.0 }
    }

    /// A frame whose global search, if there is one, gives a fix at this offset from the pose.
    fn frame(&mut self, global: Option<(u64, f64)>, missed: &[u64]) -> (FramePlan, Decision) {
        self.x_m += 0.1;
        let at = prior(Pose2::new(self.x_m, 0.0, 0.0), 0.03, 0.5);
        let plan = self.schedule.plan(0, Some(&at));
        let made = global.filter(|_| plan.global.is_some()).map(|(id, off_m)| fixed(id, self.x_m + off_m));
        let missed: Vec<_> = missed.iter().map(|id| LandmarkId(*id)).collect();
        let decision = self.schedule.finish(&FrameReport {
            camera: 0,
            motion: Pose2::new(0.1, 0.0, 0.0),
            prior: Some(&at),
            searched: plan.global.is_some(),
            global: made.as_ref(),
            missed: &missed,
        });
        (plan, decision)
    }

    fn run(&mut self, frames: usize, global: Option<(u64, f64)>) -> Vec<(FramePlan, Decision)> {
        (0..frames).map(|_| self.frame(global, &[])).collect()
    }

    /// Frames with this offset until the pose is replaced; `None` if it never is.
    fn until_replaced(&mut self, landmark: u64, off_m: f64, missed: &[u64], most: usize) -> Option<usize> {
        (1..=most).find(|_| matches!(self.frame(Some((landmark, off_m)), missed).1, Decision::Replace(_)))
    }
}

#[test]
fn without_a_pose_every_frame_is_searched_and_only_a_global_fix_starts_one() {
    let mut schedule = Schedule::default();
    let none = FrameReport {
        camera: 0,
        motion: Pose2::default(),
        prior: None,
        searched: true,
        global: None,
        missed: &[],
    };
    for _ in 0..5 {
        assert_eq!(schedule.plan(0, None), FramePlan { guided: false, global: Some(GlobalReason::NoPose) });
        assert_eq!(schedule.finish(&none), Decision::Keep);
        assert_eq!(schedule.trust(), Trust::NoPose);
    }
    let two = FixResult::Ambiguous(vec![fix(1, 0.0), fix(1, 1.0)]);
    assert_eq!(schedule.finish(&FrameReport { global: Some(&two), ..none }), Decision::Keep);
    assert_eq!(schedule.trust(), Trust::NoPose);
    assert_eq!(schedule.finish(&FrameReport { global: Some(&fixed(1, 0.0)), ..none }), Decision::Use);
    assert_eq!(schedule.trust(), Trust::Supported);
}

#[test]
fn every_third_frame_is_searched_every_second_without_support_and_all_when_it_is_stale() {
    let mut drive = Drive::new();
    let searched = |frames: &[(FramePlan, Decision)]| {
        frames.iter().map(|(plan, _)| usize::from(plan.global.is_some())).sum::<usize>()
    };
    assert_eq!(searched(&drive.run(10, None)), 5);
    assert_eq!(drive.schedule.trust(), Trust::Unsupported);
    drive.run(2, Some((1, 0.0)));
    assert_eq!(drive.schedule.trust(), Trust::Supported);
    assert_eq!(searched(&drive.run(27, None)), 9);
    // Thirty frames after the last support.
    drive.run(3, None);
    assert_eq!(drive.schedule.trust(), Trust::Stale);
    let frames = drive.run(5, None);
    assert!(
        frames.iter().all(|(plan, _)| *plan == FramePlan { guided: true, global: Some(GlobalReason::Stale) })
    );
    drive.run(1, Some((1, 0.0)));
    assert_eq!(drive.schedule.trust(), Trust::Supported);
    // Few frames, many metres.
    let at = prior(Pose2::default(), 0.03, 0.5);
    let far = FrameReport {
        camera: 0,
        motion: Pose2::new(10.0, 0.0, 0.0),
        prior: Some(&at),
        searched: false,
        global: None,
        missed: &[],
    };
    drive.schedule.finish(&far);
    assert_eq!(drive.schedule.trust(), Trust::Stale);
}

#[test]
fn an_uncertain_pose_and_guided_misses_cause_a_search() {
    let schedule = Schedule::default();
    let reason =
        |sigma_m, sigma_deg| schedule.plan(0, Some(&prior(Pose2::default(), sigma_m, sigma_deg))).global;
    assert_eq!(reason(0.1, 1.0), None);
    assert_eq!(reason(0.6, 1.0), Some(GlobalReason::Uncertain));
    assert_eq!(reason(0.1, 10.0), Some(GlobalReason::Uncertain));
    let after = |contradictions, missed| GuidedReport { contradictions, missed }.global_reason();
    assert_eq!(after(0, false), None);
    assert_eq!(after(0, true), Some(GlobalReason::Missed));
    assert_eq!(after(2, true), Some(GlobalReason::GuidedContradiction));
}

#[test]
fn an_unsupported_pose_is_replaced_by_one_landmark_within_three_frames() {
    // Whatever the phase of the interval.
    for before in 0..4 {
        let mut drive = Drive::new();
        drive.run(before, None);
        let frames = drive.until_replaced(7, 2.0, &[], 10).unwrap();
        assert!(frames <= 3, "{before}: {frames}");
        assert_eq!(drive.schedule.trust(), Trust::Supported);
    }
}

#[test]
fn an_established_pose_is_contradicted_within_three_frames_and_replaced_by_two_witnesses() {
    let established = || {
        let mut drive = Drive::new();
        drive.run(3, Some((1, 0.0)));
        drive.run(3, Some((2, 0.0)));
        assert_eq!(drive.schedule.trust(), Trust::Supported);
        drive
    };
    // One landmark that was moved: the pose is contradicted, and stays until its support is stale.
    let mut drive = established();
    let found = (1..=10).find(|_| matches!(drive.frame(Some((7, 2.0)), &[]).1, Decision::Doubt { .. }));
    assert!(found.unwrap() <= 3, "{found:?}");
    assert_eq!(drive.schedule.trust(), Trust::Contradicted);
    let at = prior(Pose2::default(), 0.03, 0.5);
    assert!(!drive.schedule.plan(0, Some(&at)).guided, "no guided recognition with a contradicted pose");
    assert_eq!(drive.until_replaced(7, 2.0, &[], 15), None);
    assert!(drive.until_replaced(7, 2.0, &[], 30).is_some(), "stale support protects nothing");
    // Missing it at its place is no second witness.
    let mut drive = established();
    assert_eq!(drive.until_replaced(7, 2.0, &[7], 15), None);
    // A second landmark, or another that is missed, is.
    let mut drive = established();
    drive.run(3, Some((7, 2.0)));
    assert!(drive.until_replaced(8, 2.0, &[], 3).is_some());
    let mut drive = established();
    let frames = drive.until_replaced(7, 2.0, &[1], 10).unwrap();
    assert!(frames <= 5, "{frames}");
    // Agreement ends the contradiction.
    let mut drive = established();
    drive.run(3, Some((7, 2.0)));
    assert_eq!(drive.schedule.trust(), Trust::Contradicted);
    assert_eq!(drive.frame(Some((1, 0.0)), &[]).1, Decision::Use);
    assert_eq!(drive.schedule.trust(), Trust::Supported);
}

#[test]
fn contradictions_that_disagree_do_not_add_up_and_ambiguous_fixes_replace_nothing() {
    let mut drive = Drive::new();
    for i in 0..40 {
        let (_, decision) = drive.frame(Some((7, 2.0 + 1.5 * f64::from(i % 5))), &[]);
        assert!(matches!(decision, Decision::Keep | Decision::Doubt { in_a_row: 1 }), "{decision:?}");
    }
    let mut schedule = Schedule::default();
    let at = prior(Pose2::default(), 0.03, 0.5);
    let two = FixResult::Ambiguous(vec![fix(7, 3.0), fix(7, 4.0)]);
    for _ in 0..20 {
        let report = FrameReport {
            camera: 0,
            motion: Pose2::default(),
            prior: Some(&at),
            searched: true,
            global: Some(&two),
            missed: &[],
        };
        assert_eq!(schedule.finish(&report), Decision::Doubt { in_a_row: 0 });
    }
    // One of the solutions agrees: no contradiction.
    let one_agrees = FixResult::Ambiguous(vec![fix(7, 0.0), fix(7, 4.0)]);
    let report = FrameReport {
        camera: 0,
        motion: Pose2::default(),
        prior: Some(&at),
        searched: true,
        global: Some(&one_agrees),
        missed: &[],
    };
    assert_eq!(schedule.finish(&report), Decision::Keep);
}

#[test]
fn a_fix_that_a_prior_decided_supports_nothing() {
    let mut schedule = Schedule::default();
    let at = prior(Pose2::default(), 0.03, 0.5);
    let drawn = FixResult::Fixed(Box::new(Fix { decided_by: AmbiguityResolvedBy::Prior, ..fix(1, 0.0) }));
    let report = FrameReport {
        camera: 0,
        motion: Pose2::default(),
        prior: Some(&at),
        searched: true,
        global: Some(&drawn),
        missed: &[],
    };
    assert_eq!(schedule.finish(&report), Decision::Keep);
    assert_eq!(schedule.trust(), Trust::Unsupported);
}

#[test]
fn memory_is_bounded_and_extreme_numbers_are_tolerated() {
    let mut schedule = Schedule::default();
    let at = prior(Pose2::default(), 0.03, 0.5);
    for id in 0..100 {
        for off_m in [0.0, 50.0] {
            let global = fixed(id, off_m);
            let missed: Vec<_> = (0..50).map(|k| LandmarkId(1000 + 50 * id + k)).collect();
            schedule.finish(&FrameReport {
                camera: 0,
                motion: Pose2::default(),
                prior: Some(&at),
                searched: true,
                global: Some(&global),
                missed: &missed,
            });
        }
    }
    assert!(schedule.remembered() <= 3 * MAX_SUPPORT, "{}", schedule.remembered());
    let nowhere = Pose2Covariance {
        pose: Pose2 { x_m: f64::NAN, y_m: 0.0, theta_rad: 0.0 },
        covariance: Matrix3::identity() * f64::NAN,
    };
    assert_eq!(Schedule::default().plan(0, Some(&nowhere)).global, Some(GlobalReason::Uncertain));
    let motion = Pose2 { x_m: f64::INFINITY, y_m: f64::NAN, theta_rad: f64::NAN };
    let global = fixed(1, 0.0);
    schedule.finish(&FrameReport {
        camera: 0,
        motion,
        prior: Some(&nowhere),
        searched: true,
        global: Some(&global),
        missed: &[],
    });
    schedule.finish(&FrameReport {
        camera: 0,
        motion,
        prior: None,
        searched: true,
        global: None,
        missed: &[],
    });
    assert_eq!(schedule.trust(), Trust::NoPose);
}

#[test]
fn guided_fixes_correct_only_a_pose_that_has_had_support() {
    let mut drive = Drive::new();
    drive.run(35, None);
    assert_eq!((drive.schedule.trust(), drive.schedule.guided_corrects()), (Trust::Unsupported, false));
    drive.run(2, Some((1, 0.0)));
    assert!(drive.schedule.guided_corrects());
    // While nothing contradicts it, however old the support is.
    drive.run(300, None);
    assert_eq!((drive.schedule.trust(), drive.schedule.guided_corrects()), (Trust::Stale, true));
    assert!(matches!(drive.frame(Some((7, 2.0)), &[]).1, Decision::Doubt { in_a_row: 1 }));
    assert!(!drive.schedule.guided_corrects());
    // Not in the frame that replaces it: its guided recognition used the old pose.
    assert!(matches!(drive.frame(Some((7, 2.0)), &[]).1, Decision::Replace(_)));
    assert!(!drive.schedule.guided_corrects());
    drive.frame(None, &[]);
    assert!(drive.schedule.guided_corrects());
    // Relocalisation is support.
    let mut schedule = Schedule::default();
    schedule.relocalised(&[LandmarkId(1), LandmarkId(2)]);
    assert_eq!((schedule.trust(), schedule.guided_corrects()), (Trust::Supported, true));
}

#[test]
fn every_camera_has_its_interval_and_their_number_is_bounded() {
    let at = prior(Pose2::default(), 0.03, 0.5);
    let mut schedule = Schedule::default();
    let mut searched = [0; 2];
    for frame in 0..40 {
        let camera = frame % 2;
        let plan = schedule.plan(camera, Some(&at));
        searched[camera as usize] += u32::from(plan.global.is_some());
        let report = FrameReport {
            camera,
            motion: Pose2::default(),
            prior: Some(&at),
            searched: plan.global.is_some(),
            global: None,
            missed: &[],
        };
        schedule.finish(&report);
    }
    // Ten of the first thirty frames of both together; then the pose is stale and all are searched.
    assert!(searched.iter().all(|n| *n >= 10), "{searched:?}");
    let mut schedule = Schedule::default();
    for camera in 0..=MAX_CAMERAS as u32 {
        let report = FrameReport {
            camera,
            motion: Pose2::default(),
            prior: Some(&at),
            searched: true,
            global: None,
            missed: &[],
        };
        schedule.finish(&report);
    }
    assert_eq!(schedule.plan(MAX_CAMERAS as u32 - 1, Some(&at)).global, None);
    assert_eq!(schedule.plan(MAX_CAMERAS as u32, Some(&at)).global, Some(GlobalReason::Interval));
}
