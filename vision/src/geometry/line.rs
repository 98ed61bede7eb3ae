//! Image lines in normal form, and the total-least-squares line of a set of points.
//!
//! Points go in one by one into [`LineSums`]; sums of two sets add up, so pieces of an edge are
//! joined and refitted without their points.

use nalgebra::{Point2, Vector2};

/// A line `normal . x = rho_px`. `normal` is a unit vector; its sign is the owner's choice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Unit normal.
    pub normal: Vector2<f64>,
    /// Signed distance from the origin along `normal`, px.
    pub rho_px: f64,
}

impl Line {
    /// The line through two points; its normal points to the right on screen (u right, v down) when
    /// walking from `a` to `b`. None when the points coincide or are not finite.
    pub fn from_points(a: &Point2<f64>, b: &Point2<f64>) -> Option<Self> {
        let along = b - a;
        let normal = Vector2::new(-along.y, along.x).try_normalize(f64::MIN_POSITIVE)?;
        let rho_px = normal.dot(&a.coords);
        rho_px.is_finite().then_some(Self { normal, rho_px })
    }

    /// Unit direction with the normal on its right on screen.
    pub fn direction(&self) -> Vector2<f64> {
        Vector2::new(self.normal.y, -self.normal.x)
    }

    /// Undirected direction in [0, pi), from +u towards +v.
    pub fn theta_rad(&self) -> f64 {
        let d = self.direction();
        let theta = d.y.atan2(d.x).rem_euclid(std::f64::consts::PI);
        // rem_euclid of a tiny negative angle rounds up to pi itself.
        if theta < std::f64::consts::PI { theta } else { 0.0 }
    }

    /// Signed distance of `p`, positive on the side of the normal.
    pub fn distance(&self, p: &Point2<f64>) -> f64 {
        self.normal.dot(&p.coords) - self.rho_px
    }

    /// Foot of the perpendicular from `p`.
    pub fn project(&self, p: &Point2<f64>) -> Point2<f64> {
        p - self.normal * self.distance(p)
    }

    /// The same line with the opposite normal.
    #[must_use]
    pub fn flipped(&self) -> Self {
        Self { normal: -self.normal, rho_px: -self.rho_px }
    }
}

/// Sums over points from which their line follows; `+` of two sets is the set of both.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LineSums {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

/// A total-least-squares line (method 1.3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineFit {
    /// The line; the sign of its normal is arbitrary.
    pub line: Line,
    /// Mean of the points, on the line.
    pub mean_px: Point2<f64>,
    /// Number of points.
    pub count: f64,
    /// Mean squared distance to the line, px^2.
    pub residual_px2: f64,
    /// Sum of squared distances to the mean along the line, px^2.
    pub spread_px2: f64,
}

impl LineSums {
    /// Adds one point.
    pub fn add(&mut self, p: &Point2<f64>) {
        self.n += 1.0;
        self.x += p.x;
        self.y += p.y;
        self.xx += p.x * p.x;
        self.xy += p.x * p.y;
        self.yy += p.y * p.y;
    }

    /// Number of points.
    pub fn count(&self) -> f64 {
        self.n
    }

    /// The line with the least squared perpendicular distances. None for fewer than two distinct
    /// points.
    pub fn fit(&self) -> Option<LineFit> {
        if self.n < 2.0 {
            return None;
        }
        let (mx, my) = (self.x / self.n, self.y / self.n);
        let (sxx, sxy, syy) = (self.xx - self.x * mx, self.xy - self.x * my, self.yy - self.y * my);
        let (mean, half) = (f64::midpoint(sxx, syy), 0.5 * (sxx - syy));
        let radius = (half * half + sxy * sxy).sqrt();
        let spread_px2 = mean + radius;
        // Sums of squares cancel: a spread below this is rounding.
        if !spread_px2.is_finite() || spread_px2 <= 1e-12 * (self.xx + self.yy) + f64::MIN_POSITIVE {
            return None;
        }
        // Half the angle whose cosine and sine are half / radius and sxy / radius.
        let (cos2, sin2) = if radius > 0.0 { (half / radius, sxy / radius) } else { (1.0, 0.0) };
        let direction =
            if cos2 >= 0.0 { Vector2::new(1.0 + cos2, sin2) } else { Vector2::new(sin2, 1.0 - cos2) };
        let direction = direction.normalize();
        let normal = Vector2::new(-direction.y, direction.x);
        Some(LineFit {
            line: Line { normal, rho_px: normal.x * mx + normal.y * my },
            mean_px: Point2::new(mx, my),
            count: self.n,
            residual_px2: ((mean - radius) / self.n).max(0.0),
            spread_px2,
        })
    }
}

impl std::ops::Add for LineSums {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self {
            n: self.n + o.n,
            x: self.x + o.x,
            y: self.y + o.y,
            xx: self.xx + o.xx,
            xy: self.xy + o.xy,
            yy: self.yy + o.yy,
        }
    }
}

impl std::ops::Sub for LineSums {
    type Output = Self;
    /// The sums without those of a part of the set.
    fn sub(self, o: Self) -> Self {
        Self {
            n: self.n - o.n,
            x: self.x - o.x,
            y: self.y - o.y,
            xx: self.xx - o.xx,
            xy: self.xy - o.xy,
            yy: self.yy - o.yy,
        }
    }
}

impl FromIterator<Point2<f64>> for LineSums {
    fn from_iter<I: IntoIterator<Item = Point2<f64>>>(points: I) -> Self {
        points.into_iter().fold(Self::default(), |mut sums, p| {
            sums.add(&p);
            sums
        })
    }
}

impl LineFit {
    /// Least standard deviation of an edge point across its line, px: residuals of short pieces
    /// underestimate it.
    pub const MIN_SIGMA_PX: f64 = 0.2;

    /// Variance of one point across the line, px^2, never below [`Self::MIN_SIGMA_PX`] squared.
    pub fn point_variance_px2(&self) -> f64 {
        let unbiased =
            if self.count > 2.0 { self.residual_px2 * self.count / (self.count - 2.0) } else { 0.0 };
        unbiased.max(Self::MIN_SIGMA_PX * Self::MIN_SIGMA_PX)
    }

    /// Variance of the direction, rad^2.
    pub fn theta_variance(&self) -> f64 {
        self.point_variance_px2() / self.spread_px2
    }

    /// Variance of the offset at `mean_px`, px^2.
    pub fn offset_variance(&self) -> f64 {
        self.point_variance_px2() / self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn p(x: f64, y: f64) -> Point2<f64> {
        Point2::new(x, y)
    }

    #[test]
    fn normal_points_right_of_the_walk() {
        let line = Line::from_points(&p(0.0, 2.0), &p(5.0, 2.0)).unwrap();
        assert!((line.normal - Vector2::new(0.0, 1.0)).norm() < 1e-12);
        assert!((line.rho_px - 2.0).abs() < 1e-12);
        assert!((line.distance(&p(3.0, 7.0)) - 5.0).abs() < 1e-12);
        assert!((line.direction() - Vector2::new(1.0, 0.0)).norm() < 1e-12);
        assert!((line.project(&p(3.0, 7.0)) - p(3.0, 2.0)).norm() < 1e-12);
        assert!(Line::from_points(&p(1.0, 1.0), &p(1.0, 1.0)).is_none());
        assert!(Line::from_points(&p(1.0, 1.0), &p(f64::NAN, 1.0)).is_none());
    }

    #[test]
    fn fit_needs_two_distinct_points() {
        assert!(LineSums::default().fit().is_none());
        assert!([p(700.3, 500.7)].into_iter().collect::<LineSums>().fit().is_none());
        assert!([p(700.3, 500.7); 9].into_iter().collect::<LineSums>().fit().is_none());
    }

    #[test]
    fn variances_follow_the_closed_form() {
        // y = +-0.5 alternating over x = 0..=9: residual variance and spread by hand.
        let sums: LineSums =
            (0..10).map(|i| p(f64::from(i), if i % 4 == 0 || i % 4 == 3 { 0.5 } else { -0.5 })).collect();
        let fit = sums.fit().unwrap();
        assert!(fit.line.normal.x.abs() < 0.05);
        assert!((fit.spread_px2 - 82.5).abs() < 0.2);
        let sigma2 = fit.residual_px2 * 10.0 / 8.0;
        assert!((fit.theta_variance() - sigma2 / fit.spread_px2).abs() < 1e-12);
        assert!((fit.offset_variance() - sigma2 / 10.0).abs() < 1e-12);
        let exact: LineSums = (0..10).map(|i| p(f64::from(i), 3.0)).collect();
        assert!((exact.fit().unwrap().point_variance_px2() - 0.04).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn fit_recovers_the_line_of_exact_points(
            angle in 0.0..std::f64::consts::PI, u in 0.0..4000.0, v in 0.0..4000.0, n in 3_u32..200,
        ) {
            let d = Vector2::new(angle.cos(), angle.sin());
            let points = |m: u32| (0..m).map(move |i| p(u, v) + d * f64::from(i));
            let fit = points(n).collect::<LineSums>().fit().unwrap();
            prop_assert!(fit.line.distance(&p(u, v)).abs() < 1e-5);
            prop_assert!(fit.line.direction().perp(&d).abs() < 1e-6);
            let (left, right) = (points(2), points(n).skip(2));
            let joint = (left.collect::<LineSums>() + right.collect::<LineSums>()).fit().unwrap();
            prop_assert!((joint.line.rho_px - fit.line.rho_px).abs() < 1e-4);
        }
    }
}
