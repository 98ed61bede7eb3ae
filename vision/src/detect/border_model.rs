//! How much a quad looks like the border of a thing on a wall, as a rank among rivals. A few measurements along its sides
//! go in; their weights were fitted on labelled photographs (`waymark fit border`, see `fitting`). The paper's assumption is in it:
//! outside a landmark the background is uniform, and a border is alike on all its sides, which a shadow or the hybrid
//! of an inner and an outer border is not.
//!
//! Departs from method 3.6, whose score (similarity times support) says nothing of what lies beside a border.

use super::{
    corners::RefinedQuad,
    evidence::{Gradients, edge_between, level_beside, roughness},
};
use serde::{Deserialize, Serialize};

/// Number of measurements.
pub const FEATURES: usize = 23;
/// Where grey levels beside a side are read, clear of the edge itself.
const BESIDE_PX: f64 = 4.0;
/// A second line further out, for roughness.
const FURTHER_PX: f64 = 8.0;
/// Gradient above which a spot is not plain, grey levels.
const PLAIN_STEP: f64 = 6.0;

/// Measurements of a quad, each of order one: 0 smallest and 1 mean side support, 2 mean agreement of the edge's
/// sign, 3 log of the mean side over the image diagonal, 4 weakest over mean side strength, 5 log of mean strength,
/// 6 mean and 7 largest roughness outside, 8 mean roughness inside, 9 weakest over mean difference of grey across a
/// side, 10 largest deviation of a side's inside grey from the others, 11 the same outside, 12 how alike the signs of
/// the differences are; then, per side, the strongest parallel edge as a share of the side's own, 3 to 10 px outside (13
/// mean, 14 largest), 10 to 32 px outside (15, 16), 3 to 10 px inside (17 mean, 18 smallest, 21 largest) and 10 to 32
/// px inside (19, 20, 22).
pub fn border_features(q: &RefinedQuad, g: &Gradients) -> [f64; FEATURES] {
    let corners = q.corners_px.points();
    let side = |i: usize| (&corners[i], &corners[(i + 1) % 4]);
    let mean = |v: [f64; 4]| v.iter().sum::<f64>() / 4.0;
    let min = |v: [f64; 4]| v.into_iter().fold(f64::INFINITY, f64::min);
    let max = |v: [f64; 4]| v.into_iter().fold(f64::NEG_INFINITY, f64::max);
    let support = q.support();
    let strength: [f64; 4] = std::array::from_fn(|i| q.sides[i].strength);
    let level = |i, offset| level_beside(g, side(i).0, side(i).1, offset).unwrap_or(128.0);
    let outside: [f64; 4] = std::array::from_fn(|i| level(i, BESIDE_PX));
    let inside: [f64; 4] = std::array::from_fn(|i| level(i, -BESIDE_PX));
    let difference: [f64; 4] = std::array::from_fn(|i| inside[i] - outside[i]);
    let rough = |sign: f64| -> [f64; 4] {
        std::array::from_fn(|i| {
            let (a, b) = side(i);
            let at = |offset| roughness(g, a, b, offset, PLAIN_STEP);
            f64::midpoint(at(sign * BESIDE_PX), at(sign * FURTHER_PX))
        })
    };
    let (rough_out, rough_in) = (rough(1.0), rough(-1.0));
    let length = mean(std::array::from_fn(|i| (side(i).1 - side(i).0).norm()));
    let diagonal = ((g.width() * g.width() + g.height() * g.height()) as f64).sqrt();
    let size = difference.map(f64::abs);
    let parallel = |range: (i32, i32)| -> [f64; 4] {
        std::array::from_fn(|i| edge_between(g, side(i), range, strength[i]))
    };
    let (near_out, far_out) = (parallel((3, 10)), parallel((10, 32)));
    let (near_in, far_in) = (parallel((-9, -2)), parallel((-31, -9)));
    [
        min(support),
        mean(support),
        mean(std::array::from_fn(|i| q.sides[i].agreement)),
        (length / diagonal).ln(),
        min(strength) / mean(strength).max(1.0),
        mean(strength).max(1.0).ln(),
        mean(rough_out),
        max(rough_out),
        mean(rough_in),
        min(size) / mean(size).max(1.0),
        odd_one(inside) / 50.0,
        odd_one(outside) / 50.0,
        difference.iter().map(|d| d.signum()).sum::<f64>().abs() / 4.0,
        mean(near_out),
        max(near_out),
        mean(far_out),
        max(far_out),
        mean(near_in),
        min(near_in),
        mean(far_in),
        min(far_in),
        max(near_in),
        max(far_in),
    ]
}

/// How far the oddest value lies from the middle of all four.
fn odd_one(mut v: [f64; 4]) -> f64 {
    v.sort_by(f64::total_cmp);
    let middle = f64::midpoint(v[1], v[2]);
    (v[3] - middle).max(middle - v[0])
}

/// A linear model of the features.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BorderModel {
    /// Weight of each feature.
    pub weights: [f64; FEATURES],
}

impl BorderModel {
    /// The higher, the more the quad looks like the outer border of a thing, next to others of the same thing. Means
    /// nothing for a quad alone: it grows with size.
    pub fn rank(&self, features: &[f64; FEATURES]) -> f64 {
        features.iter().zip(&self.weights).map(|(f, w)| f * w).sum()
    }
}

/// Fitted on the candidates of 107 wall photographs of framed paintings: conditional logit of the candidate nearest to
/// the label against the others of the same painting, ridge 1.
impl Default for BorderModel {
    fn default() -> Self {
        Self {
            weights: [
                -1.8826, 17.7406, 0.1413, 3.0423, -1.0152, 0.0203, -0.4339, 0.7283, -1.6644, 0.2075, -0.1394,
                0.0087, 0.3684, -1.9509, 0.4958, -2.6324, 0.5605, 1.3616, 1.1657, -0.3242, 1.947, -0.493,
                -1.0172,
            ],
        }
    }
}
