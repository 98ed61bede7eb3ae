//! Occupancy grids, and drawing walls into one.

use super::map_file::Wall;
use map::pose2::Pose2;

/// Most cells of a grid.
pub(super) const MAX_CELLS: usize = 1 << 26;
/// Border around the walls of an exported grid.
const BORDER_M: f64 = 1.0;

/// Why a grid cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum GridError {
    /// The YAML file itself.
    #[error("{problem}")]
    Yaml {
        /// Why it cannot be used.
        problem: String,
    },
    /// A field of it.
    #[error("{field}: {problem}")]
    Field {
        /// Which.
        field: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// The picture.
    #[error("{name}: {problem}")]
    Picture {
        /// Its file.
        name: String,
        /// Why it cannot be used.
        problem: String,
    },
}

/// What a cell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellState {
    /// An obstacle.
    Occupied,
    /// Free floor.
    Free,
    /// Never seen, or neither occupied nor free by the thresholds.
    Unknown,
}

/// Probabilities are kept as whole multiples of one over this.
const STEPS: f64 = 254.0;
/// The level of a cell without a probability.
const NO_PROBABILITY: u8 = 255;

/// A grid; cell (0, 0) is the lower left one.
#[derive(Debug, Clone, PartialEq)]
pub struct OccupancyGrid {
    /// Cells in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// `map_from_grid`: pose of the lower left corner of cell (0, 0).
    pub origin: Pose2,
    /// Row by row, the lowest first.
    pub cells: Vec<CellState>,
    /// Probability of an obstacle of every cell, in [`STEPS`].
    pub(super) levels: Vec<u8>,
}

impl OccupancyGrid {
    /// The cell in column `x` of row `y`; unknown outside.
    pub fn at(&self, x: i64, y: i64) -> CellState {
        if self.inside(x, y) { self.cells[y as usize * self.width + x as usize] } else { CellState::Unknown }
    }

    /// An empty grid of the given size, to be filled by [`push`](Self::push).
    pub(super) fn empty((width, height): (usize, usize), resolution_m: f64, origin: Pose2) -> Self {
        let (cells, levels) = (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
        Self { width, height, resolution_m, origin, cells, levels }
    }

    /// Adds the next cell of the lowest row that is not full.
    pub(super) fn push(&mut self, state: CellState, probability: Option<f64>) {
        self.cells.push(state);
        self.levels.push(probability.map_or(NO_PROBABILITY, |p| (p.clamp(0.0, 1.0) * STEPS).round() as u8));
    }

    /// Probability of an obstacle in column `x` of row `y`, to 1/254, as the picture has it,
    /// whatever the thresholds; `None` outside and where the picture says nothing.
    pub fn probability(&self, x: i64, y: i64) -> Option<f64> {
        let level = self.inside(x, y).then(|| self.levels[y as usize * self.width + x as usize]);
        level.filter(|l| *l != NO_PROBABILITY).map(|l| f64::from(l) / STEPS)
    }

    /// Map coordinates (metres) of a point in cells.
    pub fn to_map(&self, x: f64, y: f64) -> [f64; 2] {
        let p = self.origin.apply(&nalgebra::Point2::new(x * self.resolution_m, y * self.resolution_m));
        [p.x, p.y]
    }

    /// Cells of a point in map coordinates (metres); the inverse of [`to_map`](Self::to_map).
    pub(super) fn to_cells(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let p = self.origin.inverse().apply(&nalgebra::Point2::new(x, y));
        [p.x / self.resolution_m, p.y / self.resolution_m]
    }

    /// Draws walls: occupied along them, free where the free sides reach without crossing one,
    /// unknown elsewhere.
    pub fn of_walls(walls: &[Wall], resolution_m: f64) -> Result<Self, GridError> {
        let ends = || walls.iter().flat_map(|w| [w.a, w.b]);
        if walls.is_empty() {
            return Err(GridError::Field { field: "segments", problem: "none".to_owned() });
        }
        let bound = |k: usize, f: fn(f64, f64) -> f64, start| ends().map(|p| p[k]).fold(start, f);
        let low = [0, 1].map(|k| bound(k, f64::min, f64::INFINITY) - BORDER_M);
        let high = [0, 1].map(|k| bound(k, f64::max, f64::NEG_INFINITY) + BORDER_M);
        let size = [0, 1].map(|k| ((high[k] - low[k]) / resolution_m).ceil().max(1.0) as usize);
        if size[0].saturating_mul(size[1]) > MAX_CELLS {
            let problem = format!("{} x {} cells are more than {MAX_CELLS}", size[0], size[1]);
            return Err(GridError::Field { field: "resolution", problem });
        }
        let origin = Pose2::new(low[0], low[1], 0.0);
        let cells = vec![CellState::Unknown; size[0] * size[1]];
        let levels = vec![NO_PROBABILITY; cells.len()];
        let mut grid = Self { width: size[0], height: size[1], resolution_m, origin, cells, levels };
        let cell = |p: [f64; 2]| [0, 1].map(|k| ((p[k] - low[k]) / resolution_m).floor() as i64);
        let mut open = Vec::new();
        for wall in walls {
            let d = [wall.b[0] - wall.a[0], wall.b[1] - wall.a[1]];
            let steps = (d[0].hypot(d[1]) / (0.5 * resolution_m)).ceil().max(1.0);
            for k in 0..=steps as usize {
                let s = k as f64 / steps;
                let [x, y] = cell([wall.a[0] + s * d[0], wall.a[1] + s * d[1]]);
                grid.set(x, y, CellState::Occupied);
            }
            let length = d[0].hypot(d[1]).max(1e-9);
            let left = [-d[1] / length * 2.5 * resolution_m, d[0] / length * 2.5 * resolution_m];
            open.push(cell([
                0.5 * (wall.a[0] + wall.b[0]) + left[0],
                0.5 * (wall.a[1] + wall.b[1]) + left[1],
            ]));
        }
        while let Some([x, y]) = open.pop() {
            if grid.inside(x, y) && grid.at(x, y) == CellState::Unknown {
                grid.set(x, y, CellState::Free);
                open.extend([[x + 1, y], [x - 1, y], [x, y + 1], [x, y - 1]]);
            }
        }
        Ok(grid)
    }

    pub(super) fn inside(&self, x: i64, y: i64) -> bool {
        x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64
    }

    pub(super) fn set(&mut self, x: i64, y: i64, cell: CellState) {
        if self.inside(x, y) {
            let at = y as usize * self.width + x as usize;
            self.cells[at] = cell;
            self.levels[at] = match cell {
                CellState::Occupied => STEPS as u8,
                CellState::Free => 0,
                CellState::Unknown => NO_PROBABILITY,
            };
        }
    }
}
