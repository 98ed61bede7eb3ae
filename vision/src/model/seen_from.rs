//! From where a landmark was photographed.

use serde::{Deserialize, Serialize};

/// From where the photographs of a landmark show it, for who faces it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SeenFrom {
    /// From its left.
    Left,
    /// From its front, or from both sides.
    Front,
    /// From its right.
    Right,
}
