//! The gate: 99 % of chi2 with 3 degrees of freedom, 3.37 sigma along one axis.

use super::{drive, fix};
use crate::{
    fuse::{
        fuser::Fuser,
        outcome::{FixOutcome, FixRole},
        params::FuseParams,
    },
    localise::{Fix, FixSource},
    pose2::Pose2,
};

/// A number of sigmas away from the origin, along each axis, and whether that is inside the gate.
const CASES: [(f64, bool); 4] = [(3.35, true), (3.39, false), (6.0, false), (20.0, false)];
/// Independent errors of a fix; the difference of two has twice the variance.
const NOISE_M: f64 = 0.05;

/// Fixes of a landmark of exactly known place, `sigmas` of the difference of two fixes away.
fn away(landmark: u64, sigmas: f64) -> [Fix; 3] {
    let offset_m = sigmas * NOISE_M * 2.0_f64.sqrt();
    let poses = [(offset_m, 0.0, 0.0), (0.0, -offset_m, 0.0), (0.0, 0.0, 0.2 * offset_m)];
    poses.map(|(x_m, y_m, theta_rad)| fix(landmark, Pose2::new(x_m, y_m, theta_rad), NOISE_M, 0.0))
}

/// A pose at the origin by one fix of landmark 1.
fn fuser() -> Fuser {
    let mut fuser = Fuser::new(FuseParams::default());
    drive(&mut fuser, 0.0);
    fuser.apply_fix(0, &fix(1, Pose2::default(), NOISE_M, 0.0)).unwrap();
    fuser
}

#[test]
fn a_fix_is_applied_inside_the_gate_and_changes_nothing_outside_it() {
    let sources = [
        (FixSource::Landmarks, FixRole::Independent, 1),
        (FixSource::Landmarks, FixRole::Guided, 0),
        (FixSource::Laser, FixRole::Independent, 1),
    ];
    for (sigmas, inside) in CASES {
        for (axis, fix) in away(2, sigmas).into_iter().enumerate() {
            for (modality, role, counted) in sources {
                let mut fuser = fuser();
                let (before, errors) = (fuser.pose().unwrap(), fuser.odometry_errors());
                let outcome = fuser.apply_fix_as(0, &Fix { modality, ..fix.clone() }, role).unwrap();
                let after = fuser.pose().unwrap();
                let case = format!("{sigmas} sigma along axis {axis}, {modality:?}, {role:?}: {outcome:?}");
                let applied = after.corrections + after.laser_corrections - before.corrections;
                match outcome {
                    FixOutcome::Applied { distance2 } if inside => {
                        assert!((distance2 - sigmas * sigmas).abs() < 1e-6, "{case}");
                        assert_eq!((applied, after.contradictions), (1, 0), "{case}");
                        assert!(after.pose.pose.minus(&before.pose.pose).norm() > 0.01, "{case}");
                    }
                    FixOutcome::GatedOut { distance2, in_a_row } if !inside => {
                        assert!((distance2 - sigmas * sigmas).abs() < 1e-6, "{case}");
                        assert_eq!((in_a_row, after.contradictions), (counted, counted), "{case}");
                        assert_eq!((applied, after.pose), (0, before.pose), "{case}");
                        assert_eq!(fuser.odometry_errors(), errors, "{case}");
                    }
                    _ => panic!("{case}"),
                }
            }
        }
    }
}

#[test]
fn contradictions_agree_with_one_another_by_the_same_gate() {
    for (sigmas, inside) in CASES {
        for (axis, second) in away(3, sigmas).into_iter().enumerate() {
            let mut fuser = Fuser::new(FuseParams::default());
            drive(&mut fuser, 0.0);
            fuser.apply_fix(0, &fix(1, Pose2::new(50.0, 0.0, 0.0), NOISE_M, 0.0)).unwrap();
            fuser.apply_fix(0, &fix(2, Pose2::default(), NOISE_M, 0.0)).unwrap();
            let outcome = fuser.apply_fix(0, &second).unwrap();
            let FixOutcome::GatedOut { in_a_row, .. } = outcome else { panic!("{outcome:?}") };
            assert_eq!(in_a_row, 1 + u32::from(inside), "{sigmas} sigma along axis {axis}");
        }
    }
}
