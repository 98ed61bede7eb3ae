//! Placement: a landmark's place from posed views of it. Corner rays are intersected with a wall
//! and an upright rectangle is fitted (method 11).
//!
//! In: corners with covariance, the robot's pose at capture, extrinsics, walls. Out: place and size
//! with covariance, or why the object does not hang on a wall. All views must be of one object.

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
