//! Where exactly the border of a recognised landmark is in a picture (method 13.9).
//!
//! In: the picture, the corners by its texture, the landmark's size, the camera. Out: the corners
//! of the pose that texture and edges agree on, with their joint covariance, or why there are none.
//! A shadow, the side of a canvas or the inner edge of a frame is an edge, too: each side may be at
//! any straight edge near the texture's, or at none of them, and the known size decides.

pub mod side_edges;
pub mod estimate;
mod hypotheses;
mod linear_light;

pub use estimate::{BorderError, BorderEstimate, estimate_border};
