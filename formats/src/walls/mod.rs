//! Walls from and to files of other programs: ROS occupancy grids, vector maps, GeoJSON, and the project's map file.

mod any;
mod geojson;
mod grid;
mod map_file;
mod outline;
mod pgm;
mod ros_grid;
mod vector_map;

pub use any::{WallFileError, read, write};
pub use geojson::GeoJsonError;
pub use grid::{CellState, GridError, OccupancyGrid};
pub use map_file::{MAX_WALLS, MapFile, MapFileError, Wall};

#[cfg(test)]
mod tests;
