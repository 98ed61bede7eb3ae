//! Scores detection on a set in the evaluation format: recall at IoU 0.7 and 0.85, false quads per image, corner
//! error, time. For whoever works on the detector; users have `waymark evaluate detection`.
//!
//! `cargo run --release -p vision --example score_detection -- SET_DIR [PARAMS.json] [-v] [--dump FILE]`

#![expect(clippy::print_stdout, reason = "a command-line tool")]

use nalgebra::Point2;
use serde_json::Value;
use std::{fmt::Write as _, path::Path, time::Instant};
use vision::{
    detect::{
        detect,
        quads::{Quad, QuadKind},
    },
    frame::GrayImage,
    geometry::polygon,
    params::DetectParams,
    trace::{NoTrace, Stage, Trace},
};

/// Sums of what is reported.
#[derive(Default)]
struct Score {
    images: usize,
    truths: usize,
    hits_70: usize,
    hits_85: usize,
    false_outside: usize,
    false_inside: usize,
    false_strict: usize,
    corner_errors_px: Vec<f64>,
    times_ms: Vec<f64>,
    stages_ms: [f64; 8],
}

/// Adds up the time between stages.
struct Clock<'a> {
    last: Instant,
    sums_ms: &'a mut [f64; 8],
}

impl Trace for Clock<'_> {
    fn finished(&mut self, stage: Stage) {
        let now = Instant::now();
        self.sums_ms[stage as usize] += (now - self.last).as_secs_f64() * 1e3;
        self.last = now;
    }
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let verbose = args.iter().any(|a| a == "-v");
    let dump = args.iter().position(|a| a == "--dump").and_then(|i| args.get(i + 1));
    let set = Path::new(args.first().expect("a set directory"));
    let params: DetectParams = args
        .iter()
        .find(|a| Path::new(a).extension().is_some_and(|e| e == "json"))
        .map_or_else(DetectParams::default, |path| {
            serde_json::from_str(&std::fs::read_to_string(path).expect("readable parameters"))
                .expect("valid parameters")
        });
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(set.join("truth.json")).expect("truth.json"))
            .expect("valid JSON");
    let (mut score, mut lines) = (Score::default(), String::new());
    for entry in truth["images"].as_array().expect("images") {
        let (Some(quads), Some(file)) = (entry["quads"].as_array(), entry["file"].as_str()) else { continue };
        if entry["whole_image"].as_bool() == Some(true) || quads.is_empty() {
            continue;
        }
        let image = image::open(set.join(file)).expect("an image").to_luma8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        let image = GrayImage::new(width, height, image.into_raw()).expect("within limits");
        let truths: Vec<[Point2<f64>; 4]> = quads.iter().map(corners).collect();
        // The second run is timed: the first one pays for page faults.
        let _warm = detect(&image, &params, &mut NoTrace);
        let start = Instant::now();
        let found = detect(&image, &params, &mut Clock { last: start, sums_ms: &mut score.stages_ms });
        score.times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        score.add(file, &truths, &found, verbose);
        for quad in &found {
            let full = quad.kind == QuadKind::Full;
            let p: Vec<f64> = quad.corners_px.points().iter().flat_map(|p| [p.x, p.y]).collect();
            writeln!(
                lines,
                "{}",
                serde_json::json!({"file": file, "corners": p, "score": quad.score, "full": full,
                "support": quad.side_support, "alternates": quad.alternates.len()})
            )
            .expect("memory");
        }
    }
    if let Some(path) = dump {
        std::fs::write(path, lines).expect("a writable dump");
    }
    score.print();
}

fn corners(quad: &Value) -> [Point2<f64>; 4] {
    std::array::from_fn(|i| {
        let c = &quad["corners"][i];
        Point2::new(c[0].as_f64().unwrap_or(0.0), c[1].as_f64().unwrap_or(0.0))
    })
}

impl Score {
    fn add(&mut self, file: &str, truths: &[[Point2<f64>; 4]], found: &[Quad], verbose: bool) {
        self.images += 1;
        let full: Vec<&Quad> = found.iter().filter(|q| q.kind == QuadKind::Full).collect();
        for truth in truths {
            self.truths += 1;
            let best = full
                .iter()
                .map(|q| (polygon::iou(truth, q.corners_px.points()), *q))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let overlap = best.map_or(0.0, |b| b.0);
            self.hits_70 += usize::from(overlap >= 0.7);
            self.hits_85 += usize::from(overlap >= 0.85);
            if let Some((_, quad)) = best.filter(|b| b.0 >= 0.7) {
                self.corner_errors_px.push(corner_error(truth, quad));
            }
            if verbose && overlap < 0.85 {
                println!("{file}: best IoU {overlap:.2} for {:?}", truth.map(|p| [p.x.round(), p.y.round()]));
            }
        }
        for quad in full {
            let q = quad.corners_px.points();
            if truths.iter().any(|t| polygon::iou(t, q) >= 0.5) {
                continue;
            }
            // An inner border of a picture is a legitimate quad: it lies inside and is not much smaller.
            let inner_border = truths.iter().any(|t| {
                let area_px2 = polygon::area(q);
                polygon::intersection_area(t, q) >= 0.97 * area_px2 && area_px2 >= 0.25 * polygon::area(t)
            });
            self.false_strict += usize::from(!inner_border);
            let inside = truths.iter().any(|t| q.iter().all(|p| polygon::contains(t, p, 8.0)));
            self.false_inside += usize::from(inside);
            self.false_outside += usize::from(!inside);
            if verbose {
                let what = if inside { "inside" } else { "outside" };
                println!(
                    "{file}: false {what} {:?} score {:.2}",
                    q.map(|p| [p.x.round(), p.y.round()]),
                    quad.score
                );
            }
        }
    }

    fn print(mut self) {
        let n = self.images.max(1) as f64;
        let truths = self.truths.max(1) as f64;
        println!(
            "images {} quads {} recall_70 {:.3} recall_85 {:.3} false/image {:.3} (all outside {:.2} inside {:.2}) corner_px {:.2} ms {:.2}",
            self.images,
            self.truths,
            self.hits_70 as f64 / truths,
            self.hits_85 as f64 / truths,
            self.false_strict as f64 / n,
            self.false_outside as f64 / n,
            self.false_inside as f64 / n,
            median(&mut self.corner_errors_px),
            median(&mut self.times_ms),
        );
        for stage in Stage::ALL.iter().take(5) {
            print!("{} {:.2} ms  ", stage.name(), self.stages_ms[*stage as usize] / n);
        }
        println!();
    }
}

/// Mean distance of the corners under the best of the four namings.
fn corner_error(truth: &[Point2<f64>; 4], quad: &Quad) -> f64 {
    (0..4)
        .map(|shift| {
            let q = quad.corners_px.rotated(shift);
            (0..4).map(|i| (q.points()[i] - truth[i]).norm()).sum::<f64>() / 4.0
        })
        .fold(f64::INFINITY, f64::min)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
