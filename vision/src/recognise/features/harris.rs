//! Icon in, sub-pixel Harris points out (method 5).

use crate::{icon::Icon, recognise::features::separable::filtered};
use serde::{Deserialize, Serialize};

/// Most points that one icon may have, whatever the parameters say.
pub const MAX_POINTS: usize = 256;
/// Largest filter radius in icon pixels, whatever the parameters say.
const MAX_RADIUS: usize = 32;
/// Parts along each side for [`HarrisParams::max_points_per_part`].
const PARTS: usize = 5;
/// A response below this (grey levels to the fourth) is rounding, not texture.
const MIN_RESPONSE: f32 = 1.0;

/// Parameters of this stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HarrisParams {
    /// Scale of the derivatives, in icon pixels.
    pub sigma_derivative: f64,
    /// Scale of the integration, in icon pixels.
    pub sigma_integration: f64,
    /// Weight of the squared trace.
    pub k: f64,
    /// A point's response is above this share of the icon's greatest.
    pub relative_threshold: f64,
    /// Points keep this distance from the icon's border, in icon pixels.
    pub margin_px: usize,
    /// The strongest this many are kept, at most [`MAX_POINTS`].
    pub max_points: usize,
    /// The strongest this many of each of 5 x 5 parts of the icon are kept.
    ///
    /// Departs from method 5, which keeps the strongest above 1e-3 of the peak wherever they are: a
    /// label, a lamp or a passer-by with strong contrast would then take most of the points.
    pub max_points_per_part: usize,
}

impl Default for HarrisParams {
    fn default() -> Self {
        Self {
            sigma_derivative: 1.0,
            sigma_integration: 1.5,
            k: 0.04,
            relative_threshold: 1e-5,
            margin_px: 4,
            max_points: 60,
            max_points_per_part: 3,
        }
    }
}

/// A corner-like point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HarrisPoint {
    /// Column and row in icon pixels, sub-pixel.
    pub xy_px: [f32; 2],
    /// det M - k tr^2 M.
    pub response: f32,
}

/// The strongest local maxima (5 x 5) of the Harris response, strongest first; equal ones in
/// row-major order.
pub fn harris(icon: &Icon, p: &HarrisParams) -> Vec<HarrisPoint> {
    let response = response(icon, p);
    // Two pixels of neighbourhood are read around every point.
    let (size, margin) = (icon.size, p.margin_px.max(2));
    if size <= 2 * margin {
        return Vec::new();
    }
    let inside = margin..size - margin;
    let peak = inside
        .clone()
        .flat_map(|row| response[row * size + margin..(row + 1) * size - margin].iter().copied())
        .fold(0.0, f32::max);
    let threshold = (peak * p.relative_threshold as f32).max(MIN_RESPONSE);
    let mut points = Vec::new();
    for row in inside.clone() {
        for column in inside.clone() {
            let value = response[row * size + column];
            if value > threshold && is_peak(&response, size, column, row) {
                let (dx, dy) = sub_pixel(&response, size, column, row);
                points.push(HarrisPoint { xy_px: [column as f32 + dx, row as f32 + dy], response: value });
            }
        }
    }
    points.sort_by(|a, b| b.response.total_cmp(&a.response));
    let mut taken = [0_usize; PARTS * PARTS];
    points.retain(|q| {
        let part = q.xy_px.map(|c| (c * PARTS as f32 / size as f32).clamp(0.0, PARTS as f32 - 1.0) as usize);
        let count = &mut taken[part[1] * PARTS + part[0]];
        *count += 1;
        *count <= p.max_points_per_part
    });
    points.truncate(p.max_points.min(MAX_POINTS));
    points
}

/// The Harris response of every icon pixel, row-major.
fn response(icon: &Icon, p: &HarrisParams) -> Vec<f32> {
    let size = icon.size;
    let (smooth, slope) =
        (gaussian(p.sigma_derivative, radius(p.sigma_derivative)), derivative(p.sigma_derivative));
    let both = |pixels: &[f32], across: &[f32], down: &[f32]| filtered(pixels, size, across, down);
    let gx = both(&icon.pixels, &slope, &smooth);
    let gy = both(&icon.pixels, &smooth, &slope);
    let window = gaussian(p.sigma_integration, radius(p.sigma_integration));
    let integrate = |f: &dyn Fn(f32, f32) -> f32| {
        let product: Vec<f32> = gx.iter().zip(&gy).map(|(x, y)| f(*x, *y)).collect();
        both(&product, &window, &window)
    };
    let (xx, xy, yy) = (integrate(&|x, _| x * x), integrate(&|x, y| x * y), integrate(&|_, y| y * y));
    let k = p.k as f32;
    (0..size * size).map(|i| xx[i] * yy[i] - xy[i] * xy[i] - k * (xx[i] + yy[i]) * (xx[i] + yy[i])).collect()
}

/// Greatest of its 5 x 5 neighbourhood; of equal neighbours the first in row-major order.
fn is_peak(response: &[f32], size: usize, column: usize, row: usize) -> bool {
    let value = response[row * size + column];
    (row - 2..=row + 2).all(|r| {
        (column - 2..=column + 2).all(|c| {
            let other = response[r * size + c];
            if (r, c) < (row, column) { value > other } else { value >= other }
        })
    })
}

/// Peak of the quadratic through the 3 x 3 neighbourhood, at most half a pixel away on each axis.
fn sub_pixel(response: &[f32], size: usize, column: usize, row: usize) -> (f32, f32) {
    let at = |dx: isize, dy: isize| {
        f64::from(response[row.wrapping_add_signed(dy) * size + column.wrapping_add_signed(dx)])
    };
    let (gx, gy) = (0.5 * (at(1, 0) - at(-1, 0)), 0.5 * (at(0, 1) - at(0, -1)));
    let xx = at(1, 0) - 2.0 * at(0, 0) + at(-1, 0);
    let yy = at(0, 1) - 2.0 * at(0, 0) + at(0, -1);
    let xy = 0.25 * (at(1, 1) - at(-1, 1) - at(1, -1) + at(-1, -1));
    let det = xx * yy - xy * xy;
    if !(det > 0.0 && xx < 0.0) {
        return (0.0, 0.0);
    }
    let (dx, dy) = ((xy * gy - yy * gx) / det, (xy * gx - xx * gy) / det);
    (dx.clamp(-0.5, 0.5) as f32, dy.clamp(-0.5, 0.5) as f32)
}

/// A picture in rows of `width`, smoothed by a Gaussian, border replicated.
pub(crate) fn blurred(pixels: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    blurred_to(pixels, width, sigma, radius(sigma))
}

/// The same with a Gaussian that ends `reach` pixels from its centre.
pub(crate) fn blurred_to(pixels: &[f32], width: usize, sigma: f64, reach: usize) -> Vec<f32> {
    let kernel = gaussian(sigma, reach);
    filtered(pixels, width, &kernel, &kernel)
}

/// Half length of a kernel: four sigma.
fn radius(sigma: f64) -> usize {
    // A NaN or negative sigma casts to 0: no filtering.
    ((4.0 * sigma).ceil() as usize).clamp(1, MAX_RADIUS)
}

/// Sampled Gaussian of sum 1.
fn gaussian(sigma: f64, reach: usize) -> Vec<f32> {
    let r = reach as i32;
    let weights: Vec<f64> = (-r..=r).map(|i| bell(f64::from(i), sigma)).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| (w / sum) as f32).collect()
}

/// Derivative of a Gaussian, as a correlation kernel; response 1 to a ramp of slope 1.
fn derivative(sigma: f64) -> Vec<f32> {
    let r = radius(sigma) as i32;
    let weights: Vec<f64> = (-r..=r).map(|i| f64::from(i) * bell(f64::from(i), sigma)).collect();
    let slope: f64 = (-r..=r).zip(&weights).map(|(i, w)| f64::from(i) * w).sum();
    weights.iter().map(|w| (w / slope) as f32).collect()
}

fn bell(x: f64, sigma: f64) -> f64 {
    let s = if sigma > 1e-3 { sigma } else { 1e-3 };
    // Never quite 0, so that a derivative kernel always has a slope.
    (-0.5 * (x / s).powi(2)).exp().max(1e-30)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn icon(f: impl Fn(usize, usize) -> f32) -> Icon {
        Icon { size: 75, pixels: (0..75 * 75).map(|i| f(i % 75, i / 75)).collect(), source_scale: 1.0 }
    }

    /// A bright square from (20, 25) to (50, 55), edges half way between pixels.
    fn square() -> Icon {
        icon(|x, y| if (20..50).contains(&x) && (25..55).contains(&y) { 220.0 } else { 30.0 })
    }

    #[test]
    fn corners_of_a_square_are_found() {
        let points = harris(&square(), &HarrisParams::default());
        assert_eq!(points.len(), 4, "{points:?}");
        for expected in [[19.5, 24.5], [49.5, 24.5], [49.5, 54.5], [19.5, 54.5]] {
            let near = points.iter().any(|p| {
                let d = (p.xy_px[0] - expected[0]).hypot(p.xy_px[1] - expected[1]);
                // The maximum of the Harris response lies inside the corner by a fraction of sigma.
                d < 2.0
            });
            assert!(near, "{expected:?} {points:?}");
        }
    }

    #[test]
    fn response_equals_a_direct_sum() {
        // Oracle: the two-dimensional sums written out at one pixel, without separability.
        let p = HarrisParams::default();
        let icon =
            icon(|x, y| 120.0 + 50.0 * (x as f32 * 0.3).sin() * (y as f32 * 0.21).cos() + (x * y % 7) as f32);
        let at = |x: i32, y: i32| f64::from(icon.pixels[(y * 75 + x) as usize]);
        let gauss = |x: i32, y: i32, s: f64| (-f64::from(x * x + y * y) / (2.0 * s * s)).exp();
        let gradient = |cx: i32, cy: i32| {
            let (mut gx, mut gy, mut norm) = (0.0, 0.0, 0.0);
            for dy in -4..=4 {
                for dx in -4..=4 {
                    let w = gauss(dx, dy, 1.0);
                    gx += f64::from(dx) * w * at(cx + dx, cy + dy);
                    gy += f64::from(dy) * w * at(cx + dx, cy + dy);
                    norm += f64::from(dx * dx) * w;
                }
            }
            (gx / norm, gy / norm)
        };
        let (mut xx, mut xy, mut yy, mut norm) = (0.0, 0.0, 0.0, 0.0);
        for dy in -6..=6 {
            for dx in -6..=6 {
                let w = gauss(dx, dy, 1.5);
                let (gx, gy) = gradient(33 + dx, 41 + dy);
                xx += w * gx * gx;
                xy += w * gx * gy;
                yy += w * gy * gy;
                norm += w;
            }
        }
        let (xx, xy, yy) = (xx / norm, xy / norm, yy / norm);
        let expected = xx * yy - xy * xy - 0.04 * (xx + yy) * (xx + yy);
        let actual = f64::from(response(&icon, &p)[41 * 75 + 33]);
        assert!((actual - expected).abs() < 1e-4 * expected.abs().max(1.0), "{actual} {expected}");
    }

    #[test]
    fn bounds_and_order() {
        let busy = icon(|x, y| if (x / 6 + y / 6) % 2 == 0 { 200.0 } else { 40.0 });
        let p = HarrisParams::default();
        let points = harris(&busy, &p);
        assert_eq!(points.len(), p.max_points);
        assert!(points.is_sorted_by(|a, b| a.response >= b.response));
        for q in points {
            assert!(q.xy_px.iter().all(|c| (3.5..=70.5).contains(c)));
        }
        assert!(harris(&icon(|_, _| 90.0), &p).is_empty());
    }

    #[test]
    fn a_quarter_turn_turns_the_points() {
        let icon =
            icon(|x, y| 100.0 + 70.0 * (x as f32 * 0.4).sin() * (y as f32 * 0.33 + 0.02 * x as f32).cos());
        let p = HarrisParams::default();
        let (plain, turned) = (harris(&icon, &p), harris(&icon.rotated(1), &p));
        assert_eq!(plain.len(), turned.len());
        for q in plain {
            let expected = [q.xy_px[1], 74.0 - q.xy_px[0]];
            assert!(turned.iter().any(|t| {
                (t.xy_px[0] - expected[0]).abs() < 1e-2 && (t.xy_px[1] - expected[1]).abs() < 1e-2
            }));
        }
    }

    proptest! {
        #[test]
        fn never_panics(
            size in 1_usize..40,
            seed in any::<u32>(),
            sigma in prop_oneof![Just(f64::NAN), Just(-1.0), Just(0.0), Just(1e9), 0.1..5.0_f64],
            margin_px in 0_usize..60,
            max_points in 0_usize..1000,
        ) {
            let mut state = seed;
            let pixels = (0..size * size).map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 24) as f32
            }).collect();
            let p = HarrisParams { sigma_derivative: sigma, sigma_integration: sigma, margin_px, max_points, ..HarrisParams::default() };
            let points = harris(&Icon { size, pixels, source_scale: 1.0 }, &p);
            prop_assert!(points.len() <= max_points.min(MAX_POINTS));
        }
    }
}
