//! Template alignment: the corners of a quad move until its picture agrees with a learnt icon.

pub mod align_params;
pub(crate) mod sampling_grid;
pub(crate) mod cost;
pub(crate) mod certainty;
pub(crate) mod minimise;
pub mod surroundings;
pub mod aligner;
