//! The paper's Fig. 15 and the error over time: the corridor from above with the trajectories by
//! truth, by odometry and corrected; below it the error along the corridor with the band of three
//! standard deviations.

use super::{
    journey::{Journey, Moment},
    world::World,
};
use crate::evaluate::chart::COLOURS;
use formats::svg::{put, text};
use map::pose2::Pose2;

const WIDTH_PX: f64 = 1100.0;
const LEFT_PX: f64 = 60.0;
const TOP_PX: f64 = 50.0;
/// Metres shown beyond the corridor's walls, for odometry that leaves it.
const BEYOND_M: f64 = 1.5;
const ERROR_HEIGHT_PX: f64 = 220.0;
const GAP_PX: f64 = 70.0;

const TRUE: &str = "#333333";
const ODOMETRY: &str = COLOURS[0];
const CORRECTED: &str = COLOURS[1];

pub(super) fn svg(world: &World, journey: &Journey) -> String {
    let mut svg = String::new();
    let plan = Plan::new(world);
    let height = TOP_PX + plan.height_px() + GAP_PX + ERROR_HEIGHT_PX + 60.0;
    put(
        &mut svg,
        &format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH_PX}" height="{height:.0}" viewBox="0 0 {WIDTH_PX} {height:.0}" font-family="sans-serif" font-size="12">"#
        ),
    );
    put(&mut svg, r#"<rect width="100%" height="100%" fill="white"/>"#);
    plan.draw(&mut svg, world, journey);
    errors(&mut svg, journey, TOP_PX + plan.height_px() + GAP_PX);
    put(&mut svg, "</svg>");
    svg
}

/// The corridor from above.
struct Plan {
    low_m: [f64; 2],
    high_m: [f64; 2],
    /// Pixels a metre.
    scale: f64,
}

impl Plan {
    fn new(world: &World) -> Self {
        let (mut low_m, mut high_m) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for wall in world.building.walls() {
            for end in [wall.a_m, wall.b_m] {
                for (i, x) in [end.x, end.y].into_iter().enumerate() {
                    (low_m[i], high_m[i]) = (low_m[i].min(x), high_m[i].max(x));
                }
            }
        }
        (low_m[1], high_m[1]) = (low_m[1] - BEYOND_M, high_m[1] + BEYOND_M);
        let scale = (WIDTH_PX - 2.0 * LEFT_PX) / (high_m[0] - low_m[0]);
        Self { low_m, high_m, scale }
    }

    fn height_px(&self) -> f64 {
        (self.high_m[1] - self.low_m[1]) * self.scale
    }

    fn at(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        (LEFT_PX + (x_m - self.low_m[0]) * self.scale, TOP_PX + (self.high_m[1] - y_m) * self.scale)
    }

    fn draw(&self, svg: &mut String, world: &World, journey: &Journey) {
        for wall in world.building.walls() {
            let ((x1, y1), (x2, y2)) = (self.at(wall.a_m.x, wall.a_m.y), self.at(wall.b_m.x, wall.b_m.y));
            put(
                svg,
                &format!(r##"<path d="M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}" stroke="#888" stroke-width="2"/>"##),
            );
        }
        for info in world.map.landmarks.values() {
            let Some(place) = info.place else { continue };
            let along = Pose2::new(place.x_m, place.y_m, place.theta_rad + std::f64::consts::FRAC_PI_2);
            let half = 0.5 * place.size.width_m;
            let [a, b] = [-half, half].map(|y| along.compose(&Pose2::new(y, 0.0, 0.0)));
            let ((x1, y1), (x2, y2)) = (self.at(a.x_m, a.y_m), self.at(b.x_m, b.y_m));
            let colour = COLOURS[2];
            put(
                svg,
                &format!(
                    r#"<path d="M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}" stroke="{colour}" stroke-width="6"/>"#
                ),
            );
            // Its name is written behind the wall.
            let behind =
                Pose2::new(place.x_m, place.y_m, place.theta_rad).compose(&Pose2::new(-0.5, 0.0, 0.0));
            let (u, v) = self.at(behind.x_m, behind.y_m);
            text(svg, (u, v + 4.0), "middle", &info.name);
        }
        let truth = |m: &Moment| Some(m.truth);
        let odometry = |m: &Moment| Some(m.odometry);
        let fused = |m: &Moment| m.fused.map(|f| f.pose);
        self.trajectory(svg, journey, &odometry, ODOMETRY);
        self.trajectory(svg, journey, &truth, TRUE);
        self.trajectory(svg, journey, &fused, CORRECTED);
        let corrections = journey.moments.iter().filter(|m| m.corrected).count();
        for moment in journey.moments.iter().filter(|m| m.corrected) {
            let Some(pose) = fused(moment) else { continue };
            let (u, v) = self.at(pose.x_m, pose.y_m);
            put(svg, &format!(r#"<circle cx="{u:.1}" cy="{v:.1}" r="2" fill="{CORRECTED}"/>"#));
        }
        let title = format!("one drive, {corrections} corrections (dots); posters green");
        text(svg, (0.5 * WIDTH_PX, 20.0), "middle", &title);
        for (i, (colour, words)) in
            [(TRUE, "true trajectory"), (ODOMETRY, "odometry alone"), (CORRECTED, "corrected")]
                .iter()
                .enumerate()
        {
            let x = LEFT_PX + 150.0 * i as f64;
            put(svg, &format!(r#"<rect x="{x:.0}" y="32" width="24" height="4" fill="{colour}"/>"#));
            text(svg, (x + 30.0, 38.0), "start", words);
        }
    }

    fn trajectory(
        &self,
        svg: &mut String,
        journey: &Journey,
        of: &dyn Fn(&Moment) -> Option<Pose2>,
        colour: &str,
    ) {
        let points: Vec<String> = journey
            .moments
            .iter()
            .filter_map(of)
            .map(|pose| {
                let (u, v) = self.at(pose.x_m, pose.y_m);
                format!("{u:.1},{v:.1}")
            })
            .collect();
        let points = points.join(" ");
        put(
            svg,
            &format!(r#"<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>"#),
        );
    }
}

/// Error along the corridor over time, and three standard deviations to both sides.
fn errors(svg: &mut String, journey: &Journey, top_px: f64) {
    let known: Vec<(f64, f64, f64)> = journey
        .moments
        .iter()
        .filter_map(|m| {
            let fused = m.fused?;
            Some((m.time_s, fused.pose.x_m - m.truth.x_m, 3.0 * fused.covariance[(0, 0)].max(0.0).sqrt()))
        })
        .collect();
    let end_s = journey.moments.last().map_or(1.0, |m| m.time_s.max(1.0));
    // The band before the second fix may be wide; it must not set the scale.
    let limit_m = 0.15;
    let at = |t: f64, e: f64| {
        let u = LEFT_PX + t / end_s * (WIDTH_PX - 2.0 * LEFT_PX);
        (u, top_px + (0.5 - 0.5 * e.clamp(-limit_m, limit_m) / limit_m) * ERROR_HEIGHT_PX)
    };
    let joined = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        points
            .map(|(t, e)| {
                let (u, v) = at(t, e);
                format!("{u:.1},{v:.1}")
            })
            .collect::<Vec<_>>()
            .join(" ")
    };
    let upper = joined(&mut known.iter().map(|k| (k.0, k.2)));
    let lower = joined(&mut known.iter().rev().map(|k| (k.0, -k.2)));
    put(svg, &format!(r#"<polygon points="{upper} {lower}" fill="{CORRECTED}" fill-opacity="0.15"/>"#));
    let line = joined(&mut known.iter().map(|k| (k.0, k.1)));
    put(svg, &format!(r#"<polyline points="{line}" fill="none" stroke="{CORRECTED}" stroke-width="1.5"/>"#));
    for e in [-0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15] {
        let (u, v) = at(0.0, e);
        put(
            svg,
            &format!(
                r##"<path d="M{u:.1} {v:.1}H{:.1}" stroke="#ccc" stroke-width="0.6"/>"##,
                at(end_s, e).0
            ),
        );
        text(svg, (u - 6.0, v + 4.0), "end", &format!("{e:.2}"));
    }
    for i in 0..=10 {
        let t = 0.1 * f64::from(i) * end_s;
        text(svg, (at(t, 0.0).0, top_px + ERROR_HEIGHT_PX + 18.0), "middle", &format!("{t:.0}"));
    }
    let title = "error along the corridor, m, with three standard deviations, over time, s";
    text(svg, (0.5 * WIDTH_PX, top_px - 12.0), "middle", title);
}
