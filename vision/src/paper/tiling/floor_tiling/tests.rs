use super::*;
use crate::{
    detect::{
        edges::edge_map::edges,
        params::DetectParams,
        segments::{chains::chains, edge_segments::segments},
        tests::rendering::Noise,
    },
    frame::{Distortion, GrayImage, Intrinsics},
    paper::tiling::tiling_params::FloorView,
};
use nalgebra::Point2;

/// A tiled floor in front of a wall with posters, seen by a level or tilted camera.
struct Room {
    view: FloorView,
    /// Turn of the tiles against the camera, rad.
    turn_rad: f64,
    tile_m: f64,
    wall_m: f64,
    /// Dark and light tiles in turn.
    chequered: bool,
}

/// Left, bottom, right, top on the wall, metres.
const POSTERS: [[f64; 4]; 2] = [[-1.1, 0.25, -0.3, 1.0], [0.35, 0.2, 1.0, 1.1]];
const SIZE: (usize, usize) = (640, 480);

fn room(tilt_rad: f64, turn_rad: f64, tile_m: f64) -> Room {
    let intrinsics = Intrinsics::new(520.0, 520.0, 319.5, 239.5, Distortion::None).unwrap();
    let view = FloorView { intrinsics, width_px: SIZE.0, height_m: 1.0, tilt_rad };
    Room { view, turn_rad, tile_m, wall_m: 3.5, chequered: false }
}

impl Room {
    /// Grey level along the ray through a pixel: light tiles with dark joints, a light wall with
    /// dark posters.
    fn level(&self, u: f64, v: f64) -> f64 {
        let k = &self.view.intrinsics;
        let (x, y) = ((u - k.cx_px) / k.fx_px, (v - k.cy_px) / k.fy_px);
        let (sin, cos) = self.view.tilt_rad.sin_cos();
        let (right, ahead, up) = (x, y * sin + cos, sin - y * cos);
        let to_wall = self.wall_m / ahead;
        let z = self.view.height_m + to_wall * up;
        if z >= 0.0 {
            let inside =
                |[l, b, r, t]: &[f64; 4]| (*l..=*r).contains(&(to_wall * right)) && (*b..=*t).contains(&z);
            return if POSTERS.iter().any(inside) { 60.0 } else { 190.0 };
        }
        let scale = -self.view.height_m / up;
        let (sin, cos) = self.turn_rad.sin_cos();
        let (a, b) = (scale * right, scale * ahead);
        if self.tile_m <= 0.0 {
            return 160.0;
        }
        let (a, b) = ((cos * a + sin * b + 0.07) / self.tile_m, (cos * b - sin * a) / self.tile_m);
        let joint = |c: f64| (c - c.round()).abs() * self.tile_m < 0.006;
        if joint(a) || joint(b) {
            90.0
        } else if self.chequered && (a.floor() + b.floor()).rem_euclid(2.0) < 0.5 {
            120.0
        } else {
            160.0
        }
    }

    fn image(&self, noise: f64) -> GrayImage {
        let mut seeded = Noise(7);
        GrayImage::from_fn(SIZE.0, SIZE.1, |u, v| {
            let at = |i: usize| (i as f64 + 0.5) / 4.0 - 0.5;
            let sum: f64 = (0..16).map(|i| self.level(u as f64 + at(i % 4), v as f64 + at(i / 4))).sum();
            (sum / 16.0 + noise * seeded.gaussian()).round().clamp(0.0, 255.0) as u8
        })
    }

    fn pixel(&self, right: f64, ahead: f64, up: f64) -> Point2<f64> {
        let (sin, cos) = self.view.tilt_rad.sin_cos();
        let depth = cos * ahead + sin * up;
        let k = &self.view.intrinsics;
        Point2::new(k.cx_px + k.fx_px * right / depth, k.cy_px + k.fy_px * (sin * ahead - cos * up) / depth)
    }

    /// The sides of the posters in the image.
    fn poster_sides(&self) -> Vec<[Point2<f64>; 2]> {
        let side = |[l, b, r, t]: &[f64; 4]| {
            let corners = [[*l, *t], [*r, *t], [*r, *b], [*l, *b]]
                .map(|[y, z]| self.pixel(y, self.wall_m, z - self.view.height_m));
            (0..4).map(move |i| [corners[i], corners[(i + 1) % 4]])
        };
        POSTERS.iter().flat_map(side).collect()
    }

    /// Row below which there is only floor.
    fn foot_px(&self) -> f64 {
        self.pixel(0.0, self.wall_m, -self.view.height_m).y
    }

    fn segments(&self) -> Vec<EdgeSegment> {
        let (image, p) = (self.image(2.0), DetectParams::default());
        let map = edges(&image, &p.edges);
        segments(&chains(&map, &p.chains), &map, &p.segments)
    }
}

fn on(side: &[Point2<f64>; 2], s: &EdgeSegment) -> bool {
    let along = (side[1] - side[0]).normalize();
    [s.p_px, s.q_px].iter().all(|e| along.perp(&(e - side[0])).abs() < 3.0)
}

fn below(segments: &[EdgeSegment], row: f64) -> usize {
    segments.iter().filter(|s| s.p_px.y.min(s.q_px.y) > row).count()
}

fn on_posters(segments: &[EdgeSegment], room: &Room) -> usize {
    let sides = room.poster_sides();
    segments.iter().filter(|s| sides.iter().any(|side| on(side, s))).count()
}

fn calibrated(room: &Room) -> TilingParams {
    TilingParams { remove: true, floor: Some(room.view), ..TilingParams::default() }
}

fn uncalibrated() -> TilingParams {
    TilingParams { remove: true, ..TilingParams::default() }
}

/// Rooms of different tilt, turn and tile size.
fn rooms() -> Vec<Room> {
    [(0.0, 0.4, 0.3), (0.0, 0.7, 0.33), (-0.2, 0.35, 0.3), (-0.12, 0.9, 0.4), (-0.25, 0.6, 0.5)]
        .map(|(tilt, turn, tile)| room(tilt, turn, tile))
        .into()
}

#[test]
fn tiles_are_removed_and_posters_stay() {
    for room in rooms() {
        for p in [calibrated(&room), uncalibrated()] {
            let all = room.segments();
            let untiled = remove_floor_tiling(all.clone(), SIZE, &p);
            let (floor, left) =
                (below(&all, room.foot_px() + 3.0), below(&untiled.kept, room.foot_px() + 3.0));
            let name = format!(
                "tilt {} turn {} calibrated {}",
                room.view.tilt_rad,
                room.turn_rad,
                p.floor.is_some()
            );
            assert!(floor >= 15, "{name}: {floor}");
            assert!(left * 5 <= floor, "{name}: {left} of {floor}");
            assert_eq!(on_posters(&untiled.kept, &room), on_posters(&all, &room), "{name}");
            assert!(on_posters(&all, &room) >= 8, "{name}");
        }
    }
}

#[test]
fn segments_keep_their_order_and_number() {
    let all = room(-0.2, 0.35, 0.3).segments();
    let untiled = remove_floor_tiling(all.clone(), SIZE, &uncalibrated());
    let (mut kept, mut removed) = (untiled.kept.iter().peekable(), untiled.removed.iter().peekable());
    for s in &all {
        let next = if kept.peek() == Some(&s) { kept.next() } else { removed.next() };
        assert_eq!(next, Some(s));
    }
    assert!(kept.next().is_none() && removed.next().is_none());
}

#[test]
fn nothing_is_removed_by_default_or_with_an_implausible_camera() {
    let scene = room(-0.2, 0.35, 0.3);
    let all = scene.segments();
    let still = |p: &TilingParams| assert_eq!(remove_floor_tiling(all.clone(), SIZE, p).kept, all);
    still(&TilingParams::default());
    still(&TilingParams { remove: false, ..calibrated(&scene) });
    let p = calibrated(&scene);
    let view = scene.view;
    for floor in [
        FloorView { height_m: 0.0, ..view },
        FloorView { height_m: f64::NAN, ..view },
        FloorView { tilt_rad: 1.5, ..view },
        FloorView { width_px: 0, ..view },
    ] {
        still(&TilingParams { floor: Some(floor), ..p.clone() });
    }
    still(&TilingParams { period_range: [0.0, f64::NAN], ..p.clone() });
    assert_eq!(remove_floor_tiling(Vec::new(), SIZE, &p), Untiled::default());
}

#[test]
fn nothing_is_removed_in_a_room_without_tiling() {
    for turn in [0.0, 0.4, 0.9] {
        let plain = room(-0.15, turn, 0.0);
        let all = plain.segments();
        assert!(on_posters(&all, &plain) >= 8);
        for p in [calibrated(&plain), uncalibrated()] {
            assert_eq!(remove_floor_tiling(all.clone(), SIZE, &p).removed, Vec::new());
        }
    }
}

/// Clutter as in the synthetic check of method 1.5: segments anywhere.
fn clutter(seed: u64) -> Vec<EdgeSegment> {
    let mut random = Noise(seed);
    (0..120)
        .map(|_| {
            let (u, v) = (random.uniform() * 640.0, random.uniform() * 480.0);
            let (angle, length) = (random.uniform() * std::f64::consts::TAU, 25.0 + 60.0 * random.uniform());
            crate::detect::tests::fixtures::segment(
                [u, v],
                [u + length * angle.cos(), v + length * angle.sin()],
            )
        })
        .collect()
}

#[test]
fn random_clutter_gives_no_pattern() {
    let scene = room(-0.15, 0.0, 0.3);
    for p in [calibrated(&scene), uncalibrated()] {
        let alarms =
            (0..300).filter(|s| !remove_floor_tiling(clutter(*s), SIZE, &p).removed.is_empty()).count();
        assert!(alarms == 0, "{alarms} alarms, calibrated {}", p.floor.is_some());
    }
}

#[test]
fn periods_are_found_at_a_centimetre_of_noise() {
    for (i, period) in [0.2, 0.25, 0.33, 0.45, 0.6].into_iter().enumerate() {
        let mut random = Noise(i as u64 + 1);
        let lines: Vec<(f64, f64)> = (0..9)
            .map(|i| (0.13 + f64::from(i) * period + 0.01 * random.gaussian(), 0.5 + random.uniform()))
            .collect();
        let lattice = Lattice::find(&lines, &TilingParams::default()).unwrap();
        assert!((lattice.period - period).abs() < 0.01, "{} for {period}", lattice.period);
        assert!(lines.iter().all(|l| lattice.residual(l.0) < 0.25));
        let mut places: Vec<i64> = lines.iter().map(|l| lattice.index(l.0)).collect();
        places.dedup();
        assert_eq!(places.len(), 9);
    }
    // Four lines are no pattern, nor are five at random.
    let few: Vec<_> = (0..4).map(|i| (f64::from(i) * 0.3, 1.0)).collect();
    assert_eq!(Lattice::find(&few, &TilingParams::default()), None);
}

#[test]
fn a_mirrored_image_removes_the_mirrored_lines() {
    let scene = room(-0.2, 0.35, 0.3);
    let mirror = |s: &EdgeSegment| {
        let at = |p: &Point2<f64>| [SIZE.0 as f64 - 1.0 - p.x, p.y];
        crate::detect::tests::fixtures::segment(at(&s.q_px), at(&s.p_px))
    };
    let all = scene.segments();
    let mirrored: Vec<EdgeSegment> = all.iter().map(mirror).collect();
    for p in [calibrated(&scene), uncalibrated()] {
        let (a, b) =
            (remove_floor_tiling(all.clone(), SIZE, &p), remove_floor_tiling(mirrored.clone(), SIZE, &p));
        let expected: Vec<EdgeSegment> = a.removed.iter().map(mirror).collect();
        assert!(!expected.is_empty());
        assert_eq!(b.removed, expected);
    }
}

#[test]
fn a_reduced_image_removes_the_same_lines() {
    let scene = room(-0.2, 0.35, 0.3);
    let halved = |s: &EdgeSegment| {
        let at = |p: &Point2<f64>| [0.5 * (p.x + 0.5) - 0.5, 0.5 * (p.y + 0.5) - 0.5];
        crate::detect::tests::fixtures::segment(at(&s.p_px), at(&s.q_px))
    };
    let p = TilingParams { horizon_gap_px: 0.0, ..calibrated(&scene) };
    let all = scene.segments();
    let whole = remove_floor_tiling(all.clone(), SIZE, &p);
    let half = remove_floor_tiling(all.iter().map(halved).collect(), (SIZE.0 / 2, SIZE.1 / 2), &p);
    assert_eq!(half.removed, whole.removed.iter().map(halved).collect::<Vec<_>>());
}

#[test]
fn quads_of_the_floor_are_removed_and_those_of_the_wall_stay() {
    use crate::{
        detect::{detector::detect, params::Grouping},
        trace::NoTrace,
    };
    let room = Room { chequered: true, ..room(-0.2, 0.35, 0.3) };
    // As noisy as the segments above. Without calibration one scale of some quieter pictures is
    // missed.
    let image = room.image(2.0);
    for grouping in [Grouping::Proposals, Grouping::Relaxation] {
        let count = |tiling: TilingParams| {
            let mut p = DetectParams { tiling, ..DetectParams::default() };
            p.quads.grouping = grouping;
            let quads = detect(&image, &p, &mut NoTrace);
            let low = |q: &&crate::detect::quad::Quad| {
                q.corners_px.points().iter().all(|c| c.y > room.foot_px() - 3.0)
            };
            (quads.iter().filter(low).count(), quads.iter().filter(|q| !low(q)).count())
        };
        let (floor, wall) = count(TilingParams::default());
        assert!(floor >= 3 && wall >= 2, "{grouping:?}: {floor} {wall}");
        for p in [calibrated(&room), uncalibrated()] {
            assert_eq!(count(p), (0, wall), "{grouping:?}, {floor} before");
        }
    }
}
