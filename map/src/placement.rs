//! A landmark's place from views of it: corner rays meet a wall, an upright rectangle is fitted (method 11).
//!
//! In: corners with covariance, the robot's pose at capture, the mounting, the walls. Out: place and size with their
//! covariance, or why the thing does not hang on a wall. Recognition is not its business: all views must be of one
//! thing.

mod params;
mod view;
mod rays;
mod wall;
mod wall_fusion;
mod ceiling;

pub use ceiling::{Ceiling, CeilingRectangle, ceiling_placement, view_on_ceiling};
pub use params::{PlacementError, PlacementParams};
pub use rays::MIN_COS_INCIDENCE;
pub use view::{MAX_VIEWS, Placement, PosedView};
pub use wall::{WallRectangle, view_on_wall};
pub use wall_fusion::placement;

#[cfg(test)]
mod tests;
