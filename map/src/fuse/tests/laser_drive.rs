//! Landmarks and scans together: drives along a corridor with errors in the map's walls, a long
//! standstill, and the limits of what a scan may do.

use super::fix;
use crate::{
    fuse::{filter::MAX_SOURCES, fuser::Fuser, outcome::FixOutcome, params::FuseParams},
    laser::Scan,
    laser_fix::{LaserFixParams, WallIndex, laser_fix},
    localise::{Fix, FixSource},
    pose2::Pose2,
    slam::world::{Walls, rectangle, scan, segments},
};
use nalgebra::{Vector2, Vector3};
use vision::{model::LandmarkId, random::Random};

/// Standard deviation of a wall across itself.
const WALL_M: f64 = 0.01;
const SECOND: i64 = 1_000_000_000;

/// A corridor 30 m long: side walls in pieces of 6 m, walls at both ends.
fn corridor() -> Walls {
    let mut walls = vec![[0.0, 1.2, 0.0, -1.2], [30.0, -1.2, 30.0, 1.2]];
    for i in 0..5 {
        let (x0, x1) = (6.0 * f64::from(i), 6.0 * f64::from(i + 1));
        walls.extend([[x0, -1.2, x1, -1.2], [x1, 1.2, x0, 1.2]]);
    }
    walls
}

/// The map of walls, each with an error by its covariance.
fn mapped(walls: &Walls, random: &mut Random) -> WallIndex {
    let off = |w: &[f64; 4], random: &mut Random| {
        let d = Vector2::new(w[2] - w[0], w[3] - w[1]).normalize();
        let e = WALL_M * random.normal();
        [w[0] - d.y * e, w[1] + d.x * e, w[2] - d.y * e, w[3] + d.x * e]
    };
    let map: Walls = walls.iter().map(|w| off(w, random)).collect();
    WallIndex::new(&segments(&map, WALL_M, 1e-4))
}

/// Applies the scan of a time, with the fuser's own pose as the prior, as in the server.
fn laser(fuser: &mut Fuser, at: i64, map: &WallIndex, seen: &Scan, p: &LaserFixParams) -> Option<FixOutcome> {
    let prior = fuser.pose_at(at)?;
    let found = laser_fix(map, seen, &prior, p).unwrap().ok()?;
    Some(fuser.apply_fix(at, &found.fix()).unwrap())
}

struct Driven {
    /// Of the pose at the end.
    nees: f64,
    /// Squared errors across the corridor and of the heading, mean.
    squares: [f64; 2],
    scans: u64,
}

/// A landmark every 7 m, observed three times; scans at every step if there are parameters for
/// them.
fn drive(random: &mut Random, scans: Option<&LaserFixParams>) -> Driven {
    let p = FuseParams::default();
    let walls = corridor();
    let map = mapped(&walls, random);
    let places: Vec<Vector3<f64>> =
        (0..4).map(|_| Vector3::new(random.normal(), random.normal(), 0.0) * 0.02).collect();
    let errors = Vector2::new(p.scale_sigma * random.normal(), p.turn_bias_sigma_rad_per_m * random.normal());
    let (mut truth, mut odom) = (Pose2::new(2.0, 0.1, 0.0), Pose2::default());
    let mut fuser = Fuser::new(p.clone());
    let (mut squares, mut n) = ([0.0; 2], 0.0);
    for i in 0..240_i64 {
        let motion = Pose2::new(0.1, 0.0, 0.0);
        let noise = p.motion_noise(&motion).map_diagonal(f64::sqrt);
        let e = noise.map(|s| s * random.normal()) + Vector3::new(errors.x, 0.0, errors.y) * 0.1;
        (truth, odom) = (truth.compose(&motion.plus(&e)), odom.compose(&motion));
        let steer = Pose2::new(0.0, 0.0, -0.1 * truth.y_m - 0.3 * truth.theta_rad);
        (truth, odom) = (truth.compose(&steer), odom.compose(&steer));
        let at = i * SECOND / 5;
        fuser.apply_odometry(at, odom).unwrap();
        if i % 70 < 15 && i % 5 == 0 {
            let l = (i / 70) as usize % 4;
            let mut made = fix(l as u64, truth, 0.04, 0.02);
            let v = made.noise.map_diagonal(f64::sqrt).map(|s| s * random.normal());
            let j = made.nuisances[0].jacobian.fixed_columns::<3>(0).into_owned();
            made.pose.pose = truth.plus(&(v + j * places[l]));
            fuser.apply_fix(at, &made).unwrap();
        }
        if let Some(p) = scans {
            laser(&mut fuser, at, &map, &scan(&walls, &truth, 0.02, 8.0, random), p);
        }
        if let Some(fused) = fuser.pose() {
            let e = fused.pose.pose.minus(&truth);
            squares = [squares[0] + e.y * e.y, squares[1] + e.z * e.z];
            n += 1.0;
        }
    }
    let fused = fuser.pose().unwrap();
    let e = fused.pose.pose.minus(&truth);
    let nees = e.dot(&fused.pose.covariance.cholesky().unwrap().solve(&e));
    Driven { nees, squares: squares.map(|s| s / n), scans: fused.laser_corrections }
}

#[test]
fn scans_make_the_pose_more_certain_and_keep_it_consistent() {
    // The simulated ranges have independent errors; by default errors of points count as shared, as
    // with real lasers.
    let exact = LaserFixParams { correlated: 1.0, rough_m: 0.0, rough_rad: 0.0, ..LaserFixParams::default() };
    let careful = LaserFixParams::default();
    let mut random = Random::new(3);
    let drives = 60;
    let (mut nees, mut careful_nees, mut with, mut without) = (0.0, 0.0, [0.0; 2], [0.0; 2]);
    for _ in 0..drives {
        let driven = drive(&mut random, Some(&exact));
        assert!(driven.scans > 150, "{}", driven.scans);
        nees += driven.nees / f64::from(drives);
        careful_nees += drive(&mut random, Some(&careful)).nees / f64::from(drives);
        let alone = drive(&mut random, None);
        for k in 0..2 {
            (with[k], without[k]) = (with[k] + driven.squares[k], without[k] + alone.squares[k]);
        }
    }
    assert!(with[0] < 0.1 * without[0] && with[1] < 0.1 * without[1], "{with:?} {without:?}");
    // 99 % band of the mean of 60 draws with 3 degrees of freedom.
    assert!((2.25..3.85).contains(&nees), "{nees}");
    assert!(careful_nees < 3.85, "{careful_nees}");
}

#[test]
fn a_long_standstill_does_not_shrink_the_covariance() {
    let (mut random, p) = (Random::new(8), LaserFixParams::default());
    let walls = rectangle([0.0, 0.0, 6.0, 4.0]);
    let map = mapped(&walls, &mut random);
    let at = Pose2::new(2.0, 1.5, 0.4);
    let mut fuser = Fuser::new(FuseParams::default());
    fuser.apply_odometry(0, Pose2::default()).unwrap();
    fuser.apply_fix(0, &fix(1, at, 0.04, 0.02)).unwrap();
    let view = scan(&walls, &at, 0.02, 8.0, &mut random);
    assert!(matches!(laser(&mut fuser, 0, &map, &view, &p), Some(FixOutcome::Applied { .. })));
    let both = Fix { landmarks: vec![LandmarkId(1), LandmarkId(2)], ..fix(2, at, 0.04, 0.02) };
    fuser.apply_fix(0, &both).unwrap();
    let once = fuser.pose().unwrap();
    // Half a minute: scans between observations of one landmark, of another and of both do not make
    // these new.
    for i in 1..300 {
        let now = i * SECOND / 10;
        fuser.apply_odometry(now, Pose2::default()).unwrap();
        let view = scan(&walls, &at, 0.02, 8.0, &mut random);
        for outcome in [
            laser(&mut fuser, now, &map, &view, &p).unwrap(),
            fuser.apply_fix(now, &fix(1 + i as u64 % 2, at, 0.04, 0.02)).unwrap(),
            fuser.apply_fix(now, &both).unwrap(),
        ] {
            assert_eq!(outcome, FixOutcome::Repeated);
        }
    }
    let after = fuser.pose().unwrap();
    assert_eq!((after.pose, after.corrections, after.laser_corrections), (once.pose, once.corrections, 1));
}

#[test]
fn passing_a_wall_often_does_not_undercut_its_covariance() {
    let (mut random, p) = (Random::new(9), LaserFixParams::default());
    let walls = rectangle([0.0, 0.0, 4.0, 4.0]);
    let map = mapped(&walls, &mut random);
    let mut fuser = Fuser::new(FuseParams::default());
    fuser.apply_odometry(0, Pose2::default()).unwrap();
    fuser.apply_fix(0, &fix(1, Pose2::new(2.0, 2.0, 0.0), 0.04, 0.02)).unwrap();
    let mut odom = Pose2::default();
    for i in 1..400 {
        // Back and forth in place, by exact odometry.
        let step = if i % 2 == 0 { 0.06 } else { -0.06 };
        odom = odom.compose(&Pose2::new(step, 0.0, 0.0));
        fuser.apply_odometry(i * SECOND / 10, odom).unwrap();
        let view = scan(&walls, &Pose2::new(2.0, 2.0, 0.0).compose(&odom), 0.02, 8.0, &mut random);
        laser(&mut fuser, i * SECOND / 10, &map, &view, &p);
    }
    let fused = fuser.pose().unwrap();
    assert!(fused.laser_corrections > 300, "{}", fused.laser_corrections);
    // One wall across, observed all the time: its own error stays.
    let sigma = fused.pose.covariance[(0, 0)].sqrt();
    assert!((0.7 * WALL_M..1.5 * WALL_M).contains(&sigma), "{sigma}");
}

#[test]
fn a_scan_starts_no_pose_and_blocks_no_landmark() {
    let mut fuser = Fuser::new(FuseParams::default());
    let by_scan = |pose| Fix {
        modality: FixSource::Laser,
        landmarks: Vec::new(),
        nuisances: Vec::new(),
        ..fix(1, pose, 0.02, 0.0)
    };
    fuser.apply_odometry(0, Pose2::default()).unwrap();
    assert_eq!(fuser.apply_fix(0, &by_scan(Pose2::default())).unwrap(), FixOutcome::NoPose);
    assert_eq!(fuser.pose(), None);
    // A wrong pose, and scans matched around it: two landmarks that agree replace it anyway.
    fuser.apply_fix(0, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap();
    for i in 1..=6_i64 {
        let (now, x) = (i * SECOND / 10, i as f64 * 0.1);
        fuser.apply_odometry(now, Pose2::new(x, 0.0, 0.0)).unwrap();
        if fuser.pose().unwrap().pose.pose.y_m < 1.0 {
            let outcome = fuser.apply_fix(now, &by_scan(Pose2::new(x, 0.0, 0.0))).unwrap();
            assert!(matches!(outcome, FixOutcome::Applied { .. }), "{outcome:?}");
        }
        fuser.apply_fix(now, &fix(2 + i as u64 % 2, Pose2::new(x, 4.0, 0.0), 0.05, 0.01)).unwrap();
    }
    let fused = fuser.pose().unwrap();
    assert!((fused.pose.pose.y_m - 4.0).abs() < 0.1, "{fused:?}");
    // Scans that contradict are counted, and never replace it.
    for i in 7..40_i64 {
        let (now, x) = (i * SECOND / 10, i as f64 * 0.1);
        fuser.apply_odometry(now, Pose2::new(x, 0.0, 0.0)).unwrap();
        let outcome = fuser.apply_fix(now, &by_scan(Pose2::new(x, 0.0, 0.0))).unwrap();
        assert!(
            matches!(outcome, FixOutcome::GatedOut { in_a_row, .. } if in_a_row == i as u32 - 6),
            "{outcome:?}"
        );
    }
    let fused = fuser.pose().unwrap();
    assert!((fused.pose.pose.y_m - 4.0).abs() < 0.1 && fused.contradictions == 33, "{fused:?}");
}

#[test]
fn remembered_sources_are_bounded() {
    let mut fuser = Fuser::new(FuseParams::default());
    fuser.apply_odometry(0, Pose2::default()).unwrap();
    let count = MAX_SOURCES as u64;
    for l in 0..=count {
        fuser.apply_fix(0, &fix(l, Pose2::default(), 0.05, 0.01)).unwrap();
    }
    assert_eq!(fuser.apply_fix(0, &fix(1, Pose2::default(), 0.05, 0.01)).unwrap(), FixOutcome::Repeated);
    let forgotten = fuser.apply_fix(0, &fix(0, Pose2::default(), 0.05, 0.01)).unwrap();
    assert!(matches!(forgotten, FixOutcome::Applied { .. }), "{forgotten:?}");
}
