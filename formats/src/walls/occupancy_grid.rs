//! ROS occupancy grids (`map_server`: a YAML file and a PGM or PNG picture): read, turned into walls, and drawn from
//! walls again.

use super::{map_file::Wall, outline, pgm};
use map::pose2::Pose2;
use std::{collections::BTreeMap, path::Path};

/// Most cells of a grid.
pub(super) const MAX_CELLS: usize = 1 << 26;
/// Longest YAML file.
const MAX_YAML_BYTES: usize = 1 << 16;
/// Border around the walls of an exported grid.
const BORDER_M: f64 = 1.0;
/// Width of the band that smoothing leaves.
const SOFT_CELLS: usize = 2;
/// Grey levels that `map_server` writes.
const OCCUPIED: u8 = 0;
const FREE: u8 = 254;
const UNKNOWN: u8 = 205;

/// Why a grid cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum GridError {
    /// The YAML file: name and reason.
    #[error("{0}: {1}")]
    Yaml(String, String),
    /// A field of it.
    #[error("{field}: {problem}")]
    Field {
        /// Which.
        field: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// The picture: name and reason.
    #[error("{0}: {1}")]
    Picture(String, String),
}

/// What a cell is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellState {
    /// An obstacle.
    Occupied,
    /// Free floor.
    Free,
    /// Never seen.
    Unknown,
}

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
}

impl OccupancyGrid {
    /// The cell in column `x` of row `y`; unknown outside.
    pub fn at(&self, x: i64, y: i64) -> CellState {
        let inside = x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64;
        if inside { self.cells[y as usize * self.width + x as usize] } else { CellState::Unknown }
    }

    /// Map coordinates (metres) of a point in cells.
    pub fn to_map(&self, x: f64, y: f64) -> [f64; 2] {
        let p = self.origin.apply(&nalgebra::Point2::new(x * self.resolution_m, y * self.resolution_m));
        [p.x, p.y]
    }

    /// Reads a YAML file and its picture.
    pub fn read(yaml: &Path) -> Result<Self, GridError> {
        let name = yaml.display().to_string();
        let text = std::fs::read_to_string(yaml).map_err(|e| GridError::Yaml(name.clone(), e.to_string()))?;
        if text.len() > MAX_YAML_BYTES {
            return Err(GridError::Yaml(name, format!("more than {MAX_YAML_BYTES} bytes")));
        }
        let fields = Fields::of(&text);
        let image = fields.get("image")?;
        let picture = pgm::read(&yaml.parent().unwrap_or(Path::new(".")).join(image))?;
        fields.grid(&picture)
    }

    /// The walls between free and occupied cells, the free side on the left.
    pub fn walls(&self, min_length_m: f64) -> Vec<Wall> {
        outline::walls(&self.hardened(), min_length_m)
    }

    /// Pictures that were smoothed have a band of unknown cells between free and occupied ones: free cells grow into it.
    fn hardened(&self) -> Self {
        let mut grid = self.clone();
        for _ in 0..SOFT_CELLS {
            let before = grid.clone();
            for y in 0..self.height as i64 {
                for x in 0..self.width as i64 {
                    let beside = [(1, 0), (-1, 0), (0, 1), (0, -1)].map(|(dx, dy)| before.at(x + dx, y + dy));
                    if before.at(x, y) == CellState::Unknown && beside.contains(&CellState::Free) {
                        grid.set(x, y, CellState::Free);
                    }
                }
            }
        }
        grid
    }

    /// Draws walls: occupied along them, free where the free sides reach without crossing one, unknown elsewhere.
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
        let mut grid = Self { width: size[0], height: size[1], resolution_m, origin, cells };
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

    fn inside(&self, x: i64, y: i64) -> bool {
        x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64
    }

    fn set(&mut self, x: i64, y: i64, cell: CellState) {
        if self.inside(x, y) {
            self.cells[y as usize * self.width + x as usize] = cell;
        }
    }

    /// Writes `NAME.yaml` and `NAME.pgm`.
    pub fn write(&self, yaml: &Path) -> std::io::Result<()> {
        let picture = yaml.with_extension("pgm");
        let rows = (0..self.height).rev().flat_map(|y| &self.cells[y * self.width..(y + 1) * self.width]);
        let levels: Vec<u8> = rows
            .map(|c| match c {
                CellState::Occupied => OCCUPIED,
                CellState::Free => FREE,
                CellState::Unknown => UNKNOWN,
            })
            .collect();
        pgm::write(&picture, self.width, self.height, &levels)?;
        let name = picture.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let Pose2 { x_m, y_m, theta_rad } = self.origin;
        let text = format!(
            "image: {name}\nmode: trinary\nresolution: {}\norigin: [{x_m}, {y_m}, {theta_rad}]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
            self.resolution_m
        );
        std::fs::write(yaml, text)?;
        Ok(())
    }
}

/// The `name: value` lines of a YAML file; no more of YAML is needed or read.
struct Fields(BTreeMap<String, String>);

impl Fields {
    fn of(text: &str) -> Self {
        let line = |l: &str| {
            let l = l.split(" #").next().unwrap_or("").trim();
            let (name, value) = l.split_once(':')?;
            let value = value.trim().trim_matches(['"', '\'']);
            Some((name.trim().to_owned(), value.to_owned()))
        };
        Self(text.lines().filter(|l| !l.trim_start().starts_with('#')).filter_map(line).collect())
    }

    fn get(&self, field: &'static str) -> Result<&str, GridError> {
        let missing = || GridError::Field { field, problem: "missing".to_owned() };
        self.0.get(field).map(String::as_str).filter(|v| !v.is_empty()).ok_or_else(missing)
    }

    fn number(&self, field: &'static str, low: f64, high: f64) -> Result<f64, GridError> {
        let text = self.get(field)?;
        let bad =
            || GridError::Field { field, problem: format!("`{text}` is no number from {low} to {high}") };
        text.parse::<f64>().ok().filter(|v| (low..=high).contains(v)).ok_or_else(bad)
    }

    fn origin(&self) -> Result<Pose2, GridError> {
        let text = self.get("origin")?;
        let bad = |problem: String| GridError::Field { field: "origin", problem };
        let numbers: Option<Vec<f64>> =
            text.trim_matches(['[', ']']).split(',').map(|v| v.trim().parse().ok()).collect();
        let Some([x, y, theta]) = numbers.as_deref() else {
            return Err(bad(format!("`{text}` is not [x, y, yaw]")));
        };
        let pose = Pose2::new(*x, *y, *theta);
        pose.check().map_err(|e| bad(e.to_string()))?;
        Ok(pose)
    }

    fn grid(&self, picture: &pgm::Grey) -> Result<OccupancyGrid, GridError> {
        if let Some(mode) = self.0.get("mode").filter(|m| !["trinary", "scale"].contains(&m.as_str())) {
            let problem = format!("`{mode}`: trinary or scale");
            return Err(GridError::Field { field: "mode", problem });
        }
        let resolution_m = self.number("resolution", 1e-3, 10.0)?;
        let negate = self.number("negate", 0.0, 1.0)? > 0.5;
        let occupied = self.number("occupied_thresh", 0.0, 1.0)?;
        let free = self.number("free_thresh", 0.0, 1.0)?;
        let cell = |level: &Option<u8>| {
            let Some(level) = level else { return CellState::Unknown };
            let share = f64::from(*level) / 255.0;
            let p = if negate { share } else { 1.0 - share };
            if p > occupied {
                CellState::Occupied
            } else if p < free {
                CellState::Free
            } else {
                CellState::Unknown
            }
        };
        let rows = (0..picture.height).rev();
        let cells = rows
            .flat_map(|y| &picture.levels[y * picture.width..(y + 1) * picture.width])
            .map(cell)
            .collect();
        Ok(OccupancyGrid {
            width: picture.width,
            height: picture.height,
            resolution_m,
            origin: self.origin()?,
            cells,
        })
    }
}
