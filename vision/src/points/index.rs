//! The points of all landmarks of a map, by word and place: a patch's points vote for landmarks without being compared with
//! every one of theirs.

use super::{
    Point,
    taught::TaughtPoint,
    vocabulary::{VOCABULARY, words},
};
use fearless_simd::{Level, dispatch};

/// Cells along a side of the landmark.
const CELLS: usize = 8;
const PROBES: usize = 3;
/// Largest difference of place along an axis that votes, in landmark units.
const REACH: f32 = 0.22;
/// Largest ratio of scales that votes.
const MAX_SCALE: f32 = 1.7;
/// Largest descriptor distance that votes.
const MAX_DISTANCE: u32 = 75;
/// Points of a patch that vote, the strongest first.
pub const MAX_VOTERS: usize = 100;

/// Landmarks that a point of a patch votes for.
const NEIGHBOURS: usize = 8;

/// One landmark's point in the index.
#[derive(Debug, Clone, Copy)]
struct Entry {
    point: Point,
    model: u32,
}

/// Points by word and cell.
#[derive(Debug, Clone, Default)]
pub struct PointIndex {
    entries: Vec<Entry>,
    /// Where each bin begins; one more than there are bins.
    starts: Vec<u32>,
    models: usize,
}

/// The bin of a word and a cell.
fn bin(word: u8, column: usize, row: usize) -> usize {
    (usize::from(word) * CELLS + row) * CELLS + column
}

fn cell(at: f32) -> usize {
    ((at * CELLS as f32).max(0.0) as usize).min(CELLS - 1)
}

impl PointIndex {
    /// Indexes the points of models, in their order.
    pub fn new<'a>(models: impl ExactSizeIterator<Item = &'a [TaughtPoint]>) -> Self {
        let count = models.len();
        let mut all: Vec<(usize, Entry)> = Vec::new();
        for (model, points) in (0_u32..).zip(models) {
            for taught in points {
                let point = taught.point();
                let [word] = words::<1>(&point.descriptor);
                all.push((bin(word, cell(point.at[0]), cell(point.at[1])), Entry { point, model }));
            }
        }
        all.sort_by_key(|(bin, entry)| (*bin, entry.model));
        let bins = VOCABULARY * CELLS * CELLS;
        let mut starts = vec![0_u32; bins + 1];
        for (bin, _) in &all {
            starts[bin + 1] += 1;
        }
        for i in 0..bins {
            starts[i + 1] += starts[i];
        }
        Self { entries: all.into_iter().map(|(_, e)| e).collect(), starts, models: count }
    }

    /// No points at all.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Memory that it takes, in bytes.
    pub fn memory_bytes(&self) -> usize {
        self.entries.len() * size_of::<Entry>() + self.starts.len() * size_of::<u32>()
    }

    /// The `count` models with most votes of `points`, most first, of equal ones the lower index; those with less than
    /// `least` are left out. Each with its votes: a point votes for the landmarks of its nearest neighbours, by how much
    /// nearer they are than the next landmark's, so that what many landmarks show counts for little, but never for nothing:
    /// more landmarks than that may have the same picture.
    pub fn vote(&self, points: &[Point], count: usize, least: u32) -> Vec<(usize, u32)> {
        if self.is_empty() {
            return Vec::new();
        }
        let votes = dispatch!(Level::new(), _s => self.votes(points));
        let mut best: Vec<(usize, u32)> =
            votes.into_iter().enumerate().filter(|(_, votes)| *votes >= least).collect();
        best.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
        best.truncate(count);
        best
    }

    #[expect(
        clippy::inline_always,
        reason = "an instruction set holds only in what is inlined where it was chosen"
    )]
    #[inline(always)]
    fn votes(&self, points: &[Point]) -> Vec<u32> {
        let mut votes = vec![0_u32; self.models];
        for point in points.iter().take(MAX_VOTERS) {
            let mut nearest = [(MAX_DISTANCE, u32::MAX); NEIGHBOURS + 1];
            let [low, high] = [-REACH, REACH].map(|r| point.at.map(|a| cell(a + r)));
            for word in words::<PROBES>(&point.descriptor) {
                for row in low[1]..=high[1] {
                    let from = self.starts[bin(word, low[0], row)] as usize;
                    let to = self.starts[bin(word, high[0], row) + 1] as usize;
                    for entry in &self.entries[from..to] {
                        let other = &entry.point;
                        let near = (other.at[0] - point.at[0]).abs() < REACH
                            && (other.at[1] - point.at[1]).abs() < REACH
                            && other.sigma < MAX_SCALE * point.sigma
                            && point.sigma < MAX_SCALE * other.sigma;
                        if near {
                            let d = other.descriptor.distance(&point.descriptor);
                            if d < nearest[NEIGHBOURS].0 {
                                insert(&mut nearest, d, entry.model);
                            }
                        }
                    }
                }
            }
            let common = nearest[NEIGHBOURS].0;
            for (d, model) in nearest.into_iter().take(NEIGHBOURS).filter(|(_, model)| *model != u32::MAX) {
                votes[model as usize] += (common - d).max(1);
            }
        }
        votes
    }
}

/// Keeps the nearest, each model once, rising.
#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn insert(nearest: &mut [(u32, u32); NEIGHBOURS + 1], d: u32, model: u32) {
    let at = nearest.iter().position(|(_, m)| *m == model).unwrap_or(NEIGHBOURS);
    if nearest[at].0 <= d && at < NEIGHBOURS {
        return;
    }
    let mut i = at;
    while i > 0 && nearest[i - 1].0 > d {
        nearest[i] = nearest[i - 1];
        i -= 1;
    }
    nearest[i] = (d, model);
}
