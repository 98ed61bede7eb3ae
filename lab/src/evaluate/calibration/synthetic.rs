//! Synthetic views of a poster by a level camera on a robot, as in method 16.5, and the error of
//! the focal length over the number of views (E9, Fig. 17).

use crate::evaluate::{
    experiment::{mixed, of_each},
    statistics::{median, quantile},
};
use nalgebra::{Isometry3, Matrix2, Matrix3, Point2, Rotation3, UnitQuaternion, Vector2, Vector3};
use serde::Serialize;
use vision::{
    camera_calibration::{CalibrateParams, CameraHeight, PlanarView, calibrate},
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    pose::{LandmarkSize, reprojection::corner_points},
    random::Random,
};

/// The method's poster.
pub(super) const POSTER: LandmarkSize = LandmarkSize { width_m: 0.84, height_m: 1.19 };
/// Image of the trial.
pub(super) const IMAGE_PX: [usize; 2] = [1280, 960];
/// The method's focal length.
const ALPHA_PX: f64 = 900.0;
/// Standard deviation of the true principal point about the image's centre.
const CENTRE_SIGMA_PX: f64 = 20.0;
/// Height of the camera over the poster's centre, and the standard deviation that C3 states.
const HEIGHT_M: f64 = -0.3;
const HEIGHT_SIGMA_M: f64 = 0.01;
/// Standard deviation of zero roll that C2 states.
const ROLL_SIGMA_RAD: f64 = 0.01;
/// Most draws of a set of views that is refused.
const REDRAWS: usize = 20;

/// One point of a curve.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Point {
    pub(super) views: usize,
    /// Relative error of the focal length over the trials: median, root mean square, 95 % quantile.
    pub(super) median: f64,
    pub(super) rms: f64,
    pub(super) p95: f64,
    /// Sets of views that were refused (too few orientations) and drawn again.
    pub(super) refused: usize,
}

/// One curve of Fig. 17.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Curve {
    pub(super) constraints: &'static str,
    pub(super) refined: bool,
    pub(super) corner_noise_px: f64,
    pub(super) trials: usize,
    pub(super) points: Vec<Point>,
}

/// The four sets of constraints.
pub(super) const SETS: [(&str, bool, bool); 4] =
    [("C1", false, false), ("C1+C2", true, false), ("C1+C3", false, true), ("C1+C2+C3", true, true)];

fn params(zero_roll: bool, known_height: bool, refine: bool) -> CalibrateParams {
    CalibrateParams {
        roll_sigma_rad: if zero_roll { ROLL_SIGMA_RAD } else { 0.0 },
        height: if known_height {
            CameraHeight::Known { height_m: HEIGHT_M, sigma_m: HEIGHT_SIGMA_M }
        } else {
            CameraHeight::Free
        },
        refine,
        ..CalibrateParams::default()
    }
}

/// All curves at one corner noise: four linear, four refined.
pub(super) fn curves(views: &[usize], trials: usize, noise_px: f64, seed: u64) -> Vec<Curve> {
    // All curves use the same views, so that they differ by the method alone.
    let points: Vec<Vec<(Point, usize)>> = views
        .iter()
        .map(|&n| {
            let tasks: Vec<u64> = (0..trials as u64).collect();
            let errors = of_each(&tasks, "calibrations", |_, trial| {
                trial_errors(n, noise_px, mixed(&[seed, n as u64, *trial]))
            });
            (0..2 * SETS.len()).map(|curve| (point(n, curve, &errors), curve)).collect()
        })
        .collect();
    let curve = |c: usize| Curve {
        constraints: SETS[c % SETS.len()].0,
        refined: c >= SETS.len(),
        corner_noise_px: noise_px,
        trials,
        points: points.iter().map(|of| of[c].0.clone()).collect(),
    };
    (0..2 * SETS.len()).map(curve).collect()
}

fn point(views: usize, curve: usize, errors: &[Vec<Option<f64>>]) -> Point {
    let mut all: Vec<f64> = errors.iter().filter_map(|e| e[curve]).collect();
    let rms = (all.iter().map(|e| e * e).sum::<f64>() / all.len().max(1) as f64).sqrt();
    let p95 = quantile(&mut all, 0.95).unwrap_or(f64::NAN);
    Point { views, median: median(&mut all).unwrap_or(f64::NAN), rms, p95, refused: errors.len() - all.len() }
}

/// Relative error of the focal length by each method, on the same views; `None`: refused.
fn trial_errors(n: usize, noise_px: f64, seed: u64) -> Vec<Option<f64>> {
    let mut random = Random::new(seed);
    let (mut u0, mut v0) = (0.5 * (IMAGE_PX[0] as f64 - 1.0), 0.5 * (IMAGE_PX[1] as f64 - 1.0));
    u0 += CENTRE_SIGMA_PX * random.normal();
    v0 += CENTRE_SIGMA_PX * random.normal();
    let truth = Intrinsics {
        fx_px: ALPHA_PX,
        fy_px: ALPHA_PX,
        cx_px: u0,
        cy_px: v0,
        distortion: Distortion::None,
        sigmas: None,
    };
    let solve = |views: &[PlanarView], (roll, height): (bool, bool), refine| {
        let found = calibrate(views, IMAGE_PX, &params(roll, height, refine)).ok()?;
        Some((found.camera.fx_px / ALPHA_PX - 1.0).abs())
    };
    let mut views = vec![];
    for _ in 0..REDRAWS {
        views = (0..n).map(|_| view(&truth, noise_px, &mut random)).collect();
        if solve(&views, (false, false), true).is_some() {
            break;
        }
    }
    [false, true]
        .iter()
        .flat_map(|refine| SETS.iter().map(|(_, roll, height)| solve(&views, (*roll, *height), *refine)))
        .collect()
}

/// The poster from 1.2 to 3.5 m, within 60 degrees of its normal, wholly in the image; no roll.
pub(super) fn view(camera: &Intrinsics, noise_px: f64, random: &mut Random) -> PlanarView {
    loop {
        let pose = pose(random);
        let px =
            corner_points(&POSTER).map(|p| camera.project(&(pose.rotation * p + pose.translation.vector)));
        let inside = |p: &Point2<f64>| {
            (0.0..IMAGE_PX[0] as f64 - 1.0).contains(&p.x) && (0.0..IMAGE_PX[1] as f64 - 1.0).contains(&p.y)
        };
        let noisy = px.map(|p| p + Vector2::new(random.normal(), random.normal()) * noise_px);
        if let (true, Ok(corners)) = (px.iter().all(inside), Corners::new(noisy)) {
            let covariance = [Matrix2::identity() * noise_px.max(0.05).powi(2); 4];
            return PlanarView::of_quad(&corners, &covariance, POSTER);
        }
    }
}

fn pose(random: &mut Random) -> Isometry3<f64> {
    let (d, psi) = (random.range(1.2, 3.5), random.range(-60.0, 60.0).to_radians());
    let centre = Vector3::new(d * psi.cos(), d * psi.sin(), HEIGHT_M);
    let (aim, tilt) = (psi + random.range(-0.25, 0.25), random.range(-0.2, 0.35));
    let flat = Vector3::new(-aim.cos(), -aim.sin(), 0.0);
    let forward = flat * f64::cos(tilt) + Vector3::z() * f64::sin(tilt);
    let right = Vector3::new(flat.y, -flat.x, 0.0);
    let down = forward.cross(&right);
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[right, down, forward]));
    let rotation = UnitQuaternion::from_rotation_matrix(&turn.inverse());
    Isometry3::from_parts((-(rotation * centre)).into(), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_fall_and_without_noise_there_is_no_error() {
        let falling = curves(&[5, 30], 24, 0.5, 3);
        assert_eq!(falling.len(), 8);
        for curve in &falling {
            assert!(curve.points[1].median < curve.points[0].median, "{curve:?}");
        }
        let exact = curves(&[5], 8, 0.0, 3);
        assert!(exact.iter().all(|c| c.points[0].p95 < 1e-8), "{exact:?}");
    }
}
