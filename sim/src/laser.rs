//! A planar laser scanner with noise and a maximum range.

use crate::{
    building::Building,
    seed,
    wall::{WallSegment, first_hit},
};
use map::{laser::Scan, pose2::Pose2};
use nalgebra::{Point2, Vector2};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// Most beams of a scan.
pub const MAX_BEAMS: usize = 4096;

/// Parameters of a laser scanner. The default covers half a turn in half-degree steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LaserParams {
    /// Pose of the laser on the robot.
    pub robot_from_laser: Pose2,
    /// Beams over the field of view, 2 to [`MAX_BEAMS`].
    pub beams: usize,
    /// Angle from the first beam (right) to the last (left), 0.01 to one turn; centred on the
    /// laser's x axis.
    pub field_rad: f64,
    /// Range beyond which there is no return, 0.5 to 200 m.
    pub max_range_m: f64,
    /// Standard deviation of a range, metres.
    pub range_sigma_m: f64,
    /// Standard deviation of walls from their line, metres; they bow as real ones do.
    pub uneven_m: f64,
}

/// Length of a bow of an uneven wall, metres: with 1 cm, walls turn by 5 mrad.
const BOW_M: f64 = 12.6;

impl Default for LaserParams {
    fn default() -> Self {
        Self {
            robot_from_laser: Pose2::new(0.2, 0.0, 0.0),
            beams: 361,
            field_rad: std::f64::consts::PI,
            max_range_m: 8.0,
            range_sigma_m: 0.015,
            uneven_m: 0.0,
        }
    }
}

/// A scan from a pose of the robot. A beam without a return reads the maximum range.
pub fn scan(building: &Building, map_from_robot: &Pose2, params: &LaserParams, seed: u64) -> Scan {
    scan_among(building.walls(), map_from_robot, params, seed)
}

/// As [`scan`], with the given walls.
pub fn scan_among(walls: &[WallSegment], map_from_robot: &Pose2, params: &LaserParams, seed: u64) -> Scan {
    let p = params;
    let within = |x: f64, low: f64, high: f64| if x.is_finite() { x.clamp(low, high) } else { low };
    let (beams, field) = (p.beams.clamp(2, MAX_BEAMS), within(p.field_rad, 0.01, std::f64::consts::TAU));
    let max_range_m = within(p.max_range_m, 0.5, 200.0);
    let map_from_laser = map_from_robot.compose(&p.robot_from_laser);
    let origin = map_from_laser.apply(&Point2::origin());
    let step = field / (beams - 1) as f64;
    let mut rng = seed::stream(seed, 40);
    let beam = |i: usize| {
        let bearing = map_from_laser.theta_rad - 0.5 * field + i as f64 * step;
        let direction = Vector2::new(bearing.cos(), bearing.sin());
        let noise: f64 = StandardNormal.sample(&mut rng);
        let Some((r, wall)) = first_hit(walls, &origin, &direction, max_range_m) else {
            return max_range_m as f32;
        };
        let across = direction.dot(&wall.normal()).abs().max(0.1);
        let uneven = p.uneven_m * bow(wall, &(origin + direction * r)) / across;
        (r + uneven + p.range_sigma_m * noise).clamp(0.001, max_range_m) as f32
    };
    let ranges = (0..beams).map(beam).collect();
    Scan::new(p.robot_from_laser, -0.5 * field, step, max_range_m, ranges)
        .expect("parameters are clamped to a scan's ranges")
}

/// How far a wall is off its line at a point, for a standard deviation of 1.
fn bow(wall: &WallSegment, at: &Point2<f64>) -> f64 {
    let along_m = wall.direction().dot(&(at - wall.a_m));
    // Every wall bows in its own way.
    let phase = seed::mix(wall.a_m.x.to_bits() ^ seed::mix(wall.b_m.y.to_bits() ^ wall.a_m.y.to_bits()));
    let phase = phase as f64 / u64::MAX as f64;
    std::f64::consts::SQRT_2 * (std::f64::consts::TAU * (along_m / BOW_M + phase)).sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quiet() -> LaserParams {
        LaserParams { range_sigma_m: 0.0, robot_from_laser: Pose2::default(), ..LaserParams::default() }
    }

    #[test]
    fn beams_end_on_walls() {
        let building = Building::corridor(2);
        let robot = Pose2::new(6.0, 0.2, 0.4);
        let scan = scan(&building, &robot, &quiet(), 0);
        let mut hits = 0;
        for i in 0..361 {
            if let Some(p) = scan.point(i) {
                assert!(building.clearance_m(&robot.apply(&p)) < 1e-5);
                hits += 1;
            }
        }
        assert!(hits > 250);
    }

    #[test]
    fn distances_by_hand() {
        let building = Building::corridor(2);
        let straight = scan(&building, &Pose2::new(6.0, 0.3, 0.0), &quiet(), 0);
        assert!((straight.range_m(0).unwrap() - 1.6).abs() < 1e-5, "right wall at y = -1.3");
        assert!((straight.range_m(360).unwrap() - 1.0).abs() < 1e-5, "left wall at y = 1.3");
        assert!(straight.range_m(180).is_none(), "the end wall is out of range");
    }

    #[test]
    fn range_noise_has_its_sigma() {
        let building = Building::corridor(2);
        let robot = Pose2::new(6.0, 0.3, 0.0);
        let noisy = LaserParams { range_sigma_m: 0.02, ..quiet() };
        let errors: Vec<f64> = (0..4000)
            .map(|seed| {
                scan(&building, &robot, &LaserParams { beams: 2, ..noisy.clone() }, seed).range_m(0).unwrap()
                    - 1.6
            })
            .collect();
        let mean = errors.iter().sum::<f64>() / 4000.0;
        let sigma = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / 4000.0).sqrt();
        assert!(mean.abs() < 0.0015 && (sigma - 0.02).abs() < 0.001, "{mean} {sigma}");
    }

    #[test]
    fn uneven_walls_are_off_their_lines_by_a_centimetre() {
        let building = Building::corridor(2);
        let uneven = LaserParams { uneven_m: 0.01, beams: 2, ..quiet() };
        let off = |i: u32| {
            let robot = Pose2::new(2.0 + 0.1 * f64::from(i), 0.3, 0.0);
            let range = |p| f64::from(scan(&building, &robot, p, 0).range_m(0).unwrap() as f32);
            range(&uneven) - range(&LaserParams { beams: 2, ..quiet() })
        };
        let all: Vec<f64> = (0..126).map(off).collect();
        let sigma = (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt();
        assert!((sigma - 0.01).abs() < 0.001, "{sigma}");
        let steepest = all.windows(2).map(|w| (w[1] - w[0]).abs() / 0.1).fold(0.0, f64::max);
        assert!((0.006..0.008).contains(&steepest), "{steepest}");
    }

    #[test]
    fn parameters_are_clamped() {
        let building = Building::corridor(2);
        let beams = |beams, field_rad| {
            let p = LaserParams { beams, field_rad, max_range_m: f64::NAN, ..quiet() };
            let scan = scan(&building, &Pose2::default(), &p, 0);
            assert!((scan.max_range_m() - 0.5).abs() < 1e-12);
            scan.ranges_m().len()
        };
        assert_eq!(beams(MAX_BEAMS, 1.0), MAX_BEAMS);
        assert_eq!(beams(MAX_BEAMS + 1, 100.0), MAX_BEAMS);
        assert_eq!(beams(0, f64::NAN), 2);
    }
}
