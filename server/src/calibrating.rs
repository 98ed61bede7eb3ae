//! Camera calibration from views of one landmark, for the command line and HTTP. In: corners (px)
//! or pictures, and constraints. Out: a report. `vision::camera_calibration` computes.

use protos::{
    api::{CalibrationConstraintsBody, CalibrationReport, CalibrationViewReport},
    convert::geometry::intrinsics_wire,
};
use vision::{
    camera_calibration::{
        CalibrateError, CalibrateParams, CameraCalibration, CameraHeight, PlanarView, RobustCalibration,
        calibrate_choosing, calibrate_pictures,
    },
    detect::BORDER_SIGMA_PX,
    frame::{GrayImage, Intrinsics, IntrinsicsSigmas},
    pose::LandmarkSize,
};

/// Standard deviation of a corner per coordinate, where nobody says.
pub const CORNER_SIGMA_PX: f64 = 0.5;
/// What is known of any camera's principal point: standard deviation from the image's centre, as a
/// share of its width.
const CENTRE_SIGMA: f64 = 0.1;
/// A camera is doubtful from so much chi2 a degree of freedom,
const DOUBTFUL_CHI2: f64 = 10.0;
/// and with its principal point so far from the image's centre, as a share of the width.
const DOUBTFUL_CENTRE: f64 = 0.15;
/// A focal length is doubtful from this standard deviation, as a share of it.
const DOUBTFUL_SIGMA: f64 = 0.03;
/// How well the roll of a camera that does not roll is 0, radians.
const ROLL_SIGMA_RAD: f64 = 0.0175;
/// How well a given height is known, metres.
const HEIGHT_SIGMA_M: f64 = 0.02;

/// Constraints of a calibration beside the views.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationConstraints {
    /// Radial coefficients (k1, k2) that may be fitted, 0 to 2; only those are that the views ask
    /// for.
    pub radial: u8,
    /// The camera does not roll (C2).
    pub zero_roll: bool,
    /// The camera is this high over the landmark's centre in all views, metres; negative below
    /// (C3).
    pub height_m: Option<f64>,
    /// The ratio of the landmark's sides is not what its size says, and is found with the camera.
    pub unknown_aspect: bool,
}

impl From<CalibrationConstraintsBody> for CalibrationConstraints {
    fn from(body: CalibrationConstraintsBody) -> Self {
        let CalibrationConstraintsBody { radial, zero_roll, height_m, unknown_aspect } = body;
        Self { radial, zero_roll, height_m, unknown_aspect }
    }
}

impl CalibrationConstraints {
    fn params(&self) -> CalibrateParams {
        CalibrateParams {
            radial: usize::from(self.radial),
            roll_sigma_rad: if self.zero_roll { ROLL_SIGMA_RAD } else { 0.0 },
            height: self.height_m.map_or(CameraHeight::Free, |height_m| CameraHeight::Known {
                height_m,
                sigma_m: HEIGHT_SIGMA_M,
            }),
            known_aspect: !self.unknown_aspect,
            centre_sigma: CENTRE_SIGMA,
            ..CalibrateParams::default()
        }
    }
}

/// Warnings about a calibration.
fn warnings(c: &CameraCalibration, image_px: [usize; 2]) -> Vec<String> {
    let mut all = vec![];
    let chi2 = c.chi2 / c.dof.max(1) as f64;
    if chi2 > DOUBTFUL_CHI2 {
        all.push(format!("corners fit {:.1} times worse than they claim", chi2.sqrt()));
    }
    let share = c.fx_sigma_px().map_or(f64::INFINITY, |sigma| sigma / c.camera.fx_px);
    if share > DOUBTFUL_SIGMA {
        all.push(format!(
            "the focal length is known to {:.0} % only: views from more sides help",
            100.0 * share
        ));
    }
    let off = [c.camera.cx_px, c.camera.cy_px]
        .iter()
        .zip(image_px)
        .map(|(p, side)| (p - 0.5 * (side as f64 - 1.0)).abs())
        .fold(0.0, f64::max);
    if off > DOUBTFUL_CENTRE * image_px[0] as f64 {
        all.push(format!("the principal point is {off:.0} px from the image's centre"));
    }
    all
}

/// Calibrates a camera. Slow for hundreds of views: not for an async thread.
pub fn calibrated(
    views: &[PlanarView],
    image_px: [usize; 2],
    constraints: &CalibrationConstraints,
) -> Result<CalibrationReport, CalibrateError> {
    let mut views = views.to_vec();
    for covariance in views.iter_mut().flat_map(|v| &mut v.covariance_px2) {
        *covariance += nalgebra::Matrix2::identity() * BORDER_SIGMA_PX.powi(2);
    }
    let RobustCalibration { calibration, used } =
        calibrate_choosing(&views, image_px, &constraints.params())?;
    Ok(report(&calibration, &used, views.len(), image_px))
}

/// A camera from pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibratedPictures {
    /// As from corners.
    pub report: CalibrationReport,
    /// For each picture: windows of the object's texture that it shows; `None` where it was not
    /// used.
    pub points: Vec<Option<usize>>,
    /// Lines along the object's sides that agree on two directions at right angles, and all that
    /// were found.
    pub lines: [usize; 2],
}

/// Calibrates a camera from pictures of one flat, textured object of about `size`. Slow: not for an
/// async thread.
pub fn calibrated_from_pictures(
    pictures: &[GrayImage],
    size: LandmarkSize,
    constraints: &CalibrationConstraints,
) -> Result<CalibratedPictures, CalibrateError> {
    let found = calibrate_pictures(pictures, size, &constraints.params())?;
    let image_px = pictures.first().map_or([0, 0], |p| [p.width(), p.height()]);
    let points_of = |i: usize| found.used.iter().position(|u| *u == i).map(|k| found.points[k]);
    Ok(CalibratedPictures {
        report: report(&found.calibration, &found.used, pictures.len(), image_px),
        points: (0..pictures.len()).map(points_of).collect(),
        lines: found.lines,
    })
}

/// The report on `count` views, of which `used` determine the camera.
fn report(c: &CameraCalibration, used: &[usize], count: usize, image_px: [usize; 2]) -> CalibrationReport {
    let sigma = |i: usize| c.covariance.map_or(f64::INFINITY, |m| m[(i, i)].sqrt());
    let view = |i: usize| {
        let fit = used.iter().position(|u| *u == i).and_then(|k| c.views.get(k));
        CalibrationViewReport {
            used: fit.is_some(),
            rms_px: fit.map(|f| f.rms_px),
            distance_m: fit.map(|f| f.camera_from_plane.translation.vector.norm()),
        }
    };
    CalibrationReport {
        intrinsics: intrinsics_wire(&with_sigmas(&c.camera, [sigma(0), sigma(1), sigma(2)])),
        width_px: image_px[0] as u32,
        height_px: image_px[1] as u32,
        fx_sigma_px: sigma(0),
        cx_sigma_px: sigma(1),
        cy_sigma_px: sigma(2),
        linear_fx_px: c.linear_fx_px,
        rms_px: c.rms_px,
        reduced_chi2: c.chi2 / c.dof.max(1) as f64,
        orientations: c.orientations,
        aspect_ratio: c.aspect_ratio,
        warnings: warnings(c, image_px),
        views: (0..count).map(view).collect(),
    }
}

/// The camera with its standard deviations (the larger one of the centre's), at most those that
/// frames may carry; without them where they are not finite.
fn with_sigmas(camera: &Intrinsics, [fx, cx, cy]: [f64; 3]) -> Intrinsics {
    let most = IntrinsicsSigmas::MAX_SHARE * camera.fx_px;
    let sigmas = IntrinsicsSigmas { focal_px: fx.min(most), center_px: cx.max(cy).min(most) };
    let is_known = fx.is_finite() && cx.is_finite() && cy.is_finite();
    Some(sigmas).filter(|_| is_known).and_then(|s| camera.with_sigmas(s).ok()).unwrap_or(*camera)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Matrix2, Matrix3, Rotation3, UnitQuaternion, Vector3};
    use vision::{
        frame::Distortion,
        geometry::Corners,
        pose::{LandmarkSize, reprojection::corner_points},
    };

    /// Nine views of a poster by a camera whose principal point is `cy`.
    fn views(cy: f64) -> Vec<PlanarView> {
        let camera = Intrinsics::new(600.0, 600.0, 319.5, cy, Distortion::None).unwrap();
        let size = LandmarkSize { width_m: 0.6, height_m: 0.84 };
        let front = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0);
        let front = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(front));
        let of = |i: i32| {
            let (turn, tilt) = (f64::from(i % 3 - 1) * 0.6, f64::from(i / 3 - 1) * 0.4 + 0.05);
            let rotation = UnitQuaternion::from_euler_angles(tilt, turn, 0.0) * front;
            let pose = Isometry3::from_parts(Vector3::new(0.05, 0.0, 2.0).into(), rotation);
            let px =
                corner_points(&size).map(|p| camera.project(&(pose.rotation * p + pose.translation.vector)));
            PlanarView::of_quad(&Corners::new(px).unwrap(), &[Matrix2::identity() * 0.01; 4], size)
        };
        (0..9).map(of).collect()
    }

    #[test]
    fn an_implausible_camera_gets_warnings() {
        let known = CalibrationConstraints::from(CalibrationConstraintsBody::default());
        let good = calibrated(&views(239.5), [640, 480], &known).unwrap();
        assert!(good.warnings.is_empty() && (good.intrinsics.fx_px - 600.0).abs() < 1.0, "{good:?}");
        assert_eq!((good.width_px, good.height_px), (640, 480));
        // What it is known to goes along with it.
        assert_eq!(good.intrinsics.focal_sigma_px, Some(good.fx_sigma_px));
        assert_eq!(good.intrinsics.center_sigma_px, Some(good.cx_sigma_px.max(good.cy_sigma_px)));
        let camera = Intrinsics::new(600.0, 600.0, 320.0, 240.0, Distortion::None).unwrap();
        let most = Some(IntrinsicsSigmas { focal_px: 150.0, center_px: 150.0 });
        assert_eq!(with_sigmas(&camera, [151.0, 1.0, 1e9]).sigmas, most);
        assert_eq!(with_sigmas(&camera, [f64::INFINITY, 1.0, 1.0]).sigmas, None);
        let off = calibrated(&views(420.0), [640, 480], &known).unwrap();
        assert!(off.warnings.iter().any(|d| d.contains("principal point")), "{off:?}");
        let mut bad = views(239.5);
        for (i, p) in bad.iter_mut().flat_map(|v| &mut v.seen_px).enumerate() {
            p.x += [4.0, -4.0, 3.0, -2.0, 1.0, 5.0, -3.0][i % 7];
        }
        let bad = calibrated(&bad, [640, 480], &known);
        assert!(bad.as_ref().is_err() || bad.as_ref().is_ok_and(|b| !b.warnings.is_empty()), "{bad:?}");
    }
}
