//! The corridor of the paper: 25 m long, with doors, windows, lamps, a column and posters on both
//! sides and at the ends (method 18, E10). Everything that is not a parameter follows from the
//! seed.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::builder::{Builder, WallObject};
use crate::building::{Building, LandmarkKind};
use crate::posters::poster;
use crate::texture::Texture;
use crate::wall::WallSegment;
use crate::{seed, surfaces};

/// Distance of a poster's face from its wall.
pub const POSTER_STAND_OFF_M: f64 = 0.005;
/// Most posters in a corridor.
pub const MAX_POSTERS: usize = 64;

/// Parameters of a corridor. The map's x axis runs along it, y = 0 is the middle, z = 0 the floor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CorridorParams {
    /// Distance of the end walls, 6 to 200 m.
    pub length_m: f64,
    /// Distance of the side walls, 1.6 to 10 m.
    pub width_m: f64,
    /// Height of the ceiling, 2.3 to 6 m.
    pub height_m: f64,
    /// Posters, at most [`MAX_POSTERS`]: alternately left and right, the last two on the far and
    /// the near end wall.
    pub posters: usize,
    /// Height of the posters' centres.
    pub poster_centre_z_m: f64,
    /// Width and height of a poster.
    pub poster_size_m: [f64; 2],
    /// First poster's picture; landmark `poster-i` shows poster `first_poster + i`.
    pub first_poster: u64,
    /// Number of different pictures: poster `i` shows the picture of poster `i - pictures`; 0: all
    /// differ.
    pub pictures: usize,
    /// Number of last posters that show a picture of their own in any case.
    pub unique_posters: usize,
    /// Whether a column stands at the right wall.
    pub column: bool,
}

impl Default for CorridorParams {
    fn default() -> Self {
        Self {
            length_m: 25.0,
            width_m: 2.6,
            height_m: 2.7,
            posters: 6,
            poster_centre_z_m: 1.5,
            poster_size_m: [0.6, 0.84],
            first_poster: 0,
            pictures: 0,
            unique_posters: 0,
            column: true,
        }
    }
}

impl Building {
    /// The corridor of the paper: 25 m, six posters `poster-0` to `poster-5`.
    pub fn corridor(seed: u64) -> Self {
        let first_poster = crate::seed::mix(seed);
        Self::corridor_with(&CorridorParams { first_poster, ..CorridorParams::default() }, seed)
    }

    /// A corridor with these parameters, clamped to their ranges.
    pub fn corridor_with(params: &CorridorParams, seed: u64) -> Self {
        let p = clamped(params);
        let mut site = Site::new(&p, seed);
        site.shell();
        site.lamps();
        site.posters();
        site.fittings();
        site.baseboards();
        site.builder.finish()
    }
}

fn clamped(p: &CorridorParams) -> CorridorParams {
    let within = |x: f64, low: f64, high: f64| if x.is_finite() { x.clamp(low, high) } else { low };
    CorridorParams {
        length_m: within(p.length_m, 6.0, 200.0),
        width_m: within(p.width_m, 1.6, 10.0),
        height_m: within(p.height_m, 2.3, 6.0),
        posters: p.posters.min(MAX_POSTERS),
        poster_centre_z_m: within(p.poster_centre_z_m, 0.3, 5.5),
        poster_size_m: p.poster_size_m.map(|s| within(s, 0.05, 2.0)),
        ..*p
    }
}

/// A side of the corridor and what is already on it: occupied stretches of x.
struct Side {
    wall: Option<WallSegment>,
    left: bool,
    taken: Vec<[f64; 2]>,
}

struct Site<'a> {
    p: &'a CorridorParams,
    seed: u64,
    rng: ChaCha8Rng,
    builder: Builder,
    sides: [Side; 2],
    ends: Vec<WallSegment>,
    fittings: u64,
}

impl<'a> Site<'a> {
    fn new(p: &'a CorridorParams, seed: u64) -> Self {
        let side = |left| Side { wall: None, left, taken: vec![] };
        let builder = Builder::new(p.height_m);
        Self {
            p,
            seed,
            rng: seed::stream(seed, 20),
            builder,
            sides: [side(true), side(false)],
            ends: vec![],
            fittings: 0,
        }
    }

    fn shell(&mut self) {
        let (length, y, z) = (self.p.length_m, 0.5 * self.p.width_m, self.p.height_m);
        let plaster = Arc::new(surfaces::plaster(self.seed));
        let concrete = Arc::new(surfaces::concrete(self.seed));
        let walls = [
            ([0.0, -y], [length, -y]),
            ([length, -y], [length, y]),
            ([length, y], [0.0, y]),
            ([0.0, y], [0.0, -y]),
        ]
        .map(|(a, b)| self.builder.wall(a, b, &plaster, 2.0));
        self.sides[0].wall = Some(walls[2]);
        self.sides[1].wall = Some(walls[0]);
        self.ends = vec![walls[1], walls[3]];
        let floor = Arc::new(surfaces::floor_tiles(self.seed));
        let ceiling = Arc::new(surfaces::ceiling_panels(self.seed));
        let plan = [[0.0, -y], [length, y]];
        self.builder.level("floor", plan, 0.0, true, (&floor, 1.6));
        self.builder.level("ceiling", plan, z, false, (&ceiling, 1.2));
        if self.p.column {
            let (x, side) = (0.69 * length, 0.32);
            let (x0, x1, y0, y1) = (x, x + side, -y, -y + side);
            for (a, b) in [([x1, y1], [x0, y1]), ([x0, y1], [x0, y0]), ([x1, y0], [x1, y1])] {
                self.builder.wall(a, b, &concrete, 1.0);
            }
            self.sides[1].taken.push([x0 - 0.15, x1 + 0.15]);
        }
    }

    fn lamps(&mut self) {
        let texture = Arc::new(surfaces::lamp());
        let count = (self.p.length_m / 2.5).round().max(1.0) as usize;
        for i in 0..count {
            let x = (i as f64 + 0.5) * self.p.length_m / count as f64;
            let power = self.rng.random_range(0.6..1.1);
            self.builder.lamp([x, 0.0], [1.2, 0.3], power, &texture);
        }
    }

    fn posters(&mut self) {
        let at_ends = if self.p.posters >= 4 { 2 } else { 0 };
        let on_sides = self.p.posters - at_ends;
        let usable = self.p.length_m - 6.0;
        for i in 0..self.p.posters {
            let shares = self.p.pictures > 0 && i + self.p.unique_posters < self.p.posters;
            let number = if shares { i % self.p.pictures } else { i };
            let texture = Arc::new(poster(self.p.first_poster.wrapping_add(number as u64)));
            let object = WallObject {
                name: format!("poster-{i}"),
                kind: Some(LandmarkKind::Poster),
                size_m: self.p.poster_size_m,
                centre_z_m: self.p.poster_centre_z_m,
                stand_off_m: POSTER_STAND_OFF_M,
                texture,
            };
            if i < on_sides {
                let jitter = self.rng.random_range(-0.12..0.12);
                let x = 3.5 + usable * ((i as f64 + 0.5 + jitter) / on_sides as f64);
                self.put(i % 2, x, &object, true);
            } else {
                let wall = self.ends[(i - on_sides) % 2];
                let along = 0.5 * wall.length_m() + self.rng.random_range(-0.3..0.3);
                self.builder.hang(&wall, along, &object);
            }
        }
    }

    /// Doors and windows at free places, about every 3 m on each side.
    fn fittings(&mut self) {
        for side in 0..2 {
            let mut x = 1.3 + self.rng.random_range(0.0..1.0);
            while x < self.p.length_m - 1.0 {
                let is_window = self.sides[side].left && self.rng.random_bool(0.35);
                let object = self.fitting(is_window);
                let step =
                    if self.put(side, x, &object, false) { self.rng.random_range(2.2..3.4) } else { 0.4 };
                x += step;
            }
        }
    }

    fn fitting(&mut self, is_window: bool) -> WallObject {
        let seed = seed::mix(self.seed ^ self.fittings << 32);
        let number = self.fittings;
        self.fittings += 1;
        if is_window {
            WallObject {
                name: format!("window-{number}"),
                kind: Some(LandmarkKind::Window),
                size_m: [1.1, 1.1],
                centre_z_m: 1.6,
                stand_off_m: 0.004,
                texture: Arc::new(surfaces::window(seed)),
            }
        } else {
            WallObject {
                name: format!("door-{number}"),
                kind: Some(LandmarkKind::Door),
                size_m: [0.95, 2.1],
                centre_z_m: 1.05,
                stand_off_m: 0.012,
                texture: Arc::new(surfaces::door(seed)),
            }
        }
    }

    /// Hangs an object with its centre at `x_m` if the place is free; with `must` at the nearest
    /// free place.
    fn put(&mut self, side: usize, x_m: f64, object: &WallObject, must: bool) -> bool {
        let Side { wall: Some(wall), left, taken } = &mut self.sides[side] else { return false };
        let half = 0.5 * object.size_m[0] + 0.2;
        let mut span = [x_m - half, x_m + half];
        let clash =
            |s: &[f64; 2], taken: &[[f64; 2]]| taken.iter().find(|t| s[0] < t[1] && t[0] < s[1]).copied();
        if let Some(other) = clash(&span, taken) {
            // A poster moves past an obstacle (the column); a fitting is left out.
            span = [other[1], other[1] + 2.0 * half];
            if !must || clash(&span, taken).is_some() {
                return false;
            }
        }
        if span[1] > self.p.length_m - 0.1 {
            return false;
        }
        taken.push(span);
        let x = f64::midpoint(span[0], span[1]);
        let along = if *left { self.p.length_m - x } else { x };
        self.builder.hang(&wall.clone(), along, object);
        true
    }

    fn baseboards(&mut self) {
        let texture: Arc<Texture> = Arc::new(surfaces::baseboard(self.seed));
        let walls: Vec<_> =
            self.sides.iter().filter_map(|s| s.wall).chain(self.ends.iter().copied()).collect();
        for (i, wall) in walls.iter().enumerate() {
            let object = WallObject {
                name: format!("baseboard-{i}"),
                kind: None,
                size_m: [wall.length_m(), 0.1],
                centre_z_m: 0.05,
                stand_off_m: 0.01,
                texture: texture.clone(),
            };
            self.builder.hang(wall, 0.5 * wall.length_m(), &object);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn the_papers_corridor() {
        for seed in 0..6 {
            let building = Building::corridor(seed);
            let posters: Vec<_> = building.posters().collect();
            assert_eq!(posters.len(), 6, "seed {seed}");
            let sides = posters.iter().map(|l| l.map_from_landmark.translation.y > 1.0).collect::<Vec<_>>();
            assert!(sides.contains(&true) && sides.contains(&false));
            for (i, l) in posters.iter().enumerate() {
                assert_eq!(l.name, format!("poster-{i}"));
                // 5 mm before a wall, facing into the corridor.
                let into = l.map_from_landmark * Point3::new(0.5, 0.0, 0.0);
                let behind = l.map_from_landmark * Point3::new(-0.005, 0.0, 0.0);
                assert!(building.clearance_m(&behind.xy()) < 1e-9);
                assert!(into.x > 0.0 && into.x < 25.0 && into.y.abs() < 1.3);
            }
            assert!(building.landmarks().iter().any(|l| l.kind == LandmarkKind::Door));
        }
    }

    #[test]
    fn nothing_overlaps_on_a_wall() {
        for seed in 0..6 {
            let building = Building::corridor(seed);
            let on_sides: Vec<_> =
                building.landmarks().iter().filter(|l| l.kind != LandmarkKind::Lamp).collect();
            for (i, a) in on_sides.iter().enumerate() {
                for b in &on_sides[..i] {
                    let d = a.map_from_landmark.translation.vector - b.map_from_landmark.translation.vector;
                    let same_wall =
                        a.map_from_landmark.rotation.angle_to(&b.map_from_landmark.rotation) < 1e-6;
                    let apart = 0.5 * (a.width_m + b.width_m);
                    assert!(!same_wall || d.xy().norm() > apart, "{} and {} of seed {seed}", a.name, b.name);
                }
            }
        }
    }

    #[test]
    fn parameters_out_of_range_are_clamped() {
        let p =
            CorridorParams { length_m: f64::NAN, posters: 1000, width_m: 1e9, ..CorridorParams::default() };
        let building = Building::corridor_with(&p, 3);
        assert!(building.posters().count() <= MAX_POSTERS);
        assert!((building.walls()[0].length_m() - 6.0).abs() < 1e-9);
    }
}
