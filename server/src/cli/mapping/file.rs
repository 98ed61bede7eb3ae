//! The map file of `waymark map build`: JSON with walls, path, key poses and loops. Written and read here.

use anyhow::Context as _;
use map::{segments::LaserSegment, slam::SlamMap};
use nalgebra::{Matrix2, Point2};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Largest map file.
const MAX_BYTES: u64 = 1 << 30;

/// A wall: the free side on the left of a to b.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Wall {
    /// First end, metres.
    pub(crate) a: [f64; 2],
    /// Second end.
    pub(crate) b: [f64; 2],
    /// Covariance of (alpha, rho): rad^2, rad m, m^2; absent where nobody knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) covariance: Option<[f64; 3]>,
    /// How many key scans saw it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) hits: Option<u32>,
}

impl Wall {
    pub(crate) fn of(s: &LaserSegment) -> Self {
        let c = &s.covariance;
        let covariance = Some([c[(0, 0)], c[(0, 1)], c[(1, 1)]]);
        Self { a: [s.a.x, s.a.y], b: [s.b.x, s.b.y], covariance, hits: Some(s.hits) }
    }

    pub(crate) fn between(a: [f64; 2], b: [f64; 2]) -> Self {
        Self { a, b, covariance: None, hits: None }
    }

    /// As the map's own type, checked; 1 cm and half a degree where nothing is known.
    pub(crate) fn segment(&self) -> Result<LaserSegment, map::check::OutOfRange> {
        let [aa, ar, rr] = self.covariance.unwrap_or([7.6e-5, 0.0, 1e-4]);
        let covariance = Matrix2::new(aa, ar, ar, rr);
        LaserSegment::from_ends(Point2::from(self.a), Point2::from(self.b), covariance)
    }
}

/// A map as a file.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct MapFile {
    /// The walls.
    pub(crate) segments: Vec<Wall>,
    /// `map_from_robot` of every scan: x, y, theta.
    pub(crate) path: Vec<[f64; 3]>,
    /// Key poses: number of the scan.
    pub(crate) key_scans: Vec<usize>,
    /// Standard deviations of the key poses: x, y, theta.
    pub(crate) key_sigmas: Vec<[f64; 3]>,
    /// Loops: numbers of both scans.
    pub(crate) loops: Vec<[usize; 2]>,
    /// Loops that looked right and were refused.
    pub(crate) refused: usize,
}

impl MapFile {
    pub(crate) fn of(map: &SlamMap) -> Self {
        let sigmas = |c: &nalgebra::Matrix3<f64>| [0, 1, 2].map(|i| c[(i, i)].max(0.0).sqrt());
        Self {
            segments: map.walls.iter().map(Wall::of).collect(),
            path: map.path.iter().map(|p| [p.x_m, p.y_m, p.theta_rad]).collect(),
            key_scans: map.keys.iter().map(|(scan, _)| *scan).collect(),
            key_sigmas: map.keys.iter().map(|(_, p)| sigmas(&p.covariance)).collect(),
            loops: map.loops.iter().map(|l| [map.keys[l.old].0, map.keys[l.new].0]).collect(),
            refused: map.refused,
        }
    }

    pub(crate) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let text = serde_json::to_string(self)?;
        std::fs::write(path, text + "\n").with_context(|| path.display().to_string())
    }

    pub(crate) fn read(path: &Path) -> anyhow::Result<Self> {
        let name = || path.display().to_string();
        let bytes = std::fs::metadata(path).with_context(name)?.len();
        anyhow::ensure!(bytes <= MAX_BYTES, "{}: more than {MAX_BYTES} bytes", name());
        let text = std::fs::read_to_string(path).with_context(name)?;
        let mut json = serde_json::Deserializer::from_str(&text);
        serde_path_to_error::deserialize(&mut json).with_context(name)
    }
}
