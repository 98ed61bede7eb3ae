//! Writes the lines beside every side of the quads found on a labelled set, with their measurements and how far each
//! lies from the labelled side, as CSV, for fitting the side model.
//!
//! `cargo run --release -p vision --example fit_sides -- SET_DIR > sides.csv`

#![expect(clippy::print_stdout, reason = "a command-line tool")]

use nalgebra::Point2;
use serde_json::Value;
use std::path::Path;
use vision::{
    detect::{candidates, evidence::Gradients, pyramid, selection, side_model::rivals},
    frame::GrayImage,
    geometry::polygon,
    params::DetectParams,
    trace::NoTrace,
};

fn main() {
    let set = std::env::args().nth(1).expect("a set directory");
    let set = Path::new(&set);
    let things = std::env::args().nth(2).is_some_and(|a| a == "things");
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(set.join("truth.json")).expect("truth.json"))
            .expect("valid JSON");
    let params = DetectParams::default();
    for entry in truth["images"].as_array().expect("images") {
        let (Some(quads), Some(file)) = (entry["quads"].as_array(), entry["file"].as_str()) else { continue };
        if entry["whole_image"].as_bool() == Some(true) || quads.is_empty() {
            continue;
        }
        let image = image::open(set.join(file)).expect("an image").to_luma8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        let image = GrayImage::new(width, height, image.into_raw()).expect("within limits");
        let factor = pyramid::working_factor(&image, params.quads.working_side_px);
        let work = pyramid::reduce(&image, factor);
        let (rated, edges) = candidates(&work, &params, &mut NoTrace);
        let g = Gradients { image: &work, gx: edges.gx(), gy: edges.gy() };
        let found = selection::resolve(rated, &params.quads);
        if things {
            let complete = entry["quads_complete"].as_bool() != Some(false);
            for s in selection::settle(found, &g, &params.quads) {
                let quad = s.quad.corners_px.points().map(|p| pyramid::enlarge(&p, factor as f64));
                let near = quads
                    .iter()
                    .map(|t| (polygon::iou(&corners(t), &quad), t["counted"].as_bool() != Some(false)))
                    .fold((0.0, true), |best, x| if x.0 > best.0 { x } else { best });
                let inner = quads.iter().any(|t| {
                    let outer = corners(t);
                    let share = polygon::area(&quad) / polygon::area(&outer);
                    polygon::relation(&outer, &quad, 4.0) == polygon::Relation::Contains && share > 0.25
                });
                let features: Vec<String> = s.features.iter().map(|f| format!("{f:.5}")).collect();
                let c = quad.map(|p| format!("{:.1},{:.1}", p.x, p.y)).join(",");
                println!("{file},{:.4},{},{inner},{complete},{c},{}", near.0, near.1, features.join(","));
            }
            continue;
        }
        for (i, t) in quads.iter().enumerate() {
            if t["state"].as_str().is_some_and(|s| s != "full") || t["counted"].as_bool() == Some(false) {
                continue;
            }
            let label = corners(t).map(|p| pyramid::enlarge(&p, 1.0 / factor as f64));
            let best = found
                .iter()
                .map(|q| (polygon::iou(&label, q.corners_px.points()), q))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((overlap, quad)) = best.filter(|b| b.0 > 0.5) else { continue };
            let start = quad.corners_px.points();
            let label = aligned(&label, start);
            for (side, lines) in rivals(&g, start).iter().enumerate() {
                for r in lines {
                    let along = (r.ends_px[1] - r.ends_px[0]).normalize();
                    let off = |p: &Point2<f64>| along.perp(&(p - r.ends_px[0])).abs();
                    let far = off(&label[side]).max(off(&label[(side + 1) % 4]));
                    let features: Vec<String> = r.features.iter().map(|f| format!("{f:.5}")).collect();
                    let e = r.ends_px.map(|p| format!("{:.3},{:.3}", p.x, p.y));
                    let l = label.map(|p| format!("{:.3},{:.3}", p.x, p.y));
                    println!(
                        "{file}#{i},{},{side},{far:.4},{overlap:.4},{factor},{},{},{}",
                        t["landmark"].as_str().unwrap_or(file),
                        e.join(","),
                        l.join(","),
                        features.join(",")
                    );
                }
            }
        }
    }
}

/// The label, named from the corner that fits best.
fn aligned(label: &[Point2<f64>; 4], to: &[Point2<f64>; 4]) -> [Point2<f64>; 4] {
    let turned = |s: usize| -> [Point2<f64>; 4] { std::array::from_fn(|i| label[(i + s) % 4]) };
    let gap = |s: usize| turned(s).iter().zip(to).map(|(a, b)| (a - b).norm()).sum::<f64>();
    turned((0..4).min_by(|a, b| gap(*a).total_cmp(&gap(*b))).unwrap_or(0))
}

fn corners(quad: &Value) -> [Point2<f64>; 4] {
    std::array::from_fn(|i| {
        let c = &quad["corners"][i];
        Point2::new(c[0].as_f64().unwrap_or(0.0), c[1].as_f64().unwrap_or(0.0))
    })
}
