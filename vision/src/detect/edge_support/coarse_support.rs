//! Coarse edge support of a quad proposal: the share of each side that an edge follows, and whether
//! all four have the same step. In: corners and gradient planes. Out: a number that ranks
//! proposals. `side_support` measures exactly.

use crate::detect::edge_support::{
    fixed_point::Fixed,
    gradients::Gradients,
    side_support::{CORNER_SHARE, scattered, share_along},
};
use nalgebra::{Point2, Vector2};

/// Samples along a side.
const SAMPLES: usize = 24;
/// Offsets across the side at which its edge is searched, in pixels, the likeliest first.
const OFFSETS: [i64; 5] = [0, -1, 1, -2, 2];
/// Factor on the rank of a seed whose sides' steps cancel out.
const MIXED_POLARITY: f64 = 0.4;

/// Edge support and polarity of a side.
struct SidePolarity {
    support: f64,
    /// Mean sign of the steps over all samples in the image, -1 to 1; positive where it is brighter
    /// outside.
    sign: f64,
}

/// Support of the worst side times the agreement of the four sides' polarities, both 0 to 1; none
/// if a side has less support than `least`. `first` is the side to begin with.
pub fn fit_of(
    g: &Gradients,
    corners_px: &[Point2<f64>; 4],
    first: usize,
    min_step: f64,
    least: f64,
) -> Option<f64> {
    let (mut worst, mut sign) = (1.0_f64, 0.0_f64);
    for i in (0..4).map(|i| (i + first) % 4) {
        let side = along_side(g, &corners_px[i], &corners_px[(i + 1) % 4], min_step as f32, least)?;
        worst = worst.min(side.support);
        sign += side.sign;
    }
    Some(worst * (MIXED_POLARITY + (1.0 - MIXED_POLARITY) * 0.25 * sign.abs()))
}

/// Measures one side; none with less support than `least`.
fn along_side(
    g: &Gradients,
    from: &Point2<f64>,
    to: &Point2<f64>,
    min_step: f32,
    least: f64,
) -> Option<SidePolarity> {
    let side = to - from;
    let length = side.norm();
    if length.is_nan() || length < 1.0 {
        return None;
    }
    let across = Vector2::new(side.y, -side.x) / length;
    let (normal, across) = (across.cast().into(), Fixed::step(&across));
    let stride = side * ((1.0 - 2.0 * CORNER_SHARE) / SAMPLES as f64);
    let (start, stride) = (Fixed::point(&(from + side * share_along(0, SAMPLES))), Fixed::step(&stride));
    let most_missed = ((1.0 - least) * SAMPLES as f64).max(0.0) as usize;
    let (mut in_image, mut with, mut sign) = (0_usize, 0_usize, 0.0_f64);
    for i in scattered(SAMPLES) {
        let foot = start.on(stride, i as i64);
        let step = |offset: &i64| g.step_following(foot.on(across, *offset), normal);
        if step(&0).is_none() {
            continue;
        }
        in_image += 1;
        if let Some(step) = OFFSETS.iter().filter_map(step).find(|s| s.abs() >= min_step) {
            with += 1;
            sign += f64::from(step.signum());
        } else if in_image - with > most_missed {
            return None;
        }
    }
    let support = with as f64 / in_image.max(1) as f64;
    (in_image > 0 && support >= least).then(|| SidePolarity { support, sign: sign / in_image as f64 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::{
            edges::edge_map::{EdgeParams, edges},
            tests::fixtures::render,
        },
        frame::GrayImage,
    };

    const CARD: [[f64; 2]; 4] = [[60.0, 40.0], [140.0, 48.0], [136.0, 120.0], [64.0, 116.0]];

    fn fit(image: &GrayImage, shift: f64) -> Option<f64> {
        let map = edges(image, &EdgeParams::default());
        let g = Gradients { image, gx: map.gx(), gy: map.gy() };
        let corners = CARD.map(|[x, y]| Point2::new(x + shift, y));
        let fits: Vec<_> = (0..4).map(|first| fit_of(&g, &corners, first, 4.0, 0.5)).collect();
        assert!(
            fits.windows(2).all(|w| (w[0].unwrap_or(-1.0) - w[1].unwrap_or(-1.0)).abs() < 1e-12),
            "{fits:?}"
        );
        fits[0]
    }

    #[test]
    fn equal_polarity_of_all_sides_ranks_highest() {
        let dark = fit(&render(200, 160, 200, &[(CARD, 60)]), 0.0).unwrap();
        let bright = fit(&render(200, 160, 60, &[(CARD, 200)]), 0.0).unwrap();
        assert!(dark > 0.95 && bright > 0.95, "{dark} {bright}");
        // A grey card before a wall that is dark on the left and bright on the right.
        let left = [[0.0, 0.0], [100.0, 0.0], [100.0, 160.0], [0.0, 160.0]];
        let mixed = fit(&render(200, 160, 240, &[(left, 20), (CARD, 130)]), 0.0).unwrap();
        assert!((0.3..0.6).contains(&mixed), "{mixed}");
    }

    #[test]
    fn a_side_without_an_edge_is_none() {
        let image = render(200, 160, 200, &[(CARD, 60)]);
        assert!(fit(&image, 2.0).is_some_and(|f| f > 0.9));
        assert_eq!(fit(&image, 8.0), None);
        // No support outside the image.
        assert_eq!(fit(&image, 500.0), None);
    }
}
