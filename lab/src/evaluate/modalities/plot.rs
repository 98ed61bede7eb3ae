//! The path from above with the best modality of every pose cell; below it the 95 % quantile of the
//! errors along it.

use super::{drive::Driven, world::World};
use crate::evaluate::{chart::COLOURS, statistics::quantile};
use formats::svg::{put, text};
use map::modality_stats::{CELL_M, Modality, ModalityMap};

const WIDTH_PX: f64 = 1100.0;
const LEFT_PX: f64 = 60.0;
const TOP_PX: f64 = 60.0;
const SCALE: f64 = 17.5;
const HALF_M: f64 = 4.5;
const ERROR_PX: f64 = 220.0;
/// The error at the top of the lower panel.
const MOST_M: f64 = 0.5;

fn colour(modality: Modality) -> &'static str {
    match modality {
        Modality::Odometry => COLOURS[0],
        Modality::Laser => COLOURS[3],
        Modality::Landmarks => COLOURS[4],
    }
}

fn at(x_m: f64, y_m: f64) -> (f64, f64) {
    (LEFT_PX + x_m * SCALE, TOP_PX + (HALF_M - y_m) * SCALE)
}

pub(super) fn svg(world: &World, areas: &ModalityMap, ways: &[(&'static str, Vec<Driven>)]) -> String {
    let mut svg = String::new();
    let height = TOP_PX + 2.0 * HALF_M * SCALE + 60.0 + ERROR_PX + 60.0;
    put(
        &mut svg,
        &format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH_PX}" height="{height:.0}" viewBox="0 0 {WIDTH_PX} {height:.0}" font-family="sans-serif" font-size="12">"#
        ),
    );
    put(&mut svg, r#"<rect width="100%" height="100%" fill="white"/>"#);
    for (i, module) in Modality::ALL.into_iter().enumerate() {
        let x = LEFT_PX + 150.0 * i as f64;
        put(&mut svg, &format!(r#"<rect x="{x}" y="14" width="14" height="14" fill="{}"/>"#, colour(module)));
        let name = format!("{module:?} is best").to_lowercase();
        text(&mut svg, (x + 20.0, 26.0), "start", &name);
    }
    for (cell, _, advice) in areas.cells() {
        let Some(best) = advice.best else { continue };
        let [x, y] = cell.middle_m();
        let (u, v) = at(x, y);
        // A triangle that points along the heading.
        let (s, c) = (f64::from(cell.heading) * std::f64::consts::FRAC_PI_2).sin_cos();
        let half = 0.5 * CELL_M * SCALE;
        let corner = |a: f64, b: f64| (u + half * (a * c - b * s), v - half * (a * s + b * c));
        let ((x1, y1), (x2, y2)) = (corner(1.0, 1.0), corner(1.0, -1.0));
        put(
            &mut svg,
            &format!(
                r#"<path d="M{u:.1} {v:.1}L{x1:.1} {y1:.1}L{x2:.1} {y2:.1}Z" fill="{}"/>"#,
                colour(best)
            ),
        );
    }
    for wall in &world.walls {
        let ((x1, y1), (x2, y2)) = (at(wall.a_m.x, wall.a_m.y), at(wall.b_m.x, wall.b_m.y));
        put(
            &mut svg,
            &format!(r##"<path d="M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}" stroke="#333" stroke-width="2"/>"##),
        );
    }
    for poster in &world.posters {
        let (u, v) = at(poster.x_m, poster.y_m);
        put(&mut svg, &format!(r#"<circle cx="{u:.1}" cy="{v:.1}" r="5" fill="{}"/>"#, COLOURS[1]));
    }
    errors(&mut svg, ways, TOP_PX + 2.0 * HALF_M * SCALE + 60.0);
    put(&mut svg, "</svg>");
    svg
}

/// 95 % quantile of the errors in every metre.
fn errors(svg: &mut String, ways: &[(&'static str, Vec<Driven>)], top: f64) {
    let height = |error: f64| top + ERROR_PX * (1.0 - (error / MOST_M).min(1.0));
    for i in 0..=5 {
        let error = 0.1 * f64::from(i);
        let (v, right) = (height(error), WIDTH_PX - LEFT_PX);
        put(svg, &format!(r##"<path d="M{LEFT_PX} {v:.1}H{right}" stroke="#ddd"/>"##));
        text(svg, (LEFT_PX - 6.0, v + 4.0), "end", &format!("{error:.1}"));
    }
    text(svg, (LEFT_PX, top - 8.0), "start", "95 % quantile of the position error, m, over x");
    for (k, (way, driven)) in ways.iter().enumerate() {
        let mut path = String::new();
        for x in 0..55 {
            let x = f64::from(x);
            let near = |m: &&super::drive::Moment| (x..x + 1.0).contains(&m.x_m);
            let mut all: Vec<f64> =
                driven.iter().flat_map(|d| d.moments.iter().filter(near).map(|m| m.error_m)).collect();
            if let Some(p95) = quantile(&mut all, 0.95) {
                let (u, _) = at(x + 0.5, 0.0);
                let begins = if path.is_empty() { 'M' } else { 'L' };
                put(&mut path, &format!("{begins}{u:.1} {:.1}", height(p95)));
            }
        }
        let colour = COLOURS[k];
        put(svg, &format!(r#"<path d="{path}" fill="none" stroke="{colour}" stroke-width="2"/>"#));
        let x = LEFT_PX + 220.0 * k as f64;
        put(
            svg,
            &format!(
                r#"<rect x="{x}" y="{:.0}" width="14" height="3" fill="{colour}"/>"#,
                top + ERROR_PX + 28.0
            ),
        );
        text(svg, (x + 20.0, top + ERROR_PX + 34.0), "start", way);
    }
}
