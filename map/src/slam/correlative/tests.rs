use super::*;
use crate::slam::{
    cloud::{CloudParams, cloud},
    world::{ring, scan},
};
use vision::random::Random;

#[test]
fn branch_and_bound_equals_exhaustive_search() {
    let mut random = Random::new(1);
    let p = CorrelativeParams { cell_m: 0.1, sigma_m: 0.15, turn_rad: 0.05 };
    for (x, y, theta) in [(5.0, 1.0, 0.1), (23.0, 8.0, 1.6), (12.0, 15.2, 3.0)] {
        let at = Pose2::new(x, y, theta);
        let there = Pose2::new(x + 0.6, y - 0.3, theta + 0.12);
        let old = cloud(&scan(&ring(), &at, 0.01, 12.0, &mut random), &CloudParams::default());
        let new = cloud(&scan(&ring(), &there, 0.01, 12.0, &mut random), &CloudParams::default());
        let points: Vec<_> = new.points.iter().map(|q| q.at).collect();
        let field = LikelihoodField::new([(at, &old)].into_iter(), &Point2::new(x, y), 20.0, 1.0, &p);
        let window = PoseWindow { middle: at, reach_m: 1.0, reach_rad: 0.3, pull: 0.05 };
        let found = field.search(&points, &window, 0.1, None, &p).unwrap();
        // Oracle: every leaf, one by one, on a field without coarse levels.
        let flat = LikelihoodField { levels: vec![field.levels[0].clone()], ..field.clone() };
        let best = flat.search(&points, &window, 0.1, None, &p).unwrap();
        assert!(field.levels.len() > 2);
        assert!((found.score - best.score).abs() < 1e-12, "{found:?} {best:?}");
        // Without the neighbourhood of the best, only worse ones are left.
        let rival = field.search(&points, &window, 0.0, Some((&found.pose, 0.5, 0.2)), &p);
        assert!(rival.is_none_or(|r| r.score < found.score && r.pose.minus(&found.pose).norm() > 0.2));
    }
}

#[test]
fn a_window_without_surfaces_gives_nothing() {
    let p = CorrelativeParams::default();
    let field = LikelihoodField::new(std::iter::empty(), &Point2::origin(), 10.0, 1.0, &p);
    let window = PoseWindow { middle: Pose2::default(), reach_m: 0.5, reach_rad: 0.1, pull: 0.0 };
    assert!(field.search(&[Point2::new(1.0, 0.0)], &window, 0.1, None, &p).is_none());
    assert!(field.search(&[], &window, -1.0, None, &p).is_none());
    let nowhere = PoseWindow { middle: Pose2::new(f64::NAN, 0.0, 0.0), ..window };
    assert!(field.search(&[Point2::origin()], &nowhere, -1.0, None, &p).is_none());
}
