//! Where a segment lies on the floor, if it lies there. With a calibrated camera in metres;
//! without, up to an affine map: below a level horizon `x / (v - h), 1 / (v - h)` keeps parallels
//! parallel and even spacing even, whatever the camera. The row h of the horizon is one on which
//! the image's lines meet.

use crate::{
    detect::segments::edge_segments::EdgeSegment,
    frame::{Distortion, Intrinsics},
    paper::tiling::tiling_params::TilingParams,
};
use nalgebra::{Point2, Vector2};

/// A segment seen as a line on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FloorLine {
    /// Index of the segment.
    pub(crate) segment: usize,
    /// Undirected direction on the floor, [0, pi).
    pub(crate) direction_rad: f64,
    /// Length on the floor.
    pub(crate) length: f64,
    middle: Point2<f64>,
}

impl FloorLine {
    /// Distance of the line's middle across a direction. The direction is the family's: a short
    /// line's own would throw its offset far off.
    pub(crate) fn offset_along(&self, direction_rad: f64) -> f64 {
        let (sin, cos) = direction_rad.sin_cos();
        cos * self.middle.y - sin * self.middle.x
    }
}

/// The floor as an image of it shows it.
pub(crate) struct Floor {
    camera: Intrinsics,
    height: f64,
    tilt_rad: f64,
    square: bool,
}

/// Rows of the horizon that are tried, as shares of the image height, and their number.
const HORIZON_RANGE: [f64; 2] = [0.05, 0.75];
const HORIZON_ROWS: usize = 141;
/// Most rows that are examined, and their smallest distance in rows.
const MAX_HORIZONS: usize = 8;
const HORIZON_GAP_ROWS: usize = 5;
/// Bins of the accumulator of meeting points along a row, one image width each way beside the image
/// included.
const MEETING_BINS: usize = 120;
/// Lines closer to the level meet a row too far away, those closer to the plumb are edges of walls.
/// Degrees.
const MEETING_RANGE_DEG: [f64; 2] = [4.0, 80.0];

impl Floor {
    /// The possible floors of the image: one with a plausible camera, several without a camera.
    pub(crate) fn possible(
        segments: &[EdgeSegment],
        image_size: (usize, usize),
        p: &TilingParams,
    ) -> Vec<Self> {
        if let Some(view) = &p.floor {
            let sensible = view.width_px > 0
                && view.height_m.is_finite()
                && view.height_m > 0.0
                && view.tilt_rad.abs() < std::f64::consts::FRAC_PI_4;
            let scale = image_size.0 as f64 / view.width_px.max(1) as f64;
            let floor = || Self {
                camera: scaled(&view.intrinsics, scale),
                height: view.height_m,
                tilt_rad: view.tilt_rad,
                square: true,
            };
            return sensible.then(floor).into_iter().collect();
        }
        let (width, height) = (image_size.0 as f64, image_size.1 as f64);
        let floor = |horizon_px| {
            // A usual lens. A wrong focal length stretches the floor away from the camera, no more.
            let camera = Intrinsics {
                fx_px: width,
                fy_px: width,
                cx_px: 0.5 * (width - 1.0),
                cy_px: horizon_px,
                distortion: Distortion::None,
                sigmas: None,
            };
            Self { camera, height: 1.0, tilt_rad: 0.0, square: false }
        };
        horizons(segments, width, height).into_iter().map(floor).collect()
    }

    /// Row of the horizon below the optical axis.
    pub(crate) fn horizon_px(&self) -> f64 {
        self.camera.cy_px + self.camera.fy_px * self.tilt_rad.tan()
    }

    /// Whether right angles on the floor are preserved.
    pub(crate) fn square(&self) -> bool {
        self.square
    }

    /// The segment on the floor, if it may lie there.
    pub(crate) fn line(&self, index: usize, segment: &EdgeSegment, p: &TilingParams) -> Option<FloorLine> {
        let ends = [self.camera.undistort(&segment.p_px)?, self.camera.undistort(&segment.q_px)?];
        let middle_px = nalgebra::center(&ends[0], &ends[1]);
        let (image_direction, gravity) = (ends[1] - ends[0], self.gravity_at(&middle_px));
        let cos = image_direction.dot(&gravity).abs() / (image_direction.norm() * gravity.norm());
        if cos.is_nan() || cos > p.gravity_deg.to_radians().cos() {
            return None;
        }
        let (a, b) = (self.point(&ends[0], p)?, self.point(&ends[1], p)?);
        let (along, length) = (b - a, (b - a).norm());
        let direction_rad = along.y.atan2(along.x).rem_euclid(std::f64::consts::PI);
        let middle = nalgebra::center(&a, &b);
        (length > 0.0 && length.is_finite()).then_some(FloorLine {
            segment: index,
            direction_rad,
            length,
            middle,
        })
    }

    /// Where the ray of a pixel meets the floor: to the right and ahead of the camera's foot.
    fn point(&self, px: &Point2<f64>, p: &TilingParams) -> Option<Point2<f64>> {
        let (sin, cos) = self.tilt_rad.sin_cos();
        let below_px = px.y - self.horizon_px() - p.horizon_gap_px;
        if below_px.is_nan() || below_px <= 0.0 {
            return None;
        }
        let (x, y) =
            ((px.x - self.camera.cx_px) / self.camera.fx_px, (px.y - self.camera.cy_px) / self.camera.fy_px);
        let scale = self.height / (y * cos - sin);
        let at = Point2::new(scale * x, scale * (y * sin + cos));
        (at.coords.norm() < p.max_distance).then_some(at)
    }

    /// Image direction of gravity at a pixel.
    fn gravity_at(&self, px: &Point2<f64>) -> Vector2<f64> {
        let (sin, cos) = self.tilt_rad.sin_cos();
        Vector2::new(
            (px.x - self.camera.cx_px) * sin,
            self.camera.fy_px * cos + (px.y - self.camera.cy_px) * sin,
        )
    }
}

/// The camera of the same image at another scale. Pixel centres are integers, so the corner of the
/// image stays.
fn scaled(camera: &Intrinsics, scale: f64) -> Intrinsics {
    let centre = |c: f64| (c + 0.5) * scale - 0.5;
    Intrinsics {
        fx_px: camera.fx_px * scale,
        fy_px: camera.fy_px * scale,
        cx_px: centre(camera.cx_px),
        cy_px: centre(camera.cy_px),
        distortion: camera.distortion,
        sigmas: None,
    }
}

/// Rows on which the lines of the image meet well, the best first: everything level in the world
/// vanishes on the horizon, walls' edges and frames as well as the floor's. Accumulates, on each
/// row, where the lines cross it; rows go by the sum of squares, the upper of equals first. Where
/// pieces of a pattern touch lines meet as well, so there is more than one candidate.
fn horizons(segments: &[EdgeSegment], width: f64, height: f64) -> Vec<f64> {
    let slanted = |s: &&EdgeSegment| {
        let lean = s.normal.x.abs().atan2(s.normal.y.abs()).to_degrees();
        (MEETING_RANGE_DEG[0]..=MEETING_RANGE_DEG[1]).contains(&lean)
    };
    let lines: Vec<&EdgeSegment> = segments.iter().filter(slanted).collect();
    let row_px = |row: usize| {
        let share = row as f64 / (HORIZON_ROWS - 1) as f64;
        (HORIZON_RANGE[0] + (HORIZON_RANGE[1] - HORIZON_RANGE[0]) * share) * height
    };
    let scores: Vec<f64> = (0..HORIZON_ROWS).map(|row| meeting(&lines, row_px(row), width)).collect();
    let mut order: Vec<usize> = (0..HORIZON_ROWS).filter(|row| scores[*row] > 0.0).collect();
    order.sort_by(|a, b| scores[*b].total_cmp(&scores[*a]).then(a.cmp(b)));
    let mut chosen: Vec<usize> = Vec::new();
    for row in order {
        if chosen.len() < MAX_HORIZONS && chosen.iter().all(|c| c.abs_diff(row) >= HORIZON_GAP_ROWS) {
            chosen.push(row);
        }
    }
    chosen.into_iter().map(row_px).collect()
}

/// How well lines meet on a row: sum of squares over the bins of an accumulator along it.
fn meeting(lines: &[&EdgeSegment], v: f64, width: f64) -> f64 {
    let mut bins = [0.0; MEETING_BINS];
    for line in lines {
        let u = (line.rho_px - line.normal.y * v) / line.normal.x;
        let place = ((u + 0.5) / width + 1.0) / 3.0 * MEETING_BINS as f64 - 0.5;
        if place >= 0.0 && place < (MEETING_BINS - 1) as f64 {
            let part = place.fract();
            bins[place as usize] += line.length_px * (1.0 - part);
            bins[place as usize + 1] += line.length_px * part;
        }
    }
    bins.iter().map(|b| b * b).sum()
}
