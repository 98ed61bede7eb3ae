//! `detect` from end to end on rendered pictures.

pub(crate) mod fixtures;
pub(crate) mod rendering;
pub(crate) mod scenes;
pub(crate) mod any_input;
pub(crate) mod symmetry;
