//! From where a landmark can be seen: the closed-form visibility map of method 12, for a landmark of any tilt: on a wall,
//! under a ceiling, on the floor, or leaning.
//!
//! In: the landmark's place, the walls and other obstacles, the camera that is to see it. Out: a multipolygon on the floor
//! with area and centroid, and tests of points and of uncertain poses against it. Says nothing of recognition.
//!
//! Seen from the middle of the landmark the area is a range of distances in every direction: whatever is seen from a point
//! is seen from everywhere between it and the landmark, but for what is too near. So penumbrae and limits become bounds
//! over direction (`envelope`), a quarter of all directions at a time, and no polygons are cut with each other.

mod settings;
mod obstacle;
mod envelope;
mod quarter_turn;
mod penumbra;
mod local_frame;
mod limits;
mod rims;
mod quarters;
mod outline;
mod area;
mod chance;
mod coverage;
mod geojson;
pub mod pointwise;

pub use area::{MAX_OBSTACLES, VisibilityMap, visibility, within_reach};
pub use chance::{DRAWS, PoseDraws};
pub use coverage::{Coverage, CoverageGap, CoverageSample, MAX_STEPS, coverage};
pub use geojson::{Feature, Geometry, Properties};
pub use obstacle::Obstacle;
pub use outline::Polygon;
pub use settings::{PanTiltCamera, VisibilityParams, VisibilitySettings};

#[cfg(test)]
mod tests;
