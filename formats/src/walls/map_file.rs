//! The map file of `waymark map build`: JSON with walls, path, keyframes and loop closures.

use map::{segments::LaserSegment, slam::SlamMap};
use nalgebra::{Matrix2, Point2};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Most walls read from a file.
pub const MAX_WALLS: usize = 1 << 20;
/// Largest map file.
const MAX_BYTES: u64 = 1 << 30;

/// Why a map file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum MapFileError {
    /// The file cannot be opened, read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// Larger than a map file may be.
    #[error("more than {MAX_BYTES} bytes")]
    TooLarge,
    /// Not the JSON of a map; names the field.
    #[error(transparent)]
    Json(#[from] serde_path_to_error::Error<serde_json::Error>),
}

/// A wall: the free side on the left of a to b.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wall {
    /// First end, metres.
    pub a: [f64; 2],
    /// Second end, metres.
    pub b: [f64; 2],
    /// Covariance of (alpha, rho): rad^2, rad m, m^2; absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<[f64; 3]>,
    /// Number of keyframes that observed it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hits: Option<u32>,
}

impl Wall {
    /// A wall of the map, with its covariance.
    pub fn of(s: &LaserSegment) -> Self {
        let c = &s.covariance;
        let covariance = Some([c[(0, 0)], c[(0, 1)], c[(1, 1)]]);
        Self { a: [s.a.x, s.a.y], b: [s.b.x, s.b.y], covariance, hits: Some(s.hits) }
    }

    /// A wall between two points (metres), without covariance.
    pub fn between(a: [f64; 2], b: [f64; 2]) -> Self {
        Self { a, b, covariance: None, hits: None }
    }

    /// A wall with the covariance of its direction and offset about its middle (rad^2, rad m, m^2),
    /// if known.
    pub fn about_middle(
        a: [f64; 2],
        b: [f64; 2],
        covariance: Option<[f64; 3]>,
    ) -> Result<Self, map::check::OutOfRange> {
        let Some([dd, dr, rr]) = covariance else { return Ok(Self::between(a, b)) };
        let covariance = Matrix2::new(dd, dr, dr, rr);
        let made = LaserSegment::about_middle(Point2::from(a), Point2::from(b), &covariance)?;
        Ok(Self { hits: None, ..Self::of(&made) })
    }

    /// The covariance of its direction and offset about its middle: rad^2, rad m, m^2. `None` if
    /// unknown.
    pub fn covariance_about_middle(&self) -> Option<[f64; 3]> {
        self.covariance?;
        let c = self.segment().ok()?.covariance_about_middle();
        Some([c[(0, 0)], c[(0, 1)], c[(1, 1)]])
    }

    /// Length, metres.
    pub fn length_m(&self) -> f64 {
        (self.b[0] - self.a[0]).hypot(self.b[1] - self.a[1])
    }

    /// The wall as a checked segment of the map; without covariance 1 cm and half a degree.
    pub fn segment(&self) -> Result<LaserSegment, map::check::OutOfRange> {
        let [aa, ar, rr] = self.covariance.unwrap_or([7.6e-5, 0.0, 1e-4]);
        let covariance = Matrix2::new(aa, ar, ar, rr);
        LaserSegment::from_ends(Point2::from(self.a), Point2::from(self.b), covariance)
    }
}

/// A map as a file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MapFile {
    /// The walls.
    pub segments: Vec<Wall>,
    /// `map_from_robot` of every scan: x, y, theta.
    pub path: Vec<[f64; 3]>,
    /// Keyframes: number of the scan.
    pub key_scans: Vec<usize>,
    /// Standard deviations of the keyframes' poses: x, y (m), theta (rad).
    pub key_sigmas: Vec<[f64; 3]>,
    /// Loop closures: numbers of both scans.
    pub loops: Vec<[usize; 2]>,
    /// Number of loop closures that verification refused.
    pub refused: usize,
}

impl MapFile {
    /// The file of a finished map.
    pub fn of(map: &SlamMap) -> Self {
        let sigmas = |c: &nalgebra::Matrix3<f64>| [0, 1, 2].map(|i| c[(i, i)].max(0.0).sqrt());
        Self {
            segments: map.walls.iter().map(Wall::of).collect(),
            path: map.path.iter().map(|p| [p.x_m, p.y_m, p.theta_rad]).collect(),
            key_scans: map.keys.iter().map(|key| key.scan).collect(),
            key_sigmas: map.keys.iter().map(|key| sigmas(&key.pose.covariance)).collect(),
            loops: map.loops.iter().map(|l| [map.keys[l.old].scan, map.keys[l.new].scan]).collect(),
            refused: map.refused,
        }
    }

    /// Writes the map as JSON.
    pub fn write(&self, path: &Path) -> Result<(), MapFileError> {
        let text = serde_json::to_string(self).map_err(std::io::Error::from)?;
        Ok(std::fs::write(path, text + "\n")?)
    }

    /// Reads the JSON of a map; unknown fields are errors.
    pub fn read(path: &Path) -> Result<Self, MapFileError> {
        if std::fs::metadata(path)?.len() > MAX_BYTES {
            return Err(MapFileError::TooLarge);
        }
        let text = std::fs::read_to_string(path)?;
        let mut json = serde_json::Deserializer::from_str(&text);
        Ok(serde_path_to_error::deserialize(&mut json)?)
    }
}
