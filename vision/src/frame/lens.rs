//! Lens models of OpenCV and ROS on normalised coordinates (x / z, y / z): distortion, its inverse
//! and both derivatives. A distortion that is not invertible at a point gives `None`.

use nalgebra::{Matrix2, Point2, Vector2};
use serde::{Deserialize, Serialize};

/// Widest ray, from the axis, that a pinhole picture is made of: 85 degrees. A fisheye sees more;
/// there is no pinhole pixel for that.
pub const MAX_RAY_RAD: f64 = 85.0 * std::f64::consts::PI / 180.0;
/// Most Newton steps of the inverse.
const MAX_STEPS: usize = 30;
/// A step below this (normalised) ends it: 1e-10 px at a focal length of 1000 px.
const STEP_TOLERANCE: f64 = 1e-13;
/// Largest round-trip error of the inverse, normalised: 1e-6 px at a focal length of 1000 px.
const ROUND_TRIP: f64 = 1e-9;
/// Points between the axis and the result at which the Jacobian is checked for folds.
const WAY_POINTS: usize = 16;

/// Lens distortion, in OpenCV's and ROS's coefficient order. Applied to normalised coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(tag = "model", content = "coefficients", rename_all = "snake_case")]
pub enum Distortion {
    /// A rectified image or a perfect pinhole.
    #[default]
    None,
    /// `plumb_bob`: k1, k2, p1, p2, k3.
    PlumbBob([f64; 5]),
    /// `rational_polynomial`: k1, k2, p1, p2, k3, k4, k5, k6; k4 to k6 are of the denominator.
    RationalPolynomial([f64; 8]),
    /// `equidistant`, OpenCV's fisheye: k1, k2, k3, k4 of the angle from the axis.
    Equidistant([f64; 4]),
}

/// A distorted point with its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DistortedPoint {
    /// The distorted point, normalised.
    pub point: Point2<f64>,
    /// Derivative by the undistorted point.
    pub by_straight: Matrix2<f64>,
}

impl Distortion {
    /// The coefficients in their order.
    pub fn coefficients(&self) -> &[f64] {
        match self {
            Self::None => &[],
            Self::PlumbBob(k) => k,
            Self::RationalPolynomial(k) => k,
            Self::Equidistant(k) => k,
        }
    }

    /// The distorted point of the undistorted point `p`, with the derivative.
    pub fn distort(&self, p: &Point2<f64>) -> DistortedPoint {
        match *self {
            Self::None => DistortedPoint { point: *p, by_straight: Matrix2::identity() },
            Self::PlumbBob([k1, k2, p1, p2, k3]) => polynomial(p, [k1, k2, k3], [0.0; 3], [p1, p2]),
            Self::RationalPolynomial([k1, k2, p1, p2, k3, k4, k5, k6]) => {
                polynomial(p, [k1, k2, k3], [k4, k5, k6], [p1, p2])
            }
            Self::Equidistant(k) => equidistant(p, k),
        }
    }

    /// The undistorted point of `bent`. `None` where there is none, beyond [`MAX_RAY_RAD`], and
    /// where the model folds between the axis and the point: there the inverse is not unique.
    pub fn undistort(&self, bent: &Point2<f64>) -> Option<Point2<f64>> {
        let start = match *self {
            Self::None => return Some(*bent),
            Self::Equidistant(k) => return straighten_angle(bent, &k),
            Self::PlumbBob(_) | Self::RationalPolynomial(_) => *bent,
        };
        let mut p = start;
        for _ in 0..MAX_STEPS {
            let at = self.distort(&p);
            let error = bent - at.point;
            let step = at.by_straight.try_inverse()? * error;
            // The step is halved until the residual falls: far out the polynomial is steep.
            let next = (0..8).map(|i| p + step * 0.5_f64.powi(i)).find(|next| {
                let left = (bent - self.distort(next).point).norm();
                left < error.norm() || left < ROUND_TRIP
            });
            p = next?;
            if step.norm() < STEP_TOLERANCE {
                break;
            }
        }
        let back = self.distort(&p).point;
        let found = (back - bent).norm() < ROUND_TRIP && p.coords.norm().atan() <= MAX_RAY_RAD;
        (found && self.is_unfolded(&p)).then_some(p)
    }

    /// Whether the Jacobian stays positive from the axis to `p`.
    fn is_unfolded(&self, p: &Point2<f64>) -> bool {
        (1..=WAY_POINTS).all(|i| {
            let at = self.distort(&Point2::from(p.coords * (i as f64 / WAY_POINTS as f64))).by_straight;
            at.determinant() > 0.0 && at.trace() > 0.0
        })
    }
}

/// Value and derivative by `r2` of `1 + r2 (a + r2 (b + r2 c))`.
fn radial([a, b, c]: [f64; 3], r2: f64) -> (f64, f64) {
    (1.0 + r2 * (a + r2 * (b + r2 * c)), a + r2 * (2.0 * b + r2 * 3.0 * c))
}

/// Brown's model with a denominator.
fn polynomial(p: &Point2<f64>, up: [f64; 3], down: [f64; 3], [p1, p2]: [f64; 2]) -> DistortedPoint {
    let (x, y) = (p.x, p.y);
    let r2 = x * x + y * y;
    let ((n, dn), (d, dd)) = (radial(up, r2), radial(down, r2));
    let (g, dg) = (n / d, (dn * d - n * dd) / (d * d));
    let point = Point2::new(
        x * g + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * g + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    );
    let cross = 2.0 * x * y * dg + 2.0 * p1 * x + 2.0 * p2 * y;
    let by_straight = Matrix2::new(
        g + 2.0 * x * x * dg + 2.0 * p1 * y + 6.0 * p2 * x,
        cross,
        cross,
        g + 2.0 * y * y * dg + 6.0 * p1 * y + 2.0 * p2 * x,
    );
    DistortedPoint { point, by_straight }
}

/// Value and derivative of the angle behind the lens by the angle before it.
fn angle([k1, k2, k3, k4]: &[f64; 4], t: f64) -> (f64, f64) {
    let t2 = t * t;
    let value = t * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))));
    (value, 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4))))
}

fn equidistant(p: &Point2<f64>, k: [f64; 4]) -> DistortedPoint {
    let r = p.coords.norm();
    if r < 1e-9 {
        return DistortedPoint { point: *p, by_straight: Matrix2::identity() };
    }
    let (bent, slope) = angle(&k, r.atan());
    let out = p.coords / r;
    let (along, across) = (slope / (1.0 + r * r), bent / r);
    let outer: Matrix2<f64> = out * out.transpose();
    let by_straight = outer * along + (Matrix2::identity() - outer) * across;
    DistortedPoint { point: Point2::from(out * bent), by_straight }
}

/// Newton on the angle, which must grow all the way to the answer.
fn straighten_angle(bent: &Point2<f64>, k: &[f64; 4]) -> Option<Point2<f64>> {
    let wanted = bent.coords.norm();
    if wanted < 1e-9 {
        return Some(*bent);
    }
    // Bisection: total, and the polynomial is cheap. The way out is checked for folds first.
    let (mut low, mut high) = (0.0, MAX_RAY_RAD);
    let steps = 8 * WAY_POINTS;
    for i in 1..=steps {
        let t = MAX_RAY_RAD * i as f64 / steps as f64;
        let (value, slope) = angle(k, t);
        if slope <= 0.0 {
            return None;
        }
        if value >= wanted {
            high = t;
            break;
        }
        low = t;
    }
    let mut t = 0.5 * (low + high);
    for _ in 0..MAX_STEPS {
        let (value, slope) = angle(k, t);
        if value < wanted {
            low = t;
        } else {
            high = t;
        }
        let newton = t - (value - wanted) / slope;
        let next = if (low..=high).contains(&newton) { newton } else { 0.5 * (low + high) };
        let step = next - t;
        t = next;
        if step.abs() < STEP_TOLERANCE {
            break;
        }
    }
    let found = (angle(k, t).0 - wanted).abs() < ROUND_TRIP;
    let out: Vector2<f64> = bent.coords / wanted;
    found.then(|| Point2::from(out * t.tan()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PLUMB_BOB: Distortion = Distortion::PlumbBob([-0.28, 0.09, 1e-3, -5e-4, -0.01]);
    const RATIONAL: Distortion =
        Distortion::RationalPolynomial([0.9, 0.3, 2e-4, -3e-4, 0.02, 1.2, 0.5, 0.06]);
    const EQUIDISTANT: Distortion = Distortion::Equidistant([-0.02, 0.006, -0.004, 0.001]);

    const OPENCV_PLUMB_BOB: [[f64; 2]; 4] = [
        [0.289_254_709, -0.192_749_806],
        [-0.454_621_847_734_375, 0.318_477_418_414_062],
        [0.017_445_458_416_947_2, 0.619_663_444_593_152],
        [0.0, 0.0],
    ];
    const OPENCV_RATIONAL: [[f64; 2]; 4] = [
        [0.288_943_138_342_19, -0.192_628_758_894_794],
        [-0.453_747_135_259_95, 0.317_619_269_681_965],
        [0.017_527_715_979_526_2, 0.618_717_339_283_418],
        [0.0, 0.0],
    ];
    const OPENCV_EQUIDISTANT: [[f64; 2]; 4] = [
        [0.287_261_725_198_727, -0.191_507_816_799_152],
        [-0.446_423_630_778_236, 0.312_496_541_544_765],
        [0.017_328_725_940_329_3, 0.606_505_407_911_526],
        [0.0, 0.0],
    ];

    /// `cv2.projectPoints(points, 0, 0, I, k)` of OpenCV 5.0.0, and `cv2.fisheye.projectPoints` for
    /// the fisheye.
    #[test]
    fn distortion_agrees_with_opencv() {
        let points = [[0.3, -0.2], [-0.5, 0.35], [0.02, 0.7], [0.0, 0.0]];
        let golden =
            [(PLUMB_BOB, OPENCV_PLUMB_BOB), (RATIONAL, OPENCV_RATIONAL), (EQUIDISTANT, OPENCV_EQUIDISTANT)];
        for (lens, expected) in golden {
            for (p, want) in points.iter().zip(expected) {
                let got = lens.distort(&Point2::from(*p)).point;
                assert!((got - Point2::from(want)).norm() < 1e-9, "{lens:?} {p:?}: {got} for {want:?}");
            }
        }
    }

    #[test]
    fn derivatives_are_the_finite_differences() {
        for lens in [Distortion::None, PLUMB_BOB, RATIONAL, EQUIDISTANT] {
            for p in [[0.3, -0.2], [-0.5, 0.35], [0.02, 0.7], [1e-12, 0.0]].map(Point2::from) {
                let at = |d: Vector2<f64>| lens.distort(&(p + d)).point;
                let along = |d: Vector2<f64>| (at(d) - at(-d)) / 2e-6;
                let numeric =
                    Matrix2::from_columns(&[along(Vector2::x() * 1e-6), along(Vector2::y() * 1e-6)]);
                assert!((numeric - lens.distort(&p).by_straight).norm() < 1e-8, "{lens:?} {p}");
            }
        }
    }

    #[test]
    fn a_folding_distortion_is_not_inverted() {
        // r (1 - 0.5 r2) has its greatest value 0.544 at r = 0.816: beyond, no straight point; a
        // steep fifth power brings the picture back further out, which is another branch.
        let folding = Distortion::PlumbBob([-0.5, 0.0, 0.0, 0.0, 0.0]);
        let straight = folding.undistort(&Point2::new(0.54, 0.0)).unwrap();
        assert!(
            (folding.distort(&straight).point - Point2::new(0.54, 0.0)).norm() < 1e-9 && straight.x < 0.8165
        );
        assert_eq!(folding.undistort(&Point2::new(0.55, 0.0)), None);
        let returning = Distortion::PlumbBob([-0.5, 0.0, 0.0, 0.0, 0.02]);
        assert_eq!(returning.undistort(&Point2::new(1.5, 0.0)), None);
        let fisheye = Distortion::Equidistant([-0.5, 0.0, 0.0, 0.0]);
        assert_eq!(fisheye.undistort(&Point2::new(0.6, 0.0)), None);
        assert_eq!(Distortion::PlumbBob([f64::NAN; 5]).undistort(&Point2::new(0.1, 0.0)), None);
    }

    #[test]
    fn no_pinhole_sees_beyond_85_degrees() {
        let ideal = Distortion::Equidistant([0.0; 4]);
        let at = |t: f64| ideal.undistort(&Point2::new(0.0, t));
        assert!((at(1.4).unwrap().y - 1.4_f64.tan()).abs() < 1e-9);
        assert!(at(MAX_RAY_RAD - 1e-6).is_some());
        assert_eq!(at(MAX_RAY_RAD + 1e-6), None);
    }

    proptest! {
        #[test]
        fn undistort_inverts_distort(x in -0.7..0.7_f64, y in -0.6..0.6_f64, model in 0_usize..4) {
            let lens = [Distortion::None, PLUMB_BOB, RATIONAL, EQUIDISTANT][model];
            let p = Point2::new(x, y);
            let back = lens.undistort(&lens.distort(&p).point).unwrap();
            prop_assert!((back - p).norm() < 1e-9, "{lens:?} {p} {back}");
        }

        #[test]
        fn any_distortion_gives_a_round_trip_or_none(
            k in proptest::array::uniform8(-5.0..5.0_f64), x in -3.0..3.0_f64, y in -3.0..3.0_f64, model in 0_usize..3,
        ) {
            let lens = [
                Distortion::PlumbBob([k[0], k[1], k[2], k[3], k[4]]),
                Distortion::RationalPolynomial(k),
                Distortion::Equidistant([k[0], k[1], k[2], k[3]]),
            ][model];
            let bent = Point2::new(x, y);
            if let Some(p) = lens.undistort(&bent) {
                prop_assert!((lens.distort(&p).point - bent).norm() < 1e-8);
            }
        }
    }
}
