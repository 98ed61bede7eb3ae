//! Statistics of modalities (method 15): which modality to trust in which part of a map, learnt
//! from reference runs.
//!
//! In: statistics of runs by pose cell, named areas, the fusion mode. Out: advice for a pose: the
//! best modality, the modalities used, and the error model of each. A cell with too few
//! measurements takes the statistics of its neighbours, then of its named area, then of the whole
//! map.

mod modality;
mod named_area;
mod evidence;
mod advice;
mod modality_map;
mod reference;
mod learn;

pub use crate::pose_cell::{CELL_M, PoseCell};
pub(crate) use advice::map_from_aligned;
pub use advice::{ErrorModel, ModalityAdvice, StatsScope};
pub use evidence::{MIN_MEASUREMENTS, MIN_VISITS, ModalityStats, ModalitySummary, StatsByModality};
pub use learn::{MAX_CELLS, ReferenceRun, RunStats, learn_modality_stats};
pub use modality::{FusionMode, Modality};
pub use modality_map::ModalityMap;
pub use named_area::{MAX_AREAS, MAX_CORNERS, MAX_NAME_BYTES, NamedArea};
pub use reference::{MAX_REFERENCE, ReferenceError, ReferenceTrajectory};

#[cfg(test)]
mod tests;
