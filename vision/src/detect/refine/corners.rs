//! Sub-pixel corners (method 3.6): a rough quad and the gradient planes in, corners with
//! covariance, side support and clipping out. Also the rule for the top-left corner. Does not
//! select quads.

use crate::{
    detect::edge_support::{
        gradients::Gradients,
        side_fit::FittedLine,
        side_support::{EdgeProbeParams, SidePoints, SideSupport},
    },
    geometry::corners::Corners,
};
use nalgebra::{Matrix2, Point2, Vector2};

/// A side that ends this close to the image border counts as clipped.
const CLIP_PX: f64 = 2.0;
/// Standard deviation of a side without edge points.
const UNFITTED_SIGMA_PX: f64 = 2.0;
/// If a second choice of the top-left corner is within this angle, recognition tries all rotations
/// (method 4).
pub const UPRIGHT_MARGIN_DEG: f64 = 15.0;

/// A quad after refitting.
#[derive(Debug, Clone, PartialEq)]
pub struct RefinedQuad {
    /// Corners from the top-left one, clockwise.
    pub corners_px: Corners,
    /// Covariance of each corner, px^2.
    pub covariance_px2: [Matrix2<f64>; 4],
    /// Edge support of each side, TL-TR first.
    pub sides: [SideSupport; 4],
    /// Whether each side runs into the image border.
    pub clipped: [bool; 4],
    /// A second choice of the top-left corner is nearly as upright.
    pub upright_ambiguous: bool,
}

impl RefinedQuad {
    /// Share of each side that edges support.
    pub fn support(&self) -> [f64; 4] {
        std::array::from_fn(|i| self.sides[i].support)
    }

    /// Support of the worst side.
    pub fn min_support(&self) -> f64 {
        self.support().into_iter().fold(1.0, f64::min)
    }
}

/// Refits the four sides on the edge points near them and intersects. `corners_px` is clockwise on
/// screen. None when the result is not a convex quad, a corner moved by more than `search.reach_px`
/// times four, or a side has less support than `search.least_support`.
pub fn refine(g: &Gradients, corners_px: &[Point2<f64>; 4], search: EdgeProbeParams) -> Option<RefinedQuad> {
    let mut points = [const { None }; 4];
    for (i, points) in points.iter_mut().enumerate() {
        *points = SidePoints::new(g, &corners_px[i], &corners_px[(i + 1) % 4], search);
        if points.is_none() && search.least_support > 0.0 {
            return None;
        }
    }
    let sides = points.map(|p| p.map_or(SideSupport::NONE, |p| p.evidence()));
    let lines: [Line; 4] = std::array::from_fn(|i| {
        sides[i].line.map_or_else(|| Line::through(&corners_px[i], &corners_px[(i + 1) % 4]), Line::Fitted)
    });
    let mut refined = *corners_px;
    let mut covariance = [Matrix2::identity(); 4];
    for i in 0..4 {
        let (corner, sigma) = meet(&lines[(i + 3) % 4], &lines[i])?;
        if (corner - corners_px[i]).norm() > 4.0 * search.reach_px {
            return None;
        }
        (refined[i], covariance[i]) = (corner, sigma);
    }
    name_corners(g, &refined, &covariance, sides)
}

/// Rotates all lists so that index 0 is the top-left corner.
fn name_corners(
    g: &Gradients,
    clockwise: &[Point2<f64>; 4],
    covariance: &[Matrix2<f64>; 4],
    sides: [SideSupport; 4],
) -> Option<RefinedQuad> {
    let corners_px = Corners::from_unordered(*clockwise).ok()?;
    let first = corners_px.points()[0];
    let shift = (0..4).find(|i| (clockwise[*i] - first).norm_squared() <= 0.0)?;
    let mut sides = sides;
    sides.rotate_left(shift);
    let clipped = std::array::from_fn(|i| {
        let p = corners_px.points();
        near_border(g, &p[i]) || near_border(g, &p[(i + 1) % 4])
    });
    Some(RefinedQuad {
        corners_px,
        covariance_px2: std::array::from_fn(|i| covariance[(i + shift) % 4]),
        sides,
        clipped,
        upright_ambiguous: upright_ambiguous(&corners_px, &Vector2::y()),
    })
}

fn near_border(g: &Gradients, p: &Point2<f64>) -> bool {
    let (width, height) = (g.width() as f64, g.height() as f64);
    p.x < CLIP_PX || p.y < CLIP_PX || p.x > width - 1.0 - CLIP_PX || p.y > height - 1.0 - CLIP_PX
}

/// Whether the second most upright choice leans at most 15 degrees more than the given, most
/// upright one, where gravity points to `down` in the image.
pub fn upright_ambiguous(corners: &Corners, down: &Vector2<f64>) -> bool {
    let best = corners.lean_rad(down);
    (1..4).any(|shift| corners.rotated(shift).lean_rad(down) - best < UPRIGHT_MARGIN_DEG.to_radians())
}

/// A side's line, fitted to edge points or not.
enum Line {
    Fitted(FittedLine),
    Given { normal: Vector2<f64>, rho_px: f64 },
}

impl Line {
    fn through(a: &Point2<f64>, b: &Point2<f64>) -> Self {
        let direction = (b - a).normalize();
        let normal = Vector2::new(direction.y, -direction.x);
        Line::Given { normal, rho_px: normal.dot(&a.coords) }
    }

    fn equation(&self) -> (Vector2<f64>, f64) {
        match self {
            Line::Fitted(f) => (f.normal, f.rho_px),
            Line::Given { normal, rho_px } => (*normal, *rho_px),
        }
    }

    fn variance_at(&self, p: &Point2<f64>) -> f64 {
        match self {
            Line::Fitted(f) => f.variance_at(p),
            Line::Given { .. } => UNFITTED_SIGMA_PX * UNFITTED_SIGMA_PX,
        }
    }
}

/// Corner of two lines and its covariance `M^-1 diag(s_i^2, s_j^2) M^-T` (method 3.6).
fn meet(a: &Line, b: &Line) -> Option<(Point2<f64>, Matrix2<f64>)> {
    let ((na, ra), (nb, rb)) = (a.equation(), b.equation());
    let inverse = Matrix2::new(na.x, na.y, nb.x, nb.y).try_inverse()?;
    let corner = Point2::from(inverse * Vector2::new(ra, rb));
    if !(corner.x.is_finite() && corner.y.is_finite()) {
        return None;
    }
    let variances = Matrix2::from_diagonal(&Vector2::new(a.variance_at(&corner), b.variance_at(&corner)));
    Some((corner, inverse * variances * inverse.transpose()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corner_covariance_agrees_with_sampling() {
        // Two lines at 60 degrees with offsets of known variance: the corner's spread over a grid
        // of disturbances.
        let (sa, sb) = (0.2_f64, 0.5_f64);
        let na = Vector2::new(0.0, 1.0);
        let nb = Vector2::new(60.0_f64.to_radians().sin(), 60.0_f64.to_radians().cos());
        let inverse = Matrix2::new(na.x, na.y, nb.x, nb.y).try_inverse().unwrap();
        let wanted = inverse * Matrix2::from_diagonal(&Vector2::new(sa * sa, sb * sb)) * inverse.transpose();
        let mut spread = Matrix2::zeros();
        for ea in [-sa, sa] {
            for eb in [-sb, sb] {
                // Intersection solved by hand: v = ra, u from the second line.
                let v = 10.0 + ea;
                let u = (20.0 + eb - nb.y * v) / nb.x;
                let off = Vector2::new(u - (20.0 - nb.y * 10.0) / nb.x, v - 10.0);
                spread += off * off.transpose() * 0.25;
            }
        }
        assert!((spread - wanted).norm() < 1e-12);
        let given = |normal, rho_px| Line::Given { normal, rho_px };
        let (corner, covariance) = meet(&given(na, 10.0), &given(nb, 20.0)).unwrap();
        assert!((corner.y - 10.0).abs() < 1e-12);
        let unit = inverse * inverse.transpose() * (UNFITTED_SIGMA_PX * UNFITTED_SIGMA_PX);
        assert!((covariance - unit).norm() < 1e-9);
        assert!(meet(&given(na, 10.0), &given(na, 20.0)).is_none());
    }

    #[test]
    fn orientation_is_ambiguous_near_forty_five_degrees() {
        let turned = |degrees: f64| {
            let (s, c) = degrees.to_radians().sin_cos();
            let points = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]: [f64; 2]| Point2::new(50.0 * (c * x - s * y), 50.0 * (s * x + c * y)));
            Corners::from_unordered(points).unwrap()
        };
        assert!(!upright_ambiguous(&turned(0.0), &Vector2::y()));
        assert!(!upright_ambiguous(&turned(35.0), &Vector2::y()));
        assert!(upright_ambiguous(&turned(40.0), &Vector2::y()));
        assert!(upright_ambiguous(&turned(45.0), &Vector2::y()));
    }
}
