//! Mismatched parts of a landmark. In: the picture in the image, aligned with the learnt icon, and
//! that icon. Out: a map of mismatches. An untextured occluder is not a mismatch.

use crate::{
    points::agreement::{Agreement, Part, TABLE},
    recognise::verification::gradient_similarity::{Bucket, CONTRADICTS, Smoothed, cells, shows},
};

/// Cells along a side. Windows of two by two overlap by half: each is as large as a part of the
/// table.
pub const CELLS: usize = 2 * TABLE;
/// Windows along a side.
pub const WINDOWS: usize = CELLS - 1;
/// Side of a block of windows, a quarter of the picture...
const BLOCK: usize = 4;
/// ... that mismatches if at least this many of its windows do. Chosen on the set `tune`; detection
/// and false-alarm rates are in docs/EVALUATION.md, "Recognition with points".
pub const MIN_DIFFERING: usize = 9;
/// With more untextured cells where the icon has texture, the block is occluded: only the edge of
/// the occluder differs.
const MAX_HIDDEN: usize = 4;

/// Where the icon has no texture, the picture mismatches with slopes of more than this share of its
/// mean.
const APPEARS_SHARE: f32 = 0.5;

/// The mismatched windows and the untextured cells of a picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MismatchMap {
    is_mismatch: [[bool; WINDOWS]; WINDOWS],
    is_hidden: [[bool; CELLS]; CELLS],
}

impl MismatchMap {
    /// Compares `picture`, aligned with `learnt`, with it. `None` where the icons are cut
    /// differently.
    pub fn new(picture: &Smoothed, learnt: &Smoothed) -> Option<Self> {
        let cells = cells(picture, learnt, CELLS)?;
        let of_two = |i: usize| {
            let first = i / WINDOWS * CELLS + i % WINDOWS;
            [1, CELLS, CELLS + 1].iter().fold(cells[first], |sum, next| sum + cells[first + next]).bucket()
        };
        let windows: Vec<_> = (0..WINDOWS * WINDOWS).map(of_two).collect();
        let mean = |power: fn(&Bucket) -> f32| windows.iter().map(power).sum::<f32>() / windows.len() as f32;
        let (power, other_power) = (mean(|w| w.power), mean(|w| w.other_power));
        let differs = |w: &Bucket| {
            let appears = w.power > APPEARS_SHARE * power;
            w.correlation < CONTRADICTS
                && shows(w.power, power)
                && (appears || shows(w.other_power, other_power))
        };
        let is_hidden = |c: &Bucket| !shows(c.power, power) && shows(c.other_power, other_power);
        let row = |y: usize| std::array::from_fn(|x| differs(&windows[y * WINDOWS + x]));
        let cell_row = |y: usize| std::array::from_fn(|x| is_hidden(&cells[y * CELLS + x].bucket()));
        Some(Self { is_mismatch: std::array::from_fn(row), is_hidden: std::array::from_fn(cell_row) })
    }

    /// Whether the window shows something else, by row and column: window i begins with cell i.
    pub fn is_mismatch(&self) -> &[[bool; WINDOWS]; WINDOWS] {
        &self.is_mismatch
    }

    /// Whether the cell shows nothing where the icon does, by row and column.
    pub fn is_hidden(&self) -> &[[bool; CELLS]; CELLS] {
        &self.is_hidden
    }

    /// The largest number of mismatches in a block, over the blocks that are not occluded.
    pub fn largest_block(&self) -> usize {
        let starts = || 0..=WINDOWS - BLOCK;
        let blocks = starts().flat_map(|y| starts().map(move |x| (x, y)));
        let is_visible = |(x, y): &(usize, usize)| count(&self.is_hidden, (*x, *y), BLOCK + 1) <= MAX_HIDDEN;
        blocks.filter(is_visible).map(|at| count(&self.is_mismatch, at, BLOCK)).max().unwrap_or(0)
    }

    /// Whether a connected part mismatches.
    pub fn has_mismatched_part(&self) -> bool {
        self.largest_block() >= MIN_DIFFERING
    }

    /// The table of the points with the mismatched parts marked.
    pub(crate) fn marked(&self, by_points: Agreement) -> Agreement {
        let differs = |x: usize, y: usize| self.is_mismatch[2 * y][2 * x];
        let part = |x: usize, y: usize| if differs(x, y) { Part::Disagrees } else { by_points.0[y][x] };
        Agreement(std::array::from_fn(|y| std::array::from_fn(|x| part(x, y))))
    }
}

/// How many of a block of `side` by `side` are set.
fn count<const N: usize>(of: &[[bool; N]; N], (x, y): (usize, usize), side: usize) -> usize {
    of[y..y + side].iter().flat_map(|row| &row[x..x + side]).filter(|is_set| **is_set).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recognise::fixture::{drawn_icon, waves as taught};

    fn made(f: impl Fn(f64, f64) -> f64) -> Smoothed {
        Smoothed::new(&drawn_icon(f))
    }

    fn other(x: f64, y: f64) -> f64 {
        120.0 + 50.0 * (23.0 * y - 4.0 * x * x).sin() + 40.0 * (21.0 * x + 11.0 * y).sin()
    }

    fn with(part: impl Fn(f64, f64) -> Option<f64>) -> MismatchMap {
        let picture = made(|x, y| part(x, y).unwrap_or(taught(x, y)));
        MismatchMap::new(&picture, &made(taught)).unwrap()
    }

    #[test]
    fn a_replaced_quarter_is_located() {
        for (left, top) in [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5), (0.2, 0.3)] {
            let is_in = |x: f64, y: f64| x >= left && x < left + 0.5 && y >= top && y < top + 0.5;
            let mismatches = with(|x, y| is_in(x, y).then(|| other(x, y)));
            assert!(mismatches.has_mismatched_part(), "{left} {top}: {mismatches:?}");
            let table = mismatches.marked(Agreement([[Part::Agrees; TABLE]; TABLE]));
            assert!(table.count(Part::Disagrees) >= 3, "{table:?}");
            for (y, row) in table.0.iter().enumerate() {
                for (x, part) in row.iter().enumerate() {
                    let [near_x, near_y] = [(x, left), (y, top)].map(|(i, from)| {
                        let middle = (i as f64 + 0.5) / TABLE as f64;
                        (middle - from - 0.25).abs() <= 0.36
                    });
                    assert!(*part == Part::Agrees || (near_x && near_y), "{left} {top}: {table:?}");
                }
            }
        }
    }

    /// Half of the icon is a plain margin.
    #[test]
    fn texture_on_a_plain_part_of_the_icon_is_a_mismatch() {
        let half = |x: f64, y: f64| if x < 0.5 { taught(x, y) } else { 120.0 };
        let differs = |picture: &dyn Fn(f64, f64) -> f64| {
            MismatchMap::new(&made(picture), &made(half)).unwrap().has_mismatched_part()
        };
        assert!(differs(&|x, y| if x > 0.5 && y > 0.5 { other(x, y) } else { half(x, y) }));
        assert!(!differs(&half));
        // A shadow's edge across it.
        assert!(!differs(&|x, y| if x + 0.3 * y > 0.8 { 0.6 * half(x, y) } else { half(x, y) }));
    }

    #[test]
    fn the_taught_picture_has_no_mismatch_under_any_light() {
        assert_eq!(with(|_, _| None).largest_block(), 0);
        assert_eq!(with(|x, y| Some(0.4 * taught(x, y) + 60.0 + 30.0 * x)).largest_block(), 0);
    }

    /// The occluder has a visible edge and no texture.
    #[test]
    fn an_untextured_occluder_is_not_a_mismatch() {
        for side in [0.3, 0.45, 0.6] {
            let is_hidden = |x: f64, y: f64| (x - 0.5).abs() < 0.5 * side && (y - 0.5).abs() < 0.5 * side;
            assert!(!with(|x, y| is_hidden(x, y).then_some(70.0)).has_mismatched_part(), "{side}");
        }
    }

    #[test]
    fn one_line_of_other_text_is_below_the_limit() {
        let mismatches = with(|x, y| (y > 0.82 && y < 0.95).then(|| other(x, y)));
        assert!(!mismatches.has_mismatched_part() && mismatches.largest_block() > 0, "{mismatches:?}");
    }
}
