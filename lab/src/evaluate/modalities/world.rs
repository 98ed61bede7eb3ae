//! The building: a corridor, a hall and a workshop along x, with openings between. The map has the
//! walls of before the workshop's were moved.

use map::{
    laser_fix::WallIndex,
    place::{LandmarkPlace, PlaceSigmas},
    segments::LaserSegment,
};
use nalgebra::{Matrix2, Point2, Vector3};
use sim::building::WallSegment;
use std::f64::consts::FRAC_PI_2;
use vision::pose::LandmarkSize;

/// A part of the building.
pub(super) struct Zone {
    pub(super) name: &'static str,
    /// From, to, along x (m).
    pub(super) x_m: [f64; 2],
    /// Distance of its side walls from the middle.
    half_width_m: f64,
}

pub(super) const ZONES: [Zone; 3] = [
    Zone { name: "corridor", x_m: [0.0, 25.0], half_width_m: 1.2 },
    Zone { name: "hall", x_m: [25.0, 40.0], half_width_m: 3.5 },
    Zone { name: "workshop", x_m: [40.0, 55.0], half_width_m: 2.5 },
];
/// Half the width of the openings between them.
const OPENING_M: f64 = 1.0;
/// By how much the side walls of the workshop were moved to the left after they were mapped: new
/// cupboards.
const MOVED_M: f64 = 0.12;
/// Standard deviation of the mapped walls.
const WALL_SIGMA_M: f64 = 0.01;
const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };
const POSTER_HEIGHT_M: f64 = 1.5;

pub(super) struct World {
    pub(super) walls: Vec<WallSegment>,
    /// Walls of the map.
    pub(super) index: WallIndex,
    /// Walls of the map with covariance.
    pub(super) posters: Vec<LandmarkPlace>,
}

impl World {
    pub(super) fn new() -> Self {
        let (walls, mapped) = (walls(MOVED_M), walls(0.0));
        let covariance = Matrix2::new(1e-6, 0.0, 0.0, WALL_SIGMA_M * WALL_SIGMA_M);
        let segments: Vec<LaserSegment> =
            mapped.iter().filter_map(|w| LaserSegment::from_ends(w.a_m, w.b_m, covariance).ok()).collect();
        // Four in the corridor, none in the hall, two in the workshop.
        let places = [(4.0, 1.2), (10.0, -1.2), (16.0, 1.2), (22.0, -1.2), (45.0, -2.5), (51.0, 2.5)];
        let posters = places
            .iter()
            .filter_map(|&(x, y): &(f64, f64)| {
                let theta = if y > 0.0 { -FRAC_PI_2 } else { FRAC_PI_2 };
                LandmarkPlace::by_hand(
                    Vector3::new(x, y, POSTER_HEIGHT_M),
                    theta,
                    SIZE,
                    PlaceSigmas::default(),
                )
                .ok()
            })
            .collect();
        Self { walls, index: WallIndex::new(&segments), posters }
    }

    /// The zone at `x_m`.
    pub(super) fn zone(x_m: f64) -> &'static Zone {
        ZONES.iter().find(|zone| x_m < zone.x_m[1]).unwrap_or(&ZONES[ZONES.len() - 1])
    }
}

/// All walls; those along the workshop's sides `moved_m` to the left.
fn walls(moved_m: f64) -> Vec<WallSegment> {
    let wall = |a: [f64; 2], b: [f64; 2]| WallSegment { a_m: Point2::from(a), b_m: Point2::from(b) };
    let mut walls = Vec::new();
    for zone in &ZONES {
        let ([x0, x1], h) = (zone.x_m, zone.half_width_m);
        let dy = if zone.name == "workshop" { moved_m } else { 0.0 };
        walls.extend([wall([x0, dy - h], [x1, dy - h]), wall([x1, dy + h], [x0, dy + h])]);
        if zone.name == "hall" {
            // Pillars and niches constrain the laser along x.
            for (x, y) in [(29.0, 2.4), (33.5, -2.6), (37.0, 2.2), (31.0, -2.9)] {
                walls.extend([
                    wall([x, y + 0.4], [x, y]),
                    wall([x, y], [x + 0.4, y]),
                    wall([x + 0.4, y], [x + 0.4, y + 0.4]),
                    wall([x + 0.4, y + 0.4], [x, y + 0.4]),
                ]);
            }
        }
    }
    let (first, last) = (&ZONES[0], &ZONES[ZONES.len() - 1]);
    let ends = [(first.x_m[0], first.half_width_m), (last.x_m[1], last.half_width_m)];
    walls.extend([
        wall([ends[0].0, ends[0].1], [ends[0].0, -ends[0].1]),
        wall([ends[1].0, -ends[1].1], [ends[1].0, ends[1].1]),
    ]);
    for pair in ZONES.windows(2) {
        let (x, wide) = (pair[0].x_m[1], pair[0].half_width_m.max(pair[1].half_width_m));
        for side in [-1.0, 1.0] {
            walls.push(wall([x, side * OPENING_M], [x, side * wide]));
        }
    }
    walls
}
