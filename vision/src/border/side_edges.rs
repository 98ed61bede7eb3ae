//! The straight edges beside one side of a landmark. In: a picture, the ends of the side. Out: up
//! to [`MAX_EDGES`] edges as offsets at both ends, with covariance and support. Which one is the
//! border is not decided here.

use crate::{
    border::linear_light::LIGHT,
    frame::{GrayImage, PictureRef},
};
use nalgebra::{Matrix2, Point2, Vector2};

/// Most edges of a side.
pub const MAX_EDGES: usize = 4;
/// Fewest and most profiles across a side.
const PROFILES: [usize; 2] = [12, 40];
/// Ends of a side that are left out, as a share of it and in pixels: edges of the neighbouring
/// sides are there.
const END_SHARE: f64 = 0.04;
const END_PX: f64 = 1.0;
/// Step along a profile, pixels.
const STEP_PX: f64 = 0.5;
/// Standard deviation of the smoothing along a profile, steps.
const SIGMA_STEPS: f64 = 1.6;
/// Reach of the smoothing, steps.
const KERNEL_REACH: usize = 5;
/// Weight of each neighbouring profile beside 1 for the profile itself.
const NEIGHBOUR: f32 = 0.458;
/// Least slope of an edge point, in light a pixel.
const MIN_SLOPE: f32 = 2.5;
/// Most edge points of a profile.
const MAX_POINTS: usize = 5;
/// An edge turns from the side by this slope at most.
const MAX_TURN: f64 = 0.08;
/// Pairs of points that lines are drawn through, at most.
const MAX_LINES: usize = 600;
/// A point this near to a line is on it, pixels.
const ON_LINE_PX: f64 = 0.5;
/// Least share of the profiles with a point on the line.
const MIN_SUPPORT: f64 = 0.4;
/// Edges nearer than this at both ends are one, pixels.
const SAME_EDGE_PX: f64 = 0.7;
/// Floor of the scatter of points about their edge, pixels.
const MIN_SCATTER_PX: f64 = 0.1;
/// Rounds of refitting.
const REFITS: usize = 3;

/// A straight edge beside a side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SideEdge {
    /// Offsets at the first and the second end of the side, pixels along [`outward`].
    pub offsets_px: Vector2<f64>,
    /// Their covariance, px^2.
    pub covariance_px2: Matrix2<f64>,
    /// Share of the side's profiles with a point on it, 0 to 1.
    pub support: f64,
}

/// An edge point: which profile, distance along the side, offset across it.
#[derive(Debug, Clone, Copy)]
struct EdgePoint {
    profile: usize,
    along_px: f64,
    offset_px: f64,
}

/// Unit normal of a side of corners in clockwise order, away from the landmark.
pub fn outward(from: &Point2<f64>, to: &Point2<f64>) -> Vector2<f64> {
    let along = (to - from).normalize();
    Vector2::new(along.y, -along.x)
}

/// The edges within `reach_px` of the side, the best supported first.
pub fn side_edges(
    image: PictureRef<'_>,
    from: &Point2<f64>,
    to: &Point2<f64>,
    reach_px: f64,
) -> Vec<SideEdge> {
    let length_px = (to - from).norm();
    let (points, profiles) = edge_points(image, from, to, reach_px);
    let mut lines = lines(&points, profiles);
    lines.sort_by_key(|(.., count)| std::cmp::Reverse(*count));
    let mut found: Vec<SideEdge> = Vec::new();
    for (start, slope, count) in lines {
        if found.len() == MAX_EDGES || (count as f64) < MIN_SUPPORT * profiles as f64 {
            break;
        }
        let Some(edge) = refitted(&points, (start, slope), length_px, profiles) else { continue };
        if found.iter().all(|f| (f.offsets_px - edge.offsets_px).amax() >= SAME_EDGE_PX) {
            found.push(edge);
        }
    }
    found
}

/// The strongest slopes of light on each profile, and the number of profiles. Slopes of the planes
/// of a colour picture are added as squares.
fn edge_points(
    image: PictureRef<'_>,
    from: &Point2<f64>,
    to: &Point2<f64>,
    reach_px: f64,
) -> (Vec<EdgePoint>, usize) {
    let length_px = (to - from).norm();
    let (along, across) = ((to - from) / length_px, outward(from, to));
    let profiles = ((length_px / 2.0) as usize).clamp(PROFILES[0], PROFILES[1]);
    let end = END_SHARE * length_px + END_PX;
    let steps = 2 * ((reach_px + 1.0) / STEP_PX).ceil() as usize + 1;
    let offset = |i: usize| (i as f64 - (steps / 2) as f64) * STEP_PX;
    let place = |p: usize| end + (length_px - 2.0 * end) * p as f64 / (profiles - 1) as f64;
    let at = |p: usize, i: usize| from + along * place(p) + across * offset(i);
    let planes = image.colour().map_or(std::slice::from_ref(image.grey()), |planes| planes.as_slice());
    let light: Vec<Vec<Vec<f32>>> = planes
        .iter()
        .map(|plane| (0..profiles).map(|p| (0..steps).map(|i| light(plane, &at(p, i))).collect()).collect())
        .collect();
    let kernel = slope_kernel();
    let mut points = Vec::new();
    for p in 0..profiles {
        let (before, after) = (p.saturating_sub(1), (p + 1).min(profiles - 1));
        let mut squares = vec![0.0_f32; steps];
        for light in &light {
            let own: Vec<f32> = (0..steps)
                .map(|i| {
                    (light[p][i] + NEIGHBOUR * (light[before][i] + light[after][i])) / (1.0 + 2.0 * NEIGHBOUR)
                })
                .collect();
            let value = |i: usize, k: usize| own[(i + k).saturating_sub(KERNEL_REACH).min(steps - 1)];
            for (i, square) in squares.iter_mut().enumerate().filter(|(i, _)| is_inside(image, &at(p, *i))) {
                *square += kernel.iter().enumerate().map(|(k, w)| w * value(i, k)).sum::<f32>().powi(2);
            }
        }
        let slopes: Vec<f32> = squares.into_iter().map(f32::sqrt).collect();
        let mut own: Vec<(f32, f64)> = (1..steps - 1)
            .filter(|i| offset(*i).abs() < reach_px)
            .filter_map(|i| peak(&slopes, i).map(|shift| (slopes[i], offset(i) + shift * STEP_PX)))
            .collect();
        own.sort_by(|a, b| b.0.total_cmp(&a.0));
        own.truncate(MAX_POINTS);
        let point = |(_, offset_px)| EdgePoint { profile: p, along_px: place(p), offset_px };
        points.extend(own.into_iter().map(point));
    }
    (points, profiles)
}

/// Where between the neighbours of `i` the largest slope is, steps; `None` unless `i` is a maximum.
fn peak(slopes: &[f32], i: usize) -> Option<f64> {
    let [before, here, after] = [slopes[i - 1], slopes[i], slopes[i + 1]].map(f64::from);
    if here <= f64::from(MIN_SLOPE) || here < before || here <= after {
        return None;
    }
    let bend = before - 2.0 * here + after;
    Some(if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-1.0, 1.0) } else { 0.0 })
}

/// The derivative of a Gaussian, per pixel.
fn slope_kernel() -> [f32; 2 * KERNEL_REACH + 1] {
    let at = |k: usize| k as f64 - KERNEL_REACH as f64;
    let bell = |k: usize| (-0.5 * (at(k) / SIGMA_STEPS).powi(2)).exp();
    let sum: f64 = (0..=2 * KERNEL_REACH).map(bell).sum();
    std::array::from_fn(|k| (at(k) / SIGMA_STEPS.powi(2) * bell(k) / sum / STEP_PX) as f32)
}

/// Bilinear light; at the image border that of the nearest pixel.
fn light(image: &GrayImage, at: &Point2<f64>) -> f32 {
    let (right, bottom) = (image.width() - 1, image.height() - 1);
    let (x, y) = (at.x.clamp(0.0, right as f64), at.y.clamp(0.0, bottom as f64));
    let (u, v) = (x as usize, y as usize);
    let (a, b) = ((x - u as f64) as f32, (y - v as f64) as f32);
    let of = |u: usize, v: usize| LIGHT[usize::from(image.at(u.min(right), v.min(bottom)))];
    (of(u, v) * (1.0 - a) + of(u + 1, v) * a) * (1.0 - b)
        + (of(u, v + 1) * (1.0 - a) + of(u + 1, v + 1) * a) * b
}

fn is_inside(image: PictureRef<'_>, at: &Point2<f64>) -> bool {
    at.x > 1.0 && at.y > 1.0 && at.x < image.width() as f64 - 2.0 && at.y < image.height() as f64 - 2.0
}

/// Lines through a point near the first end and one near the second: offset at the first end,
/// slope, and the number of profiles with a point on it.
fn lines(points: &[EdgePoint], profiles: usize) -> Vec<(f64, f64, usize)> {
    let (first, last) = (0.4 * profiles as f64, 0.6 * profiles as f64);
    let mut all = Vec::new();
    for a in points.iter().filter(|p| (p.profile as f64) < first) {
        for b in points.iter().filter(|p| p.profile as f64 >= last) {
            let slope = (b.offset_px - a.offset_px) / (b.along_px - a.along_px);
            if slope.abs() < MAX_TURN {
                all.push((a.offset_px - slope * a.along_px, slope));
            }
        }
    }
    let every = all.len().div_ceil(MAX_LINES).max(1);
    let counted = |(start, slope): (f64, f64)| {
        let mut seen = usize::MAX;
        let mut count = 0;
        for point in points {
            let is_on = (point.offset_px - start - slope * point.along_px).abs() < ON_LINE_PX;
            if is_on && point.profile != seen {
                (seen, count) = (point.profile, count + 1);
            }
        }
        (start, slope, count)
    };
    all.into_iter().step_by(every).map(counted).collect()
}

/// Least squares over the points on the line, a few times.
fn refitted(
    points: &[EdgePoint],
    (mut start, mut slope): (f64, f64),
    length_px: f64,
    profiles: usize,
) -> Option<SideEdge> {
    let mut fit = None;
    for _ in 0..REFITS {
        let on = |p: &&EdgePoint| (p.offset_px - start - slope * p.along_px).abs() < ON_LINE_PX;
        let own: Vec<EdgePoint> = points.iter().filter(on).copied().collect();
        if own.len() < 5 {
            break;
        }
        let n = own.len() as f64;
        let mean = own.iter().map(|p| p.along_px).sum::<f64>() / n;
        let centre = own.iter().map(|p| p.offset_px).sum::<f64>() / n;
        let spread: f64 = own.iter().map(|p| (p.along_px - mean).powi(2)).sum();
        if spread <= 0.0 {
            break;
        }
        slope = own.iter().map(|p| (p.along_px - mean) * (p.offset_px - centre)).sum::<f64>() / spread;
        start = centre - slope * mean;
        let squares: f64 = own.iter().map(|p| (p.offset_px - start - slope * p.along_px).powi(2)).sum();
        let variance = (squares / (n - 2.0)).max(MIN_SCATTER_PX.powi(2));
        // Offset and slope at the mean are independent.
        let ends = [-mean, length_px - mean];
        let covariance_px2 = Matrix2::from_fn(|i, j| variance * (1.0 / n + ends[i] * ends[j] / spread));
        let mut with_point: Vec<usize> = own.iter().map(|p| p.profile).collect();
        with_point.dedup();
        fit = Some(SideEdge {
            offsets_px: Vector2::new(start, start + slope * length_px),
            covariance_px2,
            support: with_point.len() as f64 / profiles as f64,
        });
    }
    fit
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Dark inside, a bright wall above row `edge(u)`, blurred by averaging light.
    fn picture(edge: impl Fn(f64) -> f64, dark: f64, bright: f64) -> GrayImage {
        GrayImage::from_fn(200, 120, |u, v| {
            let share = (v as f64 + 1.0 - edge(u as f64)).clamp(0.0, 2.0) / 2.0;
            let light = share * dark + (1.0 - share) * bright;
            (255.0 * (1.055 * light.powf(1.0 / 2.4) - 0.055)).clamp(0.0, 255.0).round() as u8
        })
    }

    fn ends(v: f64) -> (Point2<f64>, Point2<f64>) {
        (Point2::new(40.0, v), Point2::new(160.0, v))
    }

    #[test]
    fn a_tilted_edge_is_found_where_the_light_changes() {
        // The edge is 2.3 px above the side at its first end and 0.7 px below it at its second.
        let image = picture(|u| 57.7 + 3.0 * (u - 40.0) / 120.0, 0.02, 0.8);
        let (a, b) = ends(60.0);
        let found = side_edges((&image).into(), &a, &b, 6.0);
        let offsets_px = found[0].offsets_px;
        assert!((offsets_px - Vector2::new(2.3, -0.7)).amax() < 0.12, "{offsets_px:?}");
        assert!(found[0].support > 0.9);
        assert!(found[0].covariance_px2.m11.sqrt() < 0.1);
    }

    #[test]
    fn two_edges_are_both_found_and_none_is_none() {
        let image = GrayImage::from_fn(200, 120, |_, v| match v {
            0..54 => 200,
            54..61 => 120,
            _ => 30,
        });
        let (a, b) = ends(60.0);
        let found = side_edges((&image).into(), &a, &b, 8.0);
        let has = |at: f64| found.iter().any(|e| (e.offsets_px - Vector2::repeat(at)).amax() < 0.3);
        assert!(has(6.5) && has(-0.5), "{found:?}");
        assert!(side_edges((&GrayImage::from_fn(200, 120, |_, _| 90)).into(), &a, &b, 6.0).is_empty());
        // Beyond the image nothing is found, and nothing panics.
        assert!(
            side_edges((&image).into(), &Point2::new(-300.0, 5.0), &Point2::new(-200.0, 5.0), 6.0).is_empty()
        );
    }
}
