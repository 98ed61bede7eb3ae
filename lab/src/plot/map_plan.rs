//! A floor plan as SVG: metres to pixels, and the signs that the pictures of the map's stages share. What is drawn is
//! each picture's own business.

use crate::evaluate::chart::COLOURS;
use formats::svg::{put, text};
use map::{
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix2, Point2};
use std::f64::consts::TAU;

/// Squared size of every ellipse: 95 % of chi2, 2 degrees of freedom.
pub(super) const CHI2_2_95: f64 = 5.991;
/// Corners of the polygon that stands for an ellipse.
const ELLIPSE_POINTS: u32 = 40;

pub(super) const TRUTH: &str = "#333333";
pub(super) const WALL: &str = "#777777";
pub(super) const FAINT: &str = "#aaaaaa";
pub(super) const ODOMETRY: &str = COLOURS[0];
pub(super) const ESTIMATE: &str = COLOURS[1];
pub(super) const LANDMARK: &str = COLOURS[2];

/// A rectangle of the floor and where it is drawn.
pub(super) struct Plan {
    low_m: [f64; 2],
    high_m: [f64; 2],
    left_px: f64,
    top_px: f64,
    /// Pixels a metre.
    scale: f64,
}

impl Plan {
    /// The floor between two corners, its top left at a point of the picture.
    pub(super) fn new((left_px, top_px): (f64, f64), [low_m, high_m]: [[f64; 2]; 2], scale: f64) -> Self {
        Self { low_m, high_m, left_px, top_px, scale }
    }

    /// Right and lower end in the picture.
    pub(super) fn end_px(&self) -> (f64, f64) {
        self.at(&Point2::new(self.high_m[0], self.low_m[1]))
    }

    pub(super) fn at(&self, p: &Point2<f64>) -> (f64, f64) {
        (self.left_px + (p.x - self.low_m[0]) * self.scale, self.top_px + (self.high_m[1] - p.y) * self.scale)
    }

    fn joined(&self, points: impl IntoIterator<Item = Point2<f64>>) -> String {
        let points = points.into_iter().map(|p| {
            let (u, v) = self.at(&p);
            format!("{u:.1},{v:.1}")
        });
        points.collect::<Vec<_>>().join(" ")
    }

    /// A line through points; `style` are attributes of SVG.
    pub(super) fn line(&self, svg: &mut String, points: impl IntoIterator<Item = Point2<f64>>, style: &str) {
        put(svg, &format!(r#"<polyline points="{}" fill="none" {style}/>"#, self.joined(points)));
    }

    /// A closed area.
    pub(super) fn area(&self, svg: &mut String, corners: impl IntoIterator<Item = Point2<f64>>, style: &str) {
        put(svg, &format!(r#"<polygon points="{}" {style}/>"#, self.joined(corners)));
    }

    /// Small dots, all alike.
    pub(super) fn dots(
        &self,
        svg: &mut String,
        points: impl IntoIterator<Item = Point2<f64>>,
        (radius_px, colour): (f64, &str),
    ) {
        let dots = points.into_iter().map(|p| {
            let (u, v) = self.at(&p);
            // A line of no length with round ends.
            format!("M{u:.1} {v:.1}h0")
        });
        let path: String = dots.collect();
        put(
            svg,
            &format!(
                r#"<path d="{path}" stroke="{colour}" stroke-width="{:.1}" stroke-linecap="round"/>"#,
                2.0 * radius_px
            ),
        );
    }

    pub(super) fn walls<'a>(
        &self,
        svg: &mut String,
        walls: impl IntoIterator<Item = (&'a Point2<f64>, &'a Point2<f64>)>,
    ) {
        for (a, b) in walls {
            self.line(svg, [*a, *b], &format!(r#"stroke="{WALL}" stroke-width="2.5""#));
        }
    }

    /// A landmark on its wall, from above.
    pub(super) fn landmark(&self, svg: &mut String, place: &LandmarkPlace, colour: &str) {
        let (s, c) = place.theta_rad.sin_cos();
        let half = 0.5 * place.size.width_m;
        let side = |k: f64| Point2::new(place.x_m - k * half * s, place.y_m + k * half * c);
        self.line(svg, [side(-1.0), side(1.0)], &format!(r#"stroke="{colour}" stroke-width="6""#));
    }

    /// A robot: a triangle that points ahead.
    pub(super) fn robot(&self, svg: &mut String, pose: &Pose2, colour: &str) {
        let length_m = 9.0 / self.scale;
        let corner = |x: f64, y: f64| pose.apply(&Point2::new(x * length_m, y * length_m));
        let corners = [corner(1.0, 0.0), corner(-0.7, 0.7), corner(-0.7, -0.7)];
        self.area(svg, corners, &format!(r#"fill="{colour}""#));
    }

    /// The ellipse around a point that encloses 95 %.
    pub(super) fn ellipse(
        &self,
        svg: &mut String,
        (mean, covariance): (&Point2<f64>, &Matrix2<f64>),
        style: &str,
    ) {
        let Some(root) = covariance.cholesky() else { return };
        let around = |k: u32| {
            let (s, c) = (TAU * f64::from(k) / f64::from(ELLIPSE_POINTS)).sin_cos();
            mean + root.l() * nalgebra::Vector2::new(c, s) * CHI2_2_95.sqrt()
        };
        self.area(svg, (0..ELLIPSE_POINTS).map(around), style);
    }

    /// The position of a pose with its ellipse.
    pub(super) fn pose_ellipse(&self, svg: &mut String, pose: &Pose2Covariance, colour: &str) {
        let position = pose.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let style = format!(r#"fill="{colour}" fill-opacity="0.15" stroke="{colour}""#);
        self.ellipse(svg, (&pose.pose.position().into(), &position), &style);
    }

    /// A cross, for what is true.
    pub(super) fn cross(&self, svg: &mut String, at: &Point2<f64>, colour: &str) {
        let (u, v) = self.at(at);
        put(
            svg,
            &format!(
                r#"<path d="M{:.1} {:.1}l8 8m0 -8l-8 8" stroke="{colour}" stroke-width="2"/>"#,
                u - 4.0,
                v - 4.0
            ),
        );
    }

    /// Words beside a point, moved by pixels.
    pub(super) fn label(
        &self,
        svg: &mut String,
        at: &Point2<f64>,
        (anchor, [du, dv]): (&str, [f64; 2]),
        words: &str,
    ) {
        let (u, v) = self.at(at);
        text(svg, (u + du, v + dv), anchor, words);
    }

    /// A bar of this length below the plan.
    pub(super) fn scale_bar(&self, svg: &mut String, length_m: f64) {
        let (u, v) = (self.left_px, self.end_px().1 + 14.0);
        let end = u + length_m * self.scale;
        put(
            svg,
            &format!(
                r#"<path d="M{u:.1} {:.1}v6m0 -3H{end:.1}m0 -3v6" stroke="black" fill="none"/>"#,
                v - 3.0
            ),
        );
        text(svg, (end + 6.0, v + 4.0), "start", &format!("{length_m} m"));
    }
}

/// A picture of this size, drawn by `draw`, on white.
pub(super) fn page(
    [width, height]: [f64; 2],
    draw: impl FnOnce(&mut String) -> anyhow::Result<()>,
) -> anyhow::Result<String> {
    let mut svg = String::new();
    put(
        &mut svg,
        &format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">"#
        ),
    );
    put(&mut svg, r#"<rect width="100%" height="100%" fill="white"/>"#);
    draw(&mut svg)?;
    put(&mut svg, "</svg>");
    Ok(svg)
}

/// The title of a part of the picture.
pub(super) fn title(svg: &mut String, at: (f64, f64), words: &str) {
    put(svg, r#"<g font-weight="bold">"#);
    text(svg, at, "start", words);
    put(svg, "</g>");
}

/// What a legend shows before its words.
#[derive(Clone, Copy)]
pub(super) enum Sign {
    Line,
    Dashed,
    Dot,
    Cross,
    Robot,
    Landmark,
    Ellipse,
}

/// Signs and what they mean, one below the other.
pub(super) fn legend(svg: &mut String, (x, y): (f64, f64), entries: &[(Sign, &str, &str)]) {
    for (i, (sign, colour, words)) in entries.iter().enumerate() {
        let y = y + 19.0 * i as f64;
        let (u, v) = (x + 12.0, y - 4.0);
        let element = match sign {
            Sign::Line => format!(r#"<path d="M{x} {v}h24" stroke="{colour}" stroke-width="2"/>"#),
            Sign::Dashed => {
                format!(
                    r#"<path d="M{x} {v}h24" stroke="{colour}" stroke-width="2" stroke-dasharray="5 3"/>"#
                )
            }
            Sign::Dot => format!(r#"<circle cx="{u}" cy="{v}" r="3" fill="{colour}"/>"#),
            Sign::Cross => {
                format!(
                    r#"<path d="M{} {}l8 8m0 -8l-8 8" stroke="{colour}" stroke-width="2"/>"#,
                    u - 4.0,
                    v - 4.0
                )
            }
            Sign::Robot => {
                format!(r#"<path d="M{} {v}l-15 6v-12z" fill="{colour}"/>"#, u + 9.0)
            }
            Sign::Landmark => format!(r#"<path d="M{x} {v}h24" stroke="{colour}" stroke-width="6"/>"#),
            Sign::Ellipse => format!(
                r#"<ellipse cx="{u}" cy="{v}" rx="11" ry="6" fill="{colour}" fill-opacity="0.15" stroke="{colour}"/>"#
            ),
        };
        put(svg, &element);
        text(svg, (x + 32.0, y), "start", words);
    }
}
