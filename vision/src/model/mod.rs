//! The learnt model of a landmark, its bytes, and the set of models of a map.

pub mod landmark_id;
pub mod threshold;
pub mod exemplar;
pub mod components;
pub mod seen_from;
pub mod landmark_model;
pub mod model_bytes;
pub mod model_set;

pub use components::Components;
pub use exemplar::Exemplar;
pub use landmark_id::LandmarkId;
pub use landmark_model::{
    DistanceSamples, Distances, Gate, GateFailure, LandmarkModel, MAX_EXEMPLARS, MAX_VIEWS, ModelStatus,
};
pub use model_bytes::{StoredModelError, components, renumbered};
pub use model_set::{MAX_LANDMARKS, ModelSet, ModelSetError};
pub use seen_from::SeenFrom;
pub use threshold::{LimitedBy, Threshold, ThresholdError};
