//! The weights of the confidence, by the distance that decides. Not for editing: this command writes the file, byte
//! for byte, with the open sets as pictures (see docs/EVALUATION.md).
//!
//! ```text
//! waymark fit confidence --set calibrate --photographs museum-paintings --photographs poster-textures-estense \
//!   --rust vision/src/recognise/confidence_learnt.rs
//! ```

use super::confidence::MEASURES;

/// Where slopes decide.
pub(super) const BOTH: [f64; MEASURES + 1] = [0.0, -5.7954, -0.0104, -1.8392, 0.0, -1.2431, 0.0, 5.5076];

/// Where C^r decides.
pub(super) const CORRELATION: [f64; MEASURES + 1] = [0.0, 0.0, -2.949, -0.6926, 0.0, -1.9547, 0.0, 5.3093];

/// Where H^r decides.
pub(super) const HAUSDORFF: [f64; MEASURES + 1] = [0.0, 0.0, -3.4255, -4.651, -2.6218, 0.0, 0.0, 4.9197];
