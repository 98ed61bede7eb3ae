//! A picture laid on the learnt icon of what it should show in; whether a connected part of it shows something else out.
//! What hides a part without showing anything itself, such as a plain board, does not count as something else.

use super::likeness::{Bucket, CONTRADICTS, Smoothed, cells, shows};
use crate::points::agreement::{Agreement, Part, TABLE};

/// Cells along a side. Windows of two by two overlap by half: each is as large as a part of the table.
const CELLS: usize = 2 * TABLE;
/// Windows along a side.
const WINDOWS: usize = CELLS - 1;
/// Side of a block of windows, a quarter of the picture...
const BLOCK: usize = 4;
/// ... that shows something else where at least so many of its windows do. Measured on posters (docs/METHOD.md, "Points"): a
/// replaced quarter has 9 to 16, an untouched picture 2 or less in 95 of 100.
const MIN_DIFFERING: usize = 9;
/// With more cells of the block that show nothing where the icon does, it is hidden: the edge round a plain board is all
/// that differs.
const MAX_HIDDEN: usize = 4;

/// Where the icon shows nothing, the picture shows something else with slopes of more than this share of its mean.
const APPEARS_SHARE: f32 = 0.5;

/// Which windows of a picture show something else than the learnt icon, and which cells nothing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Differing {
    differs: [[bool; WINDOWS]; WINDOWS],
    is_hidden: [[bool; CELLS]; CELLS],
}

impl Differing {
    /// Compares `seen`, laid on `learnt`, with it. `None` where the icons are cut differently.
    pub(crate) fn new(seen: &Smoothed, learnt: &Smoothed) -> Option<Self> {
        let cells = cells(seen, learnt, CELLS)?;
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
        Some(Self { differs: std::array::from_fn(row), is_hidden: std::array::from_fn(cell_row) })
    }

    /// Most windows of a block that differ; of blocks that are not hidden.
    fn largest_block(&self) -> usize {
        let starts = || 0..=WINDOWS - BLOCK;
        let blocks = starts().flat_map(|y| starts().map(move |x| (x, y)));
        let is_seen = |(x, y): &(usize, usize)| count(&self.is_hidden, (*x, *y), BLOCK + 1) <= MAX_HIDDEN;
        blocks.filter(is_seen).map(|at| count(&self.differs, at, BLOCK)).max().unwrap_or(0)
    }

    /// Whether a connected part shows something else.
    pub(crate) fn has_part(&self) -> bool {
        self.largest_block() >= MIN_DIFFERING
    }

    /// Writes the parts that differ into what the points said.
    pub(crate) fn marked(&self, said: Agreement) -> Agreement {
        let differs = |x: usize, y: usize| self.differs[2 * y][2 * x];
        let part = |x: usize, y: usize| if differs(x, y) { Part::Disagrees } else { said.0[y][x] };
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
    use crate::icon::Icon;

    const SIZE: usize = 75;

    fn made(f: impl Fn(f64, f64) -> f64) -> Smoothed {
        let at = |i: usize| (i as f64 + 0.5) / SIZE as f64;
        let pixels = (0..SIZE * SIZE).map(|i| f(at(i % SIZE), at(i / SIZE)) as f32).collect();
        Smoothed::new(&Icon { size: SIZE, pixels, source_scale: 1.0 })
    }

    fn taught(x: f64, y: f64) -> f64 {
        120.0 + 50.0 * (19.0 * x + 9.0 * y * y).sin() + 40.0 * (17.0 * y - 14.0 * x).cos()
    }

    fn other(x: f64, y: f64) -> f64 {
        120.0 + 50.0 * (23.0 * y - 4.0 * x * x).sin() + 40.0 * (21.0 * x + 11.0 * y).sin()
    }

    fn with(part: impl Fn(f64, f64) -> Option<f64>) -> Differing {
        let seen = made(|x, y| part(x, y).unwrap_or(taught(x, y)));
        Differing::new(&seen, &made(taught)).unwrap()
    }

    #[test]
    fn a_replaced_quarter_is_found_wherever_it_is_and_named() {
        for (left, top) in [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5), (0.2, 0.3)] {
            let is_in = |x: f64, y: f64| x >= left && x < left + 0.5 && y >= top && y < top + 0.5;
            let differing = with(|x, y| is_in(x, y).then(|| other(x, y)));
            assert!(differing.has_part(), "{left} {top}: {differing:?}");
            let table = differing.marked(Agreement([[Part::Agrees; TABLE]; TABLE]));
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
    fn what_appears_where_the_icon_shows_nothing_is_something_else() {
        let half = |x: f64, y: f64| if x < 0.5 { taught(x, y) } else { 120.0 };
        let differs =
            |seen: &dyn Fn(f64, f64) -> f64| Differing::new(&made(seen), &made(half)).unwrap().has_part();
        assert!(differs(&|x, y| if x > 0.5 && y > 0.5 { other(x, y) } else { half(x, y) }));
        assert!(!differs(&half));
        // A shadow's edge across it.
        assert!(!differs(&|x, y| if x + 0.3 * y > 0.8 { 0.6 * half(x, y) } else { half(x, y) }));
    }

    #[test]
    fn the_taught_picture_differs_nowhere_in_any_light() {
        assert_eq!(with(|_, _| None).largest_block(), 0);
        assert_eq!(with(|x, y| Some(0.4 * taught(x, y) + 60.0 + 30.0 * x)).largest_block(), 0);
    }

    /// What hides a part shows an edge round it, and nothing else.
    #[test]
    fn a_plain_board_before_it_is_not_something_else() {
        for side in [0.3, 0.45, 0.6] {
            let is_hidden = |x: f64, y: f64| (x - 0.5).abs() < 0.5 * side && (y - 0.5).abs() < 0.5 * side;
            assert!(!with(|x, y| is_hidden(x, y).then_some(70.0)).has_part(), "{side}");
        }
    }

    #[test]
    fn a_line_of_other_letters_is_too_little() {
        let differing = with(|x, y| (y > 0.82 && y < 0.95).then(|| other(x, y)));
        assert!(!differing.has_part() && differing.largest_block() > 0, "{differing:?}");
    }
}
