//! Writes the features of every candidate quad of a labelled set, with its overlap with the nearest label, as CSV, for
//! fitting the border model.
//!
//! `cargo run --release -p vision --example fit_border -- SET_DIR > candidates.csv`

#![expect(clippy::print_stdout, reason = "a command-line tool")]

use nalgebra::Point2;
use serde_json::Value;
use std::path::Path;
use vision::{
    detect::{candidates, pyramid},
    frame::GrayImage,
    geometry::polygon,
    params::DetectParams,
    trace::NoTrace,
};

fn main() {
    let set = std::env::args().nth(1).expect("a set directory");
    let set = Path::new(&set);
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
        for r in candidates(&pyramid::reduce(&image, factor), &params, &mut NoTrace).0 {
            let Some(quad) = r.quad.scaled(factor as f64) else { continue };
            let overlap = quads
                .iter()
                .enumerate()
                .map(|(i, t)| (i, polygon::iou(&corners(t), quad.corners_px.points())))
                .fold((0, 0.0), |best, x| if x.1 > best.1 { x } else { best });
            let features: Vec<String> = r.features.iter().map(|f| format!("{f:.4}")).collect();
            println!("{file}#{},{:.4},{}", overlap.0, overlap.1, features.join(","));
        }
    }
}

fn corners(quad: &Value) -> [Point2<f64>; 4] {
    std::array::from_fn(|i| {
        let c = &quad["corners"][i];
        Point2::new(c[0].as_f64().unwrap_or(0.0), c[1].as_f64().unwrap_or(0.0))
    })
}
