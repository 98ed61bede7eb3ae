//! Clearances and shortest paths against brute force; no wall between neighbouring free cells.

use super::*;
use crate::topology::floor::Floor;
use vision::random::Random;

fn below(random: &mut Random, end: usize) -> usize {
    (random.unit() * end as f64) as usize
}

/// All simple paths from a node, by depth.
fn brute(edges: &[([usize; 2], f64)], at: usize, to: usize, visited: &mut Vec<usize>) -> f64 {
    if at == to {
        return 0.0;
    }
    visited.push(at);
    let mut best = f64::INFINITY;
    for ([a, b], length_m) in edges {
        let Some(next) = (*a == at).then_some(*b).or_else(|| (*b == at).then_some(*a)) else { continue };
        if !visited.contains(&next) {
            best = best.min(length_m + brute(edges, next, to, visited));
        }
    }
    visited.pop();
    best
}

#[test]
fn routes_are_as_short_as_the_shortest_of_all_simple_paths() {
    let mut random = Random::new(31);
    let mut found = 0;
    for _ in 0..300 {
        let nodes = 2 + below(&mut random, 6);
        let count = below(&mut random, 12);
        let edges: Vec<([usize; 2], f64)> = (0..count)
            .map(|_| ([below(&mut random, nodes), below(&mut random, nodes)], random.range(0.0, 9.0)))
            .collect();
        let best = brute(&edges, 0, nodes - 1, &mut Vec::new());
        let Some(path) = shortest(nodes, &edges, 0, nodes - 1) else {
            assert!(best.is_infinite());
            continue;
        };
        found += 1;
        let mut at = 0;
        for edge in &path {
            let [a, b] = edges[*edge].0;
            assert!(a == at || b == at, "{path:?} {edges:?}");
            at = if a == at { b } else { a };
        }
        let length_m: f64 = path.iter().map(|edge| edges[*edge].1).sum();
        assert!(at == nodes - 1 && (length_m - best).abs() < 1e-9, "{length_m} {best}");
    }
    assert!(found > 100, "{found}");
    assert_eq!(shortest(2, &[([0, 1], f64::INFINITY)], 0, 1), None);
    assert_eq!(shortest(1, &[], 0, 0), Some(vec![]));
    assert_eq!((shortest(1, &[], 1, 0), shortest(1, &[], 0, 1)), (None, None));
}

fn random_walls(random: &mut Random, count: usize, side_m: f64) -> Vec<LaserSegment> {
    let end = |random: &mut Random| random.range(0.0, side_m);
    let wall = |random: &mut Random| [end(random), end(random), end(random), end(random)];
    (0..count).map(|_| LaserSegment::by_hand(&wall(random)).unwrap()).collect()
}

fn distance_m(p: &Point2<f64>, wall: &LaserSegment) -> f64 {
    // By its foot, and by its ends.
    let along = (wall.b - wall.a).normalize();
    let t = along.dot(&(p - wall.a));
    let foot = (p - (wall.a + along * t)).norm();
    let is_beside = (0.0..=(wall.b - wall.a).norm()).contains(&t);
    if is_beside { foot } else { (p - wall.a).norm().min((p - wall.b).norm()) }
}

fn side_of(wall: &LaserSegment, p: &Point2<f64>) -> bool {
    (wall.b - wall.a).perp(&(p - wall.a)) > 0.0
}

fn crosses(wall: &LaserSegment, p: &Point2<f64>, q: &Point2<f64>) -> bool {
    let step = LaserSegment { a: *p, b: *q, ..wall.clone() };
    side_of(wall, p) != side_of(wall, q) && side_of(&step, &wall.a) != side_of(&step, &wall.b)
}

#[test]
fn clearances_are_distances_and_no_step_between_free_cells_crosses_a_wall() {
    let mut random = Random::new(32);
    // Cells of 0.1 m, and of the largest side.
    for (side_m, count, cell_m) in [(6.0, 5, CELL_M), (9.0, 8, CELL_M), (152.0, 40, MAX_CELL_M)] {
        let mut walls = random_walls(&mut random, count, side_m);
        walls.push(LaserSegment::by_hand(&[0.0, 0.0, side_m, side_m]).unwrap());
        let floor = Floor::new(&walls, &[]).unwrap();
        assert!((floor.cell_m - cell_m).abs() < 1e-9, "{}", floor.cell_m);
        let mut steps = 0;
        for cell in floor.every(if side_m > 100.0 { 3 } else { 1 }) {
            let point = floor.centre(cell);
            let nearest = walls.iter().map(|wall| distance_m(&point, wall)).fold(1.0, f64::min);
            assert!((floor.clearance_m[cell] - nearest).abs() < 1e-9, "{point} {nearest}");
            assert_eq!(floor.cell(&point), Some(cell));
            for (next, cells) in floor.around(cell).filter(|(next, _)| floor.is_free(*next)) {
                let other = floor.centre(next);
                assert!(((other - point).norm() - cells * floor.cell_m).abs() < 1e-9);
                let is_cut = || walls.iter().any(|wall| crosses(wall, &point, &other));
                assert!(!floor.is_free(cell) || !is_cut(), "{point} {other}");
                steps += 1;
            }
        }
        assert!(steps > 1000, "{steps}");
    }
}

/// Round the end of a wall: against a string drawn tight [`RADIUS_M`] away from it.
#[test]
fn a_path_is_nearly_as_short_as_a_tight_string() {
    let walls = [
        [0.0, 0.0, 8.0, 0.0],
        [8.0, 0.0, 8.0, 6.0],
        [8.0, 6.0, 0.0, 6.0],
        [0.0, 6.0, 0.0, 0.0],
        [4.0, 0.0, 4.0, 3.0],
    ];
    let made = Plan::new(&walls, &[[2.0, 0.001, FRAC_PI_2]]).topology();
    assert_eq!(made.places.len(), 1, "the way round is wide");
    let [from, to] = [Point2::new(2.0, 1.0), Point2::new(6.0, 1.0)];
    let (path, length_m) = made.path(0, &from, &to).unwrap();
    // Not shorter than the two tangents to the circle about the wall's end, not longer than by way
    // of a cell beyond it.
    let (away_m, beyond_m) = (8.0_f64.sqrt(), 2.0 + RADIUS_M + 1.5 * CELL_M);
    let tangent_m = (away_m * away_m - RADIUS_M * RADIUS_M).sqrt();
    assert!(length_m > 2.0 * tangent_m && length_m < 2.0 * beyond_m.hypot(2.0), "{length_m}");
    assert!(path.windows(2).all(|w| walls.iter().all(|ends| {
        let wall = LaserSegment::by_hand(ends).unwrap();
        !crosses(&wall, &w[0], &w[1])
    })));
    assert_eq!(made.path(1, &from, &to), None, "there is no such place");
    assert_eq!(made.path(0, &from, &Point2::new(60.0, 1.0)), None);
}
