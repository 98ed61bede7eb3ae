//! The same corners through OpenCV's `solvePnP` with IPPE, both solutions refined by
//! `solvePnPRefineLM`, the better by its residual taken.

use super::single::{draws, nearer_to_mirror};
use crate::{bench::Python, evaluate::statistics::median};
use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::path::Path;

const PROGRAM: &str = include_str!("../../../peers/poses.py");

/// Errors of poses against the truth.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Errors {
    /// Of the position: root mean square and median, metres.
    pub(super) rms_m: f64,
    pub(super) median_m: f64,
    /// Of the direction, degrees.
    pub(super) rms_deg: f64,
    pub(super) median_deg: f64,
    /// Poses nearer to the mirror image than to the truth.
    pub(super) flips: usize,
}

/// Errors of Waymark and OpenCV on the same corners.
#[derive(Debug, Clone, Serialize)]
pub(super) struct PeerComparison {
    pub(super) version: String,
    pub(super) draws: usize,
    pub(super) flagged: usize,
    /// On all draws.
    pub(super) ours: Errors,
    pub(super) theirs: Errors,
    /// On the draws that Waymark does not flag as ambiguous.
    pub(super) ours_unflagged: Errors,
    pub(super) theirs_unflagged: Errors,
    /// Largest difference between Waymark's and OpenCV's poses where both took the same solution,
    /// metres.
    pub(super) apart_m: f64,
    /// Microseconds of a pose by OpenCV, Python included.
    pub(super) their_us: f64,
}

#[derive(Deserialize)]
struct Greeting {
    version: String,
}

#[derive(Deserialize)]
struct Answer {
    poses: Vec<[[f64; 3]; 2]>,
    us: f64,
}

pub(super) fn beside(python: &Path, n: usize, seed: u64) -> Result<PeerComparison, String> {
    let drawn = draws(n, seed);
    let (mut python, Greeting { version }) = Python::start(python, PROGRAM, &[])?;
    let corners: Vec<[[f64; 2]; 4]> = drawn.iter().map(|(_, c, _)| (*c).into()).collect();
    let question = serde_json::to_string(&corners).map_err(|e| e.to_string())?;
    let answer: Answer = python.ask(&question)?;
    if answer.poses.len() != drawn.len() {
        return Err("not one pose for each question".to_owned());
    }
    let theirs: Vec<Isometry3<f64>> = answer.poses.iter().map(ours_of).collect();
    let pick = |unflagged: bool| {
        let of: Vec<usize> = (0..drawn.len()).filter(|&i| !(unflagged && drawn[i].2.ambiguous)).collect();
        let ours: Vec<_> = of.iter().map(|&i| (drawn[i].0, drawn[i].2.best.camera_from_landmark)).collect();
        let theirs: Vec<_> = of.iter().map(|&i| (drawn[i].0, theirs[i])).collect();
        (errors(&ours), errors(&theirs))
    };
    let apart_m = drawn
        .iter()
        .zip(&theirs)
        .filter(|((_, _, a), b)| a.best.camera_from_landmark.rotation.angle_to(&b.rotation) < 0.01)
        .map(|((_, _, a), b)| (a.best.camera_from_landmark.translation.vector - b.translation.vector).norm())
        .fold(0.0, f64::max);
    let ((ours, all_theirs), (ours_unflagged, theirs_unflagged)) = (pick(false), pick(true));
    Ok(PeerComparison {
        version,
        draws: drawn.len(),
        flagged: drawn.iter().filter(|d| d.2.ambiguous).count(),
        ours,
        theirs: all_theirs,
        ours_unflagged,
        theirs_unflagged,
        apart_m,
        their_us: answer.us,
    })
}

/// OpenCV's plane has x right, y up, z towards the viewer; Waymark's x towards the viewer, y right,
/// z up.
fn ours_of(pose: &[[f64; 3]; 2]) -> Isometry3<f64> {
    let turn = Rotation3::from_scaled_axis(Vector3::from(pose[0]));
    let theirs_from_ours = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
    let rotation = turn * Rotation3::from_matrix_unchecked(theirs_from_ours);
    Isometry3::from_parts(Vector3::from(pose[1]).into(), UnitQuaternion::from_rotation_matrix(&rotation))
}

fn errors(pairs: &[(Isometry3<f64>, Isometry3<f64>)]) -> Errors {
    let mut metres: Vec<f64> =
        pairs.iter().map(|(t, p)| (t.translation.vector - p.translation.vector).norm()).collect();
    let mut degrees: Vec<f64> =
        pairs.iter().map(|(t, p)| t.rotation.angle_to(&p.rotation).to_degrees()).collect();
    let rms = |all: &[f64]| (all.iter().map(|e| e * e).sum::<f64>() / all.len().max(1) as f64).sqrt();
    Errors {
        rms_m: rms(&metres),
        rms_deg: rms(&degrees),
        median_m: median(&mut metres).unwrap_or(f64::NAN),
        median_deg: median(&mut degrees).unwrap_or(f64::NAN),
        flips: pairs.iter().filter(|(t, p)| nearer_to_mirror(p, t)).count(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_python_gives_a_reason() {
        assert!(beside(Path::new("no-such-python-anywhere"), 2, 1).unwrap_err().contains("no-such-python"));
    }

    #[test]
    fn opencvs_axes_become_waymarks() {
        // Frontal at 3 m in OpenCV's axes: turned by pi about x (y up to v down), z towards the
        // viewer.
        let pose = ours_of(&[[std::f64::consts::PI, 0.0, 0.0], [0.0, 0.0, 3.0]]);
        let normal = pose.rotation * Vector3::x();
        assert!((normal + Vector3::z()).norm() < 1e-9, "{normal}");
        assert!((pose.rotation * Vector3::z() + Vector3::y()).norm() < 1e-9);
    }
}
