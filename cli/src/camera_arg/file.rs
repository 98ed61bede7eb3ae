//! Files of cameras. In: the report of `waymark camera calibrate --json`, `Intrinsics` as JSON, or
//! the YAML file of ROS' `camera_calibration` (`ost.yaml`) and of OpenCV. Out: intrinsics, and the
//! size of picture that they are of.

use super::{CameraArg, lens::Lens};
use client::{api::CalibrationReport, v1};
use protos::convert::geometry::intrinsics;
use ros2::{
    convert::{CameraModel, LensModel},
    messages::CameraInfo,
};
use serde::Deserialize;
use std::path::Path;

const EXPECTED: &str = "expected fx,fy,cx,cy in pixels (and two standard deviations: focal length, centre), the file \
    that `waymark camera calibrate --json` writes, or the ost.yaml of ROS";
/// Largest file: the report of thousands of views has less.
const MAX_BYTES: usize = 1 << 20;

pub(super) fn camera(path: &Path) -> Result<CameraArg, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("{error}; {EXPECTED}"))?;
    let text = (bytes.len() <= MAX_BYTES).then(|| std::str::from_utf8(&bytes).ok()).flatten();
    let text = text.map(|text| text.trim_start_matches('\u{feff}').trim_start());
    let read = match text {
        None => Err("no text file of a camera".to_owned()),
        Some(text) if text.starts_with('{') => of_json(text),
        Some(text) => of_yaml(text),
    };
    let (wire, size_px, lens) = read.map_err(|error| format!("{}: {error}; {EXPECTED}", path.display()))?;
    let intrinsics = intrinsics(&wire)
        .map_err(|refused| format!("{}: {}: {}", path.display(), refused.field, refused.detail))?;
    Ok(CameraArg { intrinsics, size_px, lens })
}

type Read = Result<(v1::Intrinsics, Option<[usize; 2]>, Option<Lens>), String>;

/// What `waymark camera calibrate` adds to a report.
#[derive(Deserialize)]
struct WithLens {
    #[serde(default)]
    lens: Option<Lens>,
}

fn of_json(text: &str) -> Read {
    if let Ok(report) = serde_json::from_str::<CalibrationReport>(text) {
        let size_px = [report.width_px as usize, report.height_px as usize];
        let lens = serde_json::from_str::<WithLens>(text).ok().and_then(|with| with.lens);
        return Ok((with_sigmas(&report), Some(size_px), lens));
    }
    let value: serde_json::Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    // All four numbers are needed: on the wire one that is left out is 0.
    if let Some(missing) = ["fx_px", "fy_px", "cx_px", "cy_px"].iter().find(|key| value.get(**key).is_none())
    {
        return Err(format!("{missing} is missing"));
    }
    let side = |key: &str| value.get(key).and_then(serde_json::Value::as_u64).filter(|side| *side > 0);
    let size_px = side("width_px").zip(side("height_px")).map(|(w, h)| [w as usize, h as usize]);
    let wire: v1::Intrinsics = serde_json::from_value(value).map_err(|error| error.to_string())?;
    Ok((with_lens(wire)?, size_px, None))
}

/// The lens by what is in the lists, as in messages of ROS: fewer coefficients, or more that are 0.
fn with_lens(wire: v1::Intrinsics) -> Result<v1::Intrinsics, String> {
    let lists = [
        ("plumb_bob", &wire.plumb_bob),
        ("rational_polynomial", &wire.rational_polynomial),
        ("equidistant", &wire.equidistant),
    ];
    let mut given = lists.iter().filter(|(_, list)| !list.is_empty());
    let (Some((name, list)), None) = (given.next(), given.next()) else { return Ok(wire) };
    let lens = LensModel::of(name, list).map_err(|error| error.to_string())?;
    let (width_px, height_px) = (1, 1);
    let v1::Intrinsics { fx_px, fy_px, cx_px, cy_px, .. } = wire;
    let read = CameraModel { width_px, height_px, fx_px, fy_px, cx_px, cy_px, lens }.to_wire();
    let (focal_sigma_px, center_sigma_px) = (wire.focal_sigma_px, wire.center_sigma_px);
    Ok(v1::Intrinsics { focal_sigma_px, center_sigma_px, ..read })
}

/// The intrinsics of a report with its standard deviations.
fn with_sigmas(report: &CalibrationReport) -> v1::Intrinsics {
    let mut wire = report.intrinsics.clone();
    wire.focal_sigma_px = Some(report.fx_sigma_px);
    wire.center_sigma_px = Some(report.cx_sigma_px.max(report.cy_sigma_px));
    wire
}

/// The file of ROS' `camera_calibration`, or of OpenCV's calibration, which names no model.
#[derive(Deserialize)]
struct RosFile {
    image_width: u32,
    image_height: u32,
    camera_matrix: Matrix,
    #[serde(default)]
    distortion_model: Option<String>,
    distortion_coefficients: Option<Matrix>,
}

#[derive(Deserialize)]
struct Matrix {
    data: Vec<f64>,
}

fn of_yaml(text: &str) -> Read {
    // OpenCV's files begin with a directive and have types that are not of YAML.
    let lines = text.lines().filter(|line| !line.starts_with('%'));
    let plain = lines.collect::<Vec<_>>().join("\n").replace("!!opencv-matrix", "");
    let options = serde_saphyr::options! { with_snippet: false };
    let file: RosFile =
        serde_saphyr::from_str_with_options(&plain, options).map_err(|error| error.to_string())?;
    let k: [f64; 9] = file
        .camera_matrix
        .data
        .try_into()
        .map_err(|data: Vec<f64>| format!("camera_matrix has {} numbers, not 9", data.len()))?;
    let info = CameraInfo {
        width: file.image_width,
        height: file.image_height,
        distortion_model: file.distortion_model.as_deref().unwrap_or("plumb_bob"),
        d: file.distortion_coefficients.map_or(Vec::new(), |matrix| matrix.data),
        k,
        ..CameraInfo::default()
    };
    let model = CameraModel::of_raw(&info).map_err(|error| error.to_string())?;
    Ok((model.to_wire(), Some([model.width_px as usize, model.height_px as usize]), None))
}

#[cfg(test)]
mod tests {
    use super::*;
    use vision::frame::{Distortion, IntrinsicsSigmas};

    const OST: &str = "image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo\ncamera_matrix:\n  rows: 3\n  \
        cols: 3\n  data: [600., 0., 319.5, 0., 601., 239.5, 0., 0., 1.]\ndistortion_model: plumb_bob\n\
        distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.1, 0.2, 0., 0., 0.3]\n";

    fn of(text: &str) -> Result<CameraArg, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera");
        std::fs::write(&path, text).unwrap();
        camera(&path)
    }

    #[test]
    fn json_is_read_with_its_size() {
        let read = of(r#"{"fx_px": 500, "fy_px": 500, "cx_px": 320, "cy_px": 240}"#).unwrap();
        // What a frame does not say: 0.5 % and 0.3 % of the focal length.
        let usual = IntrinsicsSigmas { focal_px: 2.5, center_px: 1.5 };
        assert_eq!((read.intrinsics.sigmas, read.size_px), (Some(usual), None));
        let sized =
            r#"{"fx_px": 500, "fy_px": 500, "cx_px": 320, "cy_px": 240, "width_px": 640, "height_px": 480}"#;
        assert_eq!(of(sized).unwrap().size_px, Some([640, 480]));
        assert!(
            of(r#"{"fx_px": 500, "fy_px": 500, "cx_px": 320}"#).unwrap_err().contains("cy_px is missing")
        );
        let report = r#"{"intrinsics": {"fx_px": 600, "fy_px": 600, "cx_px": 319, "cy_px": 239}, "width_px": 640,
            "height_px": 480, "fx_sigma_px": 5.0, "cx_sigma_px": 3.0, "cy_sigma_px": 4.0, "linear_fx_px": null,
            "rms_px": 0.1, "reduced_chi2": 1.0, "orientations": 3, "aspect_ratio": 1.0, "warnings": [], "views": []}"#;
        let read = of(report).unwrap();
        assert_eq!(read.size_px, Some([640, 480]));
        assert_eq!(read.intrinsics.sigmas, Some(IntrinsicsSigmas { focal_px: 5.0, center_px: 4.0 }));
        assert_eq!(read.lens, None);
        let with_lens =
            report.replace(r#""views": []"#, r#""views": [], "lens": {"model": "X1", "focal_35mm": 26}"#);
        assert_eq!(of(&with_lens).unwrap().lens.unwrap().to_string(), "X1, 26 mm (35 mm equivalent)");
    }

    #[test]
    fn lenses_are_read_as_in_messages_of_ros() {
        let with = |list: &str| {
            of(&format!(r#"{{"fx_px": 500, "fy_px": 500, "cx_px": 320, "cy_px": 240, {list}}}"#))
        };
        let lens = |list: &str| with(list).unwrap().intrinsics.distortion;
        assert_eq!(lens(r#""plumb_bob": [0.1, 0.2, 0, 0]"#), Distortion::PlumbBob([0.1, 0.2, 0.0, 0.0, 0.0]));
        let long = r#""rational_polynomial": [0.1, 0.2, 0, 0, 0.3, 0.4, 0.5, 0.6, 0, 0, 0, 0, 0, 0]"#;
        assert_eq!(lens(long), Distortion::RationalPolynomial([0.1, 0.2, 0.0, 0.0, 0.3, 0.4, 0.5, 0.6]));
        assert!(with(r#""equidistant": [1, 2, 3, 4, 5]"#).is_err());
        assert!(with(r#""plumb_bob": [0.1], "equidistant": [0.1]"#).is_err());
    }

    #[test]
    fn the_yaml_files_of_ros_and_opencv_are_read() {
        for text in
            [OST.to_owned(), format!("\u{feff}{OST}"), OST.replace('\n', "\r\n"), format!("# taken\n{OST}")]
        {
            let read = of(&text).unwrap();
            assert_eq!(read.size_px, Some([640, 480]));
            let k = read.intrinsics;
            let expected = [600.0, 601.0, 319.5, 239.5];
            let read = [k.fx_px, k.fy_px, k.cx_px, k.cy_px];
            assert!(read.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{read:?}");
            assert_eq!(k.distortion, Distortion::PlumbBob([0.1, 0.2, 0.0, 0.0, 0.3]));
        }
        let opencv = OST
            .replace("camera_matrix:", "camera_matrix: !!opencv-matrix")
            .replace("distortion_model: plumb_bob\n", "");
        assert!(of(&format!("%YAML:1.0\n---\n{opencv}")).is_ok());
        let fisheye = OST.replace("plumb_bob", "fisheye").replace("0., 0., 0.3]", "0., 0.]");
        assert_eq!(
            of(&fisheye).unwrap().intrinsics.distortion,
            Distortion::Equidistant([0.1, 0.2, 0.0, 0.0])
        );
        for (from, to, words) in [
            ("image_width: 640\n", "", "image_width"),
            ("camera_matrix:", "matrix:", "camera_matrix"),
            (", 0., 0., 1.]", "]", "6 numbers, not 9"),
            ("600., 0., 319.5", "0., 0., 319.5", "fx"),
            ("plumb_bob", "thin_prism", "thin_prism"),
        ] {
            let error = of(&OST.replace(from, to)).unwrap_err();
            assert!(error.contains(words), "{words}: {error}");
        }
        assert!(camera(Path::new("nosuch.json")).unwrap_err().contains("waymark camera calibrate --json"));
        assert!(of("hello").unwrap_err().contains("ost.yaml"));
    }
}
