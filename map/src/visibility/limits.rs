//! What the landmark and the camera alone allow, without any wall: incidence, apparent size, fit in the image, tilt
//! (method 12.1 to 12.3), as bounds over direction. Arcs become chords.

use super::{
    MAX_SLOPE, Viewer, VisibilityParams,
    envelope::{Envelope, Piece},
};
use crate::place::LandmarkPlace;
use std::f64::consts::FRAC_PI_2;

/// Largest distance between an arc and its chord, metres.
const MAX_SAGITTA_M: f64 = 2e-4;
/// Longest and shortest chord, as the angle seen from the landmark.
const CHORD_RAD: [f64; 2] = [0.002, 0.05];

/// A circle whose inside is allowed (far) or forbidden (near): centre on the landmark's axis, this far before the origin.
#[derive(Debug, Clone, Copy)]
struct Disc {
    ahead_m: f64,
    radius_m: f64,
}

impl Disc {
    /// Where a ray from the origin leaves it. None when the origin is outside.
    fn exit_m(&self, direction_rad: f64) -> Option<f64> {
        if self.ahead_m.abs() >= self.radius_m {
            return None;
        }
        let (s, c) = direction_rad.sin_cos();
        let across = self.ahead_m * s;
        Some(self.ahead_m * c + (self.radius_m.powi(2) - across * across).sqrt())
    }

    /// Its rim before the landmark as chords; empty when the origin is outside.
    fn rim(&self) -> Vec<Piece> {
        let edge = MAX_SLOPE.atan();
        // The origin sees a circle through it under half the angle of its centre: the step serves both.
        let step = (1.0 - MAX_SAGITTA_M / self.radius_m).max(0.0).acos().clamp(CHORD_RAD[0], CHORD_RAD[1]);
        let count = (2.0 * edge / step).ceil();
        let point = |i: usize| {
            let angle = -edge + 2.0 * edge * (i as f64 / count);
            self.exit_m(angle).map(|r| (angle.tan(), 1.0 / (r * angle.cos())))
        };
        (0..count as usize).filter_map(|i| Piece::through(point(i)?, point(i + 1)?)).collect()
    }
}

/// The bounds of one landmark for one camera.
pub(super) struct Limits {
    /// Each of them bounds what is far.
    pub far: Vec<Piece>,
    /// Nearer than this is too near; empty for no bound.
    pub near: Envelope,
    /// Nothing is further.
    pub reach_m: f64,
}

/// Nearest and furthest distance on the floor at which the unit can tilt towards the landmark's centre.
fn tilt_range_m(rise_m: f64, [low, high]: [f64; 2]) -> Option<(f64, f64)> {
    // Looking down at a landmark is looking up at its mirror image.
    let (rise, low, high) = if rise_m < 0.0 { (-rise_m, -high, -low) } else { (rise_m, low, high) };
    if rise < 1e-9 {
        return (low <= 0.0 && high >= 0.0).then_some((0.0, f64::INFINITY));
    }
    if high <= 0.0 {
        return None;
    }
    let far = if low > 0.0 { rise / low.tan() } else { f64::INFINITY };
    Some((rise / high.min(FRAC_PI_2 - 1e-6).tan(), far))
}

/// Furthest distance of the area from its origin; None when the landmark can be seen from nowhere.
pub(super) fn reach_m(place: &LandmarkPlace, viewer: &Viewer, p: &VisibilityParams) -> Option<f64> {
    let (_, tilt_far) = tilt_range_m(place.z_m - viewer.camera_height_m, viewer.tilt_rad)?;
    let wide = viewer.focal_px * place.size.width_m / p.min_side_px;
    let high = viewer.focal_px * place.size.height_m / p.min_side_px;
    let reach = wide.min(high).min(tilt_far);
    (reach > p.standoff_m).then_some(reach)
}

/// All bounds; None when nothing is left.
pub(super) fn limits(place: &LandmarkPlace, viewer: &Viewer, p: &VisibilityParams) -> Option<Limits> {
    let reach_m = reach_m(place, viewer, p)?;
    let (width, height) = (place.size.width_m, place.size.height_m);
    let (tilt_near, tilt_far) = tilt_range_m(place.z_m - viewer.camera_height_m, viewer.tilt_rad)?;
    // About the landmark's centre, which is behind the origin; and tangent to its wall there.
    let about = |radius_m: f64| Disc { ahead_m: -p.standoff_m, radius_m };
    let tangent =
        |diameter_m: f64| Disc { ahead_m: 0.5 * diameter_m - p.standoff_m, radius_m: 0.5 * diameter_m };
    let mut far = tangent(viewer.focal_px * width / p.min_side_px).rim();
    far.extend(about(viewer.focal_px * height / p.min_side_px).rim());
    if tilt_far.is_finite() {
        far.extend(about(tilt_far).rim());
    }
    let steepest = p.max_incidence_rad.tan();
    for side in [-1.0, 1.0] {
        // y = steepest (x + standoff) beyond the slope where the ray is parallel to it.
        let edge = (MAX_SLOPE / steepest - 1.0) / p.standoff_m;
        far.extend(Piece::through((side * steepest, 0.0), (side * MAX_SLOPE, edge)));
    }
    let fill = 2.0 * p.max_fill;
    let nears = [
        tangent(width / (fill * 0.5 * viewer.width_px / viewer.focal_px)),
        about(height / (fill * 0.5 * viewer.height_px / viewer.focal_px)),
        about(tilt_near),
    ];
    let rims = nears.iter().map(|d| Envelope::upper(d.rim())).filter(|e| !e.pieces().is_empty());
    let near = rims.reduce(Envelope::lower).unwrap_or_default();
    Some(Limits { far, near, reach_m })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tilt_bounds_distances_on_both_sides() {
        let (near, far) = tilt_range_m(1.0, [-0.3, 0.5]).unwrap();
        assert!((near - 1.0 / 0.5_f64.tan()).abs() < 1e-12 && far.is_infinite());
        let (near, far) = tilt_range_m(-1.0, [-0.5, -0.1]).unwrap();
        assert!((near - 1.0 / 0.5_f64.tan()).abs() < 1e-12 && (far - 1.0 / 0.1_f64.tan()).abs() < 1e-12);
        assert_eq!(tilt_range_m(1.0, [-0.5, -0.1]), None, "it hangs above, the unit looks down");
        assert_eq!(tilt_range_m(0.0, [0.1, 0.2]), None);
        assert_eq!(tilt_range_m(0.0, [-0.1, 0.2]), Some((0.0, f64::INFINITY)));
    }

    #[test]
    fn rays_leave_a_disc_on_its_rim() {
        let disc = Disc { ahead_m: 1.4, radius_m: 1.5 };
        for k in -8..=8 {
            let angle = 0.19 * f64::from(k);
            let r = disc.exit_m(angle).unwrap();
            let (x, y) = (r * angle.cos() - 1.4, r * angle.sin());
            assert!((x.hypot(y) - 1.5).abs() < 1e-12);
        }
        assert_eq!(Disc { ahead_m: -0.05, radius_m: 0.05 }.exit_m(0.0), None);
    }
}
