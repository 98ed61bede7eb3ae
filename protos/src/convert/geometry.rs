//! Numbers, poses, covariances and cameras: from the wire and to the wire.

use crate::{Code, Rejection, v1};
use map::{
    check::{MAX_COORDINATE_M, MAX_VARIANCE, OutOfRange},
    extrinsics::{CameraExtrinsics, MAX_MOUNTING_M},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion};
use vision::frame::{Distortion, FrameError, Intrinsics, IntrinsicsSigmas};

/// Largest accepted angle, radians: a limit for unwrapped odometry headings.
pub const MAX_ANGLE_RAD: f64 = 1e4;
/// A quaternion whose length differs from 1 by more than this is refused.
pub const QUATERNION_TOLERANCE: f64 = 1e-3;
/// Relative asymmetry and negative eigenvalue that rounding may leave in a covariance.
pub const COVARIANCE_TOLERANCE: f64 = 1e-6;

/// `value` if finite and within +-`limit`.
pub fn within(field: &str, value: f64, limit: f64) -> Result<f64, Rejection> {
    between(field, value, -limit, limit)
}

/// `value` if finite and within `low..=high`.
pub fn between(field: &str, value: f64, low: f64, high: f64) -> Result<f64, Rejection> {
    if !value.is_finite() {
        return Err(Rejection::new(Code::NotFinite, field, "the number is NaN or infinite"));
    }
    if !(low..=high).contains(&value) {
        return Err(Rejection::new(Code::OutOfRange, field, format!("{value} is outside {low} to {high}")));
    }
    Ok(value)
}

/// A rigid transform. Coordinates within [`MAX_COORDINATE_M`]; the quaternion is normalised when it
/// is within [`QUATERNION_TOLERANCE`] of unit length.
pub fn pose3(pose: &v1::Pose3) -> Result<Isometry3<f64>, Rejection> {
    let x = within("x_m", pose.x_m, MAX_COORDINATE_M)?;
    let y = within("y_m", pose.y_m, MAX_COORDINATE_M)?;
    let z = within("z_m", pose.z_m, MAX_COORDINATE_M)?;
    for (field, value) in [("qx", pose.qx), ("qy", pose.qy), ("qz", pose.qz), ("qw", pose.qw)] {
        within(field, value, 1.0 + QUATERNION_TOLERANCE)?;
    }
    let q = Quaternion::new(pose.qw, pose.qx, pose.qy, pose.qz);
    if (q.norm() - 1.0).abs() > QUATERNION_TOLERANCE {
        let detail = format!("the quaternion has length {}, not 1", q.norm());
        return Err(Rejection::new(Code::OutOfRange, "qw", detail));
    }
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(q)))
}

/// The wire form of a rigid transform, with `qw >= 0`.
pub fn pose3_wire(pose: &Isometry3<f64>) -> v1::Pose3 {
    let q = pose.rotation.quaternion();
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let t = pose.translation.vector;
    v1::Pose3 { qx: sign * q.i, qy: sign * q.j, qz: sign * q.k, qw: sign * q.w, x_m: t.x, y_m: t.y, z_m: t.z }
}

/// A pose on the floor; the heading is wrapped into (-pi, pi].
pub fn pose2(pose: &v1::Pose2) -> Result<Pose2, Rejection> {
    let x_m = within("x_m", pose.x_m, MAX_COORDINATE_M)?;
    let y_m = within("y_m", pose.y_m, MAX_COORDINATE_M)?;
    Ok(Pose2::new(x_m, y_m, within("theta_rad", pose.theta_rad, MAX_ANGLE_RAD)?))
}

/// The wire form of a pose on the floor.
pub fn pose2_wire(pose: &Pose2) -> v1::Pose2 {
    v1::Pose2 { x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad }
}

/// A pose on the floor with its covariance over (x, y, theta): 9 finite numbers, symmetric, not
/// negative.
pub fn pose2_covariance(value: &v1::Pose2Covariance) -> Result<Pose2Covariance, Rejection> {
    let pose =
        value.pose.as_ref().ok_or_else(|| Rejection::new(Code::Missing, "pose", "the pose is absent"))?;
    let pose = pose2(pose).map_err(|r| r.inside("pose"))?;
    let made = Pose2Covariance { pose, covariance: covariance(&value.covariance)? };
    made.check().map_err(|e| refused(&e))?;
    Ok(made)
}

/// The wire form of a pose with covariance.
pub fn pose2_covariance_wire(value: &Pose2Covariance) -> v1::Pose2Covariance {
    v1::Pose2Covariance {
        pose: Some(pose2_wire(&value.pose)),
        // Storage is column-major: the transpose reads row-major.
        covariance: value.covariance.transpose().as_slice().to_vec(),
    }
}

/// Extrinsics of a camera within [`MAX_MOUNTING_M`] of the robot's origin, with the default
/// covariance.
pub fn mounting(pose: &v1::Pose3) -> Result<CameraExtrinsics, Rejection> {
    let transform = pose3(pose)?;
    for (field, value) in [("x_m", pose.x_m), ("y_m", pose.y_m), ("z_m", pose.z_m)] {
        within(field, value, MAX_MOUNTING_M)?;
    }
    CameraExtrinsics::new(transform).map_err(|e| refused(&e))
}

/// An out-of-range error of `map` as a rejection.
pub fn refused(error: &OutOfRange) -> Rejection {
    let code = if error.value.is_finite() { Code::OutOfRange } else { Code::NotFinite };
    Rejection::new(code, error.field, error.to_string())
}

fn covariance(numbers: &[f64]) -> Result<Matrix3<f64>, Rejection> {
    if numbers.len() != 9 {
        let detail = format!("9 numbers expected, {} given", numbers.len());
        return Err(Rejection::new(Code::OutOfRange, "covariance", detail));
    }
    for (i, &value) in numbers.iter().enumerate() {
        within(&format!("covariance[{i}]"), value, MAX_VARIANCE)?;
    }
    let given = Matrix3::from_row_slice(numbers);
    let scale = given.diagonal().abs().max().max(f64::MIN_POSITIVE);
    let crooked = (given - given.transpose()).abs().max() > COVARIANCE_TOLERANCE * scale;
    let symmetric = (given + given.transpose()) * 0.5;
    if crooked || symmetric.symmetric_eigenvalues().min() < -COVARIANCE_TOLERANCE * scale {
        let detail = "not symmetric and positive semidefinite";
        return Err(Rejection::new(Code::OutOfRange, "covariance", detail));
    }
    Ok(symmetric)
}

/// A calibrated camera: no lens, or one of `plumb_bob` (5 coefficients), `rational_polynomial` (8),
/// `equidistant` (4). Absent standard deviations are [`IntrinsicsSigmas::usual`].
pub fn intrinsics(wire: &v1::Intrinsics) -> Result<Intrinsics, Rejection> {
    let (distortion, lens) = lens(wire)?;
    let made = Intrinsics::new(wire.fx_px, wire.fy_px, wire.cx_px, wire.cy_px, distortion);
    made.and_then(|camera| {
        // No camera is exact: absent standard deviations get usual values.
        let usual = IntrinsicsSigmas::usual(camera.fx_px);
        let focal_px = wire.focal_sigma_px.unwrap_or(usual.focal_px);
        camera.with_sigmas(IntrinsicsSigmas {
            focal_px,
            center_px: wire.center_sigma_px.unwrap_or(usual.center_px),
        })
    })
    .map_err(|error| match &error {
        FrameError::Intrinsics { field, value } => {
            let field = if *field == "distortion" { lens } else { field };
            let code = if value.is_finite() { Code::OutOfRange } else { Code::NotFinite };
            Rejection::new(code, field, error.to_string())
        }
        FrameError::Size { .. } | FrameError::Length { .. } | FrameError::Planes { .. } => {
            Rejection::new(Code::OutOfRange, "", error.to_string())
        }
    })
}

/// Checked intrinsics of an image of this width and height, px: those that state another scale are
/// scaled. Errors: `size_mismatch` with the field `width_px` for other proportions; half a stated
/// size.
pub fn intrinsics_of_picture(wire: &v1::Intrinsics, picture: [usize; 2]) -> Result<Intrinsics, Rejection> {
    let camera = intrinsics(wire)?;
    let stated = match (wire.width_px, wire.height_px) {
        (None, None) => return Ok(camera),
        (Some(width @ 1..), Some(height @ 1..)) => [width as usize, height as usize],
        (width, _) => {
            let field = if matches!(width, None | Some(0)) { "width_px" } else { "height_px" };
            let detail = "width_px and height_px are those of one picture: both from 1, or neither";
            return Err(Rejection::new(Code::OutOfRange, field, detail));
        }
    };
    let scaled = camera.for_picture(Some(stated), picture);
    scaled.map_err(|error| Rejection::new(Code::SizeMismatch, "width_px", error.to_string()))
}

/// The lens of a camera and the field that gives it. At most one may be given.
fn lens(wire: &v1::Intrinsics) -> Result<(Distortion, &'static str), Rejection> {
    let counted = |field: &str, wanted: usize, given: usize| {
        let detail = format!("0 or {wanted} coefficients expected, {given} given");
        Rejection::new(Code::OutOfRange, field, detail)
    };
    let mut made = (Distortion::None, "plumb_bob");
    if !wire.plumb_bob.is_empty() {
        let k = wire.plumb_bob.as_slice().try_into();
        made.0 = Distortion::PlumbBob(k.map_err(|_size| counted(made.1, 5, wire.plumb_bob.len()))?);
    }
    for (field, given) in
        [("rational_polynomial", &wire.rational_polynomial), ("equidistant", &wire.equidistant)]
    {
        if given.is_empty() {
            continue;
        }
        if made.0 != Distortion::None {
            let detail = format!("{} is given as well; a camera has one lens model", made.1);
            return Err(Rejection::new(Code::OutOfRange, field, detail));
        }
        let k = given.as_slice();
        let distortion = if field == "equidistant" {
            k.try_into().map(Distortion::Equidistant).map_err(|_size| counted(field, 4, k.len()))?
        } else {
            k.try_into().map(Distortion::RationalPolynomial).map_err(|_size| counted(field, 8, k.len()))?
        };
        made = (distortion, field);
    }
    Ok(made)
}

/// The wire form of a camera.
pub fn intrinsics_wire(camera: &Intrinsics) -> v1::Intrinsics {
    let mut made = v1::Intrinsics {
        fx_px: camera.fx_px,
        fy_px: camera.fy_px,
        cx_px: camera.cx_px,
        cy_px: camera.cy_px,
        focal_sigma_px: camera.sigmas.map(|s| s.focal_px),
        center_sigma_px: camera.sigmas.map(|s| s.center_px),
        ..v1::Intrinsics::default()
    };
    let k = camera.distortion.coefficients().to_vec();
    match camera.distortion {
        Distortion::None => {}
        Distortion::PlumbBob(_) => made.plumb_bob = k,
        Distortion::RationalPolynomial(_) => made.rational_polynomial = k,
        Distortion::Equidistant(_) => made.equidistant = k,
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn camera() -> v1::Intrinsics {
        v1::Intrinsics {
            fx_px: 700.0,
            fy_px: 710.0,
            cx_px: 320.0,
            cy_px: 240.0,
            focal_sigma_px: Some(1.5),
            center_sigma_px: Some(0.0),
            ..v1::Intrinsics::default()
        }
    }

    #[test]
    fn intrinsics_of_another_size_are_scaled_or_refused() {
        let of = |width_px, height_px, picture| {
            let stated = v1::Intrinsics { width_px, height_px, ..camera() };
            intrinsics_of_picture(&stated, picture).map(|k| k.fx_px).map_err(|r| (r.code, r.field))
        };
        assert_eq!(of(None, None, [1280, 960]), Ok(700.0));
        assert_eq!(of(Some(640), Some(480), [640, 480]), Ok(700.0));
        assert_eq!(of(Some(640), Some(480), [1280, 960]), Ok(1400.0));
        let mismatch = Err((Code::SizeMismatch, "width_px".to_owned()));
        assert_eq!(of(Some(640), Some(480), [480, 640]), mismatch);
        assert_eq!(of(Some(640), Some(480), [640, 360]), mismatch);
        let half = |field: &str| Err((Code::OutOfRange, field.to_owned()));
        assert_eq!(of(Some(640), None, [640, 480]), half("height_px"));
        assert_eq!(of(None, Some(480), [640, 480]), half("width_px"));
        assert_eq!(of(Some(0), Some(480), [640, 480]), half("width_px"));
    }

    #[test]
    fn a_camera_comes_back() {
        let mut wire = camera();
        assert_eq!(intrinsics_wire(&intrinsics(&wire).unwrap()), wire);
        wire.plumb_bob = vec![0.1, -0.2, 0.001, 0.002, 0.03];
        assert_eq!(intrinsics_wire(&intrinsics(&wire).unwrap()), wire);
        wire = v1::Intrinsics { rational_polynomial: vec![0.1; 8], ..camera() };
        assert_eq!(intrinsics(&wire).unwrap().distortion, Distortion::RationalPolynomial([0.1; 8]));
        assert_eq!(intrinsics_wire(&intrinsics(&wire).unwrap()), wire);
        wire = v1::Intrinsics { equidistant: vec![0.1; 4], ..camera() };
        assert_eq!(intrinsics(&wire).unwrap().distortion, Distortion::Equidistant([0.1; 4]));
        assert_eq!(intrinsics_wire(&intrinsics(&wire).unwrap()), wire);
    }

    #[test]
    fn a_camera_of_which_nothing_is_said_is_a_usual_one() {
        let silent = v1::Intrinsics { focal_sigma_px: None, center_sigma_px: None, ..camera() };
        let read = intrinsics(&silent).unwrap();
        assert_eq!(read.sigmas, Some(IntrinsicsSigmas { focal_px: 3.5, center_px: 2.1 }));
        // What is stated for one of them stays.
        let half = intrinsics(&v1::Intrinsics { focal_sigma_px: None, ..camera() }).unwrap();
        assert_eq!(half.sigmas, Some(IntrinsicsSigmas { focal_px: 3.5, center_px: 0.0 }));
        // A camera that is built by hand says nothing, and so does its message.
        let bare = Intrinsics { sigmas: None, ..read };
        assert_eq!(intrinsics_wire(&bare), silent);
    }

    #[test]
    fn a_bad_camera_names_its_field() {
        let refused = |change: fn(&mut v1::Intrinsics)| {
            let mut wire = camera();
            change(&mut wire);
            let r = intrinsics(&wire).unwrap_err();
            (r.code, r.field)
        };
        assert_eq!(refused(|c| c.fx_px = f64::NAN), (Code::NotFinite, "fx_px".into()));
        assert_eq!(refused(|c| c.fy_px = 0.0), (Code::OutOfRange, "fy_px".into()));
        assert_eq!(refused(|c| c.cx_px = f64::INFINITY), (Code::NotFinite, "cx_px".into()));
        assert_eq!(refused(|c| c.cy_px = 1e39), (Code::OutOfRange, "cy_px".into()));
        assert_eq!(refused(|c| c.plumb_bob = vec![0.0; 4]), (Code::OutOfRange, "plumb_bob".into()));
        assert_eq!(refused(|c| c.plumb_bob = vec![f64::NAN; 5]), (Code::NotFinite, "plumb_bob".into()));
        let (rational, equidistant) = ("rational_polynomial".to_owned(), "equidistant".to_owned());
        assert_eq!(refused(|c| c.rational_polynomial = vec![0.0; 5]), (Code::OutOfRange, rational.clone()));
        assert_eq!(refused(|c| c.rational_polynomial = vec![101.0; 8]), (Code::OutOfRange, rational));
        assert_eq!(refused(|c| c.equidistant = vec![0.0; 5]), (Code::OutOfRange, equidistant.clone()));
        assert_eq!(refused(|c| c.focal_sigma_px = Some(175.1)), (Code::OutOfRange, "focal_sigma_px".into()));
        assert_eq!(
            refused(|c| c.focal_sigma_px = Some(f64::NAN)),
            (Code::NotFinite, "focal_sigma_px".into())
        );
        assert_eq!(refused(|c| c.center_sigma_px = Some(-0.1)), (Code::OutOfRange, "center_sigma_px".into()));
        let two = |c: &mut v1::Intrinsics| (c.plumb_bob, c.equidistant) = (vec![0.0; 5], vec![0.1; 4]);
        assert_eq!(refused(two), (Code::OutOfRange, equidistant));
    }

    #[test]
    fn covariances_at_their_bounds() {
        let field = |numbers: &[f64]| covariance(numbers).map_err(|r| (r.code, r.field));
        assert!(field(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]).is_ok());
        assert_eq!(field(&[1.0; 8]), Err((Code::OutOfRange, "covariance".into())));
        let mut c = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        c[4] = f64::NAN;
        assert_eq!(field(&c), Err((Code::NotFinite, "covariance[4]".into())));
        c[4] = -1.0;
        assert_eq!(field(&c), Err((Code::OutOfRange, "covariance".into())));
        c[4] = 1.0;
        c[1] = 0.5;
        assert_eq!(field(&c), Err((Code::OutOfRange, "covariance".into())));
        c[3] = 0.5;
        assert!(field(&c).is_ok());
        c[1] = 1.5;
        c[3] = 1.5;
        assert_eq!(field(&c), Err((Code::OutOfRange, "covariance".into())));
    }

    #[test]
    fn a_camera_far_from_its_robot_is_refused() {
        let at = |y_m| mounting(&v1::Pose3 { qw: 1.0, y_m, ..v1::Pose3::default() });
        assert!(at(MAX_MOUNTING_M).is_ok());
        let refused = at(MAX_MOUNTING_M + 0.01).unwrap_err();
        assert_eq!((refused.code, refused.field.as_str()), (Code::OutOfRange, "y_m"));
    }

    #[test]
    fn a_quaternion_off_the_unit_is_refused() {
        let mut wire = v1::Pose3 { qw: 1.0 + 0.9e-3, ..v1::Pose3::default() };
        assert!(pose3(&wire).is_ok());
        wire.qw = 1.0 - 1.1e-3;
        assert_eq!(pose3(&wire).unwrap_err().field, "qw");
        wire.qw = 0.0;
        assert_eq!(pose3(&wire).unwrap_err().code, Code::OutOfRange);
        wire.qx = f64::NAN;
        assert_eq!(pose3(&wire).unwrap_err().code, Code::NotFinite);
    }

    #[test]
    fn coordinates_at_the_bound() {
        let at = |x_m| pose2(&v1::Pose2 { x_m, y_m: 0.0, theta_rad: 0.0 }).is_ok();
        assert!(at(MAX_COORDINATE_M) && at(-MAX_COORDINATE_M));
        assert!(!at(MAX_COORDINATE_M * 1.000_001) && !at(f64::NAN));
    }

    proptest! {
        #[test]
        fn poses_come_back(x in -1e4..1e4, y in -1e4..1e4, z in -1e4..1e4,
                           r in -3.0..3.0, p in -1.5..1.5, w in -3.1..3.1) {
            let pose = Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(r, p, w));
            let back = pose3(&pose3_wire(&pose)).unwrap();
            prop_assert!((back.to_homogeneous() - pose.to_homogeneous()).abs().max() < 1e-9);
            prop_assert!(pose3_wire(&pose).qw >= 0.0);
            let floor = v1::Pose2 { x_m: x, y_m: y, theta_rad: w };
            let back = pose2_wire(&pose2(&floor).unwrap());
            prop_assert!((back.theta_rad - w).abs() < 1e-9 && (back.x_m - x).abs() < 1e-9);
        }

        #[test]
        fn any_number_passes_or_names_its_field(x in any::<f64>(), y in any::<f64>(), t in any::<f64>()) {
            match pose2(&v1::Pose2 { x_m: x, y_m: y, theta_rad: t }) {
                Ok(p) => prop_assert!(p.check().is_ok()),
                Err(r) => prop_assert!(["x_m", "y_m", "theta_rad"].contains(&r.field.as_str())),
            }
        }
    }
}
