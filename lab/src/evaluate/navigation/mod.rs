//! `waymark-lab evaluate navigation` (method 18, E10 and E12): the paper's corridor, 25 m long with
//! four posters. A first drive maps the walls, a second one teaches; then robots drive through it,
//! each from a start pose that the server does not know, localised by landmarks, odometry and a
//! laser, which does not constrain the pose along the corridor. Wheels and camera follow the
//! estimate. It runs in this program, with the code that the server runs, without a server, from a
//! seed.

mod exploration;
mod surveying;
mod world;
mod pilot;
mod body;
mod kidnap;
mod journey;
mod reference_runs;
mod names;
mod plot;
mod report;

use super::experiment::{mixed, of_each, say, write_plot};
use body::DriveSettings;
use journey::{Journey, drive};
use map::modality_stats::FusionMode;
use reference_runs::learnt;
use report::Report;
use std::{path::PathBuf, sync::Arc};
use vision::params::preset::Preset;
use world::{Course, FirstMapBy, World};

/// `waymark-lab evaluate navigation`.
#[derive(Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the experiment")]
pub(crate) struct Args {
    /// Drives, one length of the corridor each, from both ends in turn.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1000))]
    drives: u32,
    /// Posters in the corridor: alternately left and right, the last two at its ends.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    posters: u32,
    /// Number of different pictures on the posters, repeated in turn. 0: all differ.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=64))]
    pictures: u32,
    /// With --pictures: number of last posters that show a picture of their own.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=64))]
    unique: u32,
    /// The pipeline of the server: the `default`, or that of the `paper`, where H^r decides.
    #[arg(long, value_name = "NAME", default_value = "default")]
    preset: Preset,
    /// Reference runs with a known path before the drives, from which the best modality of every
    /// place is learnt (method 15).
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=100))]
    runs: u32,
    /// With --runs: fuse `all` modalities, `near_best` or the `best` of every place.
    #[arg(long, value_name = "MODE", default_value = "all", value_parser = fusion)]
    fusion: FusionMode,
    /// Teach doors and windows, too.
    #[arg(long)]
    fittings: bool,
    /// Teach exact corners of photographs and exact places of landmarks. Needed to compare the
    /// errors of named corners with their covariances.
    #[arg(long, requires = "open_loop")]
    true_lessons: bool,
    /// Photographs that the first drive takes of each landmark.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..=100))]
    views: u32,
    /// Length of the corridor.
    #[arg(long, value_name = "M", default_value_t = 25.0, value_parser = length)]
    length_m: f64,
    /// Frames a second.
    #[arg(long, default_value_t = 5.0, value_parser = rate)]
    rate_hz: f64,
    /// Seed of building, lesson, drives and all noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Robots without a laser.
    #[arg(long)]
    no_laser: bool,
    /// The robots drive their true path and their camera is aimed by the truth; walls and lessons
    /// come from true poses, cameras and mountings are exact. For figures about names and corners.
    #[arg(long)]
    open_loop: bool,
    /// Walls and landmarks come from so many drives of a robot that knew neither (1), as
    /// `waymark survey` makes them, in place of a map of walls and a lesson.
    #[arg(long, value_name = "DRIVES", conflicts_with = "open_loop", num_args = 0..=1,
          default_missing_value = "1", value_parser = clap::value_parser!(u32).range(1..=8))]
    survey: Option<u32>,
    /// Kidnap every robot: carry it so far forwards, while its odometry stands still, 8 s after its
    /// first pose. The report says after how many frames the wrong pose is detected.
    #[arg(long, value_name = "M", value_parser = kidnap, allow_negative_numbers = true, requires = "open_loop")]
    kidnap_m: Option<f64>,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Write an SVG picture of the first drive: trajectories from above (true, odometry,
    /// corrected), and the error over time with the band of three standard deviations.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

fn within(text: &str, [low, high]: [f64; 2]) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if (low..=high).contains(&x) => Ok(x),
        _ => Err(format!("a number from {low} to {high}")),
    }
}

fn length(text: &str) -> Result<f64, String> {
    within(text, [6.0, 200.0])
}

fn rate(text: &str) -> Result<f64, String> {
    within(text, [0.2, 30.0])
}

fn kidnap(text: &str) -> Result<f64, String> {
    within(text, [-10.0, 10.0])
}

fn fusion(word: &str) -> Result<FusionMode, String> {
    serde_json::from_value(word.into()).map_err(|_other| "one of: all, near_best, best".to_owned())
}

/// Teaches, drives, reports.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let course = Course {
        length_m: args.length_m,
        posters: args.posters as usize,
        pictures: args.pictures as usize,
        unique: args.unique as usize,
        preset: args.preset,
        fittings: args.fittings,
        true_lessons: args.true_lessons,
        views: args.views as usize,
        first_map: match (args.open_loop, args.survey) {
            (true, _) => FirstMapBy::Truth,
            (false, Some(drives)) => FirstMapBy::Survey { drives: drives as usize },
            (false, None) => FirstMapBy::Lesson,
        },
        seed: args.seed,
    };
    let mut world = World::taught(course)?;
    let drives = |world: &World, what: u64, count: u32| -> anyhow::Result<Vec<Journey>> {
        let seeds: Vec<u64> = (0..count).map(|n| mixed(&[args.seed, what, u64::from(n)])).collect();
        let (rate_hz, laser, kidnap_m) = (args.rate_hz, !args.no_laser, args.kidnap_m.unwrap_or(0.0));
        let way =
            |n: usize, seed: &u64| DriveSettings { seed: *seed, back: n % 2 == 1, rate_hz, laser, kidnap_m };
        of_each(&seeds, "drives", |n, seed| drive(world, way(n, seed))).into_iter().collect()
    };
    if args.runs > 0 {
        let runs = drives(&world, 17, args.runs)?;
        world.map.modalities = Arc::new(learnt(runs, args.fusion)?);
    }
    let journeys = drives(&world, 10, args.drives)?;
    let report = Report::new(&world, &journeys, (!args.no_laser, args.runs as usize));
    say(args.json, &report, || report.lines())?;
    write_plot(args.plot.as_deref(), || plot::svg(&world, &journeys[0]))
}
