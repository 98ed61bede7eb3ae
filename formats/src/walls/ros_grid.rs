//! ROS occupancy grids (`map_server`): a YAML file and a PGM or PNG picture beside it.

use super::{
    grid::{CellState, GridError, OccupancyGrid},
    pgm,
};
use map::pose2::Pose2;
use std::{collections::BTreeMap, path::Path};

/// Longest YAML file.
const MAX_YAML_BYTES: usize = 1 << 16;
/// Grey levels that `map_server` writes.
const OCCUPIED: u8 = 0;
const FREE: u8 = 254;
const UNKNOWN: u8 = 205;

/// Reads a YAML file and its picture.
pub(super) fn read(yaml: &Path) -> Result<OccupancyGrid, GridError> {
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

/// Writes `NAME.yaml` and `NAME.pgm`.
pub(super) fn write(grid: &OccupancyGrid, yaml: &Path) -> std::io::Result<()> {
    let picture = yaml.with_extension("pgm");
    let rows = (0..grid.height).rev().flat_map(|y| &grid.cells[y * grid.width..(y + 1) * grid.width]);
    let levels: Vec<u8> = rows
        .map(|c| match c {
            CellState::Occupied => OCCUPIED,
            CellState::Free => FREE,
            CellState::Unknown => UNKNOWN,
        })
        .collect();
    pgm::write(&picture, grid.width, grid.height, &levels)?;
    let name = picture.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let Pose2 { x_m, y_m, theta_rad } = grid.origin;
    let text = format!(
        "image: {name}\nmode: trinary\nresolution: {}\norigin: [{x_m}, {y_m}, {theta_rad}]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
        grid.resolution_m
    );
    std::fs::write(yaml, text)?;
    Ok(())
}

/// The `name: value` lines of a YAML file; other YAML is ignored.
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
