//! Width over height of a flat rectangle from the corners of its views (method 16.7). In: corners,
//! sizes of the pictures, and cameras where they are known. Out: the ratio with its standard
//! deviation, and how a stated size agrees with it.
//!
//! One view gives two numbers: that the sides are at right angles, and the ratio; both depend on
//! the focal length. Where that is unknown, all of its values are weighed by how well they make the
//! sides of all views rectangular.

use crate::{
    camera_calibration::FOCAL_SIDES,
    frame::Intrinsics,
    geometry::{corners::Corners, homography::Homography},
    pose::LandmarkSize,
};
use nalgebra::{Matrix2, Point2, SMatrix, Vector2, Vector3};
use std::collections::BTreeMap;

/// Standard deviation of a taught corner, as a share of the rectangle's side in the picture; at
/// least [`CORNER_PX`]. Frames, shadows and margins move the corners of a quad by so much.
const CORNER_SHARE: f64 = 0.006;
/// The same in pixels.
const CORNER_PX: f64 = 1.0;
/// What all views have in common, as a share of the ratio: they may outline an inner border.
const COMMON: f64 = 0.02;
/// Focal lengths that cameras usually have, in longer sides of the picture: logarithm of the
/// middle, and its deviation.
const USUAL_FOCAL: [f64; 2] = [-0.223, 0.5];
/// Focal lengths that are tried.
const STEPS: usize = 81;
/// Most views that are used.
pub const MAX_ASPECT_VIEWS: usize = 64;
/// A ratio known worse than this refuses no size.
const SUFFICIENT: f64 = 0.05;
/// Least difference, of logarithms, at which a size is refused, and at which it is doubted.
const REFUSED: f64 = 0.15;
const DOUBTED: f64 = 0.1;

/// One view of the rectangle.
#[derive(Debug, Clone, PartialEq)]
pub struct AspectView {
    /// Its corners, px.
    pub corners_px: Corners,
    /// Width and height of the picture, px.
    pub size_px: [usize; 2],
    /// The camera, where it is known.
    pub camera: Option<Intrinsics>,
}

/// Width over height of a rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aspect {
    /// The ratio.
    pub ratio: f64,
    /// Standard deviation of its logarithm: of the ratio, as a share of it.
    pub sigma_log: f64,
}

/// How a stated size agrees with what views show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AspectAgreement {
    /// It may be right.
    Agrees,
    /// It does not fit, and the views do not determine the ratio well enough to refuse it.
    Doubtful,
    /// It is wrong.
    Differs {
        /// Width and height in the other order would agree.
        swapped: bool,
    },
}

impl Aspect {
    /// How a size agrees with it.
    pub fn agreement(&self, stated: LandmarkSize) -> AspectAgreement {
        let (stated, measured) = ((stated.width_m / stated.height_m).ln(), self.ratio.ln());
        let (off, sigmas) = ((stated - measured).abs(), |n: f64| n * self.sigma_log);
        if self.sigma_log <= SUFFICIENT && off > REFUSED.max(sigmas(4.0)) {
            AspectAgreement::Differs { swapped: (stated + measured).abs() < DOUBTED.max(sigmas(3.0)) }
        } else if off > DOUBTED.max(sigmas(2.0)) {
            AspectAgreement::Doubtful
        } else {
            AspectAgreement::Agrees
        }
    }
}

/// What one view says at one focal length: the cosine between the sides and the logarithm of their
/// ratio, with the inverse of their covariance.
struct ViewSides {
    cosine: f64,
    log_ratio: f64,
    information: Matrix2<f64>,
}

/// The ratio that views show; `None` where there is no view with corners of its own. Views whose
/// corners are those of the picture (a scan, a cut-out) say nothing of a camera and are left out.
pub fn aspect(views: &[AspectView]) -> Option<Aspect> {
    // By camera: a known one, or the pictures of one size. The pixels are exact keys.
    let mut unknown: BTreeMap<[usize; 2], Vec<[Point2<f64>; 4]>> = BTreeMap::new();
    let mut known = Vec::new();
    for view in views.iter().filter(|view| !is_whole(view)).take(MAX_ASPECT_VIEWS) {
        match &view.camera {
            None => unknown.entry(view.size_px).or_default().push(*view.corners_px.points()),
            Some(camera) => known.push((view, camera)),
        }
    }
    let mut estimates: Vec<[f64; 2]> =
        known.iter().filter_map(|(view, camera)| by_camera(view, camera)).collect();
    estimates.extend(unknown.iter().filter_map(|(size_px, views)| by_views(*size_px, views)));
    let weight: f64 = estimates.iter().map(|[_, variance]| 1.0 / variance).sum();
    if estimates.is_empty() || !weight.is_finite() || weight <= 0.0 {
        return None;
    }
    let mean = estimates.iter().map(|[mean, variance]| mean / variance).sum::<f64>() / weight;
    // Cameras that contradict one another make it less sure.
    let chi2: f64 = estimates.iter().map(|[m, variance]| (m - mean).powi(2) / variance).sum();
    let spread = (chi2 / (estimates.len() as f64 - 1.0).max(1.0)).max(1.0);
    Some(Aspect { ratio: mean.exp(), sigma_log: (spread / weight + COMMON * COMMON).sqrt() })
}

fn is_whole(AspectView { corners_px, size_px: [width, height], .. }: &AspectView) -> bool {
    let [right, bottom] = [*width as f64 - 1.0, *height as f64 - 1.0];
    let ends = [[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]];
    corners_px.points().iter().zip(ends).all(|(p, [x, y])| (p.x - x).abs() < 1.5 && (p.y - y).abs() < 1.5)
}

/// Logarithm of the ratio and its variance by one view of a known camera.
fn by_camera(view: &AspectView, camera: &Intrinsics) -> Option<[f64; 2]> {
    let points = view.corners_px.points();
    let mut rays = [Point2::origin(); 4];
    for (ray, px) in rays.iter_mut().zip(points) {
        *ray = camera.normalised(&camera.undistort(px)?);
    }
    let noise = corner_sigma(points) / f64::midpoint(camera.fx_px, camera.fy_px);
    let seen = seen(&rays, noise, 1.0)?;
    let ([mean, variance], _) = combined(std::slice::from_ref(&seen))?;
    Some([mean, variance])
}

/// The same by the views of one unknown camera with square pixels and its centre in the middle.
fn by_views([width, height]: [usize; 2], views: &[[Point2<f64>; 4]]) -> Option<[f64; 2]> {
    let (longer, middle) =
        (width.max(height) as f64, Vector2::new(0.5 * (width as f64 - 1.0), 0.5 * (height as f64 - 1.0)));
    let scaled: Vec<([Point2<f64>; 4], f64)> = views
        .iter()
        .map(|v| (v.map(|p| Point2::from((p.coords - middle) / longer)), corner_sigma(v) / longer))
        .collect();
    let [low, high] = FOCAL_SIDES.map(f64::ln);
    let at = |i: usize| low + (high - low) * i as f64 / (STEPS - 1) as f64;
    let tried: Vec<(f64, [f64; 2], f64)> = (0..STEPS)
        .filter_map(|i| {
            let seen: Vec<ViewSides> =
                scaled.iter().filter_map(|(points, noise)| seen(points, *noise, at(i).exp())).collect();
            let (estimate, chi2) = combined(&seen).filter(|_| seen.len() == scaled.len())?;
            Some((at(i), estimate, chi2))
        })
        .collect();
    let least = tried.iter().map(|(.., chi2)| *chi2).fold(f64::INFINITY, f64::min);
    // Two numbers a view, less the ratio and the focal length: what is left beyond it says that
    // corners are worse.
    let free = (2.0 * views.len() as f64 - 2.0).max(1.0);
    let scale = (least / free).max(1.0);
    let weigh = |(log_focal, [_, variance], chi2): &(f64, [f64; 2], f64)| {
        let usual = ((log_focal - USUAL_FOCAL[0]) / USUAL_FOCAL[1]).powi(2);
        (-0.5 * ((chi2 - least) / scale + usual)).exp() * variance.sqrt()
    };
    let total: f64 = tried.iter().map(weigh).sum();
    let mean = tried.iter().map(|t| weigh(t) * t.1[0]).sum::<f64>() / total;
    let variance =
        tried.iter().map(|t| weigh(t) * (scale * t.1[1] + (t.1[0] - mean).powi(2))).sum::<f64>() / total;
    (mean.is_finite() && variance.is_finite() && variance > 0.0).then_some([mean, variance])
}

/// Standard deviation of a corner, px.
fn corner_sigma(corners_px: &[Point2<f64>; 4]) -> f64 {
    let around: f64 = (0..4).map(|i| (corners_px[(i + 1) % 4] - corners_px[i]).norm()).sum();
    (CORNER_SHARE * 0.25 * around).max(CORNER_PX)
}

/// Views together: logarithm of the ratio with its variance, and chi2.
fn combined(seen: &[ViewSides]) -> Option<([f64; 2], f64)> {
    let (mut all, mut pull) = (0.0, 0.0);
    for ViewSides { cosine, log_ratio, information: i } in seen {
        all += i.m22;
        pull += i.m22 * log_ratio + i.m12 * cosine;
    }
    if seen.is_empty() || all <= 0.0 || !all.is_finite() {
        return None;
    }
    let mean = pull / all;
    let chi2 = seen.iter().map(|s| {
        let r = Vector2::new(s.cosine, s.log_ratio - mean);
        r.dot(&(s.information * r))
    });
    Some(([mean, 1.0 / all], chi2.sum()))
}

/// Points TL, TR, BR, BL with noise, at a focal length in the same unit.
fn seen(points: &[Point2<f64>; 4], noise: f64, focal: f64) -> Option<ViewSides> {
    let here = sides(points, focal)?;
    let mut slopes = SMatrix::<f64, 2, 8>::zeros();
    for k in 0..8 {
        let mut moved = *points;
        moved[k / 2][k % 2] += noise;
        let there = sides(&moved, focal)?;
        slopes.set_column(k, &(there - here));
    }
    let information = (slopes * slopes.transpose()).try_inverse()?;
    Some(ViewSides { cosine: here.x, log_ratio: here.y, information })
}

/// The cosine between the directions of width and height, and the logarithm of width over height.
fn sides(points: &[Point2<f64>; 4], focal: f64) -> Option<Vector2<f64>> {
    let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
    let homography = Homography::from_points(&unit, points).ok()?;
    let column = |i: usize| -> Vector3<f64> {
        let h = homography.matrix().column(i);
        Vector3::new(h[0] / focal, h[1] / focal, h[2])
    };
    let (across, down) = (column(0), column(1));
    let (a, b) = (across.norm(), down.norm());
    let found = Vector2::new(across.dot(&down) / (a * b), (a / b).ln());
    found.iter().all(|v| v.is_finite()).then_some(found)
}

#[cfg(test)]
mod tests;
