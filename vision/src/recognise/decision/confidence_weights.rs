//! The weights of the confidence, by the distance that decides. Not for editing: this command
//! writes the file, byte for byte but for `BOTH`:
//!
//! ```text
//! waymark-lab train confidence --set calibrate --photographs museum-paintings --photographs \
//!   poster-textures-estense --rust vision/src/recognise/decision/confidence_weights.rs
//! ```
//!
//! Commit: 1c0af82281252074387786fd06575e0077e739af. Set `museum-paintings`: SHA-256
//! aed4ef353e8c21191479c377e43d2252ac612819dc40440f287131f8477ed826 (`data/digest.py`). Set
//! `poster-textures-estense`: SHA-256
//! 2dd71596d72a6067fb4af2dcff989228685186ce49ef944e4883f80f193fc050 (`data/digest.py`).

use super::measures::MEASURES;

/// Where slopes decide. Of the same command at the commit before 46b9d8d: nearly all of its answers
/// are decided by points now, and a curve fitted to those hardly falls with the measures: it would
/// say 0.98 of a doubtful answer.
pub(super) const BOTH: [f64; MEASURES + 1] = [-1.6149, -2.3303, 0.0, -0.5381, 0.0, -2.1789, 0.0, 5.8694];

/// Where C^r decides.
pub(super) const CORRELATION: [f64; MEASURES + 1] = [-1.169, 0.0, -7.8726, 0.0, 0.0, -2.823, 0.0, 10.9312];

/// Where H^r decides.
pub(super) const HAUSDORFF: [f64; MEASURES + 1] = [0.0, 0.0, -2.4348, -8.9399, -2.2945, 0.0, 0.0, 5.3541];
