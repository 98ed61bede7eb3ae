//! The described keypoints of a frame and the points of a map in, places of landmarks in the frame
//! out.
//!
//! Each point of the frame votes for the landmarks of its nearest taught points (page 25). With the
//! place and scale of the taught point a vote says where that landmark lies and how large it is.
//! Votes that agree are a place, and an affine map that fits them gives its four corners.

use crate::points::{frame_points::FramePoint, index::PointIndex};
use nalgebra::{Matrix3, Vector3};

/// Fewest votes at different places of a landmark.
pub const MIN_SUPPORT: usize = 5;
/// Most votes for a landmark, the clearest first.
const MAX_VOTES: usize = 200;
/// Bounds of the smaller side of a landmark, work pixels.
const SIDE_PX: [f32; 2] = [24.0, 1000.0];
/// Votes agree whose centres differ by less than this share of the landmark...
const NEAR: f32 = 0.25;
/// ... and whose sizes by less than this factor.
const SCALE: f32 = 1.6;
/// Votes of taught points closer than this, in landmark units, count once.
const APART: f32 = 0.03;
/// Largest residuals of a vote with the affine map, as shares of the landmark's size, one for each
/// refit.
const TOLERANCES: [f64; 3] = [0.2, 0.12, 0.08];
/// Fewest votes of a refit.
const MIN_FITTED: usize = 6;
/// Weight of the mean size beside the votes in a refit, squared landmark units: it decides where
/// they lie in a line.
const PRIOR: f64 = 0.3;

/// Where a landmark may be.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Index of the model in the map's [`PointIndex`].
    pub model: usize,
    /// Work pixels of the landmark's corners: TL, TR, BR, BL.
    pub corners_px: [[f64; 2]; 4],
    /// Votes at different places of the landmark.
    pub support: usize,
    /// The sum of their weights.
    pub weight: u32,
}

/// A vote for a landmark.
#[derive(Debug, Clone, Copy)]
struct Vote {
    /// Where its centre would be, and its width and height, work pixels.
    centre_px: [f32; 2],
    size_px: [f32; 2],
    weight: u32,
    /// The taught point, landmark units, and the frame's, work pixels.
    at: [f32; 2],
    at_px: [f32; 2],
}

/// The best place of each of the first `models` landmarks of `index` that has one, the best
/// supported first.
pub fn frame_places(points: &[FramePoint], index: &PointIndex, models: usize) -> Vec<Place> {
    let mut votes: Vec<Vec<Vote>> = vec![Vec::new(); models];
    for point in points {
        for near in index.nearest(&point.descriptor) {
            let Some(votes) = votes.get_mut(near.model) else { continue };
            let size_px = point.sigma_px.map(|sigma| sigma / near.sigma);
            if (SIDE_PX[0]..=SIDE_PX[1]).contains(&size_px[0].min(size_px[1])) {
                let centre_px = std::array::from_fn(|i| point.at_px[i] + (0.5 - near.at[i]) * size_px[i]);
                let (weight, at, at_px) = (near.weight, near.at, point.at_px);
                votes.push(Vote { centre_px, size_px, weight, at, at_px });
            }
        }
    }
    let of = |(model, mut votes): (usize, Vec<Vote>)| {
        votes.sort_by_key(|vote| std::cmp::Reverse(vote.weight));
        votes.truncate(MAX_VOTES);
        best_place(model, &votes)
    };
    let mut found: Vec<Place> = votes.into_iter().enumerate().filter_map(of).collect();
    found.sort_by(|a, b| (b.support, b.weight, a.model).cmp(&(a.support, a.weight, b.model)));
    found
}

/// The place that most of `votes` agree on.
fn best_place(model: usize, votes: &[Vote]) -> Option<Place> {
    if votes.len() < MIN_SUPPORT {
        return None;
    }
    let mut best: Option<((usize, u32), &Vote)> = None;
    for seed in votes {
        let support = support(votes, seed);
        if best.is_none_or(|(most, _)| support > most) {
            best = Some((support, seed));
        }
    }
    let ((support, weight), seed) = best.filter(|((support, _), _)| *support >= MIN_SUPPORT)?;
    let agreeing: Vec<&Vote> = votes.iter().filter(|vote| agree(seed, vote)).collect();
    let corners_px = corners(&agreeing)?;
    Some(Place { model, corners_px, support, weight })
}

fn agree(a: &Vote, b: &Vote) -> bool {
    (0..2).all(|i| {
        (a.centre_px[i] - b.centre_px[i]).abs() < NEAR * a.size_px[i]
            && a.size_px[i] < SCALE * b.size_px[i]
            && b.size_px[i] < SCALE * a.size_px[i]
    })
}

/// How many votes agree with `seed` from different places of the landmark, and the sum of their
/// weights.
fn support(votes: &[Vote], seed: &Vote) -> (usize, u32) {
    let mut places: Vec<[f32; 2]> = Vec::new();
    let mut weight = 0;
    for vote in votes.iter().filter(|vote| agree(seed, vote)) {
        let is_new = |p: &[f32; 2]| (p[0] - vote.at[0]).abs() > APART || (p[1] - vote.at[1]).abs() > APART;
        if places.iter().all(is_new) {
            places.push(vote.at);
            weight += vote.weight;
        }
    }
    (places.len(), weight)
}

/// The landmark's corners by the affine map that fits `votes`, beginning with their mean place and
/// size.
fn corners(votes: &[&Vote]) -> Option<[[f64; 2]; 4]> {
    let count = votes.len() as f64;
    let mean = |of: &dyn Fn(&Vote) -> f32| votes.iter().map(|v| f64::from(of(v))).sum::<f64>() / count;
    let size: [f64; 2] = std::array::from_fn(|i| mean(&|v| v.size_px[i].ln()).exp());
    let corner: [f64; 2] = std::array::from_fn(|i| mean(&|v| v.centre_px[i]) - 0.5 * size[i]);
    let plain = [Vector3::new(size[0], 0.0, 0.0), Vector3::new(0.0, size[1], 0.0)];
    let mut map: [Vector3<f64>; 2] = std::array::from_fn(|i| plain[i] + Vector3::z() * corner[i]);
    let place = |vote: &Vote| Vector3::new(f64::from(vote.at[0]), f64::from(vote.at[1]), 1.0);
    let scale = (size[0] * size[1]).sqrt();
    for tolerance in TOLERANCES {
        let off_px = |vote: &Vote| {
            let [x, y]: [f64; 2] =
                std::array::from_fn(|i| map[i].dot(&place(vote)) - f64::from(vote.at_px[i]));
            x.hypot(y)
        };
        let kept: Vec<&&Vote> = votes.iter().filter(|vote| off_px(vote) < tolerance * scale).collect();
        if kept.len() < MIN_FITTED {
            break;
        }
        let prior = Matrix3::from_diagonal(&Vector3::new(PRIOR, PRIOR, 0.0));
        let mut normal = prior;
        let mut right = plain.map(|axis| prior * axis);
        for vote in kept {
            let at = place(vote);
            normal += at * at.transpose();
            for (right, px) in right.iter_mut().zip(vote.at_px) {
                *right += at * f64::from(px);
            }
        }
        let inverse = normal.try_inverse()?;
        map = right.map(|right| inverse * right);
    }
    let at = |u: f64, v: f64| map.map(|row| row.dot(&Vector3::new(u, v, 1.0)));
    Some([at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)])
}

#[cfg(test)]
mod tests;
