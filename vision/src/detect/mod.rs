//! From grey image to quads (method 1 to 3). The modules are listed in the order of the data flow.

pub mod quad;
pub mod params;
pub mod pyramid;
pub mod edges;
pub mod segments;
pub mod edge_support;
pub mod proposals;
pub mod refine;
pub mod border_model;
pub mod suppression;
pub mod edge_buffers;
pub mod detector;
#[cfg(test)]
pub(crate) mod tests;

pub use detector::{MAX_QUADS, detect, detect_for_recognition, detect_with, scored_quads};
pub use edge_buffers::{DetectBuffers, MAX_SCALES};
pub use params::{DetectParams, Grouping, Nested, QuadParams};
pub use quad::{BORDER_SIGMA_PX, Quad, QuadKind};
