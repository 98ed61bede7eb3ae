//! Walls from and to files of other programs: ROS occupancy grids, vector maps, GeoJSON, and the project's map file.

mod any;
mod geojson;
mod map_file;
mod occupancy_grid;
mod outline;
mod pgm;
mod vector_map;

pub use any::{WallFileError, read, write};
pub use geojson::GeoJsonError;
pub use map_file::{MAX_WALLS, MapFile, MapFileError, Wall};
pub use occupancy_grid::{CellState, GridError, OccupancyGrid};

#[cfg(test)]
mod tests;
