//! Walls from and to files of other programs: ROS occupancy grids, vector maps, GeoJSON, and the project's map file.

mod any;
mod border;
mod evidence;
mod geojson;
mod grid;
mod map_file;
mod outline;
mod picture;
mod report;
mod ros_grid;
mod ros_yaml;
mod vector_map;

pub use any::{Imported, WallFileError, import, read, write};
pub use geojson::GeoJsonError;
pub use grid::{CellState, GridError, OccupancyGrid};
pub use map_file::{MAX_WALLS, MapFile, MapFileError, Wall};
pub use report::{GridReport, ImportReport, MIN_EXPLAINED};
pub use ros_grid::Underlay;

#[cfg(test)]
mod tests;
