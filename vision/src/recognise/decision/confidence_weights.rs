//! The weights of the confidence, by the distance that decides. Not for editing: this command writes the file, byte
//! for byte, with the open sets as pictures (see docs/EVALUATION.md).
//!
//! ```text
//! waymark-lab train confidence --set calibrate --photographs museum-paintings --photographs poster-textures-estense \
//!   --rust vision/src/recognise/decision/confidence_weights.rs
//! ```
//!
//! Commit: not recorded.

use super::measures::MEASURES;

/// Where slopes decide.
pub(super) const BOTH: [f64; MEASURES + 1] = [-1.6149, -2.3303, 0.0, -0.5381, 0.0, -2.1789, 0.0, 5.8694];

/// Where C^r decides.
pub(super) const CORRELATION: [f64; MEASURES + 1] = [0.0, 0.0, -4.0645, 0.0, 0.0, -1.6928, 0.0, 5.281];

/// Where H^r decides.
pub(super) const HAUSDORFF: [f64; MEASURES + 1] = [0.0, 0.0, -4.8006, -3.1945, -2.1351, 0.0, 0.0, 4.877];
