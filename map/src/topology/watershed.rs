//! Free floor divided into places at its narrow spots: cores wide enough for no doorway, grown into
//! what is left, widest cells first.
//!
//! In: the floor, cells from which landmarks are seen. Out: the place of each cell.

use super::floor::Floor;
use std::{
    cmp::Reverse,
    collections::{BinaryHeap, VecDeque},
};

/// Widest passage that divides two places, metres.
pub const DOORWAY_M: f64 = 1.1;
/// Smallest core of a place, square metres.
pub const MIN_CORE_M2: f64 = 0.5;
/// Most places of a map; of more, those with the largest cores.
pub const MAX_PLACES: usize = 512;

/// The place of each cell, from 1; 0 for none. Only floor that is connected with `seeds` counts.
/// Places are in the order of the first cells of their cores.
pub(super) fn places(floor: &Floor, seeds: impl IntoIterator<Item = usize>) -> Vec<u16> {
    let reached = connected(floor, seeds);
    let mut place_of = cores(floor, &reached);
    // A flood from the cores, by falling clearance: places meet where the floor is narrowest.
    let clearance = |cell: usize| (floor.clearance_m[cell].to_bits(), Reverse(cell));
    let mut open: BinaryHeap<(u64, Reverse<usize>)> =
        (0..place_of.len()).filter(|cell| place_of[*cell] > 0).map(clearance).collect();
    while let Some((_, Reverse(cell))) = open.pop() {
        for (next, _) in floor.around(cell) {
            if reached[next] && place_of[next] == 0 {
                place_of[next] = place_of[cell];
                open.push(clearance(next));
            }
        }
    }
    place_of
}

/// Which free cells are connected with the seeds.
fn connected(floor: &Floor, seeds: impl IntoIterator<Item = usize>) -> Vec<bool> {
    let mut reached = vec![false; floor.clearance_m.len()];
    for seed in seeds {
        if floor.is_free(seed) && !reached[seed] {
            fill(floor, seed, |cell| {
                let is_new = floor.is_free(cell) && !reached[cell];
                reached[cell] |= is_new;
                is_new
            });
        }
    }
    reached
}

/// The cores: connected cells with a clearance above half of [`DOORWAY_M`].
fn cores(floor: &Floor, reached: &[bool]) -> Vec<u16> {
    let is_core = |cell: usize| reached[cell] && floor.clearance_m[cell] > 0.5 * DOORWAY_M;
    let mut core_of = vec![0_u32; reached.len()];
    let mut cells_of = vec![0_usize];
    for start in 0..reached.len() {
        if !is_core(start) || core_of[start] > 0 {
            continue;
        }
        let (core, mut cells) = (cells_of.len() as u32, 0);
        fill(floor, start, |cell| {
            let is_new = is_core(cell) && core_of[cell] == 0;
            if is_new {
                (core_of[cell], cells) = (core, cells + 1);
            }
            is_new
        });
        cells_of.push(cells);
    }
    let least = MIN_CORE_M2 / (floor.cell_m * floor.cell_m);
    let mut kept: Vec<usize> = (1..cells_of.len()).filter(|core| cells_of[*core] as f64 >= least).collect();
    kept.sort_by_key(|core| (Reverse(cells_of[*core]), *core));
    kept.truncate(MAX_PLACES);
    kept.sort_unstable();
    let mut place_of_core = vec![0_u16; cells_of.len()];
    kept.iter().zip(1..).for_each(|(core, place)| place_of_core[*core] = place);
    core_of.into_iter().map(|core| place_of_core[core as usize]).collect()
}

/// Visits the cells around `start` for which `enter` is true; it is asked once for each side.
fn fill(floor: &Floor, start: usize, mut enter: impl FnMut(usize) -> bool) {
    let mut open = VecDeque::from([start]);
    enter(start);
    while let Some(cell) = open.pop_front() {
        open.extend(floor.around(cell).map(|(next, _)| next).filter(|next| enter(*next)));
    }
}
