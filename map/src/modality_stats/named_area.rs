//! Parts of a map that somebody named.

use crate::check::{self, MAX_COORDINATE_M, OutOfRange};
use serde::{Deserialize, Serialize};

/// Most named areas of a map.
pub const MAX_AREAS: usize = 64;
/// Most corners of one area.
pub const MAX_CORNERS: usize = 64;
/// Longest name of an area, bytes.
pub const MAX_NAME_BYTES: usize = 64;

/// A part of the map with a name: a room, a piece of corridor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedArea {
    /// Name of the area, 1 to [`MAX_NAME_BYTES`] bytes.
    pub name: String,
    /// Corners in order, x and y in metres; at least three. Where areas overlap the first one
    /// counts.
    pub corners_m: Vec<[f64; 2]>,
}

impl NamedArea {
    /// Refuses an empty or long name, fewer than three corners, and corners out of range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("name", self.name.len() as f64, 1.0, MAX_NAME_BYTES as f64)?;
        check::within("corners_m", self.corners_m.len() as f64, 3.0, MAX_CORNERS as f64)?;
        for value in self.corners_m.iter().flatten() {
            check::within("corners_m", *value, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
        }
        Ok(())
    }

    /// Whether a point lies in the area (even-odd rule).
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let n = self.corners_m.len();
        let crosses = |i: &usize| {
            let ([ax, ay], [bx, by]) = (self.corners_m[*i], self.corners_m[(i + 1) % n]);
            (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax)
        };
        (0..n).filter(crosses).count() % 2 == 1
    }
}
