//! Parsers of command line values: sizes, cameras, distances.

use client::api::Size;
use vision::recognise::DistanceKind;

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

/// A height above the floor: 0 to 10 m.
pub(super) fn height_m(text: &str) -> Result<f64, String> {
    let height: Option<f64> = text.trim().parse().ok();
    height
        .filter(|h| (0.0..=10.0).contains(h))
        .ok_or_else(|| "a height above the floor: 0 to 10 m".to_owned())
}

/// Four corners `x,y,x,y,x,y,x,y`, pixels.
pub(super) fn corners(text: &str) -> Result<[[f64; 2]; 4], String> {
    let numbers: Option<[f64; 8]> = numbers(text, ',');
    numbers.map(|n| [[n[0], n[1]], [n[2], n[3]], [n[4], n[5]], [n[6], n[7]]]).ok_or_else(|| {
        "eight numbers: x,y of top-left, top-right, bottom-right, bottom-left in pixels".to_owned()
    })
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
    fn sizes_heights_and_corners_are_checked() {
        assert_eq!(size("0.60x0.84").unwrap(), Size { width_m: 0.6, height_m: 0.84 });
        assert!(
            size("0.6").is_err() && size("0x1").is_err() && size("axb").is_err() && size("infx1").is_err()
        );
        assert!(
            height_m("1.5").is_ok()
                && height_m("-3").is_err()
                && height_m("10.1").is_err()
                && height_m("x").is_err()
        );
        assert!(corners("1,2,3,4,5,6,7,8").is_ok_and(|c| c[3][0] > 6.9 && c[3][0] < 7.1));
        assert!(corners("1,2,3,4,5,6,7").is_err());
    }
}
