//! Small networks that move the sides of a quad to its border and classify whether it is an object.

pub mod feature_constants;
pub mod network;
pub(crate) mod network_weights;
pub(crate) mod side_lines;
pub(crate) mod band_row;
pub mod side_band;
pub mod side_features;
pub mod choose_sides;
pub mod quad_classifier;
