//! Calibration that drops outlier views (some may show another object) and selects the number of
//! radial coefficients by an F test on the residuals.

use crate::camera_calibration::{
    calibrate::{CalibrateError, CameraCalibration, calibrate},
    params::CalibrateParams,
    views::PlanarView,
};

/// A coefficient is fitted if it lowers chi2 by this many times the reduced chi2 (F test with a
/// false-positive rate of 0.001).
pub const LENS_GAIN: f64 = 12.0;
/// A view is dropped if the reduced chi2 without it is below this share of the one with it,
pub const OUTLIER_SHARE: f64 = 0.6;
/// and the residual of some view exceeds this, pixels.
pub const OUTLIER_PX: f64 = 1.0;
/// Views tried as outliers, those of the largest residuals.
const SUSPECTS: usize = 8;
/// No limit on residuals.
const MAX_RMS_PX: f64 = 1e4;

/// A camera and the views it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustCalibration {
    /// The camera; its views are those in `used`.
    pub calibration: CameraCalibration,
    /// Indices of the views that fit, ascending.
    pub used: Vec<usize>,
}

/// As [`calibrate`], but drops outlier views while more than half are left, and fits only those of
/// the `p.radial` radial coefficients that pass the F test.
pub fn calibrate_choosing(
    views: &[PlanarView],
    image_size_px: [usize; 2],
    p: &CalibrateParams,
) -> Result<RobustCalibration, CalibrateError> {
    let mut best = fitting(views, image_size_px, &CalibrateParams { radial: 0, ..p.clone() });
    for radial in 1..=p.radial {
        let Ok(next) = fitting(views, image_size_px, &CalibrateParams { radial, ..p.clone() }) else {
            continue;
        };
        let better = match &best {
            Err(_) => true,
            Ok(b) if b.used == next.used => {
                let (a, b) = (&next.calibration, &b.calibration);
                a.dof > 0 && b.chi2 - a.chi2 > LENS_GAIN * (b.dof - a.dof) as f64 * (a.chi2 / a.dof as f64)
            }
            Ok(b) => next.used.len() > b.used.len(),
        };
        if better {
            best = Ok(next);
        }
    }
    best
}

/// Drops one view after the other: of the worst few the one without which the others fit best.
fn fitting(
    views: &[PlanarView],
    image_size_px: [usize; 2],
    p: &CalibrateParams,
) -> Result<RobustCalibration, CalibrateError> {
    let of = |used: &[usize]| {
        let chosen: Vec<PlanarView> = used.iter().map(|&i| views[i].clone()).collect();
        // Views that do not fit need residuals, too.
        calibrate(&chosen, image_size_px, &CalibrateParams { max_rms_px: MAX_RMS_PX, ..p.clone() })
    };
    let mut used: Vec<usize> = (0..views.len()).collect();
    let mut found = of(&used)?;
    while found.views.iter().any(|v| v.rms_px > OUTLIER_PX) {
        if 2 * (used.len() - 1) <= views.len() {
            break;
        }
        let mut order: Vec<usize> = (0..used.len()).collect();
        order.sort_by(|&a, &b| found.views[b].rms_px.total_cmp(&found.views[a].rms_px));
        let without = |k: usize| {
            let left: Vec<usize> = (0..used.len()).filter(|i| *i != k).map(|i| used[i]).collect();
            of(&left).ok().map(|c| (left, c))
        };
        let tried = order.into_iter().take(SUSPECTS).filter_map(without);
        let Some(best) = tried.min_by(|a, b| a.1.chi2.total_cmp(&b.1.chi2)) else { break };
        if reduced(&best.1) > OUTLIER_SHARE * reduced(&found) {
            break;
        }
        (used, found) = best;
    }
    // With the limit of the caller.
    let chosen: Vec<PlanarView> = used.iter().map(|&i| views[i].clone()).collect();
    calibrate(&chosen, image_size_px, p).map(|calibration| RobustCalibration { calibration, used })
}

fn reduced(c: &CameraCalibration) -> f64 {
    c.chi2 / c.dof.max(1) as f64
}
