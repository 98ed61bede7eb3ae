//! Parsers of command line values: sizes, cameras, distances.

use client::api::Size;
use vision::{
    frame::{Intrinsics, IntrinsicsSigmas},
    recognise::DistanceKind,
};

/// `N` finite numbers.
pub(super) fn numbers<const N: usize>(text: &str, separator: char) -> Option<[f64; N]> {
    let parts: Option<Vec<f64>> =
        text.split(separator).map(|part| part.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    parts?.try_into().ok()
}

/// Width and height, metres: `0.60x0.84`.
pub(super) fn size(text: &str) -> Result<Size, String> {
    match numbers(text, 'x') {
        Some([width_m, height_m]) if width_m > 0.0 && height_m > 0.0 => Ok(Size { width_m, height_m }),
        _ => Err("width and height in metres, such as 0.60x0.84".to_owned()),
    }
}

/// A pinhole camera `fx,fy,cx,cy` in pixels, with standard deviations of focal length and centre where there are six.
pub(super) fn camera(text: &str) -> Result<Intrinsics, String> {
    let (pinhole, sigmas) = match (numbers(text, ','), numbers(text, ',')) {
        (Some(four), _) => (four, None),
        (None, Some([fx, fy, cx, cy, focal_px, center_px])) => {
            ([fx, fy, cx, cy], Some(IntrinsicsSigmas { focal_px, center_px }))
        }
        _ => {
            return Err(
                "four numbers: fx,fy,cx,cy in pixels; or six, with two standard deviations".to_owned()
            );
        }
    };
    let [fx, fy, cx, cy] = pinhole;
    let made = Intrinsics::new(fx, fy, cx, cy, vision::frame::Distortion::None);
    made.and_then(|camera| sigmas.map_or(Ok(camera), |s| camera.with_sigmas(s))).map_err(|e| e.to_string())
}

/// A distance of icons by its name.
pub fn distance(text: &str) -> Result<DistanceKind, String> {
    serde_json::from_value(serde_json::Value::from(text))
        .map_err(|error| format!("{error}; one of: both, correlation, hausdorff"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_cameras_are_checked() {
        assert_eq!(size("0.60x0.84").unwrap(), Size { width_m: 0.6, height_m: 0.84 });
        assert!(
            size("0.6").is_err() && size("0x1").is_err() && size("axb").is_err() && size("infx1").is_err()
        );
        assert!(camera("500,500,320,240").is_ok());
        assert!(camera("500,500,320").is_err() && camera("-1,500,320,240").is_err());
        let known = camera("500,500,320,240,2.5,1").unwrap();
        assert_eq!(known.sigmas, Some(IntrinsicsSigmas { focal_px: 2.5, center_px: 1.0 }));
        assert!(camera("500,500,320,240,2.5").is_err() && camera("500,500,320,240,126,1").is_err());
    }
}
