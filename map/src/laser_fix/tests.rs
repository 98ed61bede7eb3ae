use crate::{
    laser::Scan,
    laser_fix::{
        fix::{LaserFix, LaserRefusal},
        index::WallIndex,
        params::LaserFixParams,
        search::laser_fix,
    },
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
    slam::world::{Walls, rectangle, ring, scan, segments},
};
use nalgebra::{Matrix2, Matrix3, Point2, Rotation2, Vector2, Vector3};
use vision::random::Random;

fn prior(at: &Pose2, sigma_m: f64, sigma_rad: f64, random: &mut Random) -> Pose2Covariance {
    let e = Vector3::new(sigma_m * random.normal(), sigma_m * random.normal(), sigma_rad * random.normal());
    let v = Vector3::new(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad);
    Pose2Covariance { pose: at.plus(&e), covariance: Matrix3::from_diagonal(&v) }
}

fn fix(
    walls: &Walls,
    at: &Pose2,
    prior: &Pose2Covariance,
    random: &mut Random,
) -> Result<LaserFix, LaserRefusal> {
    let index = WallIndex::new(&segments(walls, 0.005, 0.002));
    let scan = scan(walls, at, 0.01, 12.0, random);
    laser_fix(&index, &scan, prior, &LaserFixParams::default()).unwrap()
}

#[test]
fn the_covariance_of_the_pose_is_consistent() {
    let (mut worst, mut sum, mut n) = (0.0_f64, 0.0, 0);
    for seed in 0..200 {
        let mut random = Random::new(seed);
        let at = Pose2::new(random.range(0.7, 1.4), random.range(3.0, 13.0), random.range(-3.0, 3.0));
        // Each draw has another map, with errors by its covariance.
        let off = |w: &[f64; 4], random: &mut Random| {
            let d = Vector2::new(w[2] - w[0], w[3] - w[1]).normalize();
            let e = 0.005 * random.normal();
            [w[0] - d.y * e, w[1] + d.x * e, w[2] - d.y * e, w[3] + d.x * e]
        };
        let map: Walls = ring().iter().map(|w| off(w, &mut random)).collect();
        let index = WallIndex::new(&segments(&map, 0.005, 1e-4));
        let prior = prior(&at, 0.1, 0.03, &mut random);
        let scan = scan(&ring(), &at, 0.01, 12.0, &mut random);
        let Ok(found) = laser_fix(&index, &scan, &prior, &LaserFixParams::default()).unwrap() else {
            continue;
        };
        let e = found.pose.pose.minus(&at);
        sum += e.dot(&found.pose.covariance.cholesky().unwrap().solve(&e));
        // Across the corridor and in the heading it is determined.
        worst = worst.max(e.x.abs()).max(e.z.abs());
        n += 1;
    }
    assert!(n > 190, "{n}");
    assert!(worst < 0.05, "{worst}");
    let mean = sum / f64::from(n);
    assert!((0.5..3.3).contains(&mean), "mean NEES {mean}, 3 expected");
}

#[test]
fn walls_with_wide_covariances_widen_the_fix() {
    // Oracle: in each draw every wall of the map is off by its covariance about its middle, 3 cm
    // and 3 mrad.
    let sigmas = Vector2::new(0.003, 0.03);
    let about = Matrix2::from_diagonal(&sigmas.component_mul(&sigmas));
    let (mut sum, mut as_by_hand, mut n) = (0.0, 0.0, 0);
    for seed in 0..300 {
        let mut random = Random::new(1000 + seed);
        let at = Pose2::new(random.range(0.7, 1.4), random.range(3.0, 13.0), random.range(-3.0, 3.0));
        let off = |w: &[f64; 4], random: &mut Random| {
            let (a, b) = (Vector2::new(w[0], w[1]), Vector2::new(w[2], w[3]));
            let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
            let turn = Rotation2::new(sigmas.x * random.normal());
            let across = Vector2::new(-half.y, half.x).normalize() * (sigmas.y * random.normal());
            let (a, b) = (middle + across - turn * half, middle + across + turn * half);
            [a.x, a.y, b.x, b.y]
        };
        let map: Walls = ring().iter().map(|w| off(w, &mut random)).collect();
        let known = |[ax, ay, bx, by]: &[f64; 4]| {
            LaserSegment::about_middle(Point2::new(*ax, *ay), Point2::new(*bx, *by), &about).unwrap()
        };
        let wide: Vec<LaserSegment> = map.iter().map(known).collect();
        let by_hand: Vec<_> = map.iter().map(|w| LaserSegment::by_hand(w).unwrap()).collect();
        let prior = prior(&at, 0.1, 0.03, &mut random);
        let scan = scan(&ring(), &at, 0.01, 12.0, &mut random);
        let fixed = |walls: &[LaserSegment]| {
            laser_fix(&WallIndex::new(walls), &scan, &prior, &LaserFixParams::default()).unwrap()
        };
        let (Ok(found), Ok(narrow)) = (fixed(&wide), fixed(&by_hand)) else { continue };
        let nees = |fix: &LaserFix| {
            let e = fix.pose.pose.minus(&at);
            e.dot(&fix.pose.covariance.cholesky().unwrap().solve(&e))
        };
        (sum, as_by_hand, n) = (sum + nees(&found), as_by_hand + nees(&narrow), n + 1);
    }
    let (mean, as_by_hand) = (sum / f64::from(n), as_by_hand / f64::from(n));
    assert!(n > 270, "{n}");
    assert!((1.5..4.5).contains(&mean) && as_by_hand > 1.5 * mean, "mean NEES {mean}, {as_by_hand} by hand");
}

#[test]
fn uneven_walls_widen_the_fix() {
    // Oracle: in each draw the scan sees every wall off its line by the unevenness that is
    // believed.
    let p = LaserFixParams::default();
    let straight = LaserFixParams { rough_m: 0.0, rough_rad: 0.0, ..p.clone() };
    let index = WallIndex::new(&segments(&ring(), 1e-4, 1e-5));
    let (mut sum, mut as_straight, mut n) = (0.0, 0.0, 0);
    for seed in 0..300 {
        let mut random = Random::new(3000 + seed);
        let at = Pose2::new(random.range(0.7, 1.4), random.range(3.0, 13.0), random.range(-3.0, 3.0));
        let uneven = |w: &[f64; 4], random: &mut Random| {
            let (a, b) = (Vector2::new(w[0], w[1]), Vector2::new(w[2], w[3]));
            let (along, from) = ((b - a).normalize(), at.position() - a);
            // About the foot of the robot, near the middle of what it sees.
            let foot = a + along * from.dot(&along).clamp(0.0, (b - a).norm());
            let turn = Rotation2::new(p.rough_rad * random.normal());
            let across = Vector2::new(-along.y, along.x) * (p.rough_m * random.normal());
            let [a, b] = [a, b].map(|end| foot + across + turn * (end - foot));
            [a.x, a.y, b.x, b.y]
        };
        let seen: Walls = ring().iter().map(|w| uneven(w, &mut random)).collect();
        let prior = prior(&at, 0.1, 0.03, &mut random);
        let scan = scan(&seen, &at, 0.01, 12.0, &mut random);
        let fixed = |p: &LaserFixParams| laser_fix(&index, &scan, &prior, p).unwrap();
        let (Ok(found), Ok(narrow)) = (fixed(&p), fixed(&straight)) else { continue };
        let nees = |fix: &LaserFix| {
            let e = fix.pose.pose.minus(&at);
            e.dot(&fix.pose.covariance.cholesky().unwrap().solve(&e))
        };
        (sum, as_straight, n) = (sum + nees(&found), as_straight + nees(&narrow), n + 1);
    }
    let (mean, as_straight) = (sum / f64::from(n), as_straight / f64::from(n));
    assert!(n > 270, "{n}");
    assert!(
        (1.5..4.5).contains(&mean) && as_straight > 2.0 * mean,
        "mean NEES {mean}, {as_straight} straight"
    );
}

#[test]
fn along_a_bare_corridor_the_pose_is_undetermined() {
    let walls = vec![[-60.0, -1.0, 60.0, -1.0], [-60.0, 1.0, 60.0, 1.0]];
    let mut random = Random::new(1);
    let at = Pose2::new(3.0, 0.2, 0.1);
    let believed = prior(&at, 0.1, 0.02, &mut random);
    let found = fix(&walls, &at, &believed, &mut random).unwrap();
    let c = found.pose.covariance;
    assert!(c[(0, 0)].sqrt() > 50.0, "{c}");
    assert!(c[(1, 1)].sqrt() < 0.02 && c[(2, 2)].sqrt() < 0.01, "{c}");
    // Undetermined coordinates have the prior's value: fusing them changes nothing.
    assert!((found.pose.pose.x_m - believed.pose.x_m).abs() < 0.05);
    assert!((found.pose.pose.y_m - 0.2).abs() < 0.02);
}

#[test]
fn a_scan_of_another_place_is_refused() {
    let mut random = Random::new(2);
    let at = Pose2::new(3.0, 2.0, 0.3);
    let room = rectangle([0.0, 0.0, 6.0, 4.0]);
    let index = WallIndex::new(&segments(&rectangle([0.0, 0.0, 9.0, 7.0]), 0.005, 0.002));
    let near = prior(&at, 0.05, 0.02, &mut random);
    let p = LaserFixParams::default();
    let other = laser_fix(&index, &scan(&room, &at, 0.01, 12.0, &mut random), &near, &p).unwrap();
    assert!(
        matches!(
            other,
            Err(LaserRefusal::PoorMatch { .. }
                | LaserRefusal::FewPoints { .. }
                | LaserRefusal::GatePrior { .. })
        ),
        "{other:?}"
    );
    // No walls, no returns.
    let empty = WallIndex::new(&[]);
    let measured = scan(&room, &at, 0.01, 12.0, &mut random);
    assert!(matches!(laser_fix(&empty, &measured, &near, &p).unwrap(), Err(LaserRefusal::FewPoints { .. })));
    let blind = Scan::new(Pose2::default(), 0.0, 0.01, 10.0, vec![f32::NAN; 300]).unwrap();
    assert_eq!(laser_fix(&index, &blind, &near, &p).unwrap(), Err(LaserRefusal::FewPoints { points: 0 }));
    let nan = Pose2Covariance { covariance: Matrix3::repeat(f64::NAN), ..near };
    assert_eq!(laser_fix(&index, &measured, &nan, &p).unwrap_err().field, "covariance");
}

#[test]
fn an_overconfident_wrong_prior_is_contradicted() {
    let mut random = Random::new(4);
    let room = rectangle([0.0, 0.0, 6.0, 4.0]);
    let at = Pose2::new(3.0, 2.0, 0.3);
    // Off by 0.3 m, stated within 2 cm.
    let wrong = prior(&at.plus(&Vector3::new(0.3, 0.0, 0.0)), 0.02, 0.01, &mut random);
    let found = fix(&room, &at, &wrong, &mut random);
    assert!(matches!(found, Err(LaserRefusal::GatePrior { .. })), "{found:?}");
}

#[test]
fn two_matching_poses_are_ambiguous() {
    // Identical niches every 1.2 m; the prior covers two of them.
    let mut walls = vec![[-20.0, -1.0, 20.0, -1.0]];
    for i in -16..16 {
        let x = 1.2 * f64::from(i);
        walls.extend([[x, 1.0, x + 0.6, 1.0], [x + 0.6, 1.0, x + 0.6, 1.4]]);
        walls.extend([[x + 0.6, 1.4, x + 1.2, 1.4], [x + 1.2, 1.4, x + 1.2, 1.0]]);
    }
    let mut random = Random::new(5);
    let at = Pose2::new(0.3, 0.0, 1.2);
    let v = Vector3::new(0.7 * 0.7, 0.01, 0.001);
    let wide = Pose2Covariance {
        pose: at.plus(&Vector3::new(0.6, 0.0, 0.0)),
        covariance: Matrix3::from_diagonal(&v),
    };
    let found = fix(&walls, &at, &wide, &mut random);
    assert_eq!(found, Err(LaserRefusal::Ambiguous));
    // A narrow prior resolves it.
    let sure = prior(&at, 0.05, 0.01, &mut random);
    let found = fix(&walls, &at, &sure, &mut random).unwrap();
    assert!((found.pose.pose.x_m - 0.3).abs() < 0.03, "{found:?}");
}

#[test]
fn fusion_reduces_the_uncertainty_across_a_corridor_only() {
    use crate::fuse::{FixOutcome, FuseParams, Fuser};
    let walls = vec![[-60.0, -1.0, 60.0, -1.0], [-60.0, 1.0, 60.0, 1.0]];
    let mut random = Random::new(6);
    let at = Pose2::new(3.0, 0.2, 0.1);
    let v = Vector3::new(0.3, 0.1, 0.03).map(|s: f64| s * s);
    let believed =
        Pose2Covariance { pose: Pose2::new(2.6, 0.1, 0.12), covariance: Matrix3::from_diagonal(&v) };
    let mut fuser = Fuser::new(FuseParams::default());
    fuser.apply_odometry(0, Pose2::default()).unwrap();
    fuser.start(&believed).unwrap();
    let found = fix(&walls, &at, &believed, &mut random).unwrap();
    assert!(matches!(fuser.apply_fix(0, &found.fix()).unwrap(), FixOutcome::Applied { .. }));
    let fused = fuser.pose().unwrap().pose;
    assert!((fused.pose.y_m - 0.2).abs() < 0.02 && (fused.pose.theta_rad - 0.1).abs() < 0.01, "{fused:?}");
    assert!((fused.pose.x_m - 2.6).abs() < 0.02, "{fused:?}");
    assert!((fused.covariance[(0, 0)].sqrt() - 0.3).abs() < 0.01 && fused.covariance[(1, 1)].sqrt() < 0.02);
}
