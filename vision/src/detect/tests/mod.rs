//! `detect` from end to end on rendered pictures.

mod colour;
pub(crate) mod fixtures;
pub(crate) mod rendering;
pub(crate) mod scenes;
pub(crate) mod any_input;
pub(crate) mod symmetry;
