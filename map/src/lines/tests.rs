//! A simulated laser in rooms made of known walls; Monte Carlo and eigenvectors as oracles.

use super::*;
use crate::pose2::Pose2;
use vision::random::Random;

/// Ranges of a laser at `pose` among walls (pairs of points), by brute force.
fn scan(walls: &[[f64; 4]], pose: &Pose2, n: usize, sigma_m: f64, random: &mut Random) -> Scan {
    let (first, step) = (-2.0, 4.0 / (n - 1) as f64);
    let ranges = (0..n).map(|i| {
        let a = pose.theta_rad + first + i as f64 * step;
        let d = Vector2::new(a.cos(), a.sin());
        let mut nearest = 1e9_f64;
        for [ax, ay, bx, by] in walls {
            let (e, o) = (Vector2::new(bx - ax, by - ay), Vector2::new(ax - pose.x_m, ay - pose.y_m));
            let det = d.perp(&e);
            let (r, s) = (o.perp(&e) / det, o.perp(&d) / det);
            if r > 0.0 && (0.0..=1.0).contains(&s) {
                nearest = nearest.min(r);
            }
        }
        (nearest + sigma_m * random.normal()) as f32
    });
    Scan::new(Pose2::default(), first, step, 12.0, ranges.collect()).unwrap()
}

const ROOM: [[f64; 4]; 5] = [
    [-3.0, -2.0, 4.0, -2.0],
    [4.0, -2.0, 4.0, 3.0],
    [4.0, 3.0, -3.0, 3.0],
    [-3.0, 3.0, -3.0, -2.0],
    [1.5, 0.5, 2.3, 1.3],
];

#[test]
fn a_room_gives_its_walls() {
    let mut random = Random::new(1);
    let pose = Pose2::new(0.3, 0.1, 0.2);
    let found = segments(&scan(&ROOM, &pose, 721, 0.01, &mut random), &LineParams::default());
    let back = Pose2Covariance { pose, covariance: Matrix3::zeros() };
    let mut pieces = [0; 5];
    for s in &found {
        let s = s.transformed(&back);
        // Both ends lie on one wall.
        let on = |[ax, ay, bx, by]: [f64; 4]| {
            let (o, e) = (Point2::new(ax, ay), Vector2::new(bx - ax, by - ay).normalize());
            [s.a, s.b].iter().all(|p| e.perp(&(p - o)).abs() < 0.03)
        };
        let wall = ROOM.iter().position(|w| on(*w)).unwrap_or_else(|| panic!("{s:?} is on no wall"));
        pieces[wall] += 1;
        assert!(s.facing().dot(&(Point2::new(pose.x_m, pose.y_m) - s.a)) > 0.0, "free side");
    }
    // The pillar hides the middle of the far walls: they come in up to two pieces. The wall behind
    // is out of the fan but for its ends.
    assert!(
        pieces[0] == 1 && pieces[4] == 1 && (1..=2).contains(&pieces[1]) && (1..=2).contains(&pieces[2]),
        "{pieces:?}"
    );
}

#[test]
fn the_order_of_beams_does_not_matter() {
    let mut random = Random::new(2);
    let forward = scan(&ROOM, &Pose2::default(), 721, 0.005, &mut random);
    let reversed: Vec<f32> = forward.ranges_m().iter().rev().copied().collect();
    let backward = Scan::new(Pose2::default(), 2.0, -forward.bearing_step_rad(), 12.0, reversed).unwrap();
    let p = LineParams::default();
    let (a, mut b) = (segments(&forward, &p), segments(&backward, &p));
    b.reverse();
    assert_eq!(a.len(), b.len());
    for (s, t) in a.iter().zip(&b) {
        // A corner point may fall to the other wall.
        assert!((s.a - t.a).norm() < 0.1 && (s.b - t.b).norm() < 0.1, "{s:?} {t:?}");
        assert!((s.facing() - t.facing()).norm() < 0.02);
    }
}

#[test]
fn the_fit_is_the_eigenvector() {
    let mut random = Random::new(3);
    for _ in 0..50 {
        let (angle, offset) = (random.range(-3.0, 3.0), random.range(-4.0, 4.0));
        let (t, n) = (Vector2::new(angle.cos(), angle.sin()), Vector2::new(-angle.sin(), angle.cos()));
        let points: Vec<_> = (0..20)
            .map(|i| Point2::from(t * f64::from(i) * 0.1 + n * (offset + 0.02 * random.normal())))
            .collect();
        let line = fit(&points, 0.02).unwrap();
        let centre = points.iter().fold(Vector2::zeros(), |s, p| s + p.coords) / 20.0;
        let scatter: Matrix2<f64> =
            points.iter().map(|p| (p.coords - centre) * (p.coords - centre).transpose()).sum();
        let eigen = scatter.symmetric_eigen();
        let k = usize::from(eigen.eigenvalues[0] >= eigen.eigenvalues[1]);
        let normal = eigen.eigenvectors.column(k);
        assert!((normal.dot(&line.normal()).abs() - 1.0).abs() < 1e-9);
        assert!((normal.dot(&centre).abs() - line.rho_m).abs() < 1e-9 && line.rho_m >= 0.0);
    }
}

#[test]
fn covariance_agrees_with_monte_carlo() {
    let mut random = Random::new(4);
    let (t, n): (Vector2<f64>, Vector2<f64>) = (Vector2::new(0.6, 0.8), Vector2::new(-0.8, 0.6));
    let base = Point2::new(1.0, 4.0);
    let (mut sum, mut claimed, draws) = (Matrix2::zeros(), Matrix2::zeros(), 4000);
    let truth = (n.y.atan2(n.x), n.dot(&base.coords));
    for _ in 0..draws {
        let points: Vec<_> =
            (0..30).map(|i| base + t * f64::from(i) * 0.05 + n * (0.01 * random.normal())).collect();
        let line = fit(&points, 0.01).unwrap();
        let e = Vector2::new(line.alpha_rad - truth.0, line.rho_m - truth.1);
        sum += e * e.transpose() / f64::from(draws);
        claimed = line.covariance;
    }
    for (i, j) in [(0, 0), (0, 1), (1, 1)] {
        assert!((sum[(i, j)] / claimed[(i, j)] - 1.0).abs() < 0.08, "{sum} {claimed}");
    }
}

#[test]
fn merging_compares_lines_in_common_coordinates() {
    // Two pieces of one noisy wall, far apart along it, have covariances that only fit in common
    // coordinates.
    let mut random = Random::new(5);
    let mut merged = 0;
    for _ in 0..300 {
        let run: Vec<_> =
            (0..60).map(|i| Point2::new(f64::from(i) * 0.05 + 3.0, 2.0 + 0.008 * random.normal())).collect();
        let p = LineParams { range_sigma_m: 0.008, ..LineParams::default() };
        merged += usize::from(is_one_line(&run[..20], &run[20..], &run, &p));
    }
    // 99 % gate, and a tolerance of nearly 4 sigma.
    assert!(merged > 285, "{merged}");
    let corner: Vec<_> = (0..40)
        .map(|i| {
            if i < 20 {
                Point2::new(f64::from(i) * 0.05, 0.0)
            } else {
                Point2::new(1.0, f64::from(i - 20) * 0.05)
            }
        })
        .collect();
    assert!(!is_one_line(&corner[..20], &corner[20..], &corner, &LineParams::default()));
}

#[test]
fn points_without_lines_give_nothing() {
    let p = LineParams::default();
    let of = |ranges: Vec<f32>| {
        let n = ranges.len();
        segments(&Scan::new(Pose2::default(), 0.0, 6.0 / n as f64, 12.0, ranges).unwrap(), &p)
    };
    assert!(of(vec![20.0; 300]).is_empty(), "no return");
    assert!(of(vec![f32::NAN; 300]).is_empty());
    assert!(of(vec![1.0]).is_empty());
    let mut random = Random::new(6);
    let noise = (0..300).map(|_| random.range(0.5, 8.0) as f32).collect();
    assert!(of(noise).is_empty(), "clutter");
    // The same point again and again.
    let tiny = Scan::new(Pose2::default(), 0.0, 1e-5, 12.0, vec![1.0; 300]).unwrap();
    assert!(segments(&tiny, &p).is_empty());
}

#[test]
fn a_short_or_sparse_wall_is_left_out_at_the_bound() {
    let wall = |length: f64, n: usize| {
        let pose = Pose2::default();
        let walls = [[2.0, -0.5 * length, 2.0, 0.5 * length]];
        let mut random = Random::new(7);
        segments(&scan(&walls, &pose, n, 0.0, &mut random), &LineParams::default()).len()
    };
    assert_eq!(wall(0.45, 1441), 1);
    assert_eq!(wall(0.38, 1441), 0);
    assert_eq!(wall(0.8, 40), 0, "3 or 4 points");
}
