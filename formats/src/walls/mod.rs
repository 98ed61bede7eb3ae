//! Walls from and to files of other programs: ROS occupancy grids, vector maps, GeoJSON, and the
//! project's map file; and from SVG floor plans.

mod any;
mod border;
mod evidence;
mod floor_plan;
mod geojson;
mod grid;
mod map_file;
mod outline;
mod picture;
mod report;
mod ros_grid;
mod ros_yaml;
mod vector_map;

pub use any::{ImportOptions, Imported, WallFileError, import, import_bytes, read, write};
pub use floor_plan::PlanError;
pub use geojson::GeoJsonError;
pub use grid::{CellState, GridError, OccupancyGrid};
pub use map_file::{MAX_WALLS, MapFile, MapFileError, Wall};
pub use report::{GridReport, ImportReport, MIN_EXPLAINED};
pub use ros_grid::Underlay;

#[cfg(test)]
mod tests;
