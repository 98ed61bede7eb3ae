//! Prints the straight segments of photographs as CSV, and the time of each stage to standard
//! error: `cargo run --release -p vision --example segments -- [PARAMS.json] IMAGE...`, the
//! parameters as in `DetectParams`.
#![expect(clippy::disallowed_methods, clippy::disallowed_types, reason = "a program with files and a clock")]
#![expect(clippy::print_stdout, reason = "a command-line example")]

use std::{error::Error, time::Instant};
use vision::{
    detect::{
        DetectParams,
        edges::edge_map::{EdgeMap, edges_into},
        segments::{chains::chains, edge_segments::segments},
    },
    frame::GrayImage,
};

/// Runs of which the fastest counts.
const RUNS: usize = 9;

fn main() -> Result<(), Box<dyn Error>> {
    println!("file,pu,pv,qu,qv,contrast,support,chain,clipped");
    let mut files: Vec<String> = std::env::args().skip(1).collect();
    let mut p = DetectParams::default();
    if files.first().is_some_and(|f| f.to_ascii_lowercase().ends_with(".json")) {
        p = serde_json::from_slice(&std::fs::read(files.remove(0))?)?;
    }
    for file in files {
        let gray = image::open(&file)?.into_luma8();
        let image = GrayImage::new(gray.width() as usize, gray.height() as usize, gray.into_raw())?;
        let mut best_ms = [f64::INFINITY; 3];
        let mut all = Vec::new();
        let mut map = EdgeMap::default();
        for _ in 0..RUNS {
            let start = Instant::now();
            edges_into(&image, &p.edges, &mut map);
            let after_edges = Instant::now();
            let chained = chains(&map, &p.chains);
            let after_chains = Instant::now();
            all = segments(&chained, &map, &p.segments);
            let spans = [after_edges - start, after_chains - after_edges, after_chains.elapsed()];
            for (best, span) in best_ms.iter_mut().zip(spans) {
                *best = best.min(span.as_secs_f64() * 1e3);
            }
        }
        for s in &all {
            println!(
                "{file},{:.2},{:.2},{:.2},{:.2},{:.1},{},{},{}",
                s.p_px.x, s.p_px.y, s.q_px.x, s.q_px.y, s.contrast, s.support, s.chain, s.clipped
            );
        }
        let [e, c, s] = best_ms;
        eprintln!("{file},{},{},{e:.3},{c:.3},{s:.3},{}", image.width(), image.height(), all.len());
    }
    Ok(())
}
