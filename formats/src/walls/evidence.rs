//! Which cells of a grid are walls, and which of them a set of walls explains.
//!
//! In: a grid, segments. Out: one bit a cell.

use super::{
    grid::{CellState, OccupancyGrid},
    map_file::Wall,
};

/// A wall explains the cells whose middles lie this near, metres (or a cell's side, where that is
/// more).
pub(super) const EXPLAINED_M: f64 = 0.2;
/// A cell is grey if its probability is this much above that of cells never seen.
const GREY_MARGIN: f64 = 0.02;

/// The wall cells of a grid: the occupied ones, and grey ones, which are darker than the map's
/// unknown.
#[derive(Debug, Clone)]
pub(super) struct Evidence {
    pub(super) width: usize,
    pub(super) height: usize,
    /// By cell.
    pub(super) is_wall: Vec<bool>,
    /// Those of them within [`EXPLAINED_M`] of free floor: what a laser can see. Insides of blocks
    /// are not in it.
    pub(super) is_reachable: Vec<bool>,
    /// How many of them are not occupied.
    pub(super) grey: usize,
}

impl Evidence {
    pub(super) fn of(grid: &OccupancyGrid) -> Self {
        let unknown = unknown_probability(grid);
        let is_grey = |x: i64, y: i64| {
            let p = grid.probability(x, y);
            p.is_some_and(|p| unknown.is_none_or(|u| p > u + GREY_MARGIN))
        };
        let (width, height) = (grid.width, grid.height);
        let mut is_wall = vec![false; grid.cells.len()];
        let mut grey = 0;
        for (at, state) in grid.cells.iter().enumerate() {
            let (x, y) = ((at % width) as i64, (at / width) as i64);
            let grey_here = *state == CellState::Unknown && is_grey(x, y);
            grey += usize::from(grey_here);
            is_wall[at] = grey_here || *state == CellState::Occupied;
        }
        let is_free: Vec<bool> = grid.cells.iter().map(|c| *c == CellState::Free).collect();
        let is_near_free = near((width, height), &is_free, reach_cells(grid.resolution_m));
        let is_reachable = is_wall.iter().zip(is_near_free).map(|(wall, near)| *wall && near).collect();
        Self { width, height, is_wall, is_reachable, grey }
    }

    /// Whether a cell is a wall cell; none is outside.
    pub(super) fn at(&self, x: i64, y: i64) -> bool {
        let inside = x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64;
        inside && self.is_wall[y as usize * self.width + x as usize]
    }
}

/// [`EXPLAINED_M`] in cells.
pub(super) fn reach_cells(resolution_m: f64) -> f64 {
    (EXPLAINED_M / resolution_m).max(1.0)
}

/// The probability that the picture gives to cells never seen: the most frequent one among those
/// that are neither free nor occupied, if half of them have it. Otherwise none was left out, and
/// all of those are grey walls.
fn unknown_probability(grid: &OccupancyGrid) -> Option<f64> {
    let mut counts = [0_usize; 256];
    for (level, state) in grid.levels.iter().zip(&grid.cells) {
        counts[usize::from(*level)] += usize::from(*state == CellState::Unknown);
    }
    let all: usize = counts[..255].iter().sum();
    let (level, most) = counts[..255].iter().enumerate().max_by_key(|(_, n)| **n)?;
    (2 * most > all).then(|| level as f64 / 254.0)
}

/// Cells whose middles lie within `reach` cells of the middle of a marked one.
pub(super) fn near((width, height): (usize, usize), is_marked: &[bool], reach: f64) -> Vec<bool> {
    let most = (reach.floor() as u16).min(u16::MAX - 1);
    // Rows to the next marked cell of the same column, from below and from above.
    let mut rows = vec![most + 1; width * height];
    let mut sweep = |y: usize, before: Option<usize>| {
        for x in 0..width {
            let next = before.map_or(most + 1, |b| (rows[b * width + x] + 1).min(most + 1));
            let at = y * width + x;
            rows[at] = if is_marked[at] { 0 } else { rows[at].min(next) };
        }
    };
    for y in 0..height {
        sweep(y, y.checked_sub(1));
    }
    for y in (0..height).rev() {
        sweep(y, (y + 1 < height).then_some(y + 1));
    }
    let mut is_near = vec![false; width * height];
    for y in 0..height {
        let row = &rows[y * width..(y + 1) * width];
        for x in 0..width {
            let mut columns = x.saturating_sub(usize::from(most))..(x + usize::from(most) + 1).min(width);
            is_near[y * width + x] = columns.any(|other| {
                let (dx, dy) = (other.abs_diff(x) as f64, f64::from(row[other]));
                row[other] <= most && dx * dx + dy * dy <= reach * reach
            });
        }
    }
    is_near
}

/// Calls `mark` with every cell whose middle lies within `reach` cells of the segment from `a` to
/// `b` (in cells), some of them more than once.
pub(super) fn for_cells_beside(
    (width, height): (usize, usize),
    [a, b]: [[f64; 2]; 2],
    reach: f64,
    mut mark: impl FnMut(usize),
) {
    let along = [b[0] - a[0], b[1] - a[1]];
    // Pieces about as long as they are wide, so that the boxes around them hold little else.
    let pieces = (along[0].hypot(along[1]) / (4.0 * reach)).ceil().max(1.0);
    for k in 0..pieces as usize {
        let at = |s: f64| [a[0] + s * along[0], a[1] + s * along[1]];
        let (p, q) = (at(k as f64 / pieces), at((k + 1) as f64 / pieces));
        let bounds = |axis: usize, size: usize| {
            let low = (p[axis].min(q[axis]) - reach - 0.5).ceil().max(0.0) as usize;
            let high = (p[axis].max(q[axis]) + reach + 0.5).floor().max(0.0) as usize;
            low..high.min(size)
        };
        for y in bounds(1, height) {
            for x in bounds(0, width) {
                if distance([x as f64 + 0.5, y as f64 + 0.5], p, q) <= reach {
                    mark(y * width + x);
                }
            }
        }
    }
}

fn distance(point: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (d, e) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
    let square = d[0] * d[0] + d[1] * d[1];
    let s = if square > 0.0 { ((d[0] * e[0] + d[1] * e[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
    (e[0] - s * d[0]).hypot(e[1] - s * d[1])
}

/// Cells within [`EXPLAINED_M`] of a wall.
pub(super) fn explained(grid: &OccupancyGrid, walls: &[Wall]) -> Vec<bool> {
    let mut is_explained = vec![false; grid.cells.len()];
    for wall in walls {
        let ends = [wall.a, wall.b].map(|p| grid.to_cells(p));
        for_cells_beside((grid.width, grid.height), ends, reach_cells(grid.resolution_m), |at| {
            is_explained[at] = true;
        });
    }
    is_explained
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::pose2::Pose2;

    fn grid(width: usize, levels: &[u8]) -> OccupancyGrid {
        let mut grid = OccupancyGrid::empty((width, levels.len() / width), 0.05, Pose2::default());
        for level in levels {
            let p = 1.0 - f64::from(*level) / 255.0;
            let state = if p > 0.65 {
                CellState::Occupied
            } else if p < 0.196 {
                CellState::Free
            } else {
                CellState::Unknown
            };
            grid.push(state, Some(p));
        }
        grid
    }

    #[test]
    fn grey_cells_are_walls_where_they_are_darker_than_unknown() {
        let seen = Evidence::of(&grid(9, &[0, 100, 180, 204, 205, 205, 254, 205, 205]));
        assert_eq!(seen.is_wall, [true, true, true, false, false, false, false, false, false]);
        assert_eq!(seen.grey, 2);
        // Cells two to four from the free one lie within 0.2 m of it; black is six away.
        assert_eq!(seen.is_reachable, [false, false, true, false, false, false, false, false, false]);
        // No level stands out: the map has no unknown.
        assert_eq!(Evidence::of(&grid(4, &[100, 150, 204, 254])).grey, 3);
    }

    #[test]
    fn near_cells_are_those_of_a_search_by_hand() {
        let (width, height) = (13, 11);
        let marked: Vec<bool> = (0..width * height).map(|i| i % 37 == 5).collect();
        for reach in [1.0, 2.5, 4.0] {
            let found = near((width, height), &marked, reach);
            for (at, is_near) in found.into_iter().enumerate() {
                let to = |i: usize| {
                    ((i % width) as f64 - (at % width) as f64).hypot((i / width) as f64 - (at / width) as f64)
                };
                let by_hand = (0..width * height).any(|i| marked[i] && to(i) <= reach);
                assert_eq!(is_near, by_hand, "{at} {reach}");
            }
        }
    }

    #[test]
    fn cells_beside_a_segment_are_those_of_a_search_by_hand() {
        let (width, height) = (40, 30);
        for ends in [[[3.2, 4.1], [36.5, 22.9]], [[10.0, 29.5], [10.0, 2.0]], [[-5.0, 3.0], [60.0, -4.0]]] {
            let mut marked = vec![false; width * height];
            for_cells_beside((width, height), ends, 2.2, |at| marked[at] = true);
            for (at, is_marked) in marked.iter().enumerate() {
                let middle = [(at % width) as f64 + 0.5, (at / width) as f64 + 0.5];
                assert_eq!(*is_marked, distance(middle, ends[0], ends[1]) <= 2.2, "{at}");
            }
        }
    }
}
