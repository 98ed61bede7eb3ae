//! Which modality to trust where (method 15): what runs with a known path have shown of odometry, laser and landmarks in
//! every part of a map, and what follows from it for a fix or a motion there.
//!
//! In: evidence of runs by cell (a square metre and one of four headings), areas that somebody named, the mode. Out: advice
//! for a pose: the best module, which are used, by how much each is biased and how much less sure it is than it claims.
//! Where a cell was hardly driven through, those around speak for it, then the named area it lies in, then the whole map.

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
