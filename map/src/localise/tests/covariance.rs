//! The covariance against Monte Carlo.

use crate::localise::{
    fix::{FixResult, NuisanceKey},
    tests::{
        camera, draw, fix_of, fixed, mounting, moved, nees, observe, observe_by, off, place, robot, stated,
    },
};
use nalgebra::Matrix3;
use vision::{model::LandmarkId, pose::reprojection::perturbed, random::Random};

#[test]
fn covariance_is_consistent_in_twelve_cells() {
    // Distance x view angle x noise. Place, extrinsics and corners are drawn anew each time.
    let mut random = Random::new(3);
    let (mut outside, mut wild, mut all) = (0, 0, 0);
    for sigma_px in [0.3, 0.8] {
        for d in [2.0, 4.0, 6.0] {
            for psi in [10.0, 45.0] {
                let (mut sum, mut n) = (0.0, 0);
                for _ in 0..200 {
                    let truth = robot(&place(), d, psi);
                    let true_place = moved(&place(), &draw(&place().covariance, &mut random));
                    let m = mounting();
                    let e = draw(&m.covariance, &mut random);
                    let (turn, shift) = (e.fixed_rows::<3>(0).into(), e.fixed_rows::<3>(3).into());
                    let mounted = perturbed(&m.robot_from_camera, &turn, &shift);
                    let seen = observe(&truth, &true_place, &mounted, sigma_px, &mut random).unwrap();
                    if let FixResult::Fixed(fix) = fix_of(&seen, &place(), None) {
                        let value = nees(&fix, &truth);
                        wild += usize::from(value > 30.0);
                        (sum, n) = (sum + value, n + 1);
                    }
                }
                all += n;
                let mean = sum / f64::from(n);
                assert!(n >= 150, "{d} m {psi} deg {sigma_px} px: only {n} fixes");
                assert!((2.57..3.47).contains(&mean), "{d} m {psi} deg {sigma_px} px: {mean}");
                outside += usize::from(!(2.67..3.35).contains(&mean));
            }
        }
    }
    assert!(outside <= 2, "{outside} cells outside the 95 % band");
    assert!(wild <= 2, "{wild} of {all} fixes far outside their covariance");
}

#[test]
fn errors_of_intrinsics_are_in_the_covariance_and_shared() {
    // Oracle: a camera drawn anew each time, with places, extrinsics and corners.
    let mut random = Random::new(13);
    for (d, psi) in [(2.0, 45.0), (4.0, 30.0), (3.0, 10.0)] {
        let (mut sum, mut as_exact, mut n) = (0.0, 0.0, 0.0);
        for _ in 0..250 {
            let mut truth = robot(&place(), d, psi);
            truth.theta_rad += 0.2;
            let true_place = moved(&place(), &draw(&place().covariance, &mut random));
            let m = mounting();
            let e = draw(&m.covariance, &mut random);
            let (turn, shift) = (e.fixed_rows::<3>(0).into(), e.fixed_rows::<3>(3).into());
            let mounted = perturbed(&m.robot_from_camera, &turn, &shift);
            let view = mounted.inverse() * truth.to_isometry3().inverse() * true_place.map_from_landmark();
            let real = off(&stated().error_sigmas().map(|s| s * random.normal()));
            let seed = random.clone();
            let seen = observe_by(&real, &stated(), &view, true_place.size, 0.4, &mut random).unwrap();
            let bare = observe_by(&real, &camera(), &view, true_place.size, 0.4, &mut seed.clone()).unwrap();
            let (FixResult::Fixed(fix), FixResult::Fixed(exact)) =
                (fix_of(&seen, &place(), None), fix_of(&bare, &place(), None))
            else {
                continue;
            };
            (sum, as_exact, n) = (sum + nees(&fix, &truth), as_exact + nees(&exact, &truth), n + 1.0);
            assert_eq!(fix.nuisances.last().unwrap().key, NuisanceKey::Camera);
            let parts: Matrix3<f64> =
                fix.nuisances.iter().map(|n| n.jacobian * n.covariance * n.jacobian.transpose()).sum();
            let gap = (fix.noise + parts - fix.pose.covariance).norm();
            assert!(gap < 1e-9 * fix.pose.covariance.norm(), "{gap}");
        }
        assert!(n > 200.0 && (2.5..3.5).contains(&(sum / n)), "{d} m {psi} deg: {n} {}", sum / n);
        assert!(as_exact / n > 5.0, "{d} m {psi} deg: {}", as_exact / n);
    }
}

#[test]
fn from_the_front_the_covariance_is_conservative() {
    let mut random = Random::new(5);
    let truth = robot(&place(), 6.0, 0.0);
    let (mut sum, mut n, mut heading) = (0.0, 0.0, 0.0);
    for _ in 0..200 {
        let seen = observe(&truth, &place(), &mounting().robot_from_camera, 0.5, &mut random).unwrap();
        if let FixResult::Fixed(fix) = fix_of(&seen, &place(), None) {
            (sum, n) = (sum + nees(&fix, &truth), n + 1.0);
            heading += fix.pose.covariance[(2, 2)].sqrt();
        }
    }
    let (mean, sigma_deg) = (sum / n, f64::to_degrees(heading / n));
    assert!(n > 150.0 && (1.0..3.5).contains(&mean), "{n} {mean}");
    assert!((2.0..10.0).contains(&sigma_deg), "{sigma_deg}");
}

#[test]
fn parts_of_the_covariance_add_up() {
    let mut random = Random::new(12);
    for psi in [0.0, 15.0, 50.0] {
        let truth = robot(&place(), 4.0, psi);
        let seen = observe(&truth, &place(), &mounting().robot_from_camera, 0.5, &mut random).unwrap();
        let fix = fixed(fix_of(&seen, &place(), None));
        let mut sum = fix.noise;
        for n in &fix.nuisances {
            sum += n.jacobian * n.covariance * n.jacobian.transpose();
        }
        assert!((sum - fix.pose.covariance).norm() < 1e-9 * sum.norm());
        assert!(fix.noise.symmetric_eigenvalues().min() > 0.0);
        let keys: Vec<_> = fix.nuisances.iter().map(|n| n.key).collect();
        assert_eq!(keys, [NuisanceKey::Landmark(LandmarkId(1)), NuisanceKey::Extrinsics]);
    }
}
