//! `waymark-lab bench detect`: processor time from frame to segments and to quads, beside OpenCV on
//! the same pictures.

use super::{
    frames::Frames,
    peers::{HINT, Peers},
};
use crate::evaluate::statistics::median;
use cli::{clock::Clock, parameters::ParameterArgs, scratch, screen};
use serde::Serialize;
use std::{collections::BTreeMap, hint::black_box, path::PathBuf};
use vision::{
    detect::{
        DetectBuffers, DetectParams, Grouping, detect_with,
        edges::edge_map,
        segments::{chains, edge_segments},
    },
    frame::Picture,
    trace::{NoTrace, Stage, Trace},
};

/// Names of Waymark's times.
const EDGES: &str = "edges";
const SEGMENTS: &str = "frame to segments";
const QUADS: &str = "frame to quads";
const PAPER: &str = "frame to quads, the paper's grouping";
/// The same of a picture in colour.
const COLOUR_EDGES: &str = "edges, in colour";
const COLOUR_QUADS: &str = "frame to quads, in colour";

/// Waymark's operation, what it is compared with (a peer's, or another of Waymark's), and the
/// largest ratio aimed at, if any.
const RATIOS: [(&str, &str, Option<f64>); 7] = [
    (QUADS, "LSD", Some(0.25)),
    (QUADS, "ArUco", Some(0.6)),
    (SEGMENTS, "LSD", None),
    (SEGMENTS, "EDLines", None),
    (EDGES, "Canny", None),
    (COLOUR_EDGES, EDGES, None),
    (COLOUR_QUADS, QUADS, Some(1.3)),
];

/// `waymark-lab bench detect`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Pictures or folders of them; left out, the open indoor sets beside the project, or rendered
    /// corridors.
    images: Vec<PathBuf>,
    /// Where the open sets lie.
    #[arg(long, env = "WAYMARK_DATA", value_name = "DIR")]
    data: Option<PathBuf>,
    /// Pictures in all, evenly from each set.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..=1000))]
    count: u32,
    /// Rounds: each program processes each picture once a round.
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Leave OpenCV out.
    #[arg(long)]
    no_peers: bool,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: PathBuf,
    /// Seed of the rendered frames.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    parameters: ParameterArgs,
}

/// Processor time of one thread, ms: median over the pictures of each picture's median and of its
/// least.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Cost {
    median_ms: f64,
    least_ms: f64,
}

/// The result of a run.
#[derive(Debug, Serialize)]
struct Report {
    frames: usize,
    from: String,
    rounds: u32,
    quads_per_frame: f64,
    ours: BTreeMap<String, Cost>,
    peers: BTreeMap<String, Cost>,
    opencv: Option<String>,
    /// Ratios of the medians: Waymark over the peer.
    ratios: Vec<Ratio>,
    /// Frame to quads by stage.
    stages_ms: BTreeMap<&'static str, f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct Ratio {
    ours: String,
    peer: String,
    #[serde(rename = "ratio")]
    value: f64,
    /// Largest ratio aimed at, if any.
    limit: Option<f64>,
}

/// Times of every operation, for every picture one after the other.
#[derive(Debug, Default)]
struct Times(BTreeMap<String, Vec<Vec<f64>>>);

impl Times {
    fn add(&mut self, name: &str, frame: usize, ms: f64) {
        let frames = self.0.entry(name.to_owned()).or_default();
        if frames.len() <= frame {
            frames.resize(frame + 1, vec![]);
        }
        frames[frame].push(ms);
    }

    fn costs(&self) -> BTreeMap<String, Cost> {
        let cost = |frames: &Vec<Vec<f64>>| {
            let of = |f: fn(&mut Vec<f64>) -> f64| {
                let mut each: Vec<f64> = frames.iter().map(|ms| f(&mut ms.clone())).collect();
                median(&mut each).unwrap_or(0.0)
            };
            Cost {
                median_ms: of(|ms| median(ms).unwrap_or(0.0)),
                least_ms: of(|ms| ms.iter().copied().fold(f64::INFINITY, f64::min)),
            }
        };
        self.0.iter().map(|(name, frames)| (name.clone(), cost(frames))).collect()
    }
}

/// Processor time between the ends of stages.
struct StageClock {
    last: Clock,
    ms: BTreeMap<&'static str, f64>,
}

impl Trace for StageClock {
    fn finished(&mut self, stage: Stage) {
        *self.ms.entry(stage.name()).or_default() += self.last.ms();
        self.last = Clock::start();
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let params = args.parameters.parameters()?;
    let Frames { from, frames } =
        Frames::new(&args.images, args.data.as_deref(), args.count as usize, args.seed)?;
    let folder = scratch::Folder::new("bench")?;
    let mut peers = if args.no_peers { None } else { peers(args, &frames, folder.path()) };
    let (mut ours, mut theirs, mut stages) = (Times::default(), Times::default(), Times::default());
    let mut quads = 0;
    let progress = screen::progress(args.rounds as usize * frames.len(), "timing");
    for round in 0..args.rounds {
        for (i, frame) in frames.iter().enumerate() {
            let found = time_ours(frame, &params, i, &mut ours, &mut stages);
            quads += if round == 0 { found } else { 0 };
            if let Some(running) = &mut peers {
                match running.time(i) {
                    Ok(times) => times.iter().for_each(|(name, ms)| theirs.add(name, i, *ms)),
                    Err(why) => {
                        screen::complain(&format!("OpenCV is left out from here on: {why}"));
                        peers = None;
                    }
                }
            }
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    let (ours, theirs) = (ours.costs(), theirs.costs());
    let report = Report {
        frames: frames.len(),
        from,
        rounds: args.rounds,
        quads_per_frame: quads as f64 / frames.len() as f64,
        ratios: ratios(&ours, &theirs),
        ours,
        peers: theirs,
        opencv: peers.map(|p| p.version.clone()),
        stages_ms: Stage::ALL
            .into_iter()
            .filter_map(|s| Some((s.name(), stages.costs().get(s.name())?.median_ms)))
            .collect(),
    };
    screen::say(&if args.json { serde_json::to_string(&report)? } else { table(&report) });
    Ok(())
}

fn peers(args: &Args, frames: &[Picture], folder: &std::path::Path) -> Option<Peers> {
    let grey: Vec<_> = frames.iter().map(|frame| frame.grey().clone()).collect();
    match Peers::start(&args.python, &grey, folder) {
        Ok(peers) => Some(peers),
        Err(why) => {
            screen::complain(&format!("OpenCV is left out: {why}. To have it: {HINT}"));
            None
        }
    }
}

/// Times Waymark's operations on one picture in grey, each after a warm-up run; on its colours,
/// too, if it has any. Returns the number of quads.
fn time_ours(
    picture: &Picture,
    params: &DetectParams,
    i: usize,
    ours: &mut Times,
    stages: &mut Times,
) -> usize {
    let frame = picture.grey();
    let mut timed = |name: &str, work: &mut dyn FnMut()| {
        work();
        let clock = Clock::start();
        work();
        ours.add(name, i, clock.ms());
    };
    let mut edge_map = edge_map::EdgeMap::default();
    timed(EDGES, &mut || edge_map::edges_into(black_box(frame), &params.edges, &mut edge_map));
    timed(SEGMENTS, &mut || {
        edge_map::edges_into(black_box(frame), &params.edges, &mut edge_map);
        let chained = chains::chains(&edge_map, &params.chains);
        black_box(edge_segments::segments(&chained, &edge_map, &params.segments));
    });
    let mut memory = DetectBuffers::default();
    let mut found = 0;
    timed(QUADS, &mut || found = detect_with(&mut memory, black_box(frame), params, &mut NoTrace).len());
    let mut paper = params.clone();
    paper.quads.grouping = Grouping::Relaxation;
    timed(PAPER, &mut || {
        black_box(detect_with(&mut memory, black_box(frame), &paper, &mut NoTrace));
    });
    if picture.colour().is_some() {
        timed(COLOUR_EDGES, &mut || edge_map::edges_into(black_box(picture), &params.edges, &mut edge_map));
        timed(COLOUR_QUADS, &mut || {
            black_box(detect_with(&mut memory, black_box(picture), params, &mut NoTrace));
        });
    }
    let mut clock = StageClock { last: Clock::start(), ms: BTreeMap::new() };
    detect_with(&mut memory, frame, params, &mut clock);
    for (stage, ms) in clock.ms {
        stages.add(stage, i, ms);
    }
    found
}

fn ratios(ours: &BTreeMap<String, Cost>, theirs: &BTreeMap<String, Cost>) -> Vec<Ratio> {
    let ratio = |(mine, peer, limit): (&str, &str, Option<f64>)| {
        let (a, b) = (ours.get(mine)?, theirs.get(peer).or_else(|| ours.get(peer))?);
        let value = a.median_ms / b.median_ms;
        Some(Ratio { ours: mine.into(), peer: peer.into(), value, limit })
    };
    RATIOS.into_iter().filter_map(ratio).collect()
}

fn table(r: &Report) -> String {
    let mut lines = vec![
        format!(
            "{} frames of 640 x 480 ({}), {} rounds, one core, {:.1} quads a frame",
            r.frames, r.from, r.rounds, r.quads_per_frame
        ),
        "processor time: median over frames of each frame's median (of its least)".into(),
    ];
    let row = |(name, cost): (&String, &Cost)| {
        format!("  {name:<38} {:8.3} ms  ({:.3})", cost.median_ms, cost.least_ms)
    };
    lines.push("Waymark".into());
    lines.extend(r.ours.iter().map(row));
    if let Some(version) = &r.opencv {
        lines.push(format!("OpenCV {version}, one thread"));
    }
    lines.extend(r.peers.iter().map(row));
    if !r.ratios.is_empty() {
        lines.push("ratios".into());
    }
    for ratio in &r.ratios {
        let limit = ratio.limit.map_or(String::new(), |l| format!("  (at most {l})"));
        let name = format!("{} / {}", ratio.ours, ratio.peer);
        lines.push(format!("  {name:<38} {:8.3}{limit}", ratio.value));
    }
    lines.push("frame to quads by stage".into());
    let sum: f64 = r.stages_ms.values().sum();
    for stage in Stage::ALL {
        if let Some(ms) = r.stages_ms.get(stage.name()) {
            lines.push(format!("  {:<38} {ms:8.3} ms  {:3.0} %", stage.name(), 100.0 * ms / sum));
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_are_medians_over_frames() {
        let mut times = Times::default();
        for (frame, ms) in
            [(0, 1.0), (1, 10.0), (2, 5.0), (0, 3.0), (1, 20.0), (2, 5.0), (0, 2.0), (1, 30.0), (2, 8.0)]
        {
            times.add("x", frame, ms);
        }
        // Medians 2, 20, 5; least 1, 10, 5.
        assert_eq!(times.costs()["x"], Cost { median_ms: 5.0, least_ms: 5.0 });
    }

    #[test]
    fn ratios_need_both_times() {
        let cost = |median_ms| Cost { median_ms, least_ms: 1.0 };
        let ours = BTreeMap::from([(QUADS.to_owned(), cost(2.0))]);
        let theirs = BTreeMap::from([("LSD".to_owned(), cost(16.0)), ("Canny".to_owned(), cost(1.0))]);
        let found = ratios(&ours, &theirs);
        assert_eq!(found.len(), 1);
        assert!((found[0].value - 0.125).abs() < 1e-12 && found[0].limit == Some(0.25));
    }
}
