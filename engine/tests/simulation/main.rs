//! The way of frames under a simulated network, clock and workers: the real intake, slots,
//! numbering, epochs, deadlines and snapshots, driven by steps that follow from a seed. After every
//! step a model says what must hold ([`world`]).
//!
//! `WAYMARK_SEED=n` runs one seed with its steps printed, `WAYMARK_SEEDS=n` so many (2000). The
//! store's half of the simulation (keys, revisions, commits) is `simulation` of the server's
//! publication.

mod random;
mod robot;
mod world;

use std::panic::{AssertUnwindSafe, catch_unwind};
use world::World;

/// Seeds of a run.
const SEEDS: u64 = 2000;
/// Steps of a seed.
const STEPS: usize = 500;

fn run(seed: u64, is_told: bool) {
    let mut world = World::new(seed, is_told);
    for _ in 0..STEPS {
        world.step();
        world.check();
    }
    world.settle();
}

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|text| text.parse().ok())
}

#[test]
fn whatever_the_network_does_frames_end_once_and_the_newest_wins() {
    if let Some(seed) = number("WAYMARK_SEED") {
        run(seed, true);
        return;
    }
    for seed in 0..number("WAYMARK_SEEDS").unwrap_or(SEEDS) {
        let ended = catch_unwind(AssertUnwindSafe(|| run(seed, false)));
        assert!(
            ended.is_ok(),
            "seed {seed} failed: WAYMARK_SEED={seed} cargo test -p engine --test simulation -- --nocapture"
        );
    }
}

/// The simulation is of use only if everything happens in it.
#[test]
fn every_outcome_happens_in_the_simulation() {
    let mut seen = world::Tally::default();
    for seed in 0..40 {
        let mut world = World::new(seed, false);
        (0..STEPS).for_each(|_| world.step());
        seen.add(world.seen());
    }
    assert!(seen.all_happened(), "{seen:?}");
}
