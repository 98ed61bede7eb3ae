//! `waymark-lab evaluate navigation` (method 18, E10 and E12): the paper's corridor, 25 m long with
//! four posters. A first drive teaches; then robots drive through it, each from an unknown start
//! pose, localised by landmarks, odometry and a laser, which does not constrain the pose along the
//! corridor. It runs in this program, with the code that the server runs, without a server, from a
//! seed.

mod journey;
mod kidnap;
mod plot;
mod report;
mod world;

use super::experiment::{mixed, of_each, say, write_plot};
use journey::{DriveSettings, Journey, drive};
use report::Report;
use std::path::PathBuf;
use world::{Course, World};

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
    /// Icons decide, not points (`algorithm.recognise.verdict.points = false`).
    #[arg(long)]
    icons: bool,
    /// Teach doors and windows, too.
    #[arg(long)]
    fittings: bool,
    /// Teach exact corners of photographs and exact places of landmarks. Needed to compare the
    /// errors of named corners with their covariances.
    #[arg(long)]
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
    /// Draw errors of intrinsics, extrinsics and survey poses by their stated standard deviations;
    /// otherwise they are exact. Needed to evaluate covariances.
    #[arg(long)]
    own_errors: bool,
    /// Kidnap every robot: carry it so far forwards, while its odometry stands still, 8 s after its
    /// first pose. The report says after how many frames the wrong pose is detected.
    #[arg(long, value_name = "M", default_value_t = 0.0, value_parser = kidnap, allow_negative_numbers = true)]
    kidnap_m: f64,
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

/// Teaches, drives, reports.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let course = Course {
        length_m: args.length_m,
        posters: args.posters as usize,
        pictures: args.pictures as usize,
        unique: args.unique as usize,
        points: !args.icons,
        fittings: args.fittings,
        true_lessons: args.true_lessons,
        views: args.views as usize,
        exact: !args.own_errors,
        seed: args.seed,
    };
    let world = World::taught(course)?;
    let seeds: Vec<u64> = (0..args.drives).map(|n| mixed(&[args.seed, 10, u64::from(n)])).collect();
    let (rate_hz, laser, exact) = (args.rate_hz, !args.no_laser, !args.own_errors);
    let kidnap_m = args.kidnap_m;
    let way = |n: usize, seed: &u64| DriveSettings {
        seed: *seed,
        back: n % 2 == 1,
        rate_hz,
        laser,
        exact,
        kidnap_m,
    };
    let journeys = of_each(&seeds, "drives", |n, seed| drive(&world, way(n, seed)));
    let journeys = journeys.into_iter().collect::<anyhow::Result<Vec<Journey>>>()?;
    let report = Report::new(&world, &journeys, (laser, exact), args.seed);
    say(args.json, &report, || report.lines())?;
    write_plot(args.plot.as_deref(), || plot::svg(&world, &journeys[0]))
}
