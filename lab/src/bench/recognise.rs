//! `waymark-lab bench recognise`: from quad to verdict among few and many landmarks; whole frames,
//! global and guided, beside OpenCV's SIFT; memory a landmark; recall of the short list; a lesson.

pub(super) mod landmarks;
mod queries;
mod frames;
mod guided;
mod scenes;
mod single;
mod lesson;

use cli::{clock::Clock, screen};
use frames::Named;
use scenes::Scenes;
use serde::Serialize;
use std::{collections::BTreeMap, path::PathBuf, sync::Arc};
use vision::{
    model::{LandmarkModel, ModelSet},
    params::Params,
};

/// Landmarks of SIFT's index, and negatives of the lesson.
const MAP: usize = 1000;

/// `waymark-lab bench recognise`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Sizes of the maps.
    #[arg(long, value_delimiter = ',', default_values_t = [100, 1000, 10_000], value_parser = clap::value_parser!(u32).range(1..=100_000))]
    landmarks: Vec<u32>,
    /// Landmarks that are taught as a server teaches them; the others have icons and points of
    /// their own and the thresholds of these.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(24..=1000))]
    taught: u32,
    /// Quads of landmarks that are timed, and as many of distractors.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    quads: u32,
    /// Quads of landmarks on which the recall of the short list in the largest map is measured.
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    recall_quads: u32,
    /// Rendered frames, 640 x 480; 0 leaves them out.
    #[arg(long, default_value_t = 48, value_parser = clap::value_parser!(u32).range(0..=1000))]
    frames: u32,
    /// Rounds over quads and frames; the fastest of each counts.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Views of the lesson.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(2..=200))]
    views: u32,
    /// Leave OpenCV out.
    #[arg(long)]
    no_peers: bool,
    /// The Python that has OpenCV.
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: PathBuf,
    /// Seed of posters, corridor, views and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

/// Threads that prepare; timed work runs on one.
fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// The result of a run.
#[derive(Debug, Serialize)]
struct Report {
    taught: usize,
    prepare_ms_per_landmark: f64,
    landmark: Landmark,
    quads: Vec<single::Report>,
    short_list: single::Recall,
    frames: Option<frames::Report>,
    lesson: lesson::Report,
}

/// Memory of a landmark, kB, mean over the largest map.
#[derive(Debug, Serialize)]
struct Landmark {
    memory_kb: f64,
    parts_kb: BTreeMap<&'static str, f64>,
    /// Stored form of the model.
    stored_kb: f64,
    points: f64,
}

impl Landmark {
    fn new(models: &ModelSet) -> Self {
        let n = models.len().max(1) as f64;
        let parts_kb: BTreeMap<_, _> =
            models.memory_parts().into_iter().map(|(part, bytes)| (part, bytes as f64 / n / 1e3)).collect();
        Self {
            memory_kb: models.memory_bytes() as f64 / n / 1e3,
            parts_kb,
            stored_kb: models.iter().map(|m| m.to_bytes().len()).sum::<usize>() as f64 / n / 1e3,
            points: models.iter().map(|m| m.points.len()).sum::<usize>() as f64 / n,
        }
    }
}

pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let p = Params::default();
    // Posters with other numbers than the landmarks' are distractors.
    let first = args.seed.wrapping_mul(1_000_003);
    let mut sizes: Vec<usize> = args.landmarks.iter().map(|n| *n as usize).collect();
    sizes.sort_unstable();
    let largest = sizes.last().copied().unwrap_or(MAP);
    let clock = std::time::Instant::now();
    let count = largest.max(MAP);
    let models = landmarks::models(first, count, args.taught as usize, threads(), &p)?;
    let prepare_ms_per_landmark = clock.elapsed().as_secs_f64() * 1e3 / count as f64;
    let asked = single::Asked::new(args, first, sizes.first().copied().unwrap_or(1).min(models.len()))?;
    let maps: Vec<ModelSet> =
        sizes.iter().map(|n| first_of(&models, *n, &p)).collect::<anyhow::Result<_>>()?;
    let landmark = Landmark::new(&first_of(&models, largest, &p)?);
    let quads = maps.iter().map(|map| asked.time(map, args.rounds as usize, &p)).collect();
    let short_list = single::recall(args, first, &first_of(&models, largest, &p)?, &p)?;
    let frames = if args.frames > 0 {
        let scenes = Scenes::new(first, args.frames as usize, args.seed);
        Some(frames::run(args, first, &scenes, &maps, &p)?)
    } else {
        None
    };
    let lesson = lesson::run(args, first, &first_of(&models, MAP, &p)?, &p)?;
    let taught = (args.taught as usize).min(count);
    let report = Report { taught, prepare_ms_per_landmark, landmark, quads, short_list, frames, lesson };
    screen::say(&if args.json { serde_json::to_string(&report)? } else { table(&report) });
    Ok(())
}

fn first_of(models: &[Arc<LandmarkModel>], count: usize, p: &Params) -> anyhow::Result<ModelSet> {
    Ok(ModelSet::new(models.iter().take(count).cloned().collect(), p)?)
}

/// The fastest of `rounds` runs of `work`, ms of processor time, and its result.
fn fastest<T>(rounds: usize, mut work: impl FnMut() -> T) -> (f64, T) {
    let mut timed = || {
        let clock = Clock::start();
        let result = work();
        (clock.ms(), result)
    };
    let (mut least, mut result) = timed();
    for _ in 1..rounds {
        let (ms, again) = timed();
        (least, result) = (least.min(ms), again);
    }
    (least, result)
}

fn table(r: &Report) -> String {
    let mut lines = vec![format!(
        "one core, processor time, fastest of the rounds; {} landmarks taught, the others drawn ({:.1} ms a landmark)",
        r.taught, r.prepare_ms_per_landmark
    )];
    lines.push("one quad, from the picture to the verdict".into());
    for q in &r.quads {
        lines.push(format!(
            "  {:>6} landmarks  own {:.3} ms, distractor {:.3} ms; {} of {} right, {} wrong, {} of {} distractors taken",
            q.landmarks, q.own_ms, q.distractor_ms, q.right, q.asked, q.wrong, q.distractors_accepted, q.asked
        ));
        let steps: Vec<String> = q.steps_ms.iter().map(|(step, ms)| format!("{step} {ms:.3}")).collect();
        lines.push(format!("                    mean of both: {}", steps.join(", ")));
    }
    let l = &r.landmark;
    let parts: Vec<String> = l.parts_kb.iter().map(|(part, kb)| format!("{part} {kb:.2}")).collect();
    lines.push(format!(
        "a landmark: {:.1} kB in memory ({}), {:.1} kB stored; {:.0} points",
        l.memory_kb,
        parts.join(", "),
        l.stored_kb,
        l.points
    ));
    let s = &r.short_list;
    lines.push(format!(
        "short list of {} of {}: {} of {} quads that the right landmark alone accepts are lost ({:.2} %)",
        s.short_list,
        s.landmarks,
        s.lost,
        s.accepted,
        100.0 * s.lost as f64 / s.accepted.max(1) as f64
    ));
    if let Some(f) = &r.frames {
        lines.extend(frame_lines(f));
    }
    lines.push(format!(
        "a lesson of {} views against {} others ({} icons): {:.0} ms",
        r.lesson.views, r.lesson.others, r.lesson.negatives, r.lesson.ms
    ));
    lines.join("\n")
}

fn frame_lines(f: &frames::Report) -> Vec<String> {
    let mut lines = vec![format!(
        "{} frames of 640 x 480, {} landmarks in view in all, {:.1} quads a frame",
        f.frames, f.visible, f.quads_per_frame
    )];
    let named = |who: &str, n: &Named| {
        let Named { right, missed, wrong, frame_ms } = n;
        format!("  {who:<24} {frame_ms:8.2} ms; {right} right, {missed} missed, {wrong} wrong")
    };
    for m in &f.maps {
        lines.push(named(&format!("{} landmarks, global", m.landmarks), &m.global));
        lines.push(format!(
            "    of which detection {:.2}, recognition {:.2} ms",
            m.detection_ms, m.recognition_ms
        ));
        lines.push(named(&format!("{} landmarks, guided", m.landmarks), &m.guided));
    }
    if let (Some(least), Some(most)) = (f.maps.first(), f.maps.last()) {
        lines.push(format!(
            "  {} landmarks over {}: {:.2} (at most 1.5)",
            most.landmarks,
            least.landmarks,
            most.global.frame_ms / least.global.frame_ms
        ));
    }
    if let Some(sift) = &f.sift {
        lines.push(named(&format!("SIFT, {MAP} landmarks"), sift));
    }
    if let (Some(global), Some(guided)) = (f.global_ratio, f.guided_ratio) {
        lines.push(format!(
            "  Waymark / SIFT: global {global:.4} (at most 0.05), guided {guided:.4} (at most 0.025)"
        ));
    }
    lines
}
