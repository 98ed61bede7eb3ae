use super::*;

const T: Tolerance = Tolerance { split_px: 1.5, merge_rad: 0.052 };

fn walk(corners: &[(f64, f64)]) -> Vec<Point2<f64>> {
    corners
        .windows(2)
        .flat_map(|w| {
            let (a, b) = (Point2::new(w[0].0, w[0].1), Point2::new(w[1].0, w[1].1));
            let steps = (b - a).norm() as usize;
            (0..steps).map(move |i| a + (b - a) * (i as f64 / steps as f64))
        })
        .collect()
}

fn polyline(points: &[Point2<f64>], closed: bool, t: Tolerance) -> Polyline {
    let mut line = Polyline::default();
    line.cut(points.iter().copied(), closed, t);
    line
}

#[test]
fn corners_split_an_open_chain() {
    let points = walk(&[(0.0, 0.0), (40.0, 0.0), (40.0, 30.0), (90.0, 30.0)]);
    assert_eq!(polyline(&points, false, T).pieces, [0..41, 40..71, 70..120]);
}

#[test]
fn a_closed_chain_gives_its_sides_wherever_it_starts() {
    let mut points = walk(&[(10.0, 10.0), (90.0, 10.0), (90.0, 60.0), (10.0, 60.0), (10.0, 10.0)]);
    for _ in 0..points.len() {
        points.rotate_left(1);
        let line = polyline(&points, true, T);
        let pieces = &line.pieces;
        let mut lengths: Vec<f64> =
            pieces.iter().map(|r| (line.point(r.end - 1) - line.point(r.start)).norm().round()).collect();
        lengths.sort_by(f64::total_cmp);
        assert_eq!(pieces.len(), 4, "{pieces:?}");
        assert!(
            lengths.iter().zip([50.0, 50.0, 80.0, 80.0]).all(|(a, b)| (a - b).abs() < 2.1),
            "{lengths:?}"
        );
    }
}

#[test]
fn splits_that_were_not_needed_are_merged() {
    // A bow 2.1 px high: too far from the chord, not from the common line.
    let bow = |i: i32| 2.1 * (1.0 - (f64::from(i) / 100.0 - 1.0).powi(2));
    let points: Vec<_> = (0..=200).map(|i| Point2::new(f64::from(i), bow(i))).collect();
    let line = polyline(&points, false, T);
    assert_eq!((line.cuts.len(), line.pieces.len()), (2, 1));
}

#[test]
fn degenerate_chains_give_no_pieces() {
    let same = [Point2::new(3.0, 3.0); 7];
    for closed in [false, true] {
        assert!(polyline(&[], closed, T).pieces.is_empty());
        assert!(polyline(&same[..1], closed, T).pieces.is_empty());
        assert!(polyline(&same, closed, T).pieces.len() <= 2);
        assert_eq!(polyline(&walk(&[(0.0, 0.0), (2.0, 0.0)]), closed, T).pieces.len(), 1);
    }
}

#[test]
fn common_points_are_counted_around_the_turn() {
    let points = walk(&[(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0), (0.0, 0.0)]);
    let n = points.len();
    let line = polyline(&points, true, T);
    let turn = |range: &Range<usize>| range.clone().map(|k| k % n).collect::<Vec<_>>();
    for a in (0..2 * n).flat_map(|start| (1..=n).map(move |len| start..start + len)) {
        for b in [0..3, n - 2..n + 3, 2 * n - 1..3 * n - 1, 5..6] {
            let plain = turn(&a).into_iter().filter(|k| turn(&b).contains(k)).count();
            assert_eq!(line.common(&a, &b), plain, "{a:?} {b:?} of {n}");
        }
    }
}
