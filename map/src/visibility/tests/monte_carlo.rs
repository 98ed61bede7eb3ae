//! Random scenes: polygons and areas against point-by-point tests.

use crate::{
    place::LandmarkPlace,
    visibility::{
        area::visibility,
        obstacle::Obstacle,
        outline::Polygon,
        pointwise,
        settings::{PanTiltCamera, VisibilityParams},
        tests::{Dice, place},
    },
};
use nalgebra::{Point2, Rotation2, Vector2};
use std::f64::consts::FRAC_PI_2;

/// The same scene with the landmark under the ceiling, on the floor or leaning, at any height, and
/// a camera that can be tilted to it.
fn random_tilted_map(seed: u64) -> (LandmarkPlace, Vec<Obstacle>, PanTiltCamera) {
    let (mut landmark, mut obstacles, mut viewer) = random_map(seed);
    let mut dice = Dice::new(5000 + seed);
    landmark.tilt_rad = match seed % 4 {
        0 => FRAC_PI_2,
        1 => -FRAC_PI_2,
        _ => dice.within(-FRAC_PI_2, FRAC_PI_2),
    };
    let rise = dice.within(-0.3, 2.5);
    landmark.z_m = viewer.camera_height_m + rise.copysign(rise * landmark.tilt_rad);
    viewer.tilt_rad = [dice.within(-1.5, -0.6), dice.within(0.6, 1.5)];
    // Its own wall would cut a leaning landmark.
    obstacles.pop();
    (landmark, obstacles, viewer)
}

/// A landmark on its wall with long and short, near and far, high and low obstacles about it.
pub(super) fn random_map(seed: u64) -> (LandmarkPlace, Vec<Obstacle>, PanTiltCamera) {
    let mut dice = Dice::new(seed);
    let theta = dice.within(-3.1, 3.1);
    let landmark = place(
        dice.within(-50.0, 50.0),
        dice.within(-50.0, 50.0),
        dice.within(0.8, 2.2),
        theta,
        (dice.within(0.2, 1.5), dice.within(0.2, 1.5)),
    );
    let centre = Point2::new(landmark.x_m, landmark.y_m);
    let turn = Rotation2::new(theta);
    let mut at = |ahead: (f64, f64), aside: f64| {
        centre + turn * Vector2::new(dice.within(ahead.0, ahead.1), dice.within(-aside, aside))
    };
    let mut obstacles: Vec<Obstacle> =
        (0..4).map(|_| Obstacle { a: at((0.3, 8.0), 6.0), b: at((0.3, 8.0), 6.0), height_m: None }).collect();
    for _ in 0..8 {
        let a = at((-1.0, 6.0), 6.0);
        obstacles.push(Obstacle { a, b: a + (at((-0.5, 0.5), 0.5) - centre), height_m: None });
    }
    obstacles.push(Obstacle {
        a: centre + turn * Vector2::new(0.0, -5.0),
        b: centre + turn * Vector2::new(0.0, 5.0),
        height_m: None,
    });
    obstacles[2].height_m = Some(dice.within(0.2, 1.6));
    let viewer = PanTiltCamera {
        focal_px: dice.within(400.0, 900.0),
        camera_height_m: dice.within(0.5, 1.6),
        ..PanTiltCamera::default()
    };
    (landmark, obstacles, viewer)
}

type Scene = fn(u64) -> (LandmarkPlace, Vec<Obstacle>, PanTiltCamera);

/// Over 200 points of each map: points compared, points that differ, points from which it is
/// visible.
fn compared_with_brute_force(scene: Scene, seeds: u64) -> (u32, u32, u32) {
    let p = VisibilityParams::default();
    let (mut compared, mut differ, mut visible) = (0, 0, 0);
    for seed in 0..seeds {
        let (landmark, obstacles, viewer) = scene(seed);
        let map = visibility(&landmark, &obstacles, &viewer, &p).unwrap();
        let mut dice = Dice::new(1000 + seed);
        let centre = Point2::new(landmark.x_m, landmark.y_m);
        let reach = 1.05 * map.reach_m();
        for _ in 0..200 {
            let q = centre + Vector2::new(dice.within(-reach, reach), dice.within(-reach, reach));
            let expected = pointwise::sees(&landmark, &obstacles, &viewer, &p, &q);
            let by_polygon = map.polygons().iter().any(|polygon| polygon.contains(&q));
            assert_eq!(by_polygon, map.contains(&q), "{seed} {q}: polygon and bounds");
            compared += 1;
            differ += u32::from(by_polygon != expected);
            visible += u32::from(expected);
        }
    }
    (compared, differ, visible)
}

#[test]
fn polygons_agree_with_brute_force() {
    // Oracle: every condition at every point separately. The whole comparison is
    // `waymark-lab evaluate visibility`.
    let (compared, differ, visible) = compared_with_brute_force(random_map, 40);
    assert!(visible > 500, "{visible} of {compared}");
    assert!(differ <= 1, "{differ} of {compared}");
}

#[test]
fn tilted_polygons_agree_with_brute_force() {
    let (compared, differ, visible) = compared_with_brute_force(random_tilted_map, 120);
    assert!(visible > 1000, "{visible} of {compared}");
    assert!(differ <= 2, "{differ} of {compared}");
}

/// The area over that counted on grids, of 12 maps.
fn area_over_counted(scene: Scene) -> f64 {
    let p = VisibilityParams::default();
    let (mut expected, mut got) = (0.0, 0.0);
    for seed in 0..12 {
        let (landmark, obstacles, viewer) = scene(seed);
        let map = visibility(&landmark, &obstacles, &viewer, &p).unwrap();
        let (reach, side) = (map.reach_m(), 160);
        let centre = Point2::new(landmark.x_m, landmark.y_m);
        let cell = 2.0 * reach / f64::from(side);
        let at = |i: i32| (f64::from(i) + 0.5) * cell - reach;
        let visible = (0..side * side).filter(|i| {
            let q = centre + Vector2::new(at(i / side), at(i % side));
            pointwise::sees(&landmark, &obstacles, &viewer, &p, &q)
        });
        expected += visible.count() as f64 * cell * cell;
        got += map.area_m2();
        let parts: f64 = map.polygons().iter().map(Polygon::area_m2).sum();
        assert!((parts - map.area_m2()).abs() < 1e-9);
    }
    got / expected
}

#[test]
fn areas_agree_with_monte_carlo() {
    for scene in [random_map as Scene, random_tilted_map] {
        let ratio = area_over_counted(scene);
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    }
}
