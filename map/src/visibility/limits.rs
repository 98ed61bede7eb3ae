//! The limits of landmark and camera without any wall: incidence, apparent size, fit in the image,
//! tilt range (method 12.1 to 12.3), for a landmark of any tilt. In one direction on the floor each
//! limit allows one range of distances, in closed form except for the height, whose ends are roots
//! of a quartic.

use crate::visibility::{
    local_frame::Moved,
    settings::{PanTiltCamera, VisibilityParams},
};
use std::f64::consts::FRAC_PI_2;
use vision::pose::LandmarkSize;

/// A landmark nearer to the camera's height than this counts as this far above it, metres, so that
/// elevations are defined.
const MIN_RISE_M: f64 = 1e-6;
/// Bisections of a range in which a bound is sought: a relative precision of 1e-15.
const HALVINGS: u32 = 50;
/// Golden section: share of a range kept in the search for the largest apparent height.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// The conditions of one landmark for one camera.
///
/// The camera is at (r cos d, r sin d, -rise) from the landmark's middle, direction d from its
/// normal on the floor. The normal is n = (cos t, 0, -sin t), its height runs along u = (sin t, 0,
/// cos t), its width along (0, 1, 0).
// Departs from method 12.1 to 12.3: these are its conditions in space. For a landmark at the
// camera's height, on a wall, they are those of the plan view; high up on a wall the plan view
// takes the landmark for nearer and less oblique than it is.
#[derive(Debug, Clone)]
pub(super) struct Limits {
    rise_m: f64,
    tilt: (f64, f64),
    size: LandmarkSize,
    /// Distances at which width and height, unforeshortened, have the least size, metres.
    wide_m: f64,
    high_m: f64,
    /// Width and height of the image that may be filled, at 1 m distance, metres.
    room: [f64; 2],
    min_cosine: f64,
    /// Distances on the floor to which the unit can tilt, metres.
    tilt_m: (f64, f64),
}

/// Nearest and farthest distance on the floor at which the unit can tilt towards the landmark's
/// centre, metres.
fn tilt_range_m(rise_m: f64, [low, high]: [f64; 2]) -> Option<(f64, f64)> {
    // A view down at a landmark is a view up at its mirror image.
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

impl Limits {
    /// `None` when the landmark is visible from nowhere.
    pub(super) fn new(moved: &Moved, viewer: &PanTiltCamera, p: &VisibilityParams) -> Option<Self> {
        let rise = moved.height_m - viewer.camera_height_m;
        let tilt_m = tilt_range_m(rise, viewer.tilt_rad)?;
        let size = moved.size;
        let room = |side_px: f64| p.max_fill * side_px / viewer.focal_px;
        let made = Self {
            rise_m: if rise.abs() < MIN_RISE_M { MIN_RISE_M.copysign(rise) } else { rise },
            tilt: moved.tilt_rad.sin_cos(),
            size,
            wide_m: viewer.focal_px * size.width_m / p.min_side_px,
            high_m: viewer.focal_px * size.height_m / p.min_side_px,
            room: [room(viewer.width_px), room(viewer.height_px)],
            min_cosine: p.max_incidence_rad.cos(),
            tilt_m,
        };
        (made.rise_m.abs() < made.wide_m.min(made.high_m)).then_some(made)
    }

    /// Upper bound of the distance from the landmark's centre, metres.
    pub(super) fn reach_m(&self) -> f64 {
        self.wide_m.min(self.high_m).min(self.tilt_m.1)
    }

    /// Range of distances in a direction at which the landmark is visible, metres.
    pub(super) fn span_m(&self, direction_rad: f64) -> Option<(f64, f64)> {
        let (sine, cosine) = direction_rad.sin_cos();
        let (near, far) = self.upright_m(cosine)?;
        let near = near.max(self.tilt_m.0).max(self.fits_from_m(sine, cosine));
        let far = far.min(self.tilt_m.1).min(self.wide_to_m(cosine)?);
        if near >= far {
            return None;
        }
        self.high_within_m(cosine, (near, far))
    }

    /// Limit of incidence: with the angle e from the vertical, r = rise tan e, it is a sin e + b
    /// cos e >= `min_cosine`.
    fn upright_m(&self, cosine: f64) -> Option<(f64, f64)> {
        let (sin_tilt, cos_tilt) = self.tilt;
        let (across, down) = (cosine * cos_tilt, sin_tilt.copysign(sin_tilt * self.rise_m));
        let most = across.hypot(down);
        if most < self.min_cosine {
            return None;
        }
        let (middle, half) = (across.atan2(down), (self.min_cosine / most).acos());
        let (low, high) = (middle - half, middle + half);
        if high <= 0.0 || low >= FRAC_PI_2 {
            return None;
        }
        let rise = self.rise_m.abs();
        let far = if high < FRAC_PI_2 { rise * high.tan() } else { f64::INFINITY };
        Some((rise * low.max(0.0).tan(), far))
    }

    /// Largest distance at which it is wide enough: (r^2 + rise^2)^2 = wide^2 (r^2 cos^2 d +
    /// rise^2).
    fn wide_to_m(&self, cosine: f64) -> Option<f64> {
        let (rise2, wide2) = (self.rise_m.powi(2), self.wide_m.powi(2));
        let half = rise2 - 0.5 * wide2 * cosine * cosine;
        let root = (half * half - rise2 * (rise2 - wide2)).max(0.0).sqrt();
        // Of two numbers whose product is known the larger comes without cancellation.
        let square = if half > 0.0 { rise2 * (wide2 - rise2) / (half + root) } else { root - half };
        (square > 0.0).then(|| square.sqrt())
    }

    /// Smallest distance at which it fits: its bounding box in the image, without foreshortening of
    /// the height by elevation.
    fn fits_from_m(&self, sine: f64, cosine: f64) -> f64 {
        let (sin_tilt, cos_tilt) = self.tilt;
        let LandmarkSize { width_m, height_m } = self.size;
        let by_width = (width_m * cosine.abs() + height_m * (sin_tilt * sine).abs()) / self.room[0];
        // height / D + width |rise sin d| / D^2 = height of the image that may be filled.
        let height = height_m * cos_tilt.hypot(sin_tilt * cosine);
        let lying = width_m * (self.rise_m * sine).abs();
        let by_height =
            (height + (height * height + 4.0 * self.room[1] * lying).sqrt()) / (2.0 * self.room[1]);
        let distance = by_width.max(by_height);
        (distance * distance - self.rise_m.powi(2)).max(0.0).sqrt()
    }

    // Behind and below a landmark tilted by 20 to 40 degrees the apparent height is not monotonic
    // at very oblique views: it dips by at most 12 %. Such a dip is not cut out.
    /// The part of a range in which it is high enough.
    fn high_within_m(&self, cosine: f64, (near, far): (f64, f64)) -> Option<(f64, f64)> {
        let enough = |r: f64| self.high_m * self.height_m2(cosine, r).sqrt() >= r * r + self.rise_m.powi(2);
        match (enough(near), enough(far)) {
            (true, true) => Some((near, far)),
            (true, false) => Some((near, last(near, far, enough))),
            (false, true) => Some((last(far, near, enough), far)),
            (false, false) => {
                let top = self.highest_m(cosine, (near, far));
                enough(top).then(|| (last(top, near, enough), last(top, far, enough)))
            }
        }
    }

    /// Squared distance of the camera from the line of the landmark's height, which determines its
    /// foreshortening.
    fn height_m2(&self, cosine: f64, r: f64) -> f64 {
        let (sin_tilt, cos_tilt) = self.tilt;
        let along = r * cosine * sin_tilt - self.rise_m * cos_tilt;
        (r * r + self.rise_m.powi(2) - along * along).max(0.0)
    }

    /// Distance within a range at which the height appears largest.
    fn highest_m(&self, cosine: f64, (mut near, mut far): (f64, f64)) -> f64 {
        let apparent = |r: f64| self.height_m2(cosine, r) / (r * r + self.rise_m.powi(2)).powi(2);
        for _ in 0..HALVINGS {
            let part = GOLDEN * (far - near);
            if apparent(far - part) >= apparent(near + part) {
                far = near + part;
            } else {
                near = far - part;
            }
        }
        0.5 * (near + far)
    }
}

/// The last point with the property on the way from one with it to one without it.
fn last(mut good: f64, mut bad: f64, is: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (good + bad);
        if is(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
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
        assert_eq!(tilt_range_m(1.0, [-0.5, -0.1]), None, "it is above, the unit tilts down");
        assert_eq!(tilt_range_m(0.0, [0.1, 0.2]), None);
        assert_eq!(tilt_range_m(0.0, [-0.1, 0.2]), Some((0.0, f64::INFINITY)));
    }

    fn limits(tilt_rad: f64, height_m: f64) -> Limits {
        let size = LandmarkSize { width_m: 0.6, height_m: 0.6 };
        let viewer = PanTiltCamera { tilt_rad: [-1.5, 1.5], ..PanTiltCamera::default() };
        Limits::new(&Moved { height_m, tilt_rad, size }, &viewer, &VisibilityParams::default()).unwrap()
    }

    #[test]
    fn under_a_ceiling_the_floor_circle_is_that_of_the_incidence_or_the_size() {
        // By hand, 1 m above the camera: straight ahead the width is whole and ends at 512 * 0.6 /
        // 75 m in space, the height is foreshortened: 512 * 0.6 * 1 / (r^2 + 1) = 75.
        let limits = limits(FRAC_PI_2, 2.2);
        let diameter: f64 = 512.0 * 0.6 / 75.0;
        for direction in [0.0, FRAC_PI_2, 3.0 * FRAC_PI_2, 2.0 * FRAC_PI_2] {
            let (near, far) = limits.span_m(direction).unwrap();
            // Straight below it fills 0.6 * 512 px of 480, of which 432 are allowed.
            assert!((near - 1.0 / 1.5_f64.tan()).abs() < 1e-9, "{near}: the unit cannot tilt up straight");
            assert!((far - (diameter - 1.0).sqrt()).abs() < 1e-9, "{direction}: {far}");
        }
    }

    #[test]
    fn high_on_a_wall_it_is_visible_from_a_distance_only() {
        // By hand: 1 m above the camera the view angle is below 75 degrees from r > 1 / tan 75 on,
        // straight ahead.
        let limits = limits(0.0, 2.2);
        let (near, far) = limits.span_m(0.0).unwrap();
        let fits: f64 = 0.6 / (0.9 * 480.0 / 512.0);
        assert!(near >= 1.0 / 75.0_f64.to_radians().tan() && near >= (fits * fits - 1.0).max(0.0).sqrt());
        let diameter: f64 = 512.0 * 0.6 / 75.0;
        // Its width ends at the sphere about it; its height earlier: r / (r^2 + 1) = 1 / diameter.
        let expected = 0.5 * (diameter + (diameter * diameter - 4.0).sqrt());
        assert!((far - expected).abs() < 1e-9, "{far} for {expected}");
        assert_eq!(limits.span_m(1.4), None, "too oblique");
    }
}
