//! The way of a frame: `intake -> slots -> workers -> decode -> analysis -> guided -> landmark_checks -> answer -> motion`.

pub mod ambiguous_observations;
pub mod analysis;
pub mod answer;
pub mod context;
pub mod decode;
pub mod fixes;
pub mod guided;
pub mod intake;
pub mod landmark_checks;
pub mod pose_refusal;
pub mod relocalise;
pub mod search_policy;
pub mod slots;
pub mod workers;
