//! The border of free floor in a grid, as closed chains of edges between cells.
//!
//! In: a grid and its wall cells. Out: for each edge where it lies, where the wall behind it
//! begins, and which way the free side is.

use super::{
    evidence::Evidence,
    grid::{CellState, OccupancyGrid},
};
use nalgebra::{Point2, Vector2};

/// A wall may begin this far behind the free floor: pictures that were smoothed have a band
/// between.
const BEHIND_M: f64 = 0.1;
/// The same in cells, at least.
const BEHIND_CELLS: f64 = 2.0;
/// East, north, west, south.
const STEPS: [(i64, i64); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// One edge between a free cell, on its left, and one that is not.
#[derive(Debug, Clone, Copy)]
pub(super) struct BorderEdge {
    /// Its middle, in cells; where a wall is, moved to the face of the wall's first cell.
    pub(super) middle: Point2<f64>,
    /// Whether a wall cell lies behind it.
    pub(super) has_wall: bool,
}

/// The chains of a grid. The free side is on the left all along, and each chain ends where it
/// begins.
pub(super) fn chains(grid: &OccupancyGrid, evidence: &Evidence) -> Vec<Vec<BorderEdge>> {
    let mut border = Border::of(grid);
    let depth = (BEHIND_M / grid.resolution_m).max(BEHIND_CELLS).floor() as usize;
    let mut chains = Vec::new();
    for start in 0..border.leaving.len() {
        while border.leaving[start] != 0 {
            let edges = border.chain(start);
            let look = |(corner, direction)| edge(grid, evidence, depth, corner, direction);
            chains.push(edges.into_iter().map(look).collect());
        }
    }
    chains
}

/// Directed edges between cells: at every corner a bit for each direction that leaves it.
struct Border {
    width: usize,
    leaving: Vec<u8>,
}

impl Border {
    fn of(grid: &OccupancyGrid) -> Self {
        let width = grid.width + 1;
        let mut leaving = vec![0; width * (grid.height + 1)];
        for y in 0..grid.height as i64 {
            for x in 0..grid.width as i64 {
                if grid.at(x, y) != CellState::Free {
                    continue;
                }
                // South, east, north, west of the cell, which is on the left of each.
                let sides = [
                    ((0, -1), (x, y)),
                    ((1, 0), (x + 1, y)),
                    ((0, 1), (x + 1, y + 1)),
                    ((-1, 0), (x, y + 1)),
                ];
                for (direction, ((dx, dy), (cx, cy))) in sides.into_iter().enumerate() {
                    if grid.at(x + dx, y + dy) != CellState::Free {
                        leaving[cy as usize * width + cx as usize] |= 1 << direction;
                    }
                }
            }
        }
        Self { width, leaving }
    }

    /// Takes the chain of edges that starts at a corner: corner and direction of each.
    fn chain(&mut self, start: usize) -> Vec<((i64, i64), usize)> {
        let width = self.width as i64;
        let (mut at, mut heading) = (start, 0);
        let mut chain = Vec::new();
        loop {
            // To the left first: cells that touch at a corner are one wall, and the border stays on
            // its side.
            let next = [1, 0, 3, 2]
                .map(|turn| (heading + turn) % 4)
                .into_iter()
                .find(|d| self.leaving[at] & (1 << d) != 0);
            let Some(direction) = next else { break chain };
            self.leaving[at] &= !(1 << direction);
            chain.push((((at % self.width) as i64, (at / self.width) as i64), direction));
            let (dx, dy) = STEPS[direction];
            at = (at as i64 + dx + dy * width) as usize;
            heading = direction;
        }
    }
}

fn edge(
    grid: &OccupancyGrid,
    evidence: &Evidence,
    depth: usize,
    (x, y): (i64, i64),
    direction: usize,
) -> BorderEdge {
    let (dx, dy) = STEPS[direction];
    let middle = Point2::new(x as f64 + 0.5 * dx as f64, y as f64 + 0.5 * dy as f64);
    let right = Vector2::new(dy as f64, -dx as f64);
    for steps in 0..=depth {
        let cell = middle + (steps as f64 + 0.5) * right;
        let (cx, cy) = (cell.x.floor() as i64, cell.y.floor() as i64);
        if evidence.at(cx, cy) {
            return BorderEdge { middle: middle + steps as f64 * right, has_wall: true };
        }
        if grid.at(cx, cy) == CellState::Free {
            break;
        }
    }
    BorderEdge { middle, has_wall: false }
}
