//! Known scenes, bounds, probabilities, coverage.

mod monte_carlo;

use crate::{
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance},
    visibility::{
        area::{MAX_OBSTACLES, VisibilityMap, visibility, within_reach},
        chance::PoseDraws,
        coverage::coverage,
        obstacle::Obstacle,
        outline::Polygon,
        settings::{PanTiltCamera, VisibilityParams},
        tests::monte_carlo::random_map,
    },
};
use nalgebra::{Matrix3, Point2, Rotation2, Vector2, Vector3};
use std::f64::consts::FRAC_PI_2;
use vision::{model::LandmarkId, pose::LandmarkSize};

/// Uniform numbers in [0, 1).
pub(super) struct Dice(u64);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub(super) fn within(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

pub(super) fn place(x: f64, y: f64, z: f64, theta: f64, size: (f64, f64)) -> LandmarkPlace {
    let size = LandmarkSize { width_m: size.0, height_m: size.1 };
    LandmarkPlace::by_hand(Vector3::new(x, y, z), theta, size, PlaceSigmas::default()).unwrap()
}

fn poster() -> LandmarkPlace {
    place(0.0, 0.0, 1.5, 0.0, (0.6, 0.84))
}

fn wall(ax: f64, ay: f64, bx: f64, by: f64) -> Obstacle {
    Obstacle { a: Point2::new(ax, ay), b: Point2::new(bx, by), height_m: None }
}

fn area_among(obstacles: &[Obstacle]) -> VisibilityMap {
    visibility(&poster(), obstacles, &PanTiltCamera::default(), &VisibilityParams::default()).unwrap()
}

/// A square sign under a ceiling 1.3 m above the camera, whose unit reaches up to a radian.
fn ceiling_sign(obstacles: &[Obstacle]) -> VisibilityMap {
    let mut sign = place(4.0, 3.0, 2.5, 0.7, (0.6, 0.6));
    sign.tilt_rad = FRAC_PI_2;
    let viewer = PanTiltCamera { tilt_rad: [-0.35, 1.0], ..PanTiltCamera::default() };
    visibility(&sign, obstacles, &viewer, &VisibilityParams::default()).unwrap()
}

#[test]
fn a_sign_under_the_ceiling_is_visible_from_a_ring() {
    let map = ceiling_sign(&[]);
    // By hand: the unit reaches it from rise / tan 1 on; towards the top of the sign its height is
    // foreshortened, 512 * 0.6 * rise / (r^2 + rise^2) = 75. The standoff moves it 5 cm below the
    // ceiling.
    let rise: f64 = 1.25;
    let (near, far) = (rise / 1.0_f64.tan(), (512.0 * 0.6 / 75.0 * rise - rise * rise).sqrt());
    for quarter in 0..4 {
        let along = Rotation2::new(0.7 + FRAC_PI_2 * f64::from(quarter)) * Vector2::x();
        for (r, inside) in
            [(near - 1e-3, false), (near + 1e-3, true), (far - 1e-3, true), (far + 1e-3, false)]
        {
            assert_eq!(map.contains(&(Point2::new(4.0, 3.0) + along * r)), inside, "{quarter} {r}");
        }
    }
    let [ring] = map.polygons() else { panic!("{} polygons", map.polygons().len()) };
    let hole = Polygon { corners: ring.hole.iter().rev().copied().collect(), hole: Vec::new() };
    assert!((hole.area_m2() / (std::f64::consts::PI * near * near) - 1.0).abs() < 1e-3);
    assert!((map.centroid().unwrap() - Point2::new(4.0, 3.0)).norm() < 1e-3);
    assert!((map.margin_m(&Point2::new(4.0, 3.0)) + near).abs() < 2e-3, "right below it");
}

#[test]
fn a_wall_cuts_the_ring_under_the_ceiling() {
    // A long wall beside the sign cuts off the area behind it and leaves that in front of it.
    let wall = |x: f64| Obstacle { a: Point2::new(x, -9.0), b: Point2::new(x, 9.0), height_m: None };
    let map = ceiling_sign(&[wall(5.5)]);
    assert!(map.contains(&Point2::new(5.45, 3.0)) && !map.contains(&Point2::new(5.55, 3.0)));
    assert!(map.contains(&Point2::new(2.4, 3.0)));
    assert_eq!(map.polygons().len(), 1);
    assert!(!map.polygons()[0].hole.is_empty(), "still all round it");
    let through = ceiling_sign(&[wall(3.9)]);
    assert!(through.area_m2() <= 0.0, "a wall cuts the sign itself");
    let beyond = ceiling_sign(&[wall(3.3), wall(4.7)]);
    assert!(beyond.contains(&Point2::new(4.0, 4.5)) && beyond.polygons().len() == 2, "on both sides");
}

#[test]
fn the_open_area_is_two_discs_and_a_cone() {
    // By hand: alone on its wall a poster as wide as high is visible in the disc tangent to the
    // wall, cut by the cone, less the discs where it does not fit. Polar about the centre: r from
    // max(0, ...) to D cos(psi).
    let landmark = place(0.0, 0.0, 1.2, 0.0, (0.6, 0.6));
    let viewer = PanTiltCamera { height_px: 640.0, ..PanTiltCamera::default() };
    let p = VisibilityParams { standoff_m: 0.001, ..VisibilityParams::default() };
    let map = visibility(&landmark, &[], &viewer, &p).unwrap();
    let diameter = 512.0 * 0.6 / 75.0;
    let near = 0.6 / (1.8 * 320.0 / 512.0);
    let (mut area, n) = (0.0, 20_000);
    for k in 0..n {
        let psi = (2.0 * (f64::from(k) + 0.5) / f64::from(n) - 1.0) * p.max_incidence_rad;
        let (outer, inner) = (diameter * psi.cos(), near);
        area += 0.5 * (outer * outer - inner * inner).max(0.0) * 2.0 * p.max_incidence_rad / f64::from(n);
    }
    assert!((map.area_m2() / area - 1.0).abs() < 3e-4, "{} for {area}", map.area_m2());
    assert_eq!(map.polygons().len(), 1);
    let centroid = map.centroid().unwrap();
    assert!(centroid.y.abs() < 1e-6 && centroid.x > near && centroid.x < diameter);
}

#[test]
fn a_pillar_casts_its_full_penumbra() {
    // By hand: the landmark is 0.6 m wide at x = 0.05; a pillar 0.2 m wide at x = 0.85 hides some
    // part of it from x = 2.45 within |y| < 0.1 + 2 (0.1 + 0.3), by the crossing tangents.
    let map = area_among(&[wall(0.85, -0.1, 0.85, 0.1)]);
    let edge = 0.1 + 2.0 * 0.4;
    for side in [-1.0, 1.0] {
        assert!(!map.contains(&Point2::new(2.45, side * (edge - 1e-6))));
        assert!(map.contains(&Point2::new(2.45, side * (edge + 1e-6))));
    }
    // Nothing is between it and the landmark, but that is too near to fit in the image.
    assert_eq!(map.polygons().len(), 2, "left and right of it");
}

#[test]
fn obstacles_beside_behind_or_low_hide_nothing() {
    let open = area_among(&[]).area_m2();
    let own_wall = wall(0.0, -9.0, 0.0, 9.0);
    let low = Obstacle { height_m: Some(1.0), ..wall(1.5, -0.5, 1.5, 0.5) };
    for o in [own_wall, wall(-1.0, -1.0, -1.0, 1.0), wall(6.0, -5.0, 6.0, 5.0), low] {
        assert!((area_among(&[o]).area_m2() - open).abs() < 1e-9, "{o:?}");
    }
    let high = Obstacle { height_m: Some(1.1), ..low };
    assert!(area_among(&[high]).area_m2() < 0.8 * open);
}

#[test]
fn an_obstacle_that_cuts_the_landmark_hides_it() {
    for o in [wall(-1.0, 0.1, 2.0, 0.1), wall(0.05, -0.2, 0.05, 0.2), wall(-0.1, -0.1, 0.3, 0.5)] {
        let map = area_among(&[o]);
        assert!(map.polygons().is_empty() && map.centroid().is_none(), "{o:?}");
        assert!(map.area_m2() <= 0.0 && !map.contains(&Point2::new(2.0, 0.0)));
        assert!(map.margin_m(&Point2::new(2.0, 0.0)).is_infinite());
    }
    assert!(!area_among(&[wall(-1.0, 0.31, 2.0, 0.31)]).polygons().is_empty(), "beside it");
}

#[test]
fn at_the_end_of_a_wall_the_corner_hides_one_side() {
    // The wall turns towards the viewer right beside the landmark.
    let map = area_among(&[wall(0.0, -4.0, 0.0, 0.31), wall(0.0, 0.31, 4.0, 0.31)]);
    assert!(!map.contains(&Point2::new(2.0, 0.5)));
    assert!(map.contains(&Point2::new(2.0, -0.5)) && map.contains(&Point2::new(2.0, 0.29)));
}

#[test]
fn between_and_behind_walls_nothing_is_visible() {
    let room = [wall(3.0, -3.0, 3.0, 3.0), wall(3.1, 3.0, 3.1, -3.0)];
    let map = area_among(&room);
    assert!(map.contains(&Point2::new(2.9, 0.0)));
    assert!(!map.contains(&Point2::new(3.05, 0.0)) && !map.contains(&Point2::new(3.3, 0.0)));
    assert!(!map.contains(&Point2::new(-2.0, 0.0)), "behind its own wall");
}

#[test]
fn the_area_moves_with_the_map_frame() {
    let p = VisibilityParams::default();
    let scene = |seed| {
        let (landmark, obstacles, viewer) = random_map(seed);
        let map = visibility(&landmark, &obstacles, &viewer, &p).unwrap();
        (map.area_m2() > 1.0).then_some((landmark, obstacles, viewer, map))
    };
    let (landmark, obstacles, viewer, here) = (0..40).find_map(scene).unwrap();
    let by = Pose2::new(12.0, -7.0, 2.0);
    let moved: Vec<_> = obstacles
        .iter()
        .map(|o| Obstacle { a: by.apply(&o.a), b: by.apply(&o.b), height_m: o.height_m })
        .collect();
    let centre = by.apply(&Point2::new(landmark.x_m, landmark.y_m));
    let there = LandmarkPlace {
        x_m: centre.x,
        y_m: centre.y,
        theta_rad: crate::pose2::wrap_rad(landmark.theta_rad + by.theta_rad),
        ..landmark
    };
    let there = visibility(&there, &moved, &viewer, &p).unwrap();
    assert!((here.area_m2() - there.area_m2()).abs() < 1e-6);
    assert!((by.apply(&here.centroid().unwrap()) - there.centroid().unwrap()).norm() < 1e-6);
}

#[test]
fn margin_is_the_distance_to_the_boundary() {
    let map = area_among(&[wall(3.0, -9.0, 3.0, 9.0)]);
    assert!((map.margin_m(&Point2::new(2.8, 0.0)) - 0.2).abs() < 1e-9);
    assert!((map.margin_m(&Point2::new(3.2, 0.0)) + 0.2).abs() < 1e-9);
}

#[test]
fn probability_is_the_share_of_the_gaussian_inside() {
    // Oracle: the normal distribution across one straight edge.
    let map = area_among(&[wall(3.0, -9.0, 3.0, 9.0)]);
    let at = |x: f64, sigma: f64| {
        let covariance = Matrix3::from_diagonal(&Vector3::new(sigma * sigma, 1e-6, 1e-4));
        let pose = Pose2Covariance { pose: Pose2::new(x, 0.0, 3.0), covariance };
        map.probability(&PoseDraws::new(&pose, Vector2::zeros()))
    };
    for (x, sigma, expected) in [
        (3.0, 0.1, 0.5),
        (2.9, 0.1, 0.841),
        (3.1, 0.1, 0.159),
        (2.8, 0.1, 0.977),
        (2.2, 0.01, 1.0),
        (8.0, 0.1, 0.0),
    ] {
        let got = at(x, sigma);
        assert!((got - expected).abs() < 0.04, "{x} {sigma}: {got} for {expected}");
    }
}

#[test]
fn beyond_the_pan_range_a_landmark_is_invisible() {
    let map = area_among(&[]);
    let chance = |theta: f64| {
        let covariance = Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, 1e-4));
        let pose = Pose2Covariance { pose: Pose2::new(2.5, 0.0, theta), covariance };
        map.probability(&PoseDraws::new(&pose, Vector2::zeros()))
    };
    assert!(chance(3.1) > 0.99 && chance(3.1 - 1.6) > 0.99);
    assert!(chance(0.0) <= 0.0, "it is behind the robot");
    assert!((chance(std::f64::consts::PI - 1.7) - 0.5).abs() < 0.1, "at the end of the pan range");
}

#[test]
fn coverage_names_landmarks_and_gaps() {
    let (a, b) = (area_among(&[]), {
        let far = place(20.0, 0.0, 1.5, 0.0, (0.6, 0.84));
        visibility(
            &far,
            &[],
            &PanTiltCamera {
                pan_rad: [-std::f64::consts::PI, std::f64::consts::PI],
                ..PanTiltCamera::default()
            },
            &VisibilityParams::default(),
        )
        .unwrap()
    });
    let maps = [(LandmarkId(1), &a), (LandmarkId(2), &b)];
    // Towards the first landmark, then far away to the second, whose back comes first.
    let path = [Point2::new(6.0, 0.0), Point2::new(2.0, 0.0), Point2::new(30.0, 0.0)];
    let found = coverage(&path, 0.1, &maps).unwrap();
    assert!((found.length_m - 32.0).abs() < 1e-9);
    let first = found.steps.iter().find(|s| !s.landmarks.is_empty()).unwrap();
    assert_eq!(first.landmarks, [LandmarkId(1)]);
    // It is large enough at 512 * 0.6 / 75 m.
    assert!((first.position.x - 512.0 * 0.6 / 75.0).abs() < 0.1);
    assert_eq!(found.gaps.len(), 3, "{:?}", found.gaps);
    assert!(found.gaps[0].from_m <= 0.0 && (found.gaps[0].to_m - (6.0 - 4.096)).abs() < 0.11);
    assert!((found.gaps[2].to_m - 32.0).abs() < 1e-9);
    assert!(found.share() > 0.1 && found.share() < 0.3);
    assert_eq!(coverage(&path, 0.001, &maps).unwrap_err().field, "step_m");
    assert_eq!(coverage(&[], 0.1, &maps).unwrap_err().field, "path");
    let long = [Point2::new(0.0, 0.0), Point2::new(99_000.0, 0.0)];
    assert_eq!(coverage(&long, 0.1, &maps).unwrap_err().field, "length_m");
    assert_eq!(coverage(&path[..1], 0.1, &maps).unwrap().steps.len(), 1);
}

#[test]
fn values_out_of_range_are_refused_with_their_field() {
    let with = |viewer: PanTiltCamera, p: VisibilityParams| {
        visibility(&poster(), &[], &viewer, &p).map(|_| ()).map_err(|e| e.field)
    };
    let (v, p) = (PanTiltCamera::default, VisibilityParams::default);
    assert_eq!(with(v(), p()), Ok(()));
    assert_eq!(with(PanTiltCamera { focal_px: 9.0, ..v() }, p()), Err("focal_px"));
    assert_eq!(with(PanTiltCamera { tilt_rad: [0.2, 0.1], ..v() }, p()), Err("tilt_rad[1]"));
    assert_eq!(with(PanTiltCamera { camera_height_m: f64::NAN, ..v() }, p()), Err("camera_height_m"));
    assert_eq!(with(v(), VisibilityParams { max_incidence_rad: 1.5, ..p() }), Err("max_incidence_rad"));
    assert_eq!(with(v(), VisibilityParams { standoff_m: 0.0, ..p() }), Err("standoff_m"));
    let nowhere = with(PanTiltCamera { tilt_rad: [-0.3, -0.2], ..v() }, p());
    assert_eq!(nowhere, Ok(()), "an empty area is a result");
}

#[test]
fn only_the_nearest_obstacles_count_beyond_the_bound() {
    let far = wall(3.9, -0.1, 3.9, 0.1);
    let mut many = vec![far];
    many.extend(std::iter::repeat_n(wall(1.0, 2.0, 1.0, 2.1), MAX_OBSTACLES - 1));
    let p = VisibilityParams::default();
    assert!(within_reach(&poster(), &many, &PanTiltCamera::default(), &p).contains(&far));
    many.push(wall(1.0, 2.0, 1.0, 2.1));
    let within_limit = within_reach(&poster(), &many, &PanTiltCamera::default(), &p);
    assert_eq!(within_limit.len(), MAX_OBSTACLES);
    assert!(!within_limit.contains(&far));
}
