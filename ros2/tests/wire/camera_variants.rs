//! Claim: the calibrations of other people's cameras are used, or frames go without one and say
//! why.

use super::robot::{CAMERA_INFO, IMAGE, frames, image, info, robot};
use protos::{convert::geometry::intrinsics, v1};
use ros2::messages::{AnyMessage, CameraInfo};
use vision::frame::Distortion::{self, Equidistant, None, PlumbBob, RationalPolynomial};

const D5: [f64; 5] = [0.1, 0.2, 0.001, 0.002, 0.05];
const D8: [f64; 8] = [0.1, 0.2, 0.001, 0.002, 0.05, 0.01, 0.02, 0.03];
/// Of a report on a long lens: numerator and denominator nearly cancel.
const LARGE: [f64; 8] = [-13.2, -98.0, 1e-4, -2e-4, 1357.8, -13.1, -102.4, 1383.1];

/// Name of the model, coefficients and the lens.
const LENSES: &[(&str, &[f64], Distortion)] = &[
    ("plumb_bob", &[], None),
    ("plumb_bob", &[0.1], PlumbBob([0.1, 0.0, 0.0, 0.0, 0.0])),
    ("plumb_bob", &[0.1, 0.2], PlumbBob([0.1, 0.2, 0.0, 0.0, 0.0])),
    ("plumb_bob", &[0.1, 0.2, 0.001, 0.002], PlumbBob([0.1, 0.2, 0.001, 0.002, 0.0])),
    ("plumb_bob", &D5, PlumbBob(D5)),
    ("radtan", &[0.1, 0.2, 0.001, 0.002], PlumbBob([0.1, 0.2, 0.001, 0.002, 0.0])),
    ("plumb_bob", &[0.0; 5], PlumbBob([0.0; 5])),
    ("plumb_bob", &[0.1, 0.2, 0.001, 0.002, 0.05, 0.0, 0.0, 0.0], PlumbBob(D5)),
    ("plumb_bob", &[0.0; 8], PlumbBob([0.0; 5])),
    ("plumb_bob", &[0.0; 12], PlumbBob([0.0; 5])),
    ("plumb_bob", &[0.0; 14], PlumbBob([0.0; 5])),
    ("plumb_bob", &D8, RationalPolynomial(D8)),
    ("rational_polynomial", &[], None),
    ("rational_polynomial", &D5, PlumbBob(D5)),
    ("rational_polynomial", &[0.1, 0.2, 0.001, 0.002], PlumbBob([0.1, 0.2, 0.001, 0.002, 0.0])),
    ("rational_polynomial", &D8, RationalPolynomial(D8)),
    ("rational_polynomial", &[0.0; 8], PlumbBob([0.0; 5])),
    (
        "rational_polynomial",
        &[0.1, 0.2, 0.001, 0.002, 0.05, 0.01, 0.02, 0.03, 0.0, 0.0, 0.0, 0.0],
        RationalPolynomial(D8),
    ),
    (
        "rational_polynomial",
        &[0.1, 0.2, 0.001, 0.002, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        PlumbBob(D5),
    ),
    ("equidistant", &[0.1, 0.02, 0.003, 0.004], Equidistant([0.1, 0.02, 0.003, 0.004])),
    ("fisheye", &[0.1, 0.02, 0.003, 0.004], Equidistant([0.1, 0.02, 0.003, 0.004])),
    ("fisheye", &[0.0; 4], Equidistant([0.0; 4])),
    ("equidistant", &[0.1, 0.02, 0.0, 0.0, 0.0], Equidistant([0.1, 0.02, 0.0, 0.0])),
    ("equidistant", &[], None),
    ("", &[], None),
    ("", &[0.0; 5], None),
    ("none", &[0.0; 5], None),
    ("None", &[0.0; 5], None),
    ("pinhole", &[0.0; 4], None),
    ("rectified", &[0.0; 5], None),
];

type Change = fn(&mut CameraInfo<'static>);

/// What frames say.
const REFUSED: &[(&str, Change, &str)] = &[
    ("not calibrated", |i| i.k = [0.0; 9], "the camera is not calibrated"),
    ("fx negative", |i| i.k[0] = -1.0, "`fx`"),
    ("fy NaN", |i| i.k[4] = f64::NAN, "`fy`"),
    ("cx infinite", |i| i.k[2] = f64::INFINITY, "`cx`"),
    ("fx of another unit", |i| i.k[0] = 0.003, "fx_px"),
    ("cx of another unit", |i| i.k[2] = 1e6, "cx_px"),
    ("no size", |i| (i.width, i.height) = (0, 0), "`width`"),
    ("another size", |i| (i.width, i.height) = (8, 4), "(8, 4) px"),
    ("coefficient NaN", |i| i.d[1] = f64::NAN, "`d`"),
    ("thin prism", |i| i.d = vec![0.1; 12], "12 coefficients for the lens model `plumb_bob`"),
    ("tilt", |i| (i.distortion_model, i.d) = ("rational_polynomial", vec![0.1; 14]), "14 coefficients"),
    ("fisheye of five", |i| (i.distortion_model, i.d) = ("fisheye", vec![0.1; 5]), "5 coefficients"),
    ("no name with coefficients", |i| i.distortion_model = "", "the lens model ``"),
    ("another model", |i| i.distortion_model = "thin_prism_fisheye", "`thin_prism_fisheye`"),
    (
        "large coefficients of a wide lens",
        |i| {
            (i.distortion_model, i.d) = ("rational_polynomial", LARGE.to_vec());
            (i.k[0], i.k[2], i.k[4], i.k[5]) = (10.0, 20.0, 10.0, 10.0);
        },
        "rational_polynomial",
    ),
    ("a part outside", |i| (i.roi.width, i.roi.height, i.roi.x_offset) = (4, 2, 2), "`roi`"),
    ("binning of more than the image", |i| i.binning_x = 9, "`binning`"),
];

fn calibrated(info: CameraInfo<'static>) -> Result<v1::Intrinsics, String> {
    let mut robot = robot();
    robot.take(CAMERA_INFO, &AnyMessage::CameraInfo(info));
    let taken = robot.take(IMAGE, &image(1500));
    let [(frame, lacks)] = frames(&taken)[..] else { panic!("{taken:?}") };
    frame.intrinsics.clone().ok_or_else(|| lacks[0].to_string())
}

#[test]
fn a_lens_is_what_its_coefficients_are() {
    for (distortion_model, d, lens) in LENSES {
        let info = CameraInfo { distortion_model, d: d.to_vec(), ..info(900) };
        let wire = calibrated(info).unwrap_or_else(|e| panic!("{distortion_model} {d:?}: {e}"));
        assert_eq!(intrinsics(&wire).unwrap().distortion, *lens, "{distortion_model} {d:?}");
    }
    let mut long = CameraInfo { distortion_model: "rational_polynomial", d: LARGE.to_vec(), ..info(900) };
    (long.k[0], long.k[4]) = (600.0, 600.0);
    assert_eq!(calibrated(long).unwrap().rational_polynomial, LARGE);
}

#[test]
fn what_cannot_be_used_leaves_the_frame_and_is_said() {
    for (name, change, words) in REFUSED {
        let mut changed = info(900);
        change(&mut changed);
        let said = calibrated(changed).expect_err(name);
        assert!(said.contains(words), "{name}: {said}");
    }
}
