//! Edge support of a side: the share of it that an edge supports, and where that edge runs, to a
//! fraction of a pixel (method 3.6). In: two points. Out: a line with its variance.

use crate::detect::edge_support::{
    fixed_point::Fixed,
    gradients::{Gradients, MIN_COS, across},
    side_fit::{EdgePoint, FittedLine, fit},
};
use nalgebra::{Point2, Vector2};

/// Most samples taken along one side.
pub const MAX_SAMPLES: usize = 96;
/// Fewest samples taken along one side.
const MIN_SAMPLES: usize = 12;
/// Share of a side left out at both ends: near a corner the other side's gradient mixes in.
pub(crate) const CORNER_SHARE: f64 = 0.04;
/// How the edge of a side is searched.
#[derive(Debug, Clone, Copy)]
pub struct EdgeProbeParams {
    /// How far from the proposed side its edge may lie.
    pub reach_px: f64,
    /// Smallest step height of an edge point, in grey levels.
    pub min_step: f64,
    /// Most samples along a side; [`MAX_SAMPLES`] for the best line.
    pub samples: usize,
    /// Interpolate the gradient between pixels, for the best line, or take the nearest pixel, which
    /// is faster.
    pub between_pixels: bool,
    /// Support below which the measurement of a side stops early; 0 measures all samples.
    pub least_support: f64,
}

/// Edge support of a side.
#[derive(Debug, Clone, PartialEq)]
pub struct SideSupport {
    /// Share of the samples inside the image that have an edge along the side, 0 to 1.
    pub support: f64,
    /// Share of the edge points with the more frequent sign, 0.5 to 1; 0 without points.
    pub agreement: f64,
    /// Mean step height over all samples, in grey levels, unsupported samples counting 0.
    pub strength: f64,
    /// The refitted line, if there were enough points.
    pub line: Option<FittedLine>,
}

impl SideSupport {
    pub(crate) const NONE: Self = Self { support: 0.0, agreement: 0.0, strength: 0.0, line: None };
}

/// The edge points along a side.
#[derive(Debug, Clone)]
pub(crate) struct SidePoints {
    from: Point2<f64>,
    direction: Vector2<f64>,
    normal: Vector2<f64>,
    length_px: f64,
    /// Number of samples inside the image.
    in_image: usize,
    points: Vec<EdgePoint>,
}

/// Measures the edge support of the side from `from` to `to`.
pub fn measure(g: &Gradients, from: &Point2<f64>, to: &Point2<f64>, search: EdgeProbeParams) -> SideSupport {
    let found = SidePoints::new(g, from, to, EdgeProbeParams { least_support: 0.0, ..search });
    found.map_or(SideSupport::NONE, |s| s.evidence())
}

impl SidePoints {
    /// Collects the edge points from `from` to `to`. None as soon as `search.least_support` cannot
    /// be reached.
    pub(crate) fn new(
        g: &Gradients,
        from: &Point2<f64>,
        to: &Point2<f64>,
        search: EdgeProbeParams,
    ) -> Option<Self> {
        let side = to - from;
        let length_px = side.norm();
        if !length_px.is_finite() || length_px < 1.0 || g.width() < 2 || g.height() < 2 {
            return None;
        }
        let direction = side / length_px;
        let normal = Vector2::new(direction.y, -direction.x);
        let count =
            ((length_px / 2.0) as usize).clamp(MIN_SAMPLES, search.samples.clamp(MIN_SAMPLES, MAX_SAMPLES));
        let mut points_of_side = Self {
            from: *from,
            direction,
            normal,
            length_px,
            in_image: 0,
            points: Vec::with_capacity(count),
        };
        let across = Across::new(&normal, search);
        let most_missed = (1.0 - search.least_support) * count as f64;
        for i in scattered(count) {
            let along_px = share_along(i, count) * length_px;
            let (inside, found) = across.strongest(g, &(from + direction * along_px));
            points_of_side.in_image += usize::from(inside);
            points_of_side.points.extend(found.map(|(offset_px, step)| EdgePoint {
                along_px,
                offset_px,
                step,
            }));
            if (points_of_side.in_image - points_of_side.points.len()) as f64 > most_missed {
                return None;
            }
        }
        Some(points_of_side)
    }

    /// Support, polarity, strength and line of the side.
    pub(crate) fn evidence(&self) -> SideSupport {
        if self.in_image == 0 || self.points.is_empty() {
            return SideSupport::NONE;
        }
        let n = self.points.len();
        let positive = self.points.iter().filter(|p| p.step > 0.0).count();
        SideSupport {
            support: n as f64 / self.in_image as f64,
            agreement: positive.max(n - positive) as f64 / n as f64,
            strength: self.points.iter().map(|p| p.step.abs()).sum::<f64>() / self.in_image as f64,
            line: fit(&self.points, self.length_px)
                .map(|f| f.line(&self.from, &self.direction, &self.normal)),
        }
    }
}

/// The numbers below `count`, each once, successive ones far apart: a bad side is recognised before
/// all samples are taken.
pub(crate) fn scattered(count: usize) -> impl Iterator<Item = usize> {
    // Two primes whose product is above every count: at least one does not divide it.
    let stride = if count.is_multiple_of(STRIDES[0]) { STRIDES[1] } else { STRIDES[0] };
    (0..count).map(move |i| i * stride % count)
}

const STRIDES: [usize; 2] = [7, 17];

/// Position of a sample along a side, 0 to 1.
pub(crate) fn share_along(sample: usize, count: usize) -> f64 {
    CORNER_SHARE + (1.0 - 2.0 * CORNER_SHARE) * (sample as f64 + 0.5) / count as f64
}

/// Where the edge that runs from `from` through `to` ends: the last supported point on the line
/// beyond `to`.
pub fn run_end(g: &Gradients, from: &Point2<f64>, to: &Point2<f64>, min_step: f64) -> Point2<f64> {
    /// Steps of 2 px without an edge that end the run.
    const MAX_MISSES: usize = 4;
    /// No image is longer.
    const MAX_STEPS: i64 = 8192;
    let length = (to - from).norm();
    if length.is_nan() || length < 1.0 {
        return *to;
    }
    let (direction, min_step) = ((to - from) / length, min_step as f32);
    let across = Vector2::new(direction.y, -direction.x);
    let normal = across.cast().into();
    let (start, along, across) = (Fixed::point(to), Fixed::step(&direction), Fixed::step(&across));
    let (mut end, mut misses) = (0, 0);
    for i in 1..MAX_STEPS {
        let foot = start.on(along, 2 * i);
        let Some(here) = g.follows(foot, normal, min_step) else { break };
        let beside = |offset: i64| g.follows(foot.on(across, offset), normal, min_step) == Some(true);
        if here || beside(-1) || beside(1) {
            (end, misses) = (i, 0);
        } else {
            misses += 1;
            if misses > MAX_MISSES {
                break;
            }
        }
    }
    to + direction * (2 * end) as f64
}

/// Most pixels searched to each side of a foot.
const MAX_REACH_PX: usize = 16;
/// Most pixels across a side: one more at both ends, to check that the strongest is a peak.
const MAX_ACROSS: usize = 2 * MAX_REACH_PX + 3;

/// The search across a side for its edge.
struct Across {
    normal: Vector2<f64>,
    facing: [f32; 2],
    step: Fixed,
    reach: usize,
    min_step: f32,
    between_pixels: bool,
}

impl Across {
    fn new(normal: &Vector2<f64>, search: EdgeProbeParams) -> Self {
        Self {
            normal: *normal,
            facing: normal.cast().into(),
            step: Fixed::step(normal),
            reach: (search.reach_px.round() as usize).clamp(1, MAX_REACH_PX),
            min_step: search.min_step as f32,
            between_pixels: search.between_pixels,
        }
    }

    /// Strongest edge across the side at `foot`: whether the foot lies in the image, and the edge's
    /// offset and signed step height. The gradient must point along the normal to within about 35
    /// degrees.
    fn strongest(&self, g: &Gradients, foot: &Point2<f64>) -> (bool, Option<(f64, f64)>) {
        let from = -(self.reach as i64) - 1;
        let (mut gx, mut gy) = ([f32::NAN; MAX_ACROSS], [f32::NAN; MAX_ACROSS]);
        let cells = gx.iter_mut().zip(&mut gy).take(2 * self.reach + 3);
        if self.between_pixels {
            for (i, (gx, gy)) in cells.enumerate() {
                let p = foot + self.normal * (i as i64 + from) as f64;
                [*gx, *gy] = g.sample(p.x, p.y).unwrap_or([f32::NAN; 2]);
            }
        } else {
            let mut at = Fixed::point(foot).on(self.step, from);
            // A straight line lies in the image if both its ends do.
            if g.holds(at) && g.holds(at.on(self.step, -2 * from)) {
                for (gx, gy) in cells {
                    [*gx, *gy] = g.within(at);
                    at = at.on(self.step, 1);
                }
            } else {
                for (gx, gy) in cells {
                    [*gx, *gy] = g.nearest(at).unwrap_or([f32::NAN; 2]);
                    at = at.on(self.step, 1);
                }
            }
        }
        self.among(&gx, &gy)
    }

    /// [`Self::strongest`] among the gradients at steps of a pixel; NaN outside the image.
    #[inline]
    fn among(&self, gx: &[f32; MAX_ACROSS], gy: &[f32; MAX_ACROSS]) -> (bool, Option<(f64, f64)>) {
        let (mut steps, mut heights) = ([f32::NAN; MAX_ACROSS], [-1.0_f32; MAX_ACROSS]);
        let last = 2 * self.reach + 2;
        let gradients = gx.iter().zip(gy).take(last + 1);
        for ((slot, height), (x, y)) in steps.iter_mut().zip(&mut heights).zip(gradients) {
            let (step, square) = across([*x, *y], self.facing);
            *slot = step;
            let follows = step.abs() >= self.min_step && step * step >= MIN_COS * MIN_COS * square;
            *height = if follows { step.abs() } else { -1.0 };
        }
        if steps[self.reach + 1].is_nan() {
            return (false, None);
        }
        let (mut at, mut best) = (0, -1.0);
        for (i, height) in heights.iter().enumerate().take(last).skip(1) {
            (at, best) = if *height > best { (i, *height) } else { (at, best) };
        }
        if at == 0 {
            return (true, None);
        }
        let sign = steps[at].signum();
        let known = |step: f32| if step.is_nan() { best } else { step * sign };
        let (a, b, c) = (known(steps[at - 1]), best, known(steps[at + 1]));
        // A gradient that still rises at the end of the reach belongs to another edge.
        let peak = a <= b && c <= b;
        let bend = a - 2.0 * b + c;
        let shift = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        let offset_px = at as f64 - self.reach as f64 - 1.0 + f64::from(shift);
        (true, peak.then_some((offset_px, f64::from(steps[at]))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::{
            edges::edge_map::{EdgeParams, edges},
            tests::fixtures::render,
        },
        frame::GrayImage,
    };

    const FULL: EdgeProbeParams = EdgeProbeParams {
        reach_px: 3.0,
        min_step: 6.0,
        samples: MAX_SAMPLES,
        between_pixels: true,
        least_support: 0.0,
    };

    #[test]
    fn every_sample_is_visited_once() {
        for count in MIN_SAMPLES..=MAX_SAMPLES {
            let mut all: Vec<usize> = scattered(count).collect();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count), "{count}");
        }
    }

    #[test]
    fn a_side_is_placed_to_a_tenth_of_a_pixel() {
        let quad = [[30.0, 40.3], [170.0, 52.3], [165.0, 140.0], [35.0, 140.0]];
        let image = render(200, 180, 200, &[(quad, 60)]);
        let map = edges(&image, &EdgeParams::default());
        let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
        let (from, to) = (Point2::from(quad[0]), Point2::from(quad[1]));
        // The proposed side is a pixel and a half off.
        let shift = Vector2::new(0.0, 1.5);
        let found = measure(&g, &(from + shift), &(to + shift), FULL);
        assert!(found.support > 0.95 && found.agreement > 0.99 && found.strength > 100.0, "{found:?}");
        let line = found.line.expect("a line");
        for p in [from, to] {
            assert!((line.normal.dot(&p.coords) - line.rho_px).abs() < 0.1);
            assert!(line.variance_at(&p) > 0.0 && line.variance_at(&p) < 0.05);
        }
        // Out of a polygon that is walked clockwise: upwards here.
        assert!(line.normal.y < -0.9);
        // No edge beside the quad.
        let away = Vector2::new(0.0, -20.0);
        assert!(measure(&g, &(from + away), &(to + away), FULL).support < 0.05);
        // The run from the middle of the side ends at its corner.
        let end = run_end(&g, &from, &nalgebra::center(&from, &to), 6.0);
        assert!((end - to).norm() < 6.0, "{end:?}");
    }

    #[test]
    fn half_a_side_is_half_supported() {
        let image = GrayImage::from_fn(120, 80, |u, v| if v >= 40 && u < 60 { 60 } else { 200 });
        let map = edges(&image, &EdgeParams::default());
        let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
        let found = measure(&g, &Point2::new(10.0, 39.5), &Point2::new(110.0, 39.5), FULL);
        assert!((found.support - 0.5).abs() < 0.06, "{found:?}");
        // A higher required support gives none, a lower one the same result.
        let (from, to) = (Point2::new(10.0, 39.5), Point2::new(110.0, 39.5));
        let asked =
            |least_support| SidePoints::new(&g, &from, &to, EdgeProbeParams { least_support, ..FULL });
        assert!(asked(0.6).is_none());
        assert_eq!(asked(0.4).unwrap().evidence(), found);
    }
}
