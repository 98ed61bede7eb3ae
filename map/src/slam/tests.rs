use super::world::{Walls, around, odometry, rectangle, ring, scan};
use crate::{
    laser::Scan,
    pose2::{Pose2, Pose2Covariance},
    slam::{
        map_builder::{MapKey, Slam, SlamError, SlamMap},
        params::SlamParams,
    },
};
use nalgebra::{Matrix3, Point2};
use vision::random::Random;

fn build(walls: &Walls, path: &[Pose2], odom: &[Pose2], seed: u64) -> SlamMap {
    let mut random = Random::new(seed);
    let mut slam = Slam::new(SlamParams::default());
    for (at, odom) in path.iter().zip(odom) {
        slam.add(odom, &scan(walls, at, 0.01, 12.0, &mut random)).unwrap();
    }
    slam.finish().unwrap()
}

/// Largest distance of the path from the truth, both from the first pose on.
fn worst_m(found: &[Pose2], truth: &[Pose2]) -> f64 {
    let error = |(f, t): (&Pose2, &Pose2)| (f.position() - truth[0].between(t).position()).norm();
    found.iter().zip(truth).map(error).fold(0.0, f64::max)
}

#[test]
fn a_ring_is_closed_where_odometry_alone_is_metres_off() {
    let path = around(1);
    let odom = odometry(&path, 0.01, &mut Random::new(5));
    let map = build(&ring(), &path, &odom, 7);
    assert!(worst_m(&odom, &path) > 3.0, "{}", worst_m(&odom, &path));
    assert!(worst_m(&map.path, &path) < 0.10, "{}", worst_m(&map.path, &path));
    assert!(map.loops.len() >= 3 && map.path.len() == path.len());
    // Every loop is true.
    for l in &map.loops {
        let truth = path[map.keys[l.old].scan].between(&path[map.keys[l.new].scan]);
        let d = l.old_from_new.pose.minus(&truth);
        let d2 = d.dot(&l.old_from_new.covariance.cholesky().unwrap().solve(&d));
        assert!(d2 < 30.0 && d.xy().norm() < 0.5, "{l:?} {truth:?}");
    }
    // Every wall is one of the building's.
    let back = Pose2Covariance { pose: path[0], covariance: Matrix3::zeros() };
    for wall in map.walls.iter().map(|w| w.transformed(&back)) {
        let middle = nalgebra::center(&wall.a, &wall.b);
        let off = |w: &[f64; 4]| {
            let (a, b) = (Point2::new(w[0], w[1]), Point2::new(w[2], w[3]));
            let d = b - a;
            let k = (d.dot(&(middle - a)) / d.norm_squared()).clamp(0.0, 1.0);
            (middle - (a + d * k)).norm()
        };
        assert!(ring().iter().map(off).fold(f64::INFINITY, f64::min) < 0.12, "{wall:?}");
    }
    // The building's long walls are there.
    let long = map.walls.iter().filter(|w| w.length_m() > 8.0).count();
    assert!(long >= 4, "{long}");
}

#[test]
fn the_same_scans_give_the_same_map() {
    let path: Vec<Pose2> = around(1).into_iter().take(120).collect();
    let odom = odometry(&path, 0.005, &mut Random::new(2));
    let (a, b) = (build(&ring(), &path, &odom, 3), build(&ring(), &path, &odom, 3));
    assert_eq!(a.path, b.path);
    assert_eq!(a.walls, b.walls);
}

/// Two identical rooms, 14 m apart, joined by a corridor.
fn twins() -> (Walls, Vec<Pose2>) {
    let mut walls = Vec::new();
    for x in [0.0, 20.0] {
        walls.extend([[x, 0.0, x + 6.0, 0.0], [x, 5.0, x + 6.0, 5.0]]);
        walls.extend(rectangle([x + 1.0, 3.5, x + 1.5, 4.2]));
        walls.extend(rectangle([x + 3.5, 0.0, x + 4.2, 0.8]));
    }
    walls.extend([[0.0, 0.0, 0.0, 5.0], [26.0, 0.0, 26.0, 2.0], [26.0, 3.2, 26.0, 5.0]]);
    walls.extend([
        [6.0, 0.0, 6.0, 2.0],
        [6.0, 3.2, 6.0, 5.0],
        [20.0, 0.0, 20.0, 2.0],
        [20.0, 3.2, 20.0, 5.0],
    ]);
    walls.extend([[6.0, 2.0, 20.0, 2.0], [6.0, 3.2, 20.0, 3.2]]);
    walls.extend(rectangle([10.0, 2.0, 10.3, 2.2]));
    walls.extend(rectangle([15.0, 3.0, 15.6, 3.2]));
    let path = (0..100).map(|i| Pose2::new(0.7 + 0.25 * f64::from(i), 2.6, 0.0)).collect();
    (walls, path)
}

#[test]
fn identical_rooms_are_not_closed_as_a_loop() {
    let (walls, path) = twins();
    let odom = odometry(&path, 0.004, &mut Random::new(11));
    let map = build(&walls, &path, &odom, 12);
    assert!(worst_m(&map.path, &path) < 0.5, "{}", worst_m(&map.path, &path));
    for l in &map.loops {
        let (old, new) = (path[map.keys[l.old].scan], path[map.keys[l.new].scan]);
        assert!((old.position() - new.position()).norm() < 3.0, "a loop between the two rooms: {l:?}");
    }
}

#[test]
fn the_length_of_a_bare_corridor_has_the_uncertainty_of_odometry() {
    let walls = vec![[-50.0, -1.0, 90.0, -1.0], [-50.0, 1.0, 90.0, 1.0]];
    let path: Vec<Pose2> = (0..80).map(|i| Pose2::new(0.25 * f64::from(i), 0.0, 0.0)).collect();
    // Odometry measures too little, and is turned by 0.1 rad at the end.
    let odom: Vec<Pose2> =
        (0..80).map(|i| Pose2::new(0.985 * 0.25 * f64::from(i), 0.0, 0.1 * f64::from(i) / 80.0)).collect();
    let map = build(&walls, &path, &odom, 4);
    let MapKey { scan, pose: end, .. } = map.keys.last().unwrap();
    let x_m = 0.25 * *scan as f64;
    assert!((end.pose.x_m - 0.985 * x_m).abs() < 0.15, "{end:?}");
    assert!(end.pose.y_m.abs() < 0.05 && end.pose.theta_rad.abs() < 0.01, "{end:?}");
    let (along, across) = (end.covariance[(0, 0)].sqrt(), end.covariance[(1, 1)].sqrt());
    assert!(along > 0.2 && across < 0.1, "{along} {across}");
    assert!((end.pose.x_m - x_m).abs() < 3.0 * along);
    assert!(map.loops.is_empty());
}

#[test]
fn limits_and_invalid_numbers() {
    let mut slam = Slam::new(SlamParams::default());
    let blind = Scan::new(Pose2::default(), 0.0, 0.1, 10.0, vec![f32::NAN; 20]).unwrap();
    assert!(matches!(slam.add(&Pose2::new(f64::NAN, 0.0, 0.0), &blind), Err(SlamError::OutOfRange(_))));
    // Scans without a single return: odometry alone.
    for i in 0..30 {
        slam.add(&Pose2::new(0.3 * f64::from(i), 0.0, 0.0), &blind).unwrap();
    }
    // A huge jump of odometry.
    slam.add(&Pose2::new(9e4, -9e4, 3.0), &blind).unwrap();
    let map = slam.finish().unwrap();
    assert_eq!((map.path.len(), map.walls.len()), (31, 0));
    assert!((map.path[29].x_m - 8.7).abs() < 1e-6);
    let empty = Slam::new(SlamParams::default()).finish().unwrap();
    assert!(empty.path.is_empty() && empty.keys.is_empty());
}

#[test]
fn parameters_round_trip_and_unknown_names_are_refused() {
    let text = serde_json::to_string(&SlamParams::default()).unwrap();
    assert_eq!(serde_json::from_str::<SlamParams>(&text).unwrap(), SlamParams::default());
    assert!(serde_json::from_str::<SlamParams>(r#"{"loops":{"min_weigth":0.1}}"#).is_err());
}
