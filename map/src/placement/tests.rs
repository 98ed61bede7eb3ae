//! A synthetic room: derivatives against differences, consistent covariance by Monte Carlo, the
//! choice of the wall, refusals.

use crate::{
    extrinsics::{CameraExtrinsics, pan_tilt},
    place::LandmarkPlace,
    placement::{
        params::{PlacementError, PlacementParams},
        rays::{self, INPUTS, MOUNTING, ROBOT, WALL},
        view::{CheckedView, Placement, PosedView},
        wall::{WallRectangle, view_on_wall},
        wall_fusion::placement,
    },
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
};
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Matrix6, Point2, SVector, Vector2, Vector3, Vector6};
use vision::{
    frame::{Distortion, Intrinsics, IntrinsicsSigmas},
    geometry::Corners,
    pose::{
        LandmarkSize,
        reprojection::{corner_points, perturbed, pixel},
    },
    random::Random,
};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

fn camera() -> Intrinsics {
    Intrinsics::new(700.0, 690.0, 320.0, 240.0, Distortion::None).unwrap()
}

fn mounting() -> CameraExtrinsics {
    CameraExtrinsics::new(pan_tilt(0.1, 0.05, Vector3::new(0.1, 0.02, 1.2))).unwrap()
}

/// A wall that faces the origin from the north-east, free side on the left of a -> b.
fn wall() -> LaserSegment {
    let covariance = Matrix2::new(4e-6, 2e-6, 2e-6, 1e-4);
    LaserSegment::from_ends(Point2::new(5.0, -1.0), Point2::new(3.0, 4.0), covariance).unwrap()
}

/// The landmark `along_m` from the wall's first end, centre 1.5 m high.
fn place_on(wall: &LaserSegment, along_m: f64) -> LandmarkPlace {
    let at = wall.a + wall.direction() * along_m;
    let f = wall.facing();
    LandmarkPlace {
        x_m: at.x,
        y_m: at.y,
        z_m: 1.5,
        theta_rad: f.y.atan2(f.x),
        roll_rad: 0.0,
        tilt_rad: 0.0,
        size: SIZE,
        covariance: Matrix6::zeros(),
        shared: None,
    }
}

fn robot(place: &LandmarkPlace, d_m: f64, psi_deg: f64) -> Pose2Covariance {
    let a = place.theta_rad + psi_deg.to_radians();
    let pose =
        Pose2::new(place.x_m + d_m * a.cos(), place.y_m + d_m * a.sin(), a + std::f64::consts::PI - 0.1);
    let v = Vector3::new(4e-4, 4e-4, 3e-5);
    Pose2Covariance { pose, covariance: Matrix3::from_diagonal(&v) }
}

fn project(place: &LandmarkPlace, robot: &Pose2, mounting: &CameraExtrinsics) -> [Point2<f64>; 4] {
    projected(&camera(), place, robot, mounting)
}

fn projected(
    camera: &Intrinsics,
    place: &LandmarkPlace,
    robot: &Pose2,
    mounting: &CameraExtrinsics,
) -> [Point2<f64>; 4] {
    let camera_from_landmark =
        mounting.robot_from_camera.inverse() * robot.to_isometry3().inverse() * place.map_from_landmark();
    corner_points(&place.size).map(|p| pixel(&camera_from_landmark, &p, camera).unwrap())
}

const SIGMA_PX: f64 = 0.5;

fn covariances() -> [Matrix2<f64>; 4] {
    [Matrix2::identity() * SIGMA_PX * SIGMA_PX; 4]
}

fn view_of(
    points: [Point2<f64>; 4],
    robot: &Pose2Covariance,
    walls: &[LaserSegment],
) -> Result<WallRectangle, PlacementError> {
    view_with(&camera(), points, robot, walls)
}

fn view_with(
    camera: &Intrinsics,
    points: [Point2<f64>; 4],
    robot: &Pose2Covariance,
    walls: &[LaserSegment],
) -> Result<WallRectangle, PlacementError> {
    let view = PosedView {
        corners: &Corners::new(points).unwrap(),
        covariance_px2: &covariances(),
        camera,
        map_from_robot: robot,
        mounting: &mounting(),
    };
    view_on_wall(&view, walls, &PlacementParams::default())
}

#[test]
fn exact_views_give_the_exact_place() {
    let truth = place_on(&wall(), 2.0);
    let walls = [wall()];
    let views: Vec<_> = [(2.0, 30.0), (3.0, -40.0), (2.5, 0.0)]
        .iter()
        .map(|(d, psi)| {
            let robot = robot(&truth, *d, *psi);
            view_of(project(&truth, &robot.pose, &mounting()), &robot, &walls).unwrap()
        })
        .collect();
    for used in [&views[..1], &views[..]] {
        let made = placement(used, &walls, &PlacementParams::default()).unwrap();
        let (a, b) = (made.place.map_from_landmark(), truth.map_from_landmark());
        assert!((a.to_homogeneous() - b.to_homogeneous()).norm() < 1e-9);
        assert!(
            (made.place.size.width_m - 0.6).abs() < 1e-9 && (made.place.size.height_m - 0.84).abs() < 1e-9
        );
        assert_eq!(made.used.len(), used.len());
    }
}

#[test]
fn derivatives_are_the_finite_differences() {
    let truth = place_on(&wall(), 2.0);
    let (base, base_robot) = (mounting(), robot(&truth, 2.5, 35.0));
    let points = project(&truth, &base_robot.pose, &base);
    let (theta, r) = rays::plane(&wall());
    let at = |d: &SVector<f64, INPUTS>, i: usize| {
        let mut px = points;
        for (c, p) in px.iter_mut().enumerate() {
            (p.x, p.y) = (p.x + d[2 * c], p.y + d[2 * c + 1]);
        }
        let robot =
            Pose2Covariance { pose: base_robot.pose.plus(&d.fixed_rows::<3>(ROBOT).into()), ..base_robot };
        let (turn, shift) = (d.fixed_rows::<3>(MOUNTING).into(), d.fixed_rows::<3>(MOUNTING + 3).into());
        let robot_from_camera = perturbed(&base.robot_from_camera, &turn, &shift);
        let mounting = CameraExtrinsics { robot_from_camera, ..base.clone() };
        let view = CheckedView {
            corners_px: Corners::new(px).unwrap(),
            covariance_px2: covariances(),
            camera: camera(),
            by_camera: [Matrix2x3::zeros(); 4],
            map_from_robot: &robot,
            mounting: &mounting,
        };
        rays::hit(&view, i, (theta + d[WALL], r + d[WALL + 1])).unwrap()
    };
    for i in 0..4 {
        let hit = at(&SVector::zeros(), i);
        for k in 0..INPUTS {
            let mut d = SVector::<f64, INPUTS>::zeros();
            d[k] = 1e-6;
            let numeric = (at(&d, i).point - at(&-d, i).point) / 2e-6;
            assert!((numeric - hit.by.column(k)).norm() < 1e-6, "corner {i}, input {k}");
        }
    }
}

/// The place from one or several views with everything drawn: errors of (x, y, theta, z, w, h) and
/// the claim.
fn draw(views: &[(f64, f64)], random: &mut Random) -> (Vector6<f64>, LandmarkPlace) {
    draw_with(&camera(), views, random)
}

/// The same with a camera that has errors by its stated covariance.
fn draw_with(
    stated: &Intrinsics,
    views: &[(f64, f64)],
    random: &mut Random,
) -> (Vector6<f64>, LandmarkPlace) {
    draw_on(&wall(), stated, views, (random, false))
}

/// The same on a wall that has an error by its stated covariance; the robot's error is drawn once
/// for all views, or for each.
fn draw_on(
    w: &LaserSegment,
    stated: &Intrinsics,
    views: &[(f64, f64)],
    (random, once): (&mut Random, bool),
) -> (Vector6<f64>, LandmarkPlace) {
    let e = stated.error_sigmas().map(|s| if s > 0.0 { s * random.normal() } else { 0.0 });
    let (fx_px, fy_px) = (stated.fx_px * (1.0 + e.x), stated.fy_px * (1.0 + e.x));
    let real = Intrinsics { fx_px, fy_px, cx_px: stated.cx_px + e.y, cy_px: stated.cy_px + e.z, ..*stated };
    let l = w.covariance.cholesky().unwrap().l() * Vector2::new(random.normal(), random.normal());
    let truth_wall = LaserSegment::on_line((w.alpha_rad + l.x, w.rho_m + l.y), (w.a, w.b), w.covariance, 1);
    let truth = place_on(&truth_wall, 2.0);
    let m = mounting();
    let e = m.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal());
    let (turn, shift) = (e.fixed_rows::<3>(0).into(), e.fixed_rows::<3>(3).into());
    let mounted =
        CameraExtrinsics { robot_from_camera: perturbed(&m.robot_from_camera, &turn, &shift), ..m.clone() };
    let mut robot_error = None;
    let views_on_wall: Vec<_> = views
        .iter()
        .filter_map(|(d, psi)| {
            let believed = robot(&truth, *d, *psi);
            let e = robot_error
                .filter(|_| once)
                .unwrap_or_else(|| believed.covariance.map_diagonal(f64::sqrt).map(|s| s * random.normal()));
            robot_error = Some(e);
            let points = projected(&real, &truth, &believed.pose.plus(&e), &mounted)
                .map(|p| p + Vector2::new(random.normal(), random.normal()) * SIGMA_PX);
            // Large errors of the camera give no rectangles.
            let made = view_with(stated, points, &believed, std::slice::from_ref(w));
            made.inspect_err(|_| assert!(stated.sigmas.is_some())).ok()
        })
        .collect();
    let walls = std::slice::from_ref(w);
    let Ok(Placement { place, .. }) = placement(&views_on_wall, walls, &PlacementParams::default()) else {
        return draw_on(w, stated, views, (random, once));
    };
    let error = Vector6::new(
        place.x_m - truth.x_m,
        place.y_m - truth.y_m,
        crate::pose2::wrap_rad(place.theta_rad - truth.theta_rad),
        place.z_m - truth.z_m,
        place.size.width_m - truth.size.width_m,
        place.size.height_m - truth.size.height_m,
    );
    (error, place)
}

#[test]
fn the_covariance_of_one_view_is_consistent() {
    let mut random = Random::new(1);
    let (mut sum, mut inside, n) = (0.0, 0, 1000);
    for _ in 0..n {
        let (e, place) = draw(&[(2.5, 35.0)], &mut random);
        sum += e.dot(&place.covariance.cholesky().unwrap().solve(&e));
        let within = |k: usize| e[k].abs() <= 3.0 * place.covariance[(k, k)].sqrt();
        inside += usize::from(within(0) && within(1) && within(3));
    }
    // 99 % band of the mean of 1000 draws with 6 degrees of freedom.
    let mean = sum / f64::from(n);
    assert!((5.71..6.29).contains(&mean), "{mean}");
    assert!(inside >= 985, "{inside} of 1000 within 3 sigma on all three axes");
}

#[test]
fn several_views_reduce_the_covariance_without_overconfidence() {
    let mut random = Random::new(2);
    let views = [(2.5, 35.0), (2.0, -30.0), (3.0, 10.0), (2.2, 50.0)];
    let (mut sum, mut n) = (0.0, 0.0);
    let (_, one) = draw(&views[..1], &mut random);
    for _ in 0..300 {
        let (e, place) = draw(&views, &mut random);
        sum += e.dot(&place.covariance.cholesky().unwrap().solve(&e));
        n += 1.0;
        assert!(place.covariance[(4, 4)] < one.covariance[(4, 4)], "width");
    }
    // Inflated by 2 where views are independent: below 6, but not useless.
    assert!((3.0..6.3).contains(&(sum / n)), "{}", sum / n);
}

#[test]
fn a_pose_error_that_all_views_share_is_in_the_claim() {
    // Oracle: the robot's error drawn once for all views, as laser and odometry have it.
    let mut random = Random::new(8);
    let views = [(2.5, 30.0), (2.4, 20.0), (2.3, 10.0), (2.3, 0.0), (2.4, -10.0), (2.5, -20.0)];
    let (mut sum, mut n) = (0.0, 0.0);
    for _ in 0..300 {
        let (e, place) = draw_on(&wall(), &camera(), &views, (&mut random, true));
        sum += e.dot(&place.covariance.cholesky().unwrap().solve(&e));
        n += 1.0;
    }
    assert!((3.0..6.3).contains(&(sum / n)), "{}", sum / n);
}

#[test]
fn a_wall_with_a_wide_covariance_widens_what_is_placed_on_it() {
    // Oracle: a wall drawn anew in each draw, 6 cm and 10 mrad about its middle, as a map made of
    // scans has them.
    let about = Matrix2::new(1e-4, 3e-4, 3e-4, 3.6e-3);
    let by_hand = LaserSegment::by_hand(&[5.0, -1.0, 3.0, 4.0]).unwrap();
    let wide = LaserSegment::about_middle(by_hand.a, by_hand.b, &about).unwrap();
    let mut random = Random::new(6);
    let (mut sum, mut as_by_hand, n) = (0.0, 0.0, 1000);
    for _ in 0..n {
        let (e, place) = draw_on(&wide, &camera(), &[(2.5, 35.0)], (&mut random, false));
        sum += e.dot(&place.covariance.cholesky().unwrap().solve(&e));
        let claim = draw_on(&by_hand, &camera(), &[(2.5, 35.0)], (&mut Random::new(7), false)).1.covariance;
        as_by_hand += e.dot(&claim.cholesky().unwrap().solve(&e));
    }
    let (mean, as_by_hand) = (sum / f64::from(n), as_by_hand / f64::from(n));
    // The band is twice that of an exact model: over 6 cm the place is not quite linear in the
    // wall.
    assert!((5.4..6.6).contains(&mean) && as_by_hand > 12.0, "{mean} {as_by_hand}");
}

#[test]
fn errors_of_intrinsics_are_shared_by_all_views() {
    // Oracle: a camera drawn anew in each draw and the same in all its views. 1 % and 3 px.
    let stated = camera().with_sigmas(IntrinsicsSigmas { focal_px: 7.0, center_px: 3.0 }).unwrap();
    let views = [(2.5, 35.0), (2.0, -30.0), (3.0, 10.0), (2.2, 50.0)];
    for (views, band) in [(&views[..1], 5.4..6.6), (&views[..], 4.0..6.5)] {
        let mut random = Random::new(3);
        let (mut sum, mut by_none, n) = (0.0, 0.0, 400);
        for _ in 0..n {
            let (e, place) = draw_with(&stated, views, &mut random);
            sum += e.dot(&place.covariance.cholesky().unwrap().solve(&e));
            // With intrinsics stated as exact.
            let bare = draw(views, &mut Random::new(4)).1.covariance;
            by_none += e.dot(&bare.cholesky().unwrap().solve(&e));
        }
        let (mean, by_none) = (sum / f64::from(n), by_none / f64::from(n));
        assert!(band.contains(&mean) && by_none > 1.5 * band.end, "{mean} {by_none}");
    }
    // However many views, its share of the size stays: 1 % of 0.6 m.
    let mut random = Random::new(5);
    let many: Vec<(f64, f64)> = (0..60).map(|i| (2.5, f64::from(i) - 30.0)).collect();
    let (_, place) = draw_with(&stated, &many, &mut random);
    assert!(place.covariance[(4, 4)].sqrt() > 0.005, "{}", place.covariance[(4, 4)].sqrt());
}

#[test]
fn a_view_that_disagrees_is_left_out() {
    let truth = place_on(&wall(), 2.0);
    let moved = place_on(&wall(), 2.6);
    let of = |place: &LandmarkPlace, d, psi| {
        let robot = robot(place, d, psi);
        view_of(project(place, &robot.pose, &mounting()), &robot, &[wall()]).unwrap()
    };
    let views = [of(&moved, 2.0, 20.0), of(&truth, 2.0, 20.0), of(&truth, 2.5, -30.0), of(&truth, 3.0, 0.0)];
    let made = placement(&views, &[wall()], &PlacementParams::default()).unwrap();
    assert_eq!(made.used, [1, 2, 3]);
    assert!((made.place.x_m - truth.x_m).abs() < 1e-9);
    let none = placement(&[], &[wall()], &PlacementParams::default());
    assert_eq!(none, Err(PlacementError::NoView));
}

#[test]
fn the_nearest_wall_that_is_met_counts() {
    let truth = place_on(&wall(), 2.0);
    let robot = robot(&truth, 2.5, 20.0);
    let points = project(&truth, &robot.pose, &mounting());
    let shifted = |d: f64, from: f64, to: f64| {
        let w = wall();
        let (f, t) = (w.facing(), w.direction());
        LaserSegment::from_ends(w.a + f * d + t * from, w.a + f * d + t * to, w.covariance).unwrap()
    };
    let (behind, before) = (shifted(-1.0, -2.0, 7.0), shifted(0.8, 0.0, 5.0));
    let on = |walls: &[LaserSegment]| view_of(points, &robot, walls).map(|v| v.wall);
    assert_eq!(on(&[behind.clone(), wall()]), Ok(1));
    assert_eq!(on(&[wall(), behind]), Ok(0));
    assert_eq!(on(&[wall(), before]), Ok(1), "a board before the wall");
    // A pillar that hides half of it.
    let half = shifted(0.5, 0.5, 1.8);
    assert_eq!(on(&[wall(), half]), Err(PlacementError::Straddles));
    // The back of a wall does not count.
    let back = LaserSegment::from_ends(wall().b, wall().a, wall().covariance).unwrap();
    assert_eq!(on(&[back]), Err(PlacementError::NoWall));
    assert_eq!(on(&[]), Err(PlacementError::NoWall));
    assert_eq!(on(&[shifted(0.0, 3.2, 5.0)]), Err(PlacementError::NoWall), "beside it");
}

#[test]
fn an_open_door_is_not_on_the_wall() {
    let mut open = place_on(&wall(), 2.0);
    open.theta_rad += 0.9;
    let robot = robot(&place_on(&wall(), 2.0), 2.5, 20.0);
    let refused = view_of(project(&open, &robot.pose, &mounting()), &robot, &[wall()]);
    assert!(matches!(refused, Err(PlacementError::NotOnWall { .. })), "{refused:?}");
    let mut askew = place_on(&wall(), 2.0);
    askew.roll_rad = 0.15;
    let refused = view_of(project(&askew, &robot.pose, &mounting()), &robot, &[wall()]);
    assert!(matches!(refused, Err(PlacementError::NotOnWall { .. })), "{refused:?}");
}

#[test]
fn grazing_rays_and_invalid_numbers_are_refused() {
    let truth = place_on(&wall(), 2.0);
    let grazing = robot(&truth, 3.0, 82.0);
    let points = project(&truth, &grazing.pose, &mounting());
    assert_eq!(view_of(points, &grazing, &[wall()]), Err(PlacementError::NoWall));
    let mut nowhere = robot(&truth, 2.0, 0.0);
    let points = project(&truth, &nowhere.pose, &mounting());
    nowhere.pose.x_m = f64::NAN;
    assert!(matches!(view_of(points, &nowhere, &[wall()]), Err(PlacementError::OutOfRange(_))));
}
