//! Files of walls of every kind, told by the extension of their names.

use super::{
    evidence::Evidence,
    geojson::{self, GeoJsonError},
    grid::{GridError, OccupancyGrid},
    map_file::{MAX_WALLS, MapFile, MapFileError, Wall},
    outline,
    report::{GridImport, ImportReport},
    ros_grid::{self, Underlay},
    vector_map,
};
use crate::scan_log::ReadError;
use map::check::OutOfRange;
use std::path::Path;

/// Sides of a cell of a written grid, metres.
const RESOLUTION_M: std::ops::RangeInclusive<f64> = 0.005..=1.0;

/// Why walls cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum WallFileError {
    /// The file itself.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// An occupancy grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The picture of an occupancy grid, without what says where it lies.
    #[error("this is the picture; give its .yaml (none of the same name lies beside it)")]
    OnlyPicture,
    /// A map file.
    #[error(transparent)]
    MapFile(#[from] MapFileError),
    /// A GeoJSON file.
    #[error(transparent)]
    GeoJson(#[from] GeoJsonError),
    /// A vector map.
    #[error(transparent)]
    Vector(#[from] ReadError),
    /// Larger than a file of its kind may be.
    #[error("more than {0} bytes")]
    TooLarge(u64),
    /// More walls than are read.
    #[error("more than {MAX_WALLS} segments")]
    TooMany,
    /// A wall that cannot be.
    #[error("segment {index}: {source}")]
    Segment {
        /// From 0.
        index: usize,
        /// What is wrong.
        source: OutOfRange,
    },
    /// The cells of a grid to write.
    #[error("resolution {0} m: 0.005 to 1")]
    Resolution(f64),
    /// A file to write of a kind that is not known.
    #[error("`.{0}` is none of .yaml, .txt, .json, .geojson")]
    Extension(String),
}

/// A file that was read: its walls, and what of the file became of them.
#[derive(Debug, Clone)]
pub struct Imported {
    /// The walls; of a map file the rest of it, too.
    pub map: MapFile,
    /// What was taken.
    pub report: ImportReport,
    /// Of a grid: its picture.
    pub underlay: Option<Underlay>,
    grid: Option<GridImport>,
}

impl Imported {
    fn of(map: MapFile) -> Self {
        let length_m = map.segments.iter().map(Wall::length_m).sum();
        let report = ImportReport { segments: map.segments.len(), length_m, grid: None };
        Self { map, report, underlay: None, grid: None }
    }

    fn of_grid(grid: OccupancyGrid, underlay: Underlay, min_length_m: f64) -> Self {
        let evidence = Evidence::of(&grid);
        let segments = outline::walls(&grid, &evidence, min_length_m);
        let mut imported = Self::of(MapFile { segments, ..MapFile::default() });
        let grid = GridImport::new(grid, evidence, &imported.map.segments);
        imported.report.grid = Some(grid.report(&imported.map.segments));
        imported.underlay = Some(underlay);
        imported.grid = Some(grid);
        imported
    }

    /// Of a grid: its cells and walls, and in red the wall cells that no wall explains, as SVG.
    pub fn picture(&self) -> Option<Result<String, GridError>> {
        self.grid.as_ref().map(|grid| grid.svg(&self.map.segments))
    }
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Reads the walls of `.yaml` (`map_server`; or its `.pgm` or `.png`), `.json` (map file), `.geojson`, or else of a
/// vector map. Walls of a grid shorter than `min_length_m` are left out, but for those that alone explain some cells.
pub fn import(path: &Path, min_length_m: f64) -> Result<Imported, WallFileError> {
    let of = |segments| Imported::of(MapFile { segments, ..MapFile::default() });
    let of_grid = |yaml: &Path| -> Result<Imported, WallFileError> {
        let (grid, underlay) = ros_grid::read(yaml)?;
        Ok(Imported::of_grid(grid, underlay, min_length_m))
    };
    let imported = match extension(path).as_str() {
        "yaml" | "yml" => of_grid(path)?,
        "pgm" | "png" => of_grid(&ros_grid::yaml_beside(path).ok_or(WallFileError::OnlyPicture)?)?,
        "json" => Imported::of(MapFile::read(path)?),
        "geojson" => {
            if std::fs::metadata(path)?.len() > geojson::MAX_BYTES {
                return Err(WallFileError::TooLarge(geojson::MAX_BYTES));
            }
            of(geojson::walls(&std::fs::read_to_string(path)?)?)
        }
        _ => of(vector_map::read(path)?),
    };
    if imported.map.segments.len() > MAX_WALLS {
        return Err(WallFileError::TooMany);
    }
    for (index, wall) in imported.map.segments.iter().enumerate() {
        wall.segment().map_err(|source| WallFileError::Segment { index, source })?;
    }
    Ok(imported)
}

/// Reads the walls of a file, as [`import`] does.
pub fn read(path: &Path, min_length_m: f64) -> Result<MapFile, WallFileError> {
    Ok(import(path, min_length_m)?.map)
}

/// Writes a map as `.yaml` (with a `.pgm` beside it, cells of `resolution_m`), `.txt` (vector map), `.geojson` or
/// `.json`.
pub fn write(map: &MapFile, path: &Path, resolution_m: f64) -> Result<(), WallFileError> {
    match extension(path).as_str() {
        "yaml" | "yml" if !RESOLUTION_M.contains(&resolution_m) => {
            Err(WallFileError::Resolution(resolution_m))
        }
        "yaml" | "yml" => Ok(ros_grid::write(&OccupancyGrid::of_walls(&map.segments, resolution_m)?, path)?),
        "json" => Ok(map.write(path)?),
        "geojson" => Ok(std::fs::write(path, geojson::text(&map.segments))?),
        "txt" => Ok(std::fs::write(path, vector_map::text(&map.segments))?),
        other => Err(WallFileError::Extension(other.to_owned())),
    }
}
