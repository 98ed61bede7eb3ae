//! Where the robot might be while only ambiguous landmarks are seen: Markov localisation over a grid of poses (method
//! 19.1).
//!
//! In: motions, sightings of things that may be any of several landmarks, landmarks that should have been seen. Out: the
//! modes of the belief, and one pose once a single mode holds enough of it. Never says one while several are left.

mod params;
mod observation;
mod grid;
mod grid_belief;

pub use grid::{MAX_CELLS, MAX_MODES, PoseHypothesis};
pub use grid_belief::GridBelief;
pub use observation::{AssociationHypothesis, MAX_MEMBERS, PossibleLandmark, RelativeObservation};
pub use params::GridBeliefParams;

#[cfg(test)]
mod tests;
