//! Files of walls of every format, chosen by the extension of their names.

use super::{
    geojson::{self, GeoJsonError},
    grid::{GridError, OccupancyGrid},
    map_file::{MAX_WALLS, MapFile, MapFileError},
    outline, ros_grid, vector_map,
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
    /// A wall out of range.
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
    /// A file to write with an unknown extension.
    #[error("`.{0}` is none of .yaml, .txt, .json")]
    Extension(String),
}

fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Reads the walls of `.yaml` (`map_server`), `.json` (map file), `.geojson`, or else of a vector map. Walls of a
/// grid shorter than `min_length_m` are left out.
pub fn read(path: &Path, min_length_m: f64) -> Result<MapFile, WallFileError> {
    let of = |segments| MapFile { segments, ..MapFile::default() };
    let map = match extension(path).as_str() {
        "yaml" | "yml" => of(outline::walls(&ros_grid::read(path)?, min_length_m)),
        "json" => MapFile::read(path)?,
        "geojson" => {
            if std::fs::metadata(path)?.len() > geojson::MAX_BYTES {
                return Err(WallFileError::TooLarge(geojson::MAX_BYTES));
            }
            of(geojson::walls(&std::fs::read_to_string(path)?)?)
        }
        _ => of(vector_map::read(path)?),
    };
    if map.segments.len() > MAX_WALLS {
        return Err(WallFileError::TooMany);
    }
    for (index, wall) in map.segments.iter().enumerate() {
        wall.segment().map_err(|source| WallFileError::Segment { index, source })?;
    }
    Ok(map)
}

/// Writes a map as `.yaml` (with a `.pgm` beside it, cells of `resolution_m`), `.txt` (vector map) or `.json`.
pub fn write(map: &MapFile, path: &Path, resolution_m: f64) -> Result<(), WallFileError> {
    match extension(path).as_str() {
        "yaml" | "yml" if !RESOLUTION_M.contains(&resolution_m) => {
            Err(WallFileError::Resolution(resolution_m))
        }
        "yaml" | "yml" => Ok(ros_grid::write(&OccupancyGrid::of_walls(&map.segments, resolution_m)?, path)?),
        "json" => Ok(map.write(path)?),
        "txt" => Ok(std::fs::write(path, vector_map::text(&map.segments))?),
        other => Err(WallFileError::Extension(other.to_owned())),
    }
}
