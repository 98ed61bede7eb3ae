//! `waymark-lab evaluate modalities` (method 15): gain by modality statistics. Robots drive a path
//! on which each modality fails somewhere. The first drives are reference runs; the others are
//! evaluated without statistics and in every fusion mode. Corners and ranges are drawn, nothing is
//! rendered.

mod drive;
mod plot;
mod world;

use super::{
    experiment::{mixed, of_each, say, write_plot},
    statistics::quantile,
};
use drive::{Drive, Driven, follow};
use map::{
    fuse::FuseParams,
    modality_stats::{FusionMode, ModalityMap, ReferenceRun, ReferenceTrajectory, learn_modality_stats},
};
use serde::Serialize;
use std::{path::PathBuf, sync::Arc};
use world::{World, ZONES};

/// Standard deviations of the reference trajectories: m, rad.
const PATH_SIGMA: [f64; 2] = [0.01, 0.003];

/// `waymark-lab evaluate modalities`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Reference runs, half of them from either end.
    #[arg(long, default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=100))]
    runs: u32,
    /// Drives that are evaluated.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    drives: u32,
    /// Seed of all noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Write an SVG picture: the path from above with the best modality of every pose cell, and the
    /// errors along it.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// One fusion mode in one part of the path.
#[derive(Debug, Clone, Serialize)]
struct Row {
    way: &'static str,
    zone: &'static str,
    /// Error of the position: median, 95 %, largest.
    median_m: f64,
    p95_m: f64,
    worst_m: f64,
    /// Mean normalised squared error, 3 expected.
    nees: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    experiment: &'static str,
    seed: u64,
    runs: usize,
    drives: usize,
    /// Pose cells with statistics, and in how many of them each modality is best.
    cells: usize,
    best: [usize; 3],
    rows: Vec<Row>,
}

impl Report {
    fn lines(&self) -> Vec<String> {
        let [odometry, laser, landmarks] = self.best;
        let mut lines = vec![
            format!(
                "{} reference runs, {} drives; of {} pose cells odometry is best in {odometry}, the laser in {laser}, landmarks in {landmarks}",
                self.runs, self.drives, self.cells
            ),
            format!("{:24} {:10} {:>9} {:>9} {:>9} {:>7}", "", "", "median m", "95 % m", "worst m", "NEES"),
        ];
        lines.extend(self.rows.iter().map(|r| {
            format!(
                "{:24} {:10} {:9.3} {:9.3} {:9.3} {:7.2}",
                r.way, r.zone, r.median_m, r.p95_m, r.worst_m, r.nees
            )
        }));
        lines
    }
}

/// Teaches, drives, reports.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let world = World::new();
    let drives = |n: u32, what: u64| -> Vec<Drive> {
        (0..n).map(|i| Drive::new(&world, mixed(&[args.seed, what, u64::from(i)]), i % 2 == 1)).collect()
    };
    let untaught = Arc::new(ModalityMap::default());
    let teaching = drives(args.runs, 15);
    let learnt = of_each(&teaching, "runs", |_, drive| taught(&world, drive));
    let areas = |mode| Arc::new(ModalityMap::new(mode, Vec::new(), &learnt));
    let ways: [(&'static str, Arc<ModalityMap>); 4] = [
        ("untaught", untaught),
        ("all, with error models", areas(FusionMode::All)),
        ("near_best", areas(FusionMode::NearBest)),
        ("best", areas(FusionMode::Best)),
    ];
    let evaluated = drives(args.drives, 16);
    let of_ways: Vec<(&'static str, Vec<Driven>)> = ways
        .iter()
        .map(|(way, areas)| (*way, of_each(&evaluated, "drives", |_, drive| follow(&world, drive, areas))))
        .collect();
    let rows = of_ways.iter().flat_map(|(way, driven)| rows(way, driven)).collect();
    let all = &ways[1].1;
    let best = map::modality_stats::Modality::ALL
        .map(|m| all.cells().filter(|(.., advice)| advice.best == Some(m)).count());
    let report = Report {
        experiment: "modalities",
        seed: args.seed,
        runs: teaching.len(),
        drives: evaluated.len(),
        cells: best.iter().sum(),
        best,
        rows,
    };
    say(args.json, &report, || report.lines())?;
    write_plot(args.plot.as_deref(), || plot::svg(&world, all, &of_ways))
}

/// Statistics of a reference run.
fn taught(
    world: &World,
    drive: &Drive,
) -> std::collections::BTreeMap<map::modality_stats::PoseCell, map::modality_stats::StatsByModality> {
    let driven = follow(world, drive, &Arc::default());
    let [sigma_m, sigma_rad] = PATH_SIGMA;
    let path = ReferenceTrajectory::new(drive.reference(PATH_SIGMA), sigma_m, sigma_rad)
        .expect("a drive has poses in order");
    let run = ReferenceRun { odometry: &drive.odometry(), fixes: &driven.fixes, reference: &path };
    learn_modality_stats(&run, &FuseParams::default()).cells
}

fn rows(way: &'static str, driven: &[Driven]) -> Vec<Row> {
    let zones = ZONES.iter().map(|zone| zone.name).chain(["all"]);
    zones
        .filter_map(|zone| {
            let of_zone = || {
                let moments = driven.iter().flat_map(|d| &d.moments);
                moments.filter(move |m| zone == "all" || m.zone == zone)
            };
            let mut errors: Vec<f64> = of_zone().map(|m| m.error_m).collect();
            let count = errors.len() as f64;
            Some(Row {
                way,
                zone,
                worst_m: quantile(&mut errors, 1.0)?,
                median_m: quantile(&mut errors, 0.5)?,
                p95_m: quantile(&mut errors, 0.95)?,
                nees: of_zone().map(|m| m.nees).sum::<f64>() / count,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_runs_improve_the_pose_where_a_modality_fails() {
        let world = World::new();
        let cells: Vec<_> = (0..6).map(|i| taught(&world, &Drive::new(&world, 50 + i, i % 2 == 1))).collect();
        let p95 = |mode: Option<FusionMode>| {
            let areas = Arc::new(
                mode.map_or_else(ModalityMap::default, |mode| ModalityMap::new(mode, Vec::new(), &cells)),
            );
            let driven: Vec<Driven> =
                (0..4).map(|i| follow(&world, &Drive::new(&world, 90 + i, i % 2 == 0), &areas)).collect();
            let rows = rows("", &driven);
            rows.iter()
                .find(|row| row.zone == "workshop")
                .map(|row| (row.p95_m, row.nees))
                .expect("driven through")
        };
        let (untaught, taught) = (p95(None), p95(Some(FusionMode::All)));
        assert!(taught.0 < 0.75 * untaught.0, "{taught:?} {untaught:?}");
        assert!(taught.1 < 3.5, "{taught:?}");
    }
}
