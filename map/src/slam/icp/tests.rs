use super::*;
use crate::slam::{
    cloud::{CloudParams, cloud},
    world::{Walls, rectangle, ring, scan},
};
use vision::random::Random;

fn cloud_at(walls: &Walls, at: &Pose2, sigma_m: f64, random: &mut Random) -> Cloud {
    cloud(&scan(walls, at, sigma_m, 12.0, random), &CloudParams::default())
}

#[test]
fn a_known_motion_is_recovered() {
    let mut random = Random::new(1);
    let (a, b) = (Pose2::new(12.5, 1.0, 0.1), Pose2::new(12.9, 0.9, 0.25));
    let (old, new) = (cloud_at(&ring(), &a, 0.0, &mut random), cloud_at(&ring(), &b, 0.0, &mut random));
    let reference = SurfaceIndex::new([(a, &old)].into_iter(), 0.5);
    let guess = Pose2::new(12.75, 1.05, 0.15);
    let found = align(&reference, &new, &guess, None, &IcpParams::default()).unwrap();
    let d = found.pose.minus(&b);
    assert!(d.xy().norm() < 0.01 && d.z.abs() < 0.002, "{d}");
    assert!(found.matched > 0.6, "{found:?}");
}

#[test]
fn a_corridor_gives_no_information_along_itself() {
    let mut random = Random::new(2);
    let walls = vec![[-60.0, -1.0, 60.0, -1.0], [-60.0, 1.0, 60.0, 1.0]];
    for turn in [0.0_f64, 0.7, 2.0] {
        // The same corridor, the robot turned: the unknown direction follows the walls, not the
        // robot.
        let at = Pose2::new(0.0, 0.1, turn.sin() * 0.3);
        let old = cloud_at(&walls, &at, 0.01, &mut random);
        let reference = SurfaceIndex::new([(at, &old)].into_iter(), 0.5);
        let found = align(&reference, &old, &at, None, &IcpParams::default()).unwrap();
        let eigen = found.information.symmetric_eigen();
        let (least, k) =
            (0..3).map(|i| (eigen.eigenvalues[i], i)).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        let axis = eigen.eigenvectors.column(k);
        assert!(axis.x.abs() > 0.99, "{axis}");
        assert!(least < 1.0 / 0.4_f64.powi(2), "no better than 40 cm, {least}");
        assert!(found.information[(1, 1)] > 1.0 / 0.02_f64.powi(2), "{}", found.information);
    }
}

#[test]
fn the_covariance_agrees_with_monte_carlo() {
    // Monte Carlo in a cluttered room; both scans have noise.
    let mut walls = rectangle([0.0, 0.0, 6.0, 5.0]);
    walls.extend(rectangle([4.0, 2.0, 4.6, 2.7]));
    let (mut sum, draws) = (0.0, 300);
    for seed in 0..draws {
        let mut random = Random::new(seed);
        let a = Pose2::new(1.5, 2.0, 0.4 + 0.2 * random.normal());
        let b = a.compose(&Pose2::new(0.3, 0.02, 0.1));
        let (old, new) = (cloud_at(&walls, &a, 0.015, &mut random), cloud_at(&walls, &b, 0.015, &mut random));
        let reference = SurfaceIndex::new([(a, &old)].into_iter(), 0.5);
        let found = align(&reference, &new, &b, None, &IcpParams::default()).unwrap();
        let e = found.pose.minus(&b);
        sum += e.dot(&(found.information * e));
    }
    // 3 degrees of freedom. Never overconfident; real scans have shared errors, so a lower value is
    // right.
    let mean = sum / draws as f64;
    assert!((0.3..3.2).contains(&mean), "{mean}");
}

#[test]
fn a_floor_is_added_to_the_covariance() {
    let information = Matrix3::new(500.0, 20.0, 3.0, 20.0, 900.0, -8.0, 3.0, -8.0, 2000.0);
    let made = with_floor(&information, [0.02, 0.01]);
    let expected =
        information.try_inverse().unwrap() + Matrix3::from_diagonal(&Vector3::new(4e-4, 4e-4, 1e-4));
    assert!((made.try_inverse().unwrap() - expected).norm() < 1e-9);
    // Zero information stays zero.
    let mut singular = Matrix3::zeros();
    singular[(1, 1)] = 1e4;
    let made = with_floor(&singular, [0.02, 0.01]);
    assert!(made[(0, 0)].abs() < 1e-9 && (made[(1, 1)] - 1.0 / (1e-4 + 4e-4)).abs() < 1e-6);
}

#[test]
fn too_few_points_give_no_match() {
    let reference = SurfaceIndex::new(std::iter::empty(), 0.5);
    let mut random = Random::new(3);
    let new = cloud_at(&ring(), &Pose2::new(12.5, 1.0, 0.1), 0.0, &mut random);
    assert!(align(&reference, &new, &Pose2::default(), None, &IcpParams::default()).is_none());
}
