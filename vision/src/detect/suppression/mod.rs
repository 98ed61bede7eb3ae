//! Non-maximum suppression and nested borders: overlapping quads in, the final quads out (method
//! 3.4, 3.6).

pub mod non_maximum;
pub mod blank;
pub mod nested_borders;
pub mod nested_quads;
