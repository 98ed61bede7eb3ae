//! A window of the reference picture in, its place in another picture out: least squares of grey
//! levels under a homography, with gain and offset (Lucas and Kanade, inverse compositional).

use crate::{frame::GrayImage, geometry::homography::Homography};
use nalgebra::{Matrix2, Matrix4, Point2, Vector2, Vector4};

const MAX_STEPS: usize = 20;
/// A step below this ends the search, px of the reference.
const SETTLED_PX: f64 = 0.005;
/// Smallest standard deviation of a window's place, px: light and blur differ between pictures.
const MIN_SIGMA_PX: f64 = 0.25;

/// Grey levels from here on may be clipped: an edge beside them moves with the exposure.
const CLIPPED: f64 = 250.0;
/// Largest share of such grey levels in a window.
const MAX_CLIPPED: f64 = 0.03;

/// A square window about a pixel of the reference picture.
pub(crate) struct Window {
    at: Point2<f64>,
    half: usize,
    /// Grey levels, row by row, and their derivatives along x and y.
    grey: Vec<f64>,
    by_x: Vec<f64>,
    by_y: Vec<f64>,
}

/// A window in another picture.
pub(crate) struct FollowedWindow {
    pub(crate) px: Point2<f64>,
    pub(crate) covariance_px2: Matrix2<f64>,
    /// Correlation of the grey levels.
    pub(crate) correlation: f64,
}

impl Window {
    /// The window of `2 half + 1` pixels squared about a whole pixel; `None` at the border of the
    /// image and where it is overexposed.
    pub(crate) fn new(image: &GrayImage, at: Point2<f64>, half: usize) -> Option<Self> {
        let reach = half as f64 + 1.0;
        let (w, h) = (image.width() as f64, image.height() as f64);
        if at.x < reach || at.y < reach || at.x + reach > w - 1.0 || at.y + reach > h - 1.0 {
            return None;
        }
        let (u, v) = (at.x as usize, at.y as usize);
        let side = 2 * half + 1;
        let grey = |x: usize, y: usize| f64::from(image.at(x, y));
        let (mut all, mut by_x, mut by_y) = (vec![], vec![], vec![]);
        for k in 0..side * side {
            let (x, y) = (u + k % side - half, v + k / side - half);
            all.push(grey(x, y));
            by_x.push(0.5 * (grey(x + 1, y) - grey(x - 1, y)));
            by_y.push(0.5 * (grey(x, y + 1) - grey(x, y - 1)));
        }
        (!is_clipped(&all)).then_some(Self { at, half, grey: all, by_x, by_y })
    }

    /// Sum of the products of the gradients: the information on its place for grey levels of
    /// variance 1.
    pub(crate) fn information(&self) -> Matrix2<f64> {
        let mut sum = Matrix2::zeros();
        for (x, y) in self.by_x.iter().zip(&self.by_y) {
            let g = Vector2::new(*x, *y);
            sum += g * g.transpose();
        }
        sum
    }

    /// The grey levels of `image` where `map` and then `shift` (px of the reference) put the
    /// window's pixels.
    fn sampled(
        &self,
        image: &GrayImage,
        map: &Homography,
        shift: Vector2<f64>,
        samples: usize,
    ) -> Option<Vec<f64>> {
        let side = 2 * self.half + 1;
        let (w, h) = (image.width() as f64 - 1.0, image.height() as f64 - 1.0);
        let mut made = Vec::with_capacity(side * side);
        for k in 0..side * side {
            let offset = Vector2::new((k % side) as f64, (k / side) as f64).add_scalar(-(self.half as f64));
            let mut sum = 0.0;
            for s in 0..samples * samples {
                let spread = |i: usize| (i as f64 + 0.5) / samples as f64 - 0.5;
                let within = Vector2::new(spread(s % samples), spread(s / samples));
                let p = map.apply(&(self.at + offset + within + shift));
                if !(p.x >= 0.0 && p.y >= 0.0 && p.x <= w && p.y <= h) {
                    return None;
                }
                sum += f64::from(image.sample(p.x, p.y));
            }
            made.push(sum / (samples * samples) as f64);
        }
        Some(made)
    }
}

/// Where `image` shows the window, at most `reach_px` (px of the reference) from where `map` puts
/// it.
pub(crate) fn followed(
    window: &Window,
    image: &GrayImage,
    map: &Homography,
    reach_px: f64,
) -> Option<FollowedWindow> {
    if map.denominator(&window.at) <= 0.0 {
        return None;
    }
    let mut shift = Vector2::zeros();
    let scale = jacobian(map, &window.at).determinant().abs().sqrt();
    let samples = ((scale / 1.25).ceil() as usize).clamp(1, 4);
    let n = window.grey.len() as f64;
    for step in 0..=MAX_STEPS {
        let grey = window.sampled(image, map, shift, samples).filter(|grey| !is_clipped(grey))?;
        // T + dT d = gain I + offset, for d, gain and offset.
        let (mut normal, mut right, mut squares) = (Matrix4::zeros(), Vector4::zeros(), 0.0);
        for ((grey, taught), slope) in grey.iter().zip(&window.grey).zip(window.by_x.iter().zip(&window.by_y))
        {
            let row = Vector4::new(-slope.0, -slope.1, *grey, 1.0);
            normal += row * row.transpose();
            right += row * *taught;
            squares += taught * taught;
        }
        let x = normal.cholesky()?.solve(&right);
        let move_px = Vector2::new(x[0], x[1]);
        if x[2] <= 0.0 {
            return None;
        }
        if move_px.norm() < SETTLED_PX || step == MAX_STEPS {
            let residual = (squares - x.dot(&right)).max(0.0) / (n - 4.0);
            let covariance =
                window.information().try_inverse()? * residual + Matrix2::identity() * MIN_SIGMA_PX.powi(2);
            let at = window.at + shift;
            let by = jacobian(map, &at);
            let covariance_px2 = by * covariance * by.transpose();
            return (move_px.norm() < 10.0 * SETTLED_PX).then(|| FollowedWindow {
                px: map.apply(&at),
                covariance_px2,
                correlation: correlation(&window.grey, &grey),
            });
        }
        // The picture looks like the window moved by d: the window's place is d back.
        shift -= move_px.cap_magnitude(1.5);
        if shift.norm() > reach_px {
            return None;
        }
    }
    None
}

fn is_clipped(grey: &[f64]) -> bool {
    grey.iter().filter(|g| **g >= CLIPPED).count() as f64 > MAX_CLIPPED * grey.len() as f64
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let (ma, mb) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (x - ma, y - mb);
        (ab, aa, bb) = (ab + x * y, aa + x * x, bb + y * y);
    }
    ab / (aa * bb).sqrt().max(f64::MIN_POSITIVE)
}

/// Derivative of a homography's image.
fn jacobian(map: &Homography, p: &Point2<f64>) -> Matrix2<f64> {
    let m = map.matrix();
    let (w, q) = (map.denominator(p), map.apply(p));
    Matrix2::new(
        m[(0, 0)] - q.x * m[(2, 0)],
        m[(0, 1)] - q.x * m[(2, 1)],
        m[(1, 0)] - q.y * m[(2, 0)],
        m[(1, 1)] - q.y * m[(2, 1)],
    ) / w
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    /// Smooth blobs, brighter by `gain`.
    fn blobs(gain: f64, at: impl Fn(f64, f64) -> [f64; 2]) -> GrayImage {
        GrayImage::from_fn(200, 160, |u, v| {
            let [x, y] = at(u as f64, v as f64);
            let wave = f64::sin(0.21 * x) * f64::cos(0.17 * y) + 0.6 * f64::sin(0.11 * x + 0.23 * y);
            (110.0 + gain * 50.0 * wave).round() as u8
        })
    }

    #[test]
    fn a_window_is_followed_to_a_tenth_of_a_pixel_under_other_light() {
        let map = Matrix3::new(1.15, 0.06, -8.0, -0.04, 0.95, 6.0, 3e-4, -2e-4, 1.0);
        let map = Homography::from_matrix(map).unwrap();
        let back = map.inverse().unwrap();
        let reference = blobs(1.0, |x, y| [x, y]);
        let image = blobs(0.7, |x, y| back.apply(&Point2::new(x, y)).into());
        // The start is 2 px off.
        let shift = Matrix3::new(1.0, 0.0, 1.5, 0.0, 1.0, -1.3, 0.0, 0.0, 1.0);
        let start = Homography::from_matrix(shift * map.matrix()).unwrap();
        for at in [[60.0, 50.0], [120.0, 90.0], [90.0, 110.0]].map(Point2::from) {
            let window = Window::new(&reference, at, 8).unwrap();
            let found = followed(&window, &image, &start, 6.0).unwrap();
            assert!(
                (found.px - map.apply(&at)).norm() < 0.1,
                "{:?} instead of {:?}",
                found.px,
                map.apply(&at)
            );
            assert!(found.correlation > 0.99, "{}", found.correlation);
            assert!(followed(&window, &image, &start, 1.0).is_none());
        }
    }

    #[test]
    fn overexposed_windows_and_such_at_the_border_are_none() {
        let white = GrayImage::from_fn(60, 60, |u, _| if u < 30 { 100 } else { 255 });
        assert!(Window::new(&white, Point2::new(15.0, 30.0), 6).is_some());
        assert!(Window::new(&white, Point2::new(28.0, 30.0), 6).is_none());
        assert!(Window::new(&white, Point2::new(5.0, 30.0), 6).is_none());
    }
}
