//! The number that names a landmark.

use serde::{Deserialize, Serialize};

/// Number that names a landmark inside one map. The server keeps the readable name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct LandmarkId(pub u64);
