//! The identifier of a landmark.

use serde::{Deserialize, Serialize};

/// Identifier of a landmark inside one map. The server stores the readable name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct LandmarkId(pub u64);
