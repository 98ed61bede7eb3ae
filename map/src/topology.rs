//! Topological navigation: places and passages as a graph, and a route through it with the next
//! landmark to look for (method 19.2).
//!
//! In: walls and visibility areas of each map, links between maps. Out: places (free floor that no
//! doorway divides) with the landmarks seen from them, passages (doorways and links) with lengths,
//! routes as legs from passage to passage.

mod floor;
mod watershed;
mod search;
mod map_topology;
mod site_topology;
mod route;
mod next_landmark;

pub use floor::{CELL_M, MAX_CELL_M, MAX_CELLS, RADIUS_M, TooLarge};
pub use map_topology::{
    Doorway, MAX_DOORWAYS, MAX_SEEN, MapTopology, NEAR_M, Place, SeenLandmark, map_topology,
};
pub use next_landmark::{LOOK_STEP_M, NextLandmark, next_landmark};
pub use route::{Leg, shortest};
pub use site_topology::{MAX_SITE_MAPS, Passage, PlaceAt, SiteTopology, TooManyMaps};
pub use watershed::{DOORWAY_M, MAX_PLACES, MIN_CORE_M2};

#[cfg(test)]
mod tests;
