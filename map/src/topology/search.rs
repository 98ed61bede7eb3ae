//! Shortest paths over the cells of one place.

use super::floor::Floor;
use nalgebra::Point2;
use std::{cmp::Reverse, collections::BinaryHeap};

/// Distances from a cell over the cells of a place, eight steps around each, metres.
#[derive(Debug)]
pub(super) struct Search {
    distance_m: Vec<f64>,
    before: Vec<usize>,
    touched: Vec<usize>,
}

impl Search {
    pub(super) fn new(floor: &Floor) -> Self {
        let cells = floor.clearance_m.len();
        Self { distance_m: vec![f64::INFINITY; cells], before: vec![0; cells], touched: Vec::new() }
    }

    /// Searches anew from a cell. Cells for which `is_end` is true are reached, not left.
    pub(super) fn from(
        &mut self,
        floor: &Floor,
        start: usize,
        is_inside: impl Fn(usize) -> bool,
        is_end: impl Fn(usize) -> bool,
    ) {
        self.touched.drain(..).for_each(|cell| self.distance_m[cell] = f64::INFINITY);
        self.reach(start, 0.0, start);
        // Not negative, so their bits are in the order of the numbers.
        let mut open = BinaryHeap::from([Reverse((0.0_f64.to_bits(), start))]);
        while let Some(Reverse((bits, cell))) = open.pop() {
            let distance_m = f64::from_bits(bits);
            if distance_m > self.distance_m[cell] || (cell != start && is_end(cell) && !is_inside(cell)) {
                continue;
            }
            for (next, cells) in floor.around(cell) {
                let to_next = distance_m + cells * floor.cell_m;
                if to_next < self.distance_m[next] && (is_inside(next) || is_end(next)) {
                    self.reach(next, to_next, cell);
                    open.push(Reverse((to_next.to_bits(), next)));
                }
            }
        }
    }

    fn reach(&mut self, cell: usize, distance_m: f64, before: usize) {
        if self.distance_m[cell].is_infinite() {
            self.touched.push(cell);
        }
        (self.distance_m[cell], self.before[cell]) = (distance_m, before);
    }

    /// Infinite where it was not reached.
    pub(super) fn distance_m(&self, cell: usize) -> f64 {
        self.distance_m[cell]
    }

    /// Cells from the start to one that was reached.
    pub(super) fn path(&self, to: usize) -> Vec<usize> {
        let mut cells = vec![to];
        while let Some(last) = cells.last().filter(|last| self.before[**last] != **last) {
            cells.push(self.before[*last]);
        }
        cells.reverse();
        cells
    }
}

/// The corners of a path: what lies between two of them is free on the straight line.
pub(super) fn straightened(floor: &Floor, cells: &[usize]) -> Vec<Point2<f64>> {
    let mut corners: Vec<usize> = cells.first().copied().into_iter().collect();
    let mut last = None;
    for cell in cells {
        if let (Some(anchor), Some(before)) = (corners.last().copied(), last)
            && !is_straight(floor, anchor, *cell)
        {
            corners.push(before);
        }
        last = Some(*cell);
    }
    corners.extend(last.filter(|last| corners.last() != Some(last)));
    corners.into_iter().map(|cell| floor.centre(cell)).collect()
}

/// Whether the floor is free at every half cell between two cells.
fn is_straight(floor: &Floor, from: usize, to: usize) -> bool {
    let (a, b) = (floor.centre(from), floor.centre(to));
    let steps = ((b - a).norm() / (0.5 * floor.cell_m)).ceil().max(1.0);
    (1..steps as usize).all(|i| {
        let point = a + (b - a) * (i as f64 / steps);
        floor.cell(&point).is_some_and(|cell| floor.is_free(cell))
    })
}
