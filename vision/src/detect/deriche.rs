//! Grey image in, the two gradient planes out (method 1.1): the recursive filter of Canny and Deriche.
//!
//! Smoothing and derivative share their poles, so one causal recursion p+ and one anticausal recursion p- along a
//! line give both:  S = k (p+[n] + q(a-1) p+[n-1] + q(a+1) p-[n+1] - q^2 p-[n+2]),  D = (1-q)^2 (p-[n+1] - p+[n-1]).
//! Columns are filtered [`LANES`] at a time, rows too after a transposition; no thresholds here.

use crate::frame::GrayImage;

/// Lines filtered side by side.
const LANES: usize = 16;
type Lane = [f32; LANES];

/// Range of alpha in which the f32 recursion keeps its accuracy.
const ALPHA_RANGE: (f32, f32) = (0.25, 4.0);

/// Coefficients of the filter for one alpha.
#[derive(Debug, Clone, Copy)]
struct Deriche {
    /// Feedback 2q and -q^2.
    feedback: [f32; 2],
    /// Weights of p+[n], p+[n-1], p-[n+1], p-[n+2] in the smoothed value.
    smooth: [f32; 4],
    /// (1-q)^2: the peak response to a step is the step's height.
    step: f32,
}

impl Deriche {
    fn new(alpha: f32) -> Self {
        let a = f64::from(alpha.clamp(ALPHA_RANGE.0, ALPHA_RANGE.1));
        let q = (-a).exp();
        let k = (1.0 - q).powi(2) / (1.0 + 2.0 * a * q - q * q);
        Self {
            feedback: [(2.0 * q) as f32, (-q * q) as f32],
            smooth: [k, k * q * (a - 1.0), k * q * (a + 1.0), -k * q * q].map(|w| w as f32),
            step: ((1.0 - q).powi(2)) as f32,
        }
    }

    /// p of a constant signal `x`: the state that the replicated border would have led to.
    fn steady(&self, x: &Lane) -> Lane {
        x.map(|x| x / self.step)
    }

    #[inline]
    fn next(&self, x: &Lane, p1: &Lane, p2: &Lane) -> Lane {
        std::array::from_fn(|i| (x[i] + self.feedback[1] * p2[i]) + self.feedback[0] * p1[i])
    }

    /// Runs both recursions over `x` and hands n, p+[n], p+[n-1], p-[n+1], p-[n+2] to `emit`. `minus` is scratch.
    #[inline]
    fn run(&self, x: &[Lane], minus: &mut Vec<Lane>, mut emit: impl FnMut(usize, [&Lane; 4])) {
        let (Some(first), Some(last)) = (x.first(), x.last()) else { return };
        let n = x.len();
        minus.clear();
        minus.resize(n + 2, self.steady(last));
        let (mut p1, mut p2) = (minus[n], minus[n + 1]);
        for (x, out) in x.iter().zip(minus.iter_mut()).rev() {
            let p = self.next(x, &p1, &p2);
            *out = p;
            (p1, p2) = (p, p1);
        }
        let mut p1 = self.steady(first);
        let mut p2 = p1;
        for (i, (x, m)) in x.iter().zip(minus[1..].windows(2)).enumerate() {
            let p = self.next(x, &p1, &p2);
            emit(i, [&p, &p1, &m[0], &m[1]]);
            (p1, p2) = (p, p1);
        }
    }

    #[inline]
    fn smoothed(&self, p: [&Lane; 4]) -> Lane {
        let w = self.smooth;
        std::array::from_fn(|i| (w[0] * p[0][i] + w[2] * p[2][i]) + (w[1] * p[1][i] + w[3] * p[3][i]))
    }

    #[inline]
    fn derived(&self, p: [&Lane; 4]) -> Lane {
        std::array::from_fn(|i| self.step * (p[2][i] - p[1][i]))
    }
}

/// Gradient planes (gx, gy), row-major, in grey levels of step height, pointing to the brighter side. The image is
/// continued by its border pixels.
pub(crate) fn gradients(image: &GrayImage, alpha: f32) -> (Vec<f32>, Vec<f32>) {
    let (width, height) = (image.width(), image.height());
    let filter = Deriche::new(alpha);
    let mut smooth_v = vec![0.0; width * height];
    let mut derive_v = vec![0.0; width * height];
    let mut lines: Vec<Lane> = Vec::with_capacity(width.max(height));
    let mut minus: Vec<Lane> = Vec::with_capacity(width.max(height) + 2);
    for u in (0..width).step_by(LANES) {
        let lanes = LANES.min(width - u);
        lines.clear();
        lines.extend(image.data().chunks_exact(width).map(|row| from_bytes(&row[u..u + lanes])));
        filter.run(&lines, &mut minus, |v, p| {
            let at = v * width + u;
            store(&mut smooth_v[at..at + lanes], &filter.smoothed(p));
            store(&mut derive_v[at..at + lanes], &filter.derived(p));
        });
    }
    // Derive_x(Smooth_y) and Smooth_x(Derive_y): the axes commute, so both share the pass above. Each block of rows
    // is replaced in place.
    let mut out: Vec<Lane> = vec![[0.0; LANES]; width];
    for (smooth_rows, derive_rows) in
        smooth_v.chunks_mut(width * LANES).zip(derive_v.chunks_mut(width * LANES))
    {
        lines_of_rows(smooth_rows, width, &mut lines);
        filter.run(&lines, &mut minus, |u, p| out[u] = filter.derived(p));
        rows_of_lines(&out, smooth_rows);
        lines_of_rows(derive_rows, width, &mut lines);
        filter.run(&lines, &mut minus, |u, p| out[u] = filter.smoothed(p));
        rows_of_lines(&out, derive_rows);
    }
    (smooth_v, derive_v)
}

#[inline]
fn from_bytes(bytes: &[u8]) -> Lane {
    let mut lane = [0.0; LANES];
    if let Ok(full) = <&[u8; LANES]>::try_from(bytes) {
        lane = full.map(f32::from);
    } else {
        for (to, from) in lane.iter_mut().zip(bytes) {
            *to = f32::from(*from);
        }
    }
    lane
}

#[inline]
fn store(to: &mut [f32], lane: &Lane) {
    if let Ok(full) = <&mut [f32; LANES]>::try_from(&mut *to) {
        *full = *lane;
    } else {
        to.copy_from_slice(&lane[..to.len()]);
    }
}

/// Transposes up to [`LANES`] rows of `width` into one lane a column; missing rows are zero.
fn lines_of_rows(rows: &[f32], width: usize, lines: &mut Vec<Lane>) {
    lines.clear();
    lines.resize(width, [0.0; LANES]);
    for (r, row) in rows.chunks_exact(width).enumerate() {
        for (line, x) in lines.iter_mut().zip(row) {
            line[r] = *x;
        }
    }
}

fn rows_of_lines(lines: &[Lane], rows: &mut [f32]) {
    for (r, row) in rows.chunks_exact_mut(lines.len()).enumerate() {
        for (x, line) in row.iter_mut().zip(lines) {
            *x = line[r];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Explicit kernels on the edge-padded signal, f64, far enough that the tails vanish.
    fn oracle(x: &[f64], alpha: f64) -> (Vec<f64>, Vec<f64>) {
        let q = (-alpha).exp();
        let k = (1.0 - q).powi(2) / (1.0 + 2.0 * alpha * q - q * q);
        let at = |i: i64| x[i.clamp(0, x.len() as i64 - 1) as usize];
        let reach = (45.0 / alpha) as i64;
        (0..x.len() as i64)
            .map(|n| {
                (-reach..=reach).fold((0.0, 0.0), |(s, d), j| {
                    let decay = (-alpha * j.abs() as f64).exp();
                    let smooth = k * (alpha * j.abs() as f64 + 1.0) * decay;
                    // n q^(n-1) is the impulse response of 1/(1 - q z)^2 after one delay.
                    let derive = (1.0 - q).powi(2) * j as f64 * decay / q;
                    (s + smooth * at(n + j), d + derive * at(n + j))
                })
            })
            .unzip()
    }

    fn lines(x: &[f64]) -> Vec<Lane> {
        x.iter().map(|x| [*x as f32; LANES]).collect()
    }

    fn filtered(x: &[f64], alpha: f64) -> (Vec<f64>, Vec<f64>) {
        let filter = Deriche::new(alpha as f32);
        let mut out = (vec![], vec![]);
        filter.run(&lines(x), &mut vec![], |_, p| {
            out.0.push(f64::from(filter.smoothed(p)[3]));
            out.1.push(f64::from(filter.derived(p)[7]));
        });
        out
    }

    #[test]
    fn step_responses_are_the_golden_values() {
        let step: Vec<f64> = (0..200).map(|i| f64::from(i >= 100)).collect();
        for (alpha, golden) in
            [(1.0, [0.3064, 0.6004, 1.0]), (0.5, [0.6574, 0.8452, 1.0]), (2.0, [0.05, 0.2524, 1.0])]
        {
            let (_, d) = filtered(&step, alpha);
            for (i, expected) in golden.iter().enumerate() {
                assert!((d[97 + i] - expected).abs() < 1e-4, "alpha {alpha}: {} at {}", d[97 + i], 97 + i);
                assert!((d[102 - i] - expected).abs() < 1e-4, "alpha {alpha}: {} at {}", d[102 - i], 102 - i);
            }
        }
    }

    #[test]
    fn recursion_equals_the_explicit_kernel() {
        let mut state = 7_u32;
        let noise: Vec<f64> = (0..97)
            .map(|_| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(state >> 8) / f64::from(1 << 24)
            })
            .collect();
        for alpha in [0.5, 0.8, 1.0, 2.0] {
            for n in [1, 2, 3, 16, 97] {
                let (s, d) = filtered(&noise[..n], alpha);
                let (os, od) = oracle(&noise[..n], alpha);
                for i in 0..n {
                    assert!(
                        (s[i] - os[i]).abs() < 1e-5,
                        "smooth alpha {alpha} n {n} at {i}: {} {}",
                        s[i],
                        os[i]
                    );
                    assert!(
                        (d[i] - od[i]).abs() < 1e-5,
                        "derive alpha {alpha} n {n} at {i}: {} {}",
                        d[i],
                        od[i]
                    );
                }
            }
        }
    }

    #[test]
    fn planes_are_the_separable_product() {
        // Every width and height around the lane count, against the 1-D oracle along both axes.
        for (width, height) in [(1, 1), (1, 20), (33, 2), (15, 17), (16, 16), (40, 31)] {
            let image =
                GrayImage::from_fn(width, height, |u, v| ((u * 37 + v * 91 + u * v * 13) % 256) as u8);
            let (gx, gy) = gradients(&image, 1.0);
            let column = |u: usize| (0..height).map(|v| f64::from(image.at(u, v))).collect::<Vec<_>>();
            let columns: Vec<_> = (0..width).map(|u| oracle(&column(u), 1.0)).collect();
            for v in 0..height {
                let smooth_row: Vec<f64> = columns.iter().map(|c| c.0[v]).collect();
                let derive_row: Vec<f64> = columns.iter().map(|c| c.1[v]).collect();
                let (x, y) = (oracle(&smooth_row, 1.0).1, oracle(&derive_row, 1.0).0);
                for u in 0..width {
                    let at = v * width + u;
                    assert!((f64::from(gx[at]) - x[u]).abs() < 255e-5, "gx at {u},{v} of {width}x{height}");
                    assert!((f64::from(gy[at]) - y[u]).abs() < 255e-5, "gy at {u},{v} of {width}x{height}");
                }
            }
        }
    }
}
