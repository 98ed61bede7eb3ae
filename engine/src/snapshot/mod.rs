//! Versions of maps as the workers read them. Everybody imports this module; it imports none of the
//! engine's others.

pub mod look_alike_classes;
pub mod map_snapshot;
pub mod published;
pub mod stored_model;

pub use look_alike_classes::{LookAlikeClasses, look_alike_classes};
pub use map_snapshot::{LandmarkInfo, MapSnapshot, Pending, PoseParams};
pub use published::{MapChange, Snapshots};
pub use stored_model::StoredModel;
