//! Test world: walls as lines, a scanner with exact truth and odometry that drifts.

use crate::{laser::Scan, pose2::Pose2, segments::LaserSegment};
use nalgebra::{Matrix2, Point2, Vector2};
use vision::random::Random;

/// Walls: x and y of both ends.
pub(crate) type Walls = Vec<[f64; 4]>;

/// Half a turn in one-degree steps; `sigma_m` on every range.
pub(crate) fn scan(walls: &Walls, at: &Pose2, sigma_m: f64, max_m: f64, random: &mut Random) -> Scan {
    let step = std::f64::consts::PI / 180.0;
    let origin = Point2::from(at.position());
    let ranges = (0..181).map(|i| {
        let bearing = at.theta_rad + (f64::from(i) - 90.0) * step;
        let d = Vector2::new(bearing.cos(), bearing.sin());
        let hit = walls.iter().filter_map(|[ax, ay, bx, by]| {
            let (along, to) = (Vector2::new(bx - ax, by - ay), Point2::new(*ax, *ay) - origin);
            let cross = d.perp(&along);
            let (r, k) = (to.perp(&along) / cross, to.perp(&d) / cross);
            (cross.abs() > 1e-12 && r > 1e-6 && (0.0..=1.0).contains(&k)).then_some(r)
        });
        let noise = sigma_m * random.normal();
        let hit = hit.fold(f64::INFINITY, f64::min);
        if hit < max_m { (hit + noise).max(0.01) as f32 } else { f32::INFINITY }
    });
    Scan::new(Pose2::default(), -90.0 * step, step, max_m, ranges.collect()).unwrap()
}

/// The walls as a finished map with the covariance of `sigma_m` and `sigma_rad`.
pub(crate) fn segments(walls: &Walls, sigma_m: f64, sigma_rad: f64) -> Vec<LaserSegment> {
    let covariance = Matrix2::new(sigma_rad * sigma_rad, 0.0, 0.0, sigma_m * sigma_m);
    let one = |[ax, ay, bx, by]: &[f64; 4]| {
        LaserSegment::from_ends(Point2::new(*ax, *ay), Point2::new(*bx, *by), covariance).unwrap()
    };
    walls.iter().map(one).collect()
}

/// The four walls of a rectangle.
pub(crate) fn rectangle([x0, y0, x1, y1]: [f64; 4]) -> Walls {
    vec![[x0, y0, x1, y0], [x1, y0, x1, y1], [x1, y1, x0, y1], [x0, y1, x0, y0]]
}

/// A ring of corridors 2 m wide around a block, with niches and pillars that make its places
/// different.
pub(crate) fn ring() -> Walls {
    let mut walls = rectangle([0.0, 0.0, 24.0, 16.0]);
    walls.extend(rectangle([2.0, 2.0, 22.0, 14.0]));
    for (x, y, side) in [(5.0, 0.0, 0.3), (6.5, 0.0, 0.4), (11.0, 0.0, 0.5), (17.5, 0.0, 0.3)] {
        walls.extend(rectangle([x, y, x + side, y + 0.4]));
    }
    for (x, y, side) in [(4.0, 15.5, 0.6), (13.0, 15.6, 0.3), (15.0, 15.5, 0.4), (19.0, 15.6, 0.5)] {
        walls.extend(rectangle([x, y, x + side, 16.0]));
    }
    for (y, side) in [(5.0, 0.5), (9.0, 0.3), (10.5, 0.4)] {
        walls.extend(rectangle([0.0, y, 0.4, y + side]));
        walls.extend(rectangle([23.5, y + 1.3, 24.0, y + 1.3 + side]));
    }
    walls
}

/// Around the ring and a little further, in steps of a quarter of a metre.
pub(crate) fn around(rounds: usize) -> Vec<Pose2> {
    let corners = [[1.0, 1.0], [23.0, 1.0], [23.0, 15.0], [1.0, 15.0]];
    let mut poses = Vec::new();
    for i in 0..=4 * rounds {
        let (a, b) = (Vector2::<f64>::from(corners[i % 4]), Vector2::from(corners[(i + 1) % 4]));
        let d = b - a;
        let heading = d.y.atan2(d.x);
        let before = poses.last().map_or(heading, |p: &Pose2| p.theta_rad);
        let turn = crate::pose2::wrap_rad(heading - before);
        poses.extend((1..=4).map(|k| Pose2::new(a.x, a.y, before + turn * f64::from(k) / 4.0)));
        let steps = (d.norm() / 0.25) as usize;
        poses.extend((1..steps).map(|k| {
            let p = a + d * (k as f64 / steps as f64);
            Pose2::new(p.x, p.y, heading)
        }));
    }
    poses
}

/// Odometry along a path: noise and a bias to one side.
pub(crate) fn odometry(path: &[Pose2], bias_rad_per_m: f64, random: &mut Random) -> Vec<Pose2> {
    let mut odom = vec![Pose2::default()];
    for pair in path.windows(2) {
        let m = pair[0].between(&pair[1]);
        let d = m.position().norm();
        let step = Pose2::new(
            m.x_m * (1.0 + 0.03 * random.normal()),
            m.y_m + 0.01 * d * random.normal(),
            m.theta_rad
                + bias_rad_per_m * d
                + 0.01 * d.sqrt() * random.normal()
                + 0.03 * m.theta_rad * random.normal(),
        );
        odom.push(odom[odom.len() - 1].compose(&step));
    }
    odom
}
