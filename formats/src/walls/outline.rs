//! From an occupancy grid to straight walls: the border between occupied and free cells is followed, cut where it
//! bends, and every piece is fitted with a line.

use super::{
    grid::{CellState, OccupancyGrid},
    map_file::Wall,
};
use nalgebra::{Matrix2, Point2, Vector2};

/// Distance from the chord at which a corner cuts the border, in cells: a stair of cells is a straight wall.
const CUT_CELLS: f64 = 1.2;

/// Width of the band of unknown cells that smoothing leaves.
const SOFT_CELLS: usize = 2;
/// East, north, west, south.
const STEPS: [(i64, i64); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Directed edges between cells, the free side on the left: at every corner a bit for each direction that leaves it.
struct Border {
    width: usize,
    leaving: Vec<u8>,
    arriving: Vec<u8>,
}

impl Border {
    fn of(grid: &OccupancyGrid) -> Self {
        let (width, height) = (grid.width + 1, grid.height + 1);
        let mut border = Self { width, leaving: vec![0; width * height], arriving: vec![0; width * height] };
        for y in 0..grid.height as i64 {
            for x in 0..grid.width as i64 {
                if grid.at(x, y) != CellState::Occupied {
                    continue;
                }
                // Free to the north, west, south, east: along that side with the free cell on the left.
                let sides = [
                    ((0, 1), (x, y + 1), 0),
                    ((-1, 0), (x, y), 1),
                    ((0, -1), (x + 1, y), 2),
                    ((1, 0), (x + 1, y + 1), 3),
                ];
                for ((dx, dy), (cx, cy), direction) in sides {
                    if grid.at(x + dx, y + dy) == CellState::Free {
                        let (sx, sy) = STEPS[direction];
                        border.leaving[cy as usize * width + cx as usize] |= 1 << direction;
                        border.arriving[(cy + sy) as usize * width + (cx + sx) as usize] |= 1 << direction;
                    }
                }
            }
        }
        border
    }

    /// Takes the chain of edges that starts at a corner.
    fn chain(&mut self, start: usize) -> Vec<Point2<f64>> {
        let point = |at: usize| Point2::new((at % self.width) as f64, (at / self.width) as f64);
        let (mut at, mut heading) = (start, 0);
        let mut chain = vec![point(at)];
        let width = self.width as i64;
        loop {
            // Left first: cells that touch at a corner are one wall.
            let next = [1, 0, 3, 2]
                .map(|turn| (heading + turn) % 4)
                .into_iter()
                .find(|d| self.leaving[at] & (1 << d) != 0);
            let Some(direction) = next else { break };
            self.leaving[at] &= !(1 << direction);
            let (dx, dy) = STEPS[direction];
            at = (at as i64 + dx + dy * width) as usize;
            heading = direction;
            chain.push(Point2::new((at % self.width) as f64, (at / self.width) as f64));
        }
        chain
    }
}

/// The walls between free and occupied cells, the free side on the left; pieces shorter than `min_length_m` are
/// left out.
pub(super) fn walls(grid: &OccupancyGrid, min_length_m: f64) -> Vec<Wall> {
    let grid = &hardened(grid);
    let mut border = Border::of(grid);
    let mut walls = Vec::new();
    // Ends of open chains first; the rest are closed chains.
    for open in [true, false] {
        for at in 0..border.leaving.len() {
            let is_end = border.leaving[at].count_ones() > border.arriving[at].count_ones();
            while border.leaving[at] != 0 && (is_end || !open) {
                let chain = border.chain(at);
                walls.extend(pieces(&chain).into_iter().filter_map(|(i, j)| {
                    let [a, b] = fitted(&chain[i..=j])?;
                    let wall = Wall::between(grid.to_map(a.x, a.y), grid.to_map(b.x, b.y));
                    ((b - a).norm() * grid.resolution_m >= min_length_m).then_some(wall)
                }));
            }
        }
    }
    walls
}

/// Index ranges whose corners lie near their chord.
fn pieces(chain: &[Point2<f64>]) -> Vec<(usize, usize)> {
    let (mut done, mut open) = (Vec::new(), vec![(0, chain.len() - 1)]);
    while let Some((i, j)) = open.pop() {
        let chord = chain[j] - chain[i];
        let length = chord.norm();
        let off = |k: usize| {
            let d = chain[k] - chain[i];
            if length > 0.0 { (chord.perp(&d) / length).abs() } else { d.norm() }
        };
        let farthest = (i + 1..j).max_by(|a, b| off(*a).total_cmp(&off(*b)));
        match farthest {
            Some(k) if off(k) > CUT_CELLS => open.extend([(k, j), (i, k)]),
            _ => done.push((i, j)),
        }
    }
    done
}

/// The fitted line through the middles of the edges; both ends on it.
fn fitted(corners: &[Point2<f64>]) -> Option<[Point2<f64>; 2]> {
    let (first, last) = (corners.first()?, corners.last()?);
    let middles: Vec<Vector2<f64>> = corners.windows(2).map(|p| 0.5 * (p[0].coords + p[1].coords)).collect();
    if middles.len() < 2 || (last - first).norm() < 1e-9 {
        return None;
    }
    let centre = middles.iter().sum::<Vector2<f64>>() / middles.len() as f64;
    let scatter: Matrix2<f64> = middles.iter().map(|m| (m - centre) * (m - centre).transpose()).sum();
    let angle = 0.5 * (2.0 * scatter[(0, 1)]).atan2(scatter[(0, 0)] - scatter[(1, 1)]);
    let along = Vector2::new(angle.cos(), angle.sin());
    let foot = |p: &Point2<f64>| Point2::from(centre + along * along.dot(&(p.coords - centre)));
    Some([foot(first), foot(last)])
}

/// Grows free cells into the band of unknown cells that smoothed pictures have along occupied ones.
fn hardened(grid: &OccupancyGrid) -> OccupancyGrid {
    let mut grid = grid.clone();
    for _ in 0..SOFT_CELLS {
        let before = grid.clone();
        for y in 0..grid.height as i64 {
            for x in 0..grid.width as i64 {
                let beside = [(1, 0), (-1, 0), (0, 1), (0, -1)].map(|(dx, dy)| before.at(x + dx, y + dy));
                if before.at(x, y) == CellState::Unknown && beside.contains(&CellState::Free) {
                    grid.set(x, y, CellState::Free);
                }
            }
        }
    }
    grid
}
