//! Calibration that drops outlier views (a share may show something else) and selects the number of radial
//! coefficients by an F test on the residuals.

use crate::camera_calibration::{
    calibrate::{CalibrateError, CameraCalibration, calibrate},
    params::CalibrateParams,
    views::PlanarView,
};

/// A coefficient is taken when it lowers chi2 by this many times the chi2 of a degree of freedom (F test; a useless one
/// gets there once in a thousand).
pub const LENS_GAIN: f64 = 12.0;
/// A view is left out when without it chi2 a degree of freedom falls below this share,
pub const OUTLIER_SHARE: f64 = 0.6;
/// and some view's residual exceeds this, pixels.
pub const OUTLIER_PX: f64 = 1.0;
/// Views that are tried for being the one that does not fit.
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

/// As [`calibrate`], but views that do not fit are left out, as long as more than half are left, and of the radial
/// coefficients, up to `p.radial`, only those are fitted that the views ask for.
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

/// Leaves out one view after the other: of the worst few the one without which the others fit best.
fn fitting(
    views: &[PlanarView],
    image_size_px: [usize; 2],
    p: &CalibrateParams,
) -> Result<RobustCalibration, CalibrateError> {
    let of = |used: &[usize]| {
        let chosen: Vec<PlanarView> = used.iter().map(|&i| views[i].clone()).collect();
        // Residuals are needed of what does not fit, too.
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
    // With the limit that was asked for.
    let chosen: Vec<PlanarView> = used.iter().map(|&i| views[i].clone()).collect();
    calibrate(&chosen, image_size_px, p).map(|calibration| RobustCalibration { calibration, used })
}

fn reduced(c: &CameraCalibration) -> f64 {
    c.chi2 / c.dof.max(1) as f64
}
