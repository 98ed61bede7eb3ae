//! The quad: four corners of a flat object in perspective (method 3.4 to 3.6).

use crate::geometry::corners::Corners;
use nalgebra::Matrix2;
use serde::{Deserialize, Serialize};

/// How many sides were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum QuadKind {
    /// Four sides: fit for recognition and metric pose.
    Full,
    /// Three sides, the fourth is the chord of the free ends: topology only, never a metric pose.
    ThreeSided,
    /// Not detected: the border of a landmark that its texture alone shows. Corners may lie outside
    /// of the image.
    Texture,
}

/// Standard deviation per coordinate of a border beyond the noise of its edges: another edge of the
/// frame, a shadow, a bent side. The corner covariance does not include it: at a stated 0.04 px,
/// corners of rendered posters are 0.2 to 0.4 px off, whatever their size (docs/EVALUATION.md,
/// "Navigation").
pub const BORDER_SIGMA_PX: f64 = 0.3;

/// A detected quad.
#[derive(Debug, Clone, PartialEq)]
pub struct Quad {
    /// Sub-pixel corners.
    pub corners_px: Corners,
    /// Covariance of each corner, px^2, in the corners' order.
    pub corner_covariance_px2: [Matrix2<f64>; 4],
    /// Share of each side (TL-TR, TR-BR, BR-BL, BL-TL) that edges support, 0 to 1.
    pub side_support: [f64; 4],
    /// Whether each side runs into the image border.
    pub side_clipped: [bool; 4],
    /// Detection score, 0 to 1.
    pub score: f64,
    /// Four sides or three.
    pub kind: QuadKind,
    /// A second choice of the top-left corner is nearly as upright: recognition tries all four
    /// rotations.
    pub upright_ambiguous: bool,
    /// Other borders of the same object (mat, canvas, inner frame) and objects inside (a poster on
    /// a door), nested in `corners_px`, outermost first.
    pub alternates: Vec<Corners>,
}

impl Quad {
    /// Covariance of each corner: of the fitted edges plus [`BORDER_SIGMA_PX`] squared, px^2.
    pub fn believed_covariance_px2(&self) -> [Matrix2<f64>; 4] {
        self.corner_covariance_px2.map(|c| c + Matrix2::identity() * BORDER_SIGMA_PX.powi(2))
    }
}
