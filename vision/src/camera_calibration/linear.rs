//! The image of the absolute conic from homographies: the constraints C1, C2, C3 as rows of a
//! linear system (method 16.1 to 16.3). In: homographies of metric planes, in pixels. Out: alpha,
//! u0, v0 and the singular value ratios.

use nalgebra::{DMatrix, Matrix3, RowVector4, Vector3};

/// The conic has four coefficients up to scale.
const UNKNOWNS: usize = 4;
/// A conic whose second smallest singular value is below this share of the greatest is not
/// determined.
pub(crate) const MIN_SIGMA_SHARE: f64 = 1e-6;

/// Which constraints are used.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constraints {
    /// Sizes along both axes of the plane are known in the same unit: both rows of C1, else the
    /// second alone.
    pub known_aspect: bool,
    /// C2: zero roll.
    pub zero_roll: bool,
    /// C3: height of the camera over the plane's origin, metres.
    pub height_m: Option<f64>,
}

/// A conic's camera: focal length and principal point, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LinearCamera {
    pub alpha: f64,
    pub u0: f64,
    pub v0: f64,
}

/// `rho(a, b) . Omega = a^T omega b` (method 16.1).
pub(crate) fn rho(a: &Vector3<f64>, b: &Vector3<f64>) -> RowVector4<f64> {
    RowVector4::new(a.x * b.x + a.y * b.y, a.x * b.z + a.z * b.x, a.y * b.z + a.z * b.y, a.z * b.z)
}

/// The rows of one view. `h` is normalised in the image and has `|h1| = 1`.
///
/// The C3 row is divided by `|h3|`. The C2 row is not normalised: at zero tilt h2 is nearly (0,
/// c, 0) and the row nearly zero; scaled to length 1 it would be noise.
fn rows(h: &Matrix3<f64>, c: &Constraints, made: &mut Vec<RowVector4<f64>>) {
    let (h1, h2, h3): (Vector3<f64>, Vector3<f64>, Vector3<f64>) =
        (h.column(0).into(), h.column(1).into(), h.column(2).into());
    if c.known_aspect {
        made.push(rho(&h1, &h1) - rho(&h2, &h2));
    }
    made.push(rho(&h1, &h2));
    if c.zero_roll {
        made.push(rho(&Vector3::x(), &h2));
    }
    if let Some(t) = c.height_m.filter(|_| c.known_aspect) {
        made.push((rho(&h2, &h3) + rho(&h1, &h1) * t) / h3.norm().max(f64::MIN_POSITIVE));
    }
}

/// The camera of unit pixel aspect behind `homographies` (pixels from metres), `None` when the
/// conic is not one of a camera; and the second smallest singular value over the smallest (how
/// distinct the solution is) and over the greatest (0 when all views have one orientation).
pub(crate) fn solve(
    homographies: &[Matrix3<f64>],
    image_size_px: [f64; 2],
    c: &Constraints,
) -> (Option<LinearCamera>, [f64; 2]) {
    // Isotropic scale and shift: only these keep the form of omega.
    let half = 0.5 * image_size_px[0];
    let centre = [0.5 * (image_size_px[0] - 1.0), 0.5 * (image_size_px[1] - 1.0)];
    let normal = Matrix3::new(1.0, 0.0, -centre[0], 0.0, 1.0, -centre[1], 0.0, 0.0, half) / half;
    let mut all = Vec::new();
    for h in homographies {
        let h = normal * h;
        let length = h.column(0).norm();
        if length > 0.0 {
            rows(&(h / length), c, &mut all);
        }
    }
    // Rows of zeros make the matrix tall enough for all singular vectors.
    let height = all.len().max(UNKNOWNS);
    let m = DMatrix::from_fn(height, UNKNOWNS, |i, j| all.get(i).map_or(0.0, |row| row[j]));
    if !m.iter().all(|v| v.is_finite()) {
        return (None, [0.0; 2]);
    }
    let Some(svd) = m.try_svd(false, true, f64::EPSILON, 200) else { return (None, [0.0; 2]) };
    let Some(v_t) = svd.v_t.as_ref() else { return (None, [0.0; 2]) };
    let s = &svd.singular_values;
    // nalgebra sorts them in descending order.
    let sigmas = [s[2] / s[3].max(f64::MIN_POSITIVE), s[2] / s[0].max(f64::MIN_POSITIVE)];
    let o = v_t.row(3);
    let (u, v) = (-o[1] / o[0], -o[2] / o[0]);
    let alpha2 = o[3] / o[0] - u * u - v * v;
    let made = (alpha2 > 0.0 && alpha2.is_finite() && sigmas[1] > MIN_SIGMA_SHARE).then(|| LinearCamera {
        alpha: alpha2.sqrt() * half,
        u0: u * half + centre[0],
        v0: v * half + centre[1],
    });
    (made, sigmas)
}
