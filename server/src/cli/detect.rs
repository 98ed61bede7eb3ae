//! `waymark detect`: the quads of pictures, no server needed.

use super::{pictures, screen};

use serde::Serialize;
use std::{collections::BTreeMap, path::PathBuf, process::ExitCode, time::Instant};
use vision::{
    detect::{detect, quads::Quad},
    trace::{Stage, Trace},
};

/// `waymark detect`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// PNG or JPEG files.
    #[arg(required = true)]
    images: Vec<PathBuf>,
    /// One JSON line per picture: `{"image","width","height","quads":[{"corners":[[x,y]*4],"kind","score"}],"timings_ms"}`.
    ///
    /// Corners are top-left, top-right, bottom-right, bottom-left in pixels; pixel (0, 0) is the centre of the
    /// top-left pixel.
    #[arg(long)]
    json: bool,
    /// Detection parameters, JSON; only what differs from the defaults, such as {"quads": {"grouping": "relaxation"}}.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
}

#[derive(Serialize)]
struct Line {
    image: String,
    width: usize,
    height: usize,
    quads: Vec<QuadLine>,
    timings_ms: BTreeMap<&'static str, f64>,
}

#[derive(Serialize)]
struct QuadLine {
    corners: [[f64; 2]; 4],
    kind: vision::detect::quads::QuadKind,
    score: f64,
    side_support: [f64; 4],
    /// Inner borders of the same thing, outermost first.
    alternates: Vec<[[f64; 2]; 4]>,
}

/// Times each stage by the clock.
pub(crate) struct Stopwatch {
    last: Instant,
    pub(crate) ms: BTreeMap<&'static str, f64>,
}

impl Stopwatch {
    pub(crate) fn start() -> Self {
        Self { last: Instant::now(), ms: BTreeMap::new() }
    }

    /// All stages together.
    pub(crate) fn total_ms(&self) -> f64 {
        self.ms.values().sum()
    }
}

impl Trace for Stopwatch {
    fn finished(&mut self, stage: Stage) {
        let now = Instant::now();
        *self.ms.entry(stage.name()).or_default() += (now - self.last).as_secs_f64() * 1e3;
        self.last = now;
    }
}

/// Exit status 1 when any picture could not be read; the others are still done.
pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let params = pictures::detect_params(args.params.as_deref())?;
    let mut status = ExitCode::SUCCESS;
    for path in &args.images {
        let name = path.display().to_string();
        let gray = match pictures::read(path) {
            Ok(gray) => gray,
            Err(error) => {
                screen::complain(&format!("waymark: {name}: {error}"));
                status = ExitCode::FAILURE;
                continue;
            }
        };
        let mut stopwatch = Stopwatch::start();
        let quads = detect(&gray, &params, &mut stopwatch);
        if args.json {
            let line = Line {
                image: name,
                width: gray.width(),
                height: gray.height(),
                quads: quads.iter().map(quad_line).collect(),
                timings_ms: stopwatch.ms,
            };
            screen::say(&serde_json::to_string(&line)?);
        } else {
            let total = stopwatch.total_ms();
            screen::say(&format!(
                "{name}: {}x{}, {} quads, {total:.1} ms",
                gray.width(),
                gray.height(),
                quads.len()
            ));
            for quad in &quads {
                let corners = quad.corners_px.points().map(|c| format!("({:.1}, {:.1})", c.x, c.y)).join(" ");
                screen::say(&format!("  score {:.2}  {corners}  {:?}", quad.score, quad.kind));
            }
        }
    }
    Ok(status)
}

fn quad_line(quad: &Quad) -> QuadLine {
    QuadLine {
        corners: quad.corners_px.into(),
        kind: quad.kind,
        score: quad.score,
        side_support: quad.side_support,
        alternates: quad.alternates.iter().map(|c| (*c).into()).collect(),
    }
}
