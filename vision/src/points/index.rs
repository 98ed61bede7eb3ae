//! The points of all landmarks of a map, by word: a patch's points vote for landmarks without being
//! compared with all of them. Half of each descriptor is kept here, enough for votes.

use crate::points::{
    descriptor::Descriptor,
    point::Point,
    taught::{TaughtPoint, scale_of_step, scale_step},
    vocabulary::{VOCABULARY, words},
};
use fearless_simd::{Level, dispatch};

/// Words that are searched for a point.
const PROBES: usize = 6;
/// Steps of a place in a landmark unit.
const PLACES: f32 = 255.0;
/// Largest difference of place along an axis that votes, in landmark units.
const REACH: f32 = 0.22;
/// Largest difference of scale that votes, in steps of the stored one: a ratio of 1.7.
const MAX_SCALE_STEPS: u8 = 18;
/// Largest distance of half descriptors that votes.
const MAX_DISTANCE: u32 = 37;
/// Points of a patch that vote, the strongest first.
pub const MAX_VOTERS: usize = 100;

/// Landmarks that a point of a patch votes for.
const NEIGHBOURS: usize = 8;

/// One landmark's point in the index.
#[derive(Debug, Clone, Copy)]
struct Entry {
    half: [u64; 2],
    model: u32,
    at: [u8; 2],
    sigma: u8,
}

/// A taught point near a descriptor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Neighbour {
    /// Index of its model.
    pub model: usize,
    /// How much nearer it is than the next landmark's, at least 1.
    pub weight: u32,
    /// Its place on the landmark, landmark units.
    pub at: [f32; 2],
    /// Its scale, landmark units.
    pub sigma: f32,
}

/// Points by word, in each by their place from the top.
#[derive(Debug, Clone, Default)]
pub struct PointIndex {
    entries: Vec<Entry>,
    /// Where each word begins; one more than there are words.
    starts: Vec<u32>,
    models: usize,
}

fn steps(at: f32) -> u8 {
    (at.clamp(0.0, 1.0) * PLACES).round() as u8
}

impl PointIndex {
    /// Indexes the points of models, in their order.
    pub fn new<'a>(models: impl ExactSizeIterator<Item = &'a [TaughtPoint]>) -> Self {
        let count = models.len();
        let mut all: Vec<(u16, Entry)> = Vec::new();
        for (model, points) in (0_u32..).zip(models) {
            all.extend(points.iter().map(|p| {
                let at = p.point().at.map(steps);
                (p.word(), Entry { half: p.descriptor.half(), model, at, sigma: p.scale_step() })
            }));
        }
        if all.is_empty() {
            return Self { models: count, ..Self::default() };
        }
        all.sort_unstable_by_key(|(word, e)| (*word, e.at[1], e.model, e.at[0], e.sigma, e.half));
        let mut starts = vec![0_u32; VOCABULARY + 1];
        for (word, _) in &all {
            starts[usize::from(*word) + 1] += 1;
        }
        for i in 0..VOCABULARY {
            starts[i + 1] += starts[i];
        }
        Self { entries: all.into_iter().map(|(_, e)| e).collect(), starts, models: count }
    }

    /// No points at all.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Its memory, bytes.
    pub fn memory_bytes(&self) -> usize {
        self.entries.len() * size_of::<Entry>() + self.starts.len() * size_of::<u32>()
    }

    /// The `count` models with most votes of `points`, most first, of equal ones the lower index;
    /// those with less than `least` are left out. Each with its votes: a point votes for the
    /// landmarks of its nearest neighbours, weighted by how much nearer they are than the next
    /// landmark's: texture of many landmarks has little weight, but not zero, since more landmarks
    /// may have the same picture.
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

    /// The nearest taught points of at most eight landmarks, one of each, wherever they are on it:
    /// for points of which nobody knows where on a landmark they would be.
    pub fn nearest(&self, descriptor: &Descriptor) -> Vec<Neighbour> {
        if self.is_empty() {
            return Vec::new();
        }
        let nearest = dispatch!(Level::new(), _s => self.nearest_anywhere(descriptor));
        let common = nearest[NEIGHBOURS].0;
        let of = |(d, model, entry): (u32, u32, u32)| {
            let entry = self.entries.get(entry as usize)?;
            let at = entry.at.map(|at| f32::from(at) / PLACES);
            Some(Neighbour {
                model: model as usize,
                weight: (common - d).max(1),
                at,
                sigma: scale_of_step(entry.sigma),
            })
        };
        nearest.into_iter().take(NEIGHBOURS).filter_map(of).collect()
    }

    /// Distance, model and index of the entry.
    #[expect(clippy::inline_always, reason = "as below")]
    #[inline(always)]
    fn nearest_anywhere(&self, descriptor: &Descriptor) -> [(u32, u32, u32); NEIGHBOURS + 1] {
        let mut nearest = [(2 * MAX_DISTANCE + 1, u32::MAX, u32::MAX); NEIGHBOURS + 1];
        let half = descriptor.half();
        for word in words::<PROBES>(descriptor).map(usize::from) {
            for i in self.starts[word]..self.starts[word + 1] {
                let entry = &self.entries[i as usize];
                let d = 2 * half.iter().zip(&entry.half).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
                if d >= nearest[NEIGHBOURS].0 {
                    continue;
                }
                let at = nearest.iter().position(|(_, m, _)| *m == entry.model).unwrap_or(NEIGHBOURS);
                if nearest[at].0 <= d {
                    continue;
                }
                nearest[at] = (d, entry.model, i);
                nearest[..=at].sort_unstable_by_key(|(d, ..)| *d);
            }
        }
        nearest
    }

    #[expect(
        clippy::inline_always,
        reason = "an instruction set holds only in what is inlined where it was chosen"
    )]
    #[inline(always)]
    fn votes(&self, points: &[Point]) -> Vec<u32> {
        let mut votes = vec![0_u32; self.models];
        for point in points.iter().take(MAX_VOTERS) {
            let mut nearest = [(2 * MAX_DISTANCE + 1, u32::MAX); NEIGHBOURS + 1];
            let half = point.descriptor.half();
            let [left, top] = point.at.map(|a| steps(a - REACH));
            let [right, bottom] = point.at.map(|a| steps(a + REACH));
            let sigma = scale_step(point.sigma);
            let scales = sigma.saturating_sub(MAX_SCALE_STEPS)..=sigma.saturating_add(MAX_SCALE_STEPS);
            for word in words::<PROBES>(&point.descriptor) {
                let word = usize::from(word);
                let all = &self.entries[self.starts[word] as usize..self.starts[word + 1] as usize];
                let all = &all[all.partition_point(|e| e.at[1] < top)..];
                for entry in all.iter().take_while(|e| e.at[1] <= bottom) {
                    let near = u8::from(entry.at[0] >= left)
                        & u8::from(entry.at[0] <= right)
                        & u8::from(scales.contains(&entry.sigma));
                    if near == 0 {
                        continue;
                    }
                    let d = 2 * half.iter().zip(&entry.half).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
                    if d < nearest[NEIGHBOURS].0 {
                        insert(&mut nearest, d, entry.model);
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
