//! `waymark-lab evaluate joint`: the joint map of walls, landmarks and camera in simulated
//! buildings, against the truth and against two steps (laser map, then each landmark alone).

mod building;
mod cases;
mod drive;
mod figures;
mod passages;
mod report;
mod two_step;

use super::experiment::{of_each, say};
use cases::{Case, World};
use figures::Figures;
use report::{Report, Row};

/// `waymark-lab evaluate joint`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Buildings, each drawn from a seed of its own.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..=1_000))]
    buildings: u32,
    /// Seed of the first building; the others follow.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Cases by name, separated by commas; all without it.
    #[arg(long, value_delimiter = ',')]
    cases: Vec<String>,
    /// Print one JSON object instead of tables.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let mut cases = cases::all();
    if let Some(unknown) = args.cases.iter().find(|name| cases.iter().all(|case| case.name != **name)) {
        anyhow::bail!("there is no case {unknown}");
    }
    cases.retain(|case| args.cases.is_empty() || args.cases.iter().any(|name| name == case.name));
    let report = evaluated(args.buildings, args.seed, &cases);
    say(args.json, &report, || report.lines())
}

/// All cases in all buildings.
fn evaluated(buildings: u32, seed: u64, cases: &[Case]) -> Report {
    let seeds: Vec<u64> = (0..u64::from(buildings)).map(|i| seed + i).collect();
    let figures = of_each(&seeds, "buildings", |_, seed| {
        let world = World::drawn(*seed);
        cases.iter().map(|case| world.figures(case)).collect::<Vec<_>>()
    });
    let mut total: Vec<Figures> = cases.iter().map(|_| Figures::default()).collect();
    for building in figures {
        total.iter_mut().zip(building).for_each(|(all, one)| all.add(one));
    }
    let rows = cases.iter().zip(&total).map(|(case, all)| Row::of(case.name, case.what, all)).collect();
    Report::of(buildings, seed, rows)
}

#[cfg(test)]
mod tests;
