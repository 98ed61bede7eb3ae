//! Snaps every side of a quad to the line beside it that is most likely its border. A shadow under
//! a frame, the inner edge of a mat and the edge of the picture next to it all look like sides. A
//! small network scores the features of each line. In: corners. Out: corners on the likeliest
//! lines, with their measurements.
//!
//! Departs from method 3.6, which refits a side on the nearest edge only. See
//! docs/method/24-default-detector.md.

use crate::detect::{
    border_model::{
        network::Network,
        side_features::{
            BAND_FEATURES, CornerNeighbours, LogGreyLevels, SIDE_FEATURES, SideMeasurement, Sides, joined,
            meet_all,
        },
    },
    edge_support::gradients::Gradients,
};
use nalgebra::Point2;

/// Rounds in which every side is chosen given the other three.
const ROUNDS: usize = 2;

/// A line beside a side with its features.
#[derive(Debug, Clone, PartialEq)]
pub struct SideCandidate {
    /// Its ends, beside the ends of the side.
    pub ends_px: [Point2<f64>; 2],
    /// See [`choose_sides`].
    pub features: [f64; SIDE_FEATURES],
}

/// A quad with its sides on the likeliest lines.
#[derive(Debug, Clone, PartialEq)]
pub struct SnappedSides {
    /// Corners in the order of the sides.
    pub corners_px: [Point2<f64>; 4],
    /// Features of each side's line; all 0 for a side without a line.
    pub sides: [SideMeasurement; 4],
    /// The same of the lines nearest to the sides before the choice.
    pub nearest: [SideMeasurement; 4],
}

/// Moves every side of a quad, clockwise on screen, to the line beside it that looks most like the
/// border of an object. None if no side has a line, or if the chosen lines do not meet in corners.
pub fn choose_sides(g: &Gradients, corners: &[Point2<f64>; 4], model: &Network) -> Option<SnappedSides> {
    let sides = Sides::new(g, corners);
    let known: [Vec<([f64; BAND_FEATURES], LogGreyLevels)>; 4] =
        std::array::from_fn(|i| (0..sides.lines(i).len()).map(|j| sides.band_features(i, j)).collect());
    let mut chosen: [Option<usize>; 4] = std::array::from_fn(|i| sides.nearest(i));
    if chosen.iter().all(Option::is_none) {
        return None;
    }
    let mut met = sides.met(&chosen, None);
    let measure = |met: &CornerNeighbours, lines: &[Option<usize>; 4]| {
        let of_line = |i: usize, j: usize| SideMeasurement {
            features: joined(&known[i][j].0, &sides.corner_features(i, j, &met[i])),
            tones: known[i][j].1,
        };
        std::array::from_fn(|i| lines[i].map_or_else(SideMeasurement::default, |j| of_line(i, j)))
    };
    let nearest = measure(&met, &chosen);
    let mut changed = [true; 4];
    for _ in 0..ROUNDS {
        let before = chosen;
        // Beside unchanged neighbours the same line is the likeliest.
        for i in (0..4).filter(|i| changed[(i + 1) % 4] || changed[(i + 3) % 4]) {
            let weigh =
                |j: usize| model.output(&joined(&known[i][j].0, &sides.corner_features(i, j, &met[i])));
            let weights: Vec<f64> = (0..known[i].len()).map(weigh).collect();
            chosen[i] = (0..weights.len()).max_by(|a, b| weights[*a].total_cmp(&weights[*b]).then(b.cmp(a)));
        }
        if chosen == before {
            break;
        }
        changed = std::array::from_fn(|i| chosen[i] != before[i]);
        met = sides.met(&chosen, Some((&met, &changed)));
    }
    Some(SnappedSides { corners_px: meet_all(&sides.ends(&chosen))?, sides: measure(&met, &chosen), nearest })
}

/// The lines beside every side with their features, the corners made with the lines nearest to the
/// other sides: training data of the model.
pub fn side_candidates(g: &Gradients, corners: &[Point2<f64>; 4]) -> [Vec<SideCandidate>; 4] {
    let sides = Sides::new(g, corners);
    let met = sides.met(&std::array::from_fn(|i| sides.nearest(i)), None);
    std::array::from_fn(|i| {
        (0..sides.lines(i).len())
            .map(|j| {
                let features = joined(&sides.band_features(i, j).0, &sides.corner_features(i, j, &met[i]));
                SideCandidate { ends_px: sides.line_ends(i, j), features }
            })
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detect::{
        edges::edge_map::{EdgeParams, edges},
        params::QuadParams,
        tests::fixtures::render,
    };
    use crate::frame::GrayImage;

    const PICTURE: [[f64; 2]; 4] = [[100.0, 80.0], [300.0, 80.0], [300.0, 240.0], [100.0, 240.0]];

    #[test]
    fn the_shadow_under_a_picture_is_not_its_side() {
        // A lamp above: the wall under the picture is at six tenths, down to 20 px below it, with a
        // penumbra of 12 px.
        let is_in = |[left, top, right, bottom]: [f64; 4], x: f64, y: f64| {
            (left..right).contains(&x) && (top..bottom).contains(&y)
        };
        let image = GrayImage::from_fn(420, 340, |u, v| {
            let (x, y) = (u as f64 + 0.5, v as f64 + 0.5);
            if is_in([125.5, 105.5, 275.5, 215.5], x, y) {
                return 170;
            }
            if is_in([100.5, 80.5, 300.5, 240.5], x, y) {
                return 50;
            }
            let depth_px = (x - 102.5).min(298.5 - x).min(260.5 - y);
            let share = if y < 95.5 { 0.0 } else { (0.5 + depth_px / 12.0).clamp(0.0, 1.0) };
            (200.0 - 80.0 * share) as u8
        });
        let map = edges(&image, &EdgeParams::default());
        let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
        let with_shadow = [[100.0, 80.0], [300.0, 80.0], [300.0, 260.0], [100.0, 260.0]].map(Point2::from);
        let chosen = choose_sides(&g, &with_shadow, QuadParams::default().side_network()).unwrap();
        // Pixels belong to the picture from 100 to 299, so that its border is half a pixel further
        // out.
        for (found, [u, v]) in chosen.corners_px.iter().zip(PICTURE) {
            let wanted = Point2::new(u - 0.5, v - 0.5);
            assert!((found - wanted).norm() < 0.5, "{:?}", chosen.corners_px);
        }
    }

    #[test]
    fn a_side_without_lines_is_none() {
        let image = render(200, 200, 128, &[]);
        let map = edges(&image, &EdgeParams::default());
        let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
        let quad = [[50.0, 50.0], [150.0, 50.0], [150.0, 150.0], [50.0, 150.0]].map(Point2::from);
        assert!(choose_sides(&g, &quad, QuadParams::default().side_network()).is_none());
        assert!(side_candidates(&g, &quad).iter().all(Vec::is_empty));
    }
}
