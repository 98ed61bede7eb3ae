//! Visibility: the area from which a landmark is visible, in closed form (method 12), for a
//! landmark of any tilt: on a wall, under a ceiling, on the floor, or leaning.
//!
//! In: the landmark's place, walls and other obstacles, the camera. Out: a multipolygon on the
//! floor with area and centroid, and tests of points and uncertain poses.
//!
//! About the landmark's centre the area is a range of distances in every direction: whatever is
//! visible from a point is visible from everywhere between it and the landmark, except if it is too
//! near. Penumbrae and limits are therefore bounds over direction (`envelope`), a quarter of all
//! directions at a time, and no polygons are intersected.

mod settings;
mod obstacle;
mod envelope;
mod quarter_turn;
mod penumbra;
mod local_frame;
mod limits;
mod occlusion_edges;
mod quadrants;
mod outline;
mod area;
mod chance;
mod coverage;
mod bytes;
pub mod pointwise;

pub use area::{MAX_OBSTACLES, VisibilityMap, visibility, within_reach};
pub use bytes::{COMPUTATION, NotAnArea, inputs};
pub use chance::{DRAWS, PoseDraws};
pub use coverage::{Coverage, CoverageGap, CoverageSample, MAX_STEPS, coverage};
pub use obstacle::Obstacle;
pub use outline::Polygon;
pub(crate) use outline::distance_to_segment;
pub use settings::{PanTiltCamera, VisibilityParams, VisibilitySettings};

#[cfg(test)]
mod tests;
