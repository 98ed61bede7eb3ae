//! The way of a frame:
//! `intake -> slots -> workers -> decode -> analysis -> guided -> landmark_checks -> fixes -> answer`,
//! and on to the observers and to `motion`.

pub mod ambiguous_observations;
pub mod analysis;
pub mod answer;
pub mod context;
pub mod decode;
pub mod fixes;
pub mod guided;
pub mod intake;
pub mod landmark_checks;
pub mod relocalise;
pub mod slots;
pub mod workers;
