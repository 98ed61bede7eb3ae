//! `waymark-lab bench`: time of each stage of the pipeline on this machine, one core, on rendered
//! frames of the corridor. It asserts nothing; the figures go to docs/BENCHMARKS.md.

use crate::evaluate::statistics;
use cli::{screen, stopwatch::Stopwatch};
use serde::Serialize;
use sim::{
    building::Building,
    drive::DriveParams,
    posters,
    robot::{Robot, RobotParams},
    texture::Texture,
};
use std::{collections::BTreeMap, sync::Arc, time::Instant};
use vision::{
    frame::{FrameError, GrayImage},
    geometry::Corners,
    learn::{self, synthesis},
    model::{LandmarkId, ModelSet},
    params::Params,
    pipeline::{FrameCamera, LandmarkDatabase, Pipeline},
    points::taught::view_points,
    pose::LandmarkSize,
    recognise::DistanceKind,
    trace::Stage,
};

/// Views generated for each landmark of the benchmark's map.
const VIEWS: usize = 20;

/// `waymark-lab bench`.
#[derive(Debug, clap::Args)]
pub(super) struct PipelineArgs {
    /// Frames, 640 x 480, along a drive through the corridor.
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    frames: u32,
    /// Landmarks in the map; those of the corridor and other posters.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(6..=2000))]
    landmarks: u32,
    /// Rounds over the frames; the fastest of each frame counts.
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Seed of frames and posters.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

/// Medians over the frames, in milliseconds.
#[derive(Debug, Serialize)]
struct Report {
    frames: usize,
    landmarks: usize,
    learn_ms_per_landmark: f64,
    stages_ms: BTreeMap<&'static str, f64>,
    frame_ms: f64,
    frames_per_second: f64,
    quads_per_frame: f64,
    recognised: usize,
}

pub(super) fn run(args: &PipelineArgs) -> anyhow::Result<()> {
    let params = Params::default();
    let building = Arc::new(Building::corridor(args.seed));
    let (models, learn_ms) = models(&building, args, &params)?;
    let mut robot = Robot::new(
        building.clone(),
        &RobotParams {
            drive: DriveParams { seed: args.seed, rate_hz: 2.0, ..DriveParams::default() },
            ..RobotParams::default()
        },
    );
    let camera = *robot.camera().intrinsics();
    let progress = screen::progress(args.frames as usize, "rendering");
    let frames: Vec<GrayImage> = robot
        .by_ref()
        .take(args.frames as usize)
        .inspect(|_| progress.inc(1))
        .map(|s| s.frame.image)
        .collect();
    progress.finish_and_clear();

    let sizes: BTreeMap<LandmarkId, LandmarkSize> =
        models.iter().map(|m| (m.id, LandmarkSize { width_m: 0.6, height_m: 0.84 })).collect();
    let landmarks = LandmarkDatabase { models: &models, sizes: &sizes, kind: DistanceKind::default() };
    let mut costs: BTreeMap<&'static str, Vec<f64>> = BTreeMap::new();
    let mut totals = Vec::new();
    let (mut quads, mut recognised) = (0, 0);
    let mut pipeline = Pipeline::default();
    let of = FrameCamera::level(Some(&camera));
    for frame in &frames {
        let mut fastest: Option<Stopwatch> = None;
        for round in 0..args.rounds {
            let mut watch = Stopwatch::start();
            let facts = pipeline.analyse(frame, of, landmarks, &params, &mut watch);
            if fastest.as_ref().is_none_or(|f| watch.total_ms() < f.total_ms()) {
                fastest = Some(watch);
            }
            if round == 0 {
                quads += facts.quads.len();
                recognised += facts.quads.iter().filter(|q| q.pose.is_ok()).count();
            }
        }
        let Some(fastest) = fastest else { continue };
        totals.push(fastest.total_ms());
        for (stage, ms) in fastest.ms {
            costs.entry(stage).or_default().push(ms);
        }
    }
    let median = |values: &mut Vec<f64>| statistics::median(values).unwrap_or(0.0);
    let frame_ms = median(&mut totals);
    let report = Report {
        frames: frames.len(),
        landmarks: models.len(),
        learn_ms_per_landmark: learn_ms,
        stages_ms: costs.iter_mut().map(|(stage, ms)| (*stage, median(ms))).collect(),
        frame_ms,
        frames_per_second: 1e3 / frame_ms,
        quads_per_frame: quads as f64 / frames.len() as f64,
        recognised,
    };
    screen::say(&if args.json { serde_json::to_string(&report)? } else { table(&report) });
    Ok(())
}

/// The corridor's posters and enough others, learnt from generated views; the mean cost of a
/// lesson.
fn models(building: &Building, args: &PipelineArgs, params: &Params) -> anyhow::Result<(ModelSet, f64)> {
    let own: Vec<GrayImage> = building
        .posters()
        .filter_map(|l| building.surfaces().iter().find(|s| s.name == l.name))
        .map(|s| picture(&s.texture))
        .collect::<Result<_, _>>()?;
    let others = (0..u64::from(args.landmarks).saturating_sub(own.len() as u64))
        .map(|i| picture(&posters::poster(u64::MAX / 2 + i)));
    let pictures: Vec<GrayImage> = own.into_iter().map(Ok).chain(others).collect::<Result<_, _>>()?;
    let start = Instant::now();
    let progress = screen::progress(pictures.len(), "learning");
    let mut models = Vec::with_capacity(pictures.len());
    for (id, picture) in (1_u64..).zip(&pictures) {
        let (w, h) = (picture.width() as f64 - 0.5, picture.height() as f64 - 0.5);
        let whole = Corners::try_from([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]])?;
        let views = synthesis::views(picture, &whole, VIEWS, params, args.seed ^ id);
        let model = learn::learn(LandmarkId(id), &views, &[], params)?;
        models.push(Arc::new(model.with_points(&[view_points(picture, &whole)])));
        progress.inc(1);
    }
    progress.finish_and_clear();
    let learn_ms = start.elapsed().as_secs_f64() * 1e3 / pictures.len() as f64;
    Ok((ModelSet::new(models, params)?, learn_ms))
}

fn picture(texture: &Texture) -> Result<GrayImage, FrameError> {
    GrayImage::new(texture.width(), texture.height(), texture.data().to_vec())
}

fn table(report: &Report) -> String {
    let mut lines = vec![format!(
        "{} frames of 640 x 480, one core, {} landmarks, {:.1} quads a frame, {} poses; medians",
        report.frames, report.landmarks, report.quads_per_frame, report.recognised
    )];
    let sum: f64 = report.stages_ms.values().sum();
    for stage in Stage::ALL {
        if let Some(ms) = report.stages_ms.get(stage.name()) {
            lines.push(format!("  {:<12} {ms:8.3} ms  {:4.0} %", stage.name(), 100.0 * ms / sum));
        }
    }
    lines.push(format!(
        "  {:<12} {:8.3} ms  = {:.0} frames a second",
        "frame", report.frame_ms, report.frames_per_second
    ));
    lines.push(format!(
        "  learning     {:8.1} ms a landmark, {VIEWS} generated views each",
        report.learn_ms_per_landmark
    ));
    lines.join("\n")
}
