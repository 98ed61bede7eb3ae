//! What the gradient planes say about a supposed side: which share of it an edge supports, and where that edge runs
//! to a fraction of a pixel (method 3.6). Takes two points, gives a line with its variance; forms no hypotheses.

use crate::frame::GrayImage;
use nalgebra::{Point2, Vector2};

/// Most samples taken along one side.
pub const MAX_SAMPLES: usize = 96;
/// Fewest samples taken along one side.
const MIN_SAMPLES: usize = 12;
/// Share of a side left out at both ends: near a corner the other side's gradient mixes in.
const CORNER_SHARE: f64 = 0.04;
/// The gradient points along the normal to within about 35 degrees.
const MIN_COS: f64 = 0.82;
/// Floor of an edge point's standard deviation across the edge (method 1.3).
const MIN_SIGMA_PX: f64 = 0.2;

/// The gradient planes of a frame, row-major, in grey levels of step height.
#[derive(Debug, Clone, Copy)]
pub struct Gradients<'a> {
    /// The image they belong to.
    pub image: &'a GrayImage,
    /// Derivative along u.
    pub gx: &'a [f32],
    /// Derivative along v.
    pub gy: &'a [f32],
}

impl Gradients<'_> {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.image.width()
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.image.height()
    }

    /// Bilinear gradient; none outside the image.
    fn sample(&self, u: f64, v: f64) -> Option<Vector2<f64>> {
        let inside = u >= 0.0 && v >= 0.0 && u < (self.width() - 1) as f64 && v < (self.height() - 1) as f64;
        if !inside {
            return None;
        }
        let (u0, v0) = (u as usize, v as usize);
        let (a, b) = ((u - u0 as f64) as f32, (v - v0 as f64) as f32);
        let i = v0 * self.width() + u0;
        let at = |plane: &[f32]| {
            let top = plane[i] * (1.0 - a) + plane[i + 1] * a;
            let bottom = plane[i + self.width()] * (1.0 - a) + plane[i + self.width() + 1] * a;
            f64::from(top * (1.0 - b) + bottom * b)
        };
        Some(Vector2::new(at(self.gx), at(self.gy)))
    }
    /// Gradient at the nearest pixel; none outside the image.
    fn nearest(&self, p: &Point2<f64>) -> Option<Vector2<f64>> {
        let (u, v) = (p.x + 0.5, p.y + 0.5);
        if !(u >= 0.0 && v >= 0.0 && u < self.width() as f64 && v < self.height() as f64) {
            return None;
        }
        let i = v as usize * self.width() + u as usize;
        Some(Vector2::new(f64::from(self.gx[i]), f64::from(self.gy[i])))
    }

    /// The step across a line with this normal at the nearest pixel, 0 where the gradient does not point along the
    /// normal to within about 35 degrees; none outside the image.
    pub(super) fn step_following(&self, p: &Point2<f64>, normal: &Vector2<f64>) -> Option<f64> {
        let gradient = self.nearest(p)?;
        let step = gradient.dot(normal);
        Some(if step * step >= MIN_COS * MIN_COS * gradient.norm_squared() { step } else { 0.0 })
    }

    /// Whether the gradient at the nearest pixel is a step of at least `min_step` across a line with this normal, to
    /// within about 35 degrees; none outside the image.
    fn follows(&self, p: &Point2<f64>, normal: &Vector2<f64>, min_step: f64) -> Option<bool> {
        let gradient = self.nearest(p)?;
        let step = gradient.dot(normal).abs();
        Some(step >= min_step && step * step >= MIN_COS * MIN_COS * gradient.norm_squared())
    }
}

/// How a side is searched.
#[derive(Debug, Clone, Copy)]
pub struct Search {
    /// How far from the supposed side its edge may lie.
    pub reach_px: f64,
    /// Smallest step height of an edge point, in grey levels.
    pub min_step: f64,
    /// Most samples along a side; [`MAX_SAMPLES`] for the best line.
    pub samples: usize,
    /// Read the gradient between pixels, for the best line, or at the nearest, which is quicker.
    pub between_pixels: bool,
}

/// An edge point: distance along the side, offset across it, signed step height.
#[derive(Debug, Clone, Copy, PartialEq)]
struct EdgePoint {
    along_px: f64,
    offset_px: f64,
    step: f64,
}

/// What was found along a side.
#[derive(Debug, Clone, PartialEq)]
pub struct SideEvidence {
    /// Share of the samples inside the image that have an edge along the side, 0 to 1.
    pub support: f64,
    /// Share of the edge points with the more frequent sign, 0.5 to 1; 0 without points.
    pub agreement: f64,
    /// Mean step height over all samples, in grey levels, unsupported samples counting 0.
    pub strength: f64,
    /// The refitted line, if there were points enough.
    pub line: Option<FittedLine>,
}

/// A line `normal . x = rho_px` with the variance of its offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedLine {
    /// Unit normal: to the left of the walk from the first to the second point as seen on screen, hence out of a
    /// polygon that is walked clockwise.
    pub normal: Vector2<f64>,
    /// Signed distance from the origin.
    pub rho_px: f64,
    /// Point of the line where its offset is known best.
    centre_px: Point2<f64>,
    variance_px2: f64,
    slope_variance: f64,
}

impl FittedLine {
    /// Variance of the line's offset at the foot of `p`, extrapolation included, in px^2.
    pub fn variance_at(&self, p: &Point2<f64>) -> f64 {
        let direction = Vector2::new(-self.normal.y, self.normal.x);
        self.variance_px2 + self.slope_variance * direction.dot(&(p - self.centre_px)).powi(2)
    }
}

/// Looks for an edge along the way from `from` to `to`.
pub fn measure(g: &Gradients, from: &Point2<f64>, to: &Point2<f64>, search: Search) -> SideEvidence {
    let side = to - from;
    let length = side.norm();
    let nothing = SideEvidence { support: 0.0, agreement: 0.0, strength: 0.0, line: None };
    if !length.is_finite() || length < 1.0 || g.width() < 2 || g.height() < 2 {
        return nothing;
    }
    let direction = side / length;
    let normal = Vector2::new(direction.y, -direction.x);
    let count = ((length / 2.0) as usize).clamp(MIN_SAMPLES, search.samples.clamp(MIN_SAMPLES, MAX_SAMPLES));
    let mut seen = 0_usize;
    let mut points = Vec::with_capacity(count);
    for i in 0..count {
        let share = CORNER_SHARE + (1.0 - 2.0 * CORNER_SHARE) * (i as f64 + 0.5) / count as f64;
        let along_px = share * length;
        let foot = from + direction * along_px;
        let (inside, found) = edge_across(g, &foot, &normal, search);
        seen += usize::from(inside);
        points.extend(found.map(|(offset_px, step)| EdgePoint { along_px, offset_px, step }));
    }
    if seen == 0 || points.is_empty() {
        return nothing;
    }
    let positive = points.iter().filter(|p| p.step > 0.0).count();
    let agreement = positive.max(points.len() - positive) as f64 / points.len() as f64;
    let strength = points.iter().map(|p| p.step.abs()).sum::<f64>() / seen as f64;
    let line = fit(&points, length).map(|f| f.line(from, &direction, &normal));
    SideEvidence { support: points.len() as f64 / seen as f64, agreement, strength, line }
}

/// A coarse look: share of samples along the side with an edge within about 1.5 px that follows it. Samples outside
/// the image count as neither. Gives up with 0 once `enough` is out of reach.
pub fn quick_support(g: &Gradients, from: &Point2<f64>, to: &Point2<f64>, min_step: f64, enough: f64) -> f64 {
    const SAMPLES: usize = 24;
    let side = to - from;
    let length = side.norm();
    if length.is_nan() || length < 1.0 {
        return 0.0;
    }
    let direction = side / length;
    let normal = Vector2::new(direction.y, -direction.x);
    let (mut seen, mut supported) = (0_usize, 0_usize);
    for i in 0..SAMPLES {
        // Every seventh in turn: a bad side shows before all samples are taken.
        let share =
            CORNER_SHARE + (1.0 - 2.0 * CORNER_SHARE) * ((i * 7 % SAMPLES) as f64 + 0.5) / SAMPLES as f64;
        let foot = from + side * share;
        let Some(here) = g.follows(&foot, &normal, min_step) else { continue };
        seen += 1;
        let beside = |offset: f64| g.follows(&(foot + normal * offset), &normal, min_step) == Some(true);
        supported += usize::from(here || beside(-1.0) || beside(1.0) || beside(-2.0) || beside(2.0));
        if ((seen - supported) as f64) > (1.0 - enough) * SAMPLES as f64 {
            return 0.0;
        }
    }
    if seen == 0 { 0.0 } else { supported as f64 / seen as f64 }
}

/// Where the edge that runs from `from` through `to` ends: the last supported point on the line beyond `to`.
pub fn run_end(g: &Gradients, from: &Point2<f64>, to: &Point2<f64>, min_step: f64) -> Point2<f64> {
    /// Steps of 2 px without an edge that end the run.
    const MAX_MISSES: usize = 4;
    /// No image is longer.
    const MAX_STEPS: usize = 8192;
    let length = (to - from).norm();
    if length.is_nan() || length < 1.0 {
        return *to;
    }
    let direction = (to - from) / length;
    let normal = Vector2::new(direction.y, -direction.x);
    let (mut end, mut misses) = (*to, 0);
    for i in 1..MAX_STEPS {
        let foot = to + direction * (2.0 * i as f64);
        let Some(here) = g.follows(&foot, &normal, min_step) else { break };
        let beside = |offset: f64| g.follows(&(foot + normal * offset), &normal, min_step) == Some(true);
        if here || beside(-1.0) || beside(1.0) {
            (end, misses) = (foot, 0);
        } else {
            misses += 1;
            if misses > MAX_MISSES {
                break;
            }
        }
    }
    end
}

/// Most pixels looked at to each side of a foot.
const MAX_REACH_PX: usize = 16;

/// Strongest edge across the side at `foot`: whether the foot lies in the image, and the edge's offset and signed
/// step height. The gradient must point along the normal to within about 35 degrees.
fn edge_across(
    g: &Gradients,
    foot: &Point2<f64>,
    normal: &Vector2<f64>,
    search: Search,
) -> (bool, Option<(f64, f64)>) {
    let reach = (search.reach_px.round() as usize).clamp(1, MAX_REACH_PX);
    // One more at both ends, to tell whether the strongest is a peak. Outside the image nothing is known.
    let mut steps: [Option<f64>; 2 * MAX_REACH_PX + 3] = [None; 2 * MAX_REACH_PX + 3];
    let mut best: Option<(usize, f64)> = None;
    for (i, slot) in steps.iter_mut().enumerate().take(2 * reach + 3) {
        let p = foot + normal * (i as f64 - reach as f64 - 1.0);
        let v = if search.between_pixels { g.sample(p.x, p.y) } else { g.nearest(&p) };
        let Some(v) = v else { continue };
        let step = v.dot(normal);
        *slot = Some(step);
        let follows = step.abs() >= search.min_step && step * step >= MIN_COS * MIN_COS * v.norm_squared();
        if follows && i != 0 && i != 2 * reach + 2 && best.is_none_or(|b| step.abs() > b.1.abs()) {
            best = Some((i, step));
        }
    }
    if steps[reach + 1].is_none() {
        return (false, None);
    }
    let found = best.and_then(|(i, step)| {
        let beside = |i: usize| steps[i].map_or(step.abs(), |s| s * step.signum());
        let (a, c) = (beside(i - 1), beside(i + 1));
        // At the end of the reach a still rising gradient belongs to another edge.
        let peak = a <= step.abs() && c <= step.abs();
        let bend = a - 2.0 * step.abs() + c;
        let shift = if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
        peak.then_some((i as f64 - reach as f64 - 1.0 + shift, step))
    });
    (true, found)
}

/// `offset = offset_at_mean + slope * (along - mean)`.
struct OffsetFit {
    mean_along_px: f64,
    offset_px: f64,
    slope: f64,
    variance_px2: f64,
    slope_variance: f64,
}

/// Least squares with three rounds of trimming: texture near a side throws points far off its line.
fn fit(points: &[EdgePoint], length: f64) -> Option<OffsetFit> {
    const MIN_POINTS: usize = 5;
    let mut kept: Vec<EdgePoint> = points.to_vec();
    let mut result = None;
    for round in 0..4 {
        if kept.len() < MIN_POINTS {
            return result;
        }
        let n = kept.len() as f64;
        let mean = kept.iter().map(|p| p.along_px).sum::<f64>() / n;
        let offset = kept.iter().map(|p| p.offset_px).sum::<f64>() / n;
        let spread: f64 = kept.iter().map(|p| (p.along_px - mean).powi(2)).sum();
        // Points in one place cannot give a direction.
        if spread < n * (0.05 * length).powi(2) {
            return result;
        }
        let slope = kept.iter().map(|p| (p.along_px - mean) * (p.offset_px - offset)).sum::<f64>() / spread;
        let residual = |p: &EdgePoint| p.offset_px - offset - slope * (p.along_px - mean);
        let sum: f64 = kept.iter().map(|p| residual(p).powi(2)).sum();
        let sigma = (sum / (n - 2.0)).sqrt().max(MIN_SIGMA_PX);
        result = Some(OffsetFit {
            mean_along_px: mean,
            offset_px: offset,
            slope,
            variance_px2: sigma * sigma / n,
            slope_variance: sigma * sigma / spread,
        });
        let limit = (2.0 * sigma).max(0.5);
        let before = kept.len();
        if round == 0 {
            // The first line may lean on outliers: judge every point by it again.
            kept = points.iter().filter(|p| residual(p).abs() <= limit).copied().collect();
        } else {
            kept.retain(|p| residual(p).abs() <= limit);
        }
        if round > 0 && kept.len() == before {
            break;
        }
    }
    result
}

impl OffsetFit {
    fn line(&self, from: &Point2<f64>, direction: &Vector2<f64>, normal: &Vector2<f64>) -> FittedLine {
        let centre_px = from + direction * self.mean_along_px + normal * self.offset_px;
        let turned = (normal - direction * self.slope).normalize();
        FittedLine {
            normal: turned,
            rho_px: turned.dot(&centre_px.coords),
            centre_px,
            variance_px2: self.variance_px2,
            slope_variance: self.slope_variance,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            edges::{EdgeParams, edges},
            fixtures::render,
        },
        *,
    };

    const FULL: Search = Search { reach_px: 3.0, min_step: 6.0, samples: MAX_SAMPLES, between_pixels: true };

    #[test]
    fn a_side_is_placed_to_a_tenth_of_a_pixel() {
        let quad = [[30.0, 40.3], [170.0, 52.3], [165.0, 140.0], [35.0, 140.0]];
        let image = render(200, 180, 200, &[(quad, 60)]);
        let map = edges(&image, &EdgeParams::default());
        let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
        let (from, to) = (Point2::from(quad[0]), Point2::from(quad[1]));
        // The supposed side is a pixel and a half off.
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
        // Beside the quad there is nothing.
        let away = Vector2::new(0.0, -20.0);
        assert!(measure(&g, &(from + away), &(to + away), FULL).support < 0.05);
        assert!(quick_support(&g, &from, &to, 6.0, 0.5) > 0.95);
        assert!(quick_support(&g, &(from + away), &(to + away), 6.0, 0.5) < 0.05);
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
    }
}
