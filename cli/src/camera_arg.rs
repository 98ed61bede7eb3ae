//! A camera on the command line: numbers, or the file that `waymark camera calibrate --json` writes.

use super::arg_parsers::numbers;
use client::{api::CalibrationReport, v1};
use protos::convert::geometry::intrinsics;
use std::path::Path;
use vision::frame::{Distortion, Intrinsics, IntrinsicsSigmas};

const EXPECTED: &str = "expected fx,fy,cx,cy in pixels (and two standard deviations: focal length, centre), or the file \
    that `waymark camera calibrate --json` writes";

/// A camera: `fx,fy,cx,cy` in pixels, with standard deviations of focal length and centre where there are six numbers; or
/// the name of a file with a calibration report, or with `Intrinsics` as JSON.
pub(super) fn camera(text: &str) -> Result<Intrinsics, String> {
    let made = match (numbers(text, ','), numbers(text, ',')) {
        (Some([fx, fy, cx, cy]), _) => Intrinsics::new(fx, fy, cx, cy, Distortion::None),
        (None, Some([fx, fy, cx, cy, focal_px, center_px])) => {
            Intrinsics::new(fx, fy, cx, cy, Distortion::None)
                .and_then(|camera| camera.with_sigmas(IntrinsicsSigmas { focal_px, center_px }))
        }
        _ => return of_file(Path::new(text)),
    };
    made.map_err(|error| error.to_string())
}

fn of_file(path: &Path) -> Result<Intrinsics, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("{error}; {EXPECTED}"))?;
    let wire = match serde_json::from_slice::<CalibrationReport>(&bytes) {
        Ok(report) => with_sigmas(&report),
        Err(_not_a_report) => {
            intrinsics_alone(&bytes).map_err(|error| format!("{}: {error}; {EXPECTED}", path.display()))?
        }
    };
    intrinsics(&wire).map_err(|refused| format!("{}: {}: {}", path.display(), refused.field, refused.detail))
}

/// `Intrinsics` as JSON. All four numbers are needed: on the wire one that is left out is 0.
fn intrinsics_alone(bytes: &[u8]) -> Result<v1::Intrinsics, String> {
    let value: serde_json::Value = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
    if let Some(missing) = ["fx_px", "fy_px", "cx_px", "cy_px"].iter().find(|key| value.get(**key).is_none())
    {
        return Err(format!("{missing} is missing"));
    }
    serde_json::from_value(value).map_err(|error| error.to_string())
}

/// The intrinsics of a report with its standard deviations.
fn with_sigmas(report: &CalibrationReport) -> v1::Intrinsics {
    let mut wire = report.intrinsics.clone();
    wire.focal_sigma_px = Some(report.fx_sigma_px);
    wire.center_sigma_px = Some(report.cx_sigma_px.max(report.cy_sigma_px));
    wire
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_numbers_or_files() {
        assert!(camera("500,500,320,240").is_ok());
        assert!(camera("500,500,320").is_err() && camera("-1,500,320,240").is_err());
        let known = camera("500,500,320,240,2.5,1").unwrap();
        assert_eq!(known.sigmas, Some(IntrinsicsSigmas { focal_px: 2.5, center_px: 1.0 }));
        assert!(camera("500,500,320,240,2.5").is_err() && camera("500,500,320,240,126,1").is_err());

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.json");
        let name = path.to_str().unwrap();
        std::fs::write(&path, r#"{"fx_px": 500, "fy_px": 500, "cx_px": 320, "cy_px": 240}"#).unwrap();
        // What a frame does not say: 0.5 % and 0.3 % of the focal length.
        let usual = IntrinsicsSigmas { focal_px: 2.5, center_px: 1.5 };
        assert_eq!(camera(name).unwrap().sigmas, Some(usual));
        std::fs::write(&path, r#"{"fx_px": 500, "fy_px": 500, "cx_px": 320}"#).unwrap();
        assert!(camera(name).is_err());
        assert!(camera("nosuch.json").unwrap_err().contains("waymark camera calibrate --json"));
    }
}
