//! Reference runs: what the fusion of a drive got, beside the path that the robot truly took.
//! Drives in, modality statistics out.

use super::journey::Journey;
use map::{
    fuse::FuseParams,
    modality_stats::{FusionMode, ModalityMap, ReferenceTrajectory, learn_modality_stats},
};

/// Standard deviations that the true paths are given with: m, rad.
const PATH_SIGMA: [f64; 2] = [0.001, 0.001];

/// The statistics of these drives, for this mode. Errors: a drive of a single step.
pub(super) fn learnt(drives: Vec<Journey>, mode: FusionMode) -> anyhow::Result<ModalityMap> {
    let mut cells = Vec::new();
    for mut drive in drives {
        let Some(recording) = &mut drive.recording else { continue };
        let path = drive.moments.iter().map(|m| ((m.time_s * 1e9) as i64, m.truth)).collect();
        let path = ReferenceTrajectory::new(path, PATH_SIGMA[0], PATH_SIGMA[1])?;
        cells.push(learn_modality_stats(&recording.with_reference(&path), &FuseParams::default()).cells);
    }
    Ok(ModalityMap::new(mode, Vec::new(), &cells))
}
