use super::*;
use crate::detect::edges::maxima::{Maxima, Maximum};
use fearless_simd::{Level, dispatch};

impl<S: Simd> GradientRows<S> for () {
    fn row(&mut self, _: S, _: usize, _: [&[f32]; 2]) {}
}

fn planes(image: &GrayImage, alpha: f32) -> (Vec<f32>, Vec<f32>) {
    let n = image.width() * image.height();
    let (mut gx, mut gy) = (vec![f32::NAN; n], vec![f32::NAN; n]);
    let mut memory = FilterMemory::default();
    dispatch!(Level::new(), s => gradients(s, image, alpha, &mut memory, [&mut gx, &mut gy], &mut ()));
    (gx, gy)
}

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

#[test]
fn step_responses_are_the_golden_values() {
    let across = GrayImage::from_fn(200, 3, |u, _| if u < 100 { 50 } else { 150 });
    let down = GrayImage::from_fn(3, 200, |_, v| if v < 100 { 50 } else { 150 });
    for (alpha, golden) in
        [(1.0, [0.3064, 0.6004, 1.0]), (0.5, [0.6574, 0.8452, 1.0]), (2.0, [0.05, 0.2524, 1.0])]
    {
        let (gx, gy) = (planes(&across, alpha).0, planes(&down, alpha).1);
        for (i, expected) in golden.iter().enumerate() {
            for at in [97 + i, 102 - i] {
                assert!((gx[200 + at] / 100.0 - expected).abs() < 1e-4, "alpha {alpha}: {} at {at}", gx[at]);
                assert!((gy[3 * at + 1] / 100.0 - expected).abs() < 1e-4, "alpha {alpha} at {at}");
            }
        }
    }
}

#[test]
fn planes_are_the_separable_product() {
    // Every width and height around the lane count, against the explicit kernels along both axes.
    let sizes = [(1, 1), (1, 20), (2, 3), (33, 2), (15, 17), (16, 16), (17, 33), (40, 31), (97, 64)];
    for (alpha, tolerance) in [(1.0, 1e-4), (0.25, 3e-3), (0.5, 4e-4), (2.0, 1e-4), (4.0, 1e-4)] {
        for (width, height) in sizes {
            let image = GrayImage::from_fn(width, height, |u, v| (u * 37 + v * 91 + u * v * 13) as u8);
            let (gx, gy) = planes(&image, alpha);
            let (x, y) = separable(&image, f64::from(alpha));
            let worst = |a: &[f32], b: &[f64]| {
                a.iter().zip(b).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max)
            };
            let worst = worst(&gx, &x).max(worst(&gy, &y));
            assert!(worst < tolerance, "alpha {alpha}, {width}x{height}: {worst} grey levels");
        }
    }
}

/// Both gradients from the explicit kernels.
fn separable(image: &GrayImage, alpha: f64) -> (Vec<f64>, Vec<f64>) {
    let (width, height) = (image.width(), image.height());
    let column = |u: usize| (0..height).map(|v| f64::from(image.at(u, v))).collect::<Vec<_>>();
    let columns: Vec<_> = (0..width).map(|u| oracle(&column(u), alpha)).collect();
    let row = |v: usize| {
        let smooth: Vec<f64> = columns.iter().map(|c| c.0[v]).collect();
        let derived: Vec<f64> = columns.iter().map(|c| c.1[v]).collect();
        (oracle(&smooth, alpha).1, oracle(&derived, alpha).0)
    };
    let rows: Vec<_> = (0..height).map(row).collect();
    (rows.iter().flat_map(|r| r.0.clone()).collect(), rows.iter().flat_map(|r| r.1.clone()).collect())
}

#[test]
fn reused_memory_does_not_change_the_planes() {
    let image = |n: usize| GrayImage::from_fn(20 + 3 * n, 50 - 7 * n, |u, v| (u * n * 31 + v * 17) as u8);
    let mut memory = FilterMemory::default();
    for n in [0, 3, 1, 2] {
        let image = image(n);
        let size = image.width() * image.height();
        let (mut gx, mut gy) = (vec![f32::NAN; size], vec![f32::NAN; size]);
        dispatch!(Level::new(), s => gradients(s, &image, 1.0, &mut memory, [&mut gx, &mut gy], &mut ()));
        let fresh = planes(&image, 1.0);
        let bits = |plane: &[f32]| plane.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!((bits(&gx), bits(&gy)), (bits(&fresh.0), bits(&fresh.1)), "image {n}");
    }
}

/// Every instruction set level of this processor, the lowest first.
pub(crate) fn levels() -> Vec<Level> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let all = [
        best.as_sse2().map(Level::Sse2),
        best.as_sse4_2().map(Level::Sse4_2),
        best.as_avx2().map(Level::Avx2),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let all = [Some(Level::baseline())];
    all.into_iter().flatten().chain([best]).collect()
}

/// Both recursions along one line, in f32, in the order of operations of the vectors; one more
/// sample on both sides. `first` is the recursion that runs from the start.
fn plain_line(x: &[f32], f: &Deriche) -> Vec<f32> {
    let step = |x: f32, p1: f32, p2: f32| (x + p2 * f.feedback[1]) + p1 * f.feedback[0];
    let (start, end) = (x[0] * f.steady, x[x.len() - 1] * f.steady);
    let mut causal = vec![start, start];
    for x in x {
        let n = causal.len();
        causal.push(step(*x, causal[n - 1], causal[n - 2]));
    }
    let n = causal.len();
    let (e0, e1) = (causal[n - 1] - end, causal[n - 2] - end);
    let beyond = |[w0, w1]: [f32; 2]| end * f.steady + (e0 * w0 + e1 * w1);
    let mut out = vec![beyond(f.beyond[1]), beyond(f.beyond[0])];
    for x in causal[1..].iter().rev() {
        let n = out.len();
        out.push(step(*x, out[n - 1], out[n - 2]));
    }
    out[1..].iter().rev().copied().collect()
}

/// Gradient planes, one number at a time.
fn plain_planes(image: &GrayImage, alpha: f32) -> (Vec<f32>, Vec<f32>) {
    let f = Deriche::new(alpha);
    let scaled: Vec<f32> = image.data().iter().map(|x| f32::from(*x) * f.scale).collect();
    let rows: Vec<_> = scaled.chunks(image.width()).map(|row| plain_line(row, &f)).collect();
    let columns: Vec<Vec<f32>> = (0..image.width() + 2)
        .map(|u| {
            // Up the columns first.
            let column: Vec<f32> = rows.iter().rev().map(|row| row[u]).collect();
            plain_line(&column, &f).into_iter().rev().collect()
        })
        .collect();
    let c = |u: usize, v: usize| columns[u][v];
    let at = |i: usize| (i % image.width(), i / image.width());
    let across = |u: usize, v: usize| c(u + 2, v) - c(u, v);
    let down = |u: usize, v: usize| c(u, v + 2) - c(u, v);
    let pixels = 0..image.data().len();
    let gx =
        pixels.clone().map(at).map(|(u, v)| across(u, v + 1) + (across(u, v) + across(u, v + 2)) * f.side);
    let gy = pixels.map(at).map(|(u, v)| down(u + 1, v) + (down(u, v) + down(u + 2, v)) * f.side);
    (gx.collect(), gy.collect())
}

/// Maxima of at least `low` off the border, one pixel at a time.
fn plain_maxima(width: usize, (gx, gy): &(Vec<f32>, Vec<f32>), low: f32) -> Vec<Maximum> {
    let magnitudes: Vec<f32> = gx.iter().zip(gy).map(|(x, y)| (x * x + y * y).sqrt()).collect();
    let maximum = |at: usize| {
        let (u, v, rows) = (at % width, at / width, gx.len() / width);
        if u < 2 || v < 2 || u + 2 >= width || v + 2 >= rows || magnitudes[at] < low {
            return false;
        }
        let (du, dv) = (if gx[at] < 0.0 { -1 } else { 1 }, if gy[at] < 0.0 { -1 } else { 1 });
        let m = |du: isize, dv: isize| magnitudes[at.wrapping_add_signed(dv * width as isize + du)];
        let (ax, ay) = (gx[at].abs(), gy[at].abs());
        let (major, minor) = (ax.max(ay), ax.min(ay));
        let side = |s: isize| {
            let straight = if ax > ay { m(s * du, 0) } else { m(0, s * dv) };
            straight * (major - minor) + m(s * du, s * dv) * minor
        };
        let centre = magnitudes[at] * major;
        centre * (1.0 - 1e-4) > side(-1) && centre >= side(1) * (1.0 - 1e-4)
    };
    let all = (0..gx.len()).filter(|at| maximum(*at));
    all.map(|at| Maximum { at: at as u32, magnitude: magnitudes[at] }).collect()
}

#[test]
fn every_instruction_set_gives_the_bits_of_plain_arithmetic() {
    let bits = |plane: &[f32]| plane.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    for (width, height) in [(1, 1), (3, 3), (4, 9), (5, 5), (20, 37), (37, 20), (64, 48), (131, 70)] {
        let image = GrayImage::from_fn(width, height, |u, v| {
            let step = if 3 * u + v > 80 { 90 } else { 0 };
            (step + u * u * 5 % 17 + v * v * 7 % 23) as u8
        });
        let plain = plain_planes(&image, 1.0);
        let low = 6.0;
        let maxima = plain_maxima(width, &plain, low);
        assert!(height < 48 || maxima.len() > 60);
        for (i, level) in levels().into_iter().enumerate() {
            let (mut gx, mut gy) = (vec![0.0; width * height], vec![0.0; width * height]);
            let (mut memory, mut found) = (FilterMemory::default(), Maxima::default());
            found.restart(width, height, low);
            dispatch!(level, s => gradients(s, &image, 1.0, &mut memory, [&mut gx, &mut gy], &mut found));
            assert!(bits(&gx) == bits(&plain.0) && bits(&gy) == bits(&plain.1), "level {i} {width}x{height}");
            assert_eq!(found.found, maxima, "level {i} {width}x{height}");
        }
    }
}
