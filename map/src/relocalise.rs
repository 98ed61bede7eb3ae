//! Relocalisation: global localisation of a robot without a pose from ambiguous landmarks, by a
//! grid belief over (x, y, theta) (Markov localisation, method 19.1).
//!
//! In: motions, observations of objects that may be any of several landmarks, landmarks that should
//! have been visible. Out: pose hypotheses, and one pose once a single hypothesis is probable
//! enough.

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
