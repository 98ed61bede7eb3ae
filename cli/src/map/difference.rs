//! What an import would change: which walls of a map stay, go and come. In: old and new segments.
//! Out: metres of each.

use client::api::{WallBody, WallsBody};
use serde::Serialize;
use std::{collections::HashMap, fmt};

/// A wall stays where another lies within this distance, metres.
const SAME_WALL_M: f64 = 0.2;
/// Distance between the points of a wall that are compared, metres.
const STEP_M: f64 = 0.1;
/// Side of a cell of the index, metres: no smaller than [`SAME_WALL_M`].
const CELL_M: f64 = 1.0;

/// Metres of walls, to one step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Difference {
    /// Segments now.
    pub(super) old_segments: usize,
    /// Segments then.
    pub(super) new_segments: usize,
    /// Of the old walls: what a new wall lies beside.
    pub(super) kept_m: f64,
    /// Of the old walls: what no new wall lies beside.
    pub(super) removed_m: f64,
    /// Of the new walls: what no old wall lies beside.
    pub(super) added_m: f64,
}

impl Difference {
    /// Compares what a map has with what it would have.
    pub(super) fn of(old: &WallsBody, new: &WallsBody) -> Self {
        let [(kept_m, removed_m), (_, added_m)] =
            [(old, new), (new, old)].map(|(of, beside)| Index::new(beside).shares_m(of));
        Self {
            old_segments: old.segments.len(),
            new_segments: new.segments.len(),
            kept_m,
            removed_m,
            added_m,
        }
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} -> {} segments: {:.1} m stay, {:.1} m go, {:.1} m come",
            self.old_segments, self.new_segments, self.kept_m, self.removed_m, self.added_m
        )
    }
}

/// Segments by the cells that they pass within reach of.
struct Index<'a>(HashMap<(i64, i64), Vec<&'a WallBody>>);

impl<'a> Index<'a> {
    fn new(walls: &'a WallsBody) -> Self {
        let mut cells: HashMap<(i64, i64), Vec<&WallBody>> = HashMap::new();
        for wall in &walls.segments {
            let mut last = None;
            for point in points(wall) {
                let at = cell(point);
                if last == Some(at) {
                    continue;
                }
                last = Some(at);
                // A point beside the wall is at most one cell away.
                for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
                    let near = cells.entry((at.0 + dx, at.1 + dy)).or_default();
                    if !near.last().is_some_and(|other| std::ptr::eq(*other, wall)) {
                        near.push(wall);
                    }
                }
            }
        }
        Self(cells)
    }

    /// Metres of some walls that lie beside one of these, and metres that do not.
    fn shares_m(&self, walls: &WallsBody) -> (f64, f64) {
        let mut shares = (0.0, 0.0);
        for wall in &walls.segments {
            let all: Vec<[f64; 2]> = points(wall).collect();
            let each_m = length_m(wall) / all.len() as f64;
            for point in all {
                let is_beside = self
                    .0
                    .get(&cell(point))
                    .is_some_and(|near| near.iter().any(|other| distance_m(point, other) <= SAME_WALL_M));
                *(if is_beside { &mut shares.0 } else { &mut shares.1 }) += each_m;
            }
        }
        shares
    }
}

fn length_m(wall: &WallBody) -> f64 {
    (wall.b[0] - wall.a[0]).hypot(wall.b[1] - wall.a[1])
}

/// Points in the middle of equal pieces of a wall, none longer than a step.
fn points(wall: &WallBody) -> impl Iterator<Item = [f64; 2]> {
    let count = (length_m(wall) / STEP_M).ceil().max(1.0) as usize;
    (0..count).map(move |i| {
        let along = (i as f64 + 0.5) / count as f64;
        [0, 1].map(|k| wall.a[k] + (wall.b[k] - wall.a[k]) * along)
    })
}

fn cell([x, y]: [f64; 2]) -> (i64, i64) {
    ((x / CELL_M).floor() as i64, (y / CELL_M).floor() as i64)
}

fn distance_m([x, y]: [f64; 2], wall: &WallBody) -> f64 {
    let (dx, dy) = (wall.b[0] - wall.a[0], wall.b[1] - wall.a[1]);
    let square = dx * dx + dy * dy;
    let along = if square > 0.0 { ((x - wall.a[0]) * dx + (y - wall.a[1]) * dy) / square } else { 0.0 };
    let along = along.clamp(0.0, 1.0);
    (x - wall.a[0] - along * dx).hypot(y - wall.a[1] - along * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walls(ends: &[[[f64; 2]; 2]]) -> WallsBody {
        ends.iter().copied().collect()
    }

    #[test]
    fn what_stays_goes_and_comes_is_counted_in_metres() {
        let old = walls(&[[[0.0, 0.0], [10.0, 0.0]], [[10.0, 0.0], [10.0, 4.0]]]);
        // The first wall 10 cm off and 4 m shorter, the second gone, a third at the other end.
        let new = walls(&[[[0.0, 0.1], [6.0, 0.1]], [[0.0, 8.0], [3.0, 8.0]]]);
        let d = Difference::of(&old, &new);
        // Beyond its end a wall is beside for as far as it is off: 0.17 m.
        assert!((d.kept_m - 6.17).abs() < 0.1 && (d.removed_m - 7.83).abs() < 0.1, "{d:?}");
        assert!((d.added_m - 3.0).abs() < 0.1 && d.old_segments == 2 && d.new_segments == 2, "{d:?}");
        let same = Difference::of(&old, &old);
        assert!(same.removed_m < 1e-9 && same.added_m < 1e-9 && (same.kept_m - 14.0).abs() < 1e-9);
        let first = Difference::of(&WallsBody::default(), &new);
        assert!((first.added_m - 9.0).abs() < 1e-9 && first.kept_m < 1e-9);
    }
}
