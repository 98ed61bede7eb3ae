use super::*;
use crate::{
    detect::edges::edge_map::{EdgeParams, edges},
    frame::GrayImage,
    random::Random,
};

/// Blocks of noise, on a wall that is brighter to the right.
fn patches() -> GrayImage {
    let mut random = Random::new(5);
    GrayImage::from_fn(160, 120, |u, v| {
        let noise = if (u / 20 + v / 20) % 2 == 0 { 90.0 * random.unit() } else { 0.0 };
        (u as f64 + noise) as u8
    })
}

const QUAD: [[f64; 2]; 4] = [[30.0, 20.0], [130.0, 26.0], [124.0, 100.0], [36.0, 96.0]];

#[test]
fn the_level_of_a_strip_is_its_median() {
    let image = patches();
    let map = edges(&image, &EdgeParams::default());
    let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
    let mut compared = 0;
    for i in 0..4 {
        let [from, to] = [i, (i + 1) % 4].map(|i| Point2::from(QUAD[i]));
        let band = Band::new(&g, &from, &to, 80.0).unwrap();
        let line = SideLine { offset_px: 0.0, slope_px: 1.5, support: 1.0, sign: 1.0, step: 1.0 };
        let along = band.along_line(&line);
        for range in [(-9.0, -1.0), (1.5, 5.0), (6.0, 15.0), (0.0, 30.0), (0.2, 0.3)] {
            let mut all = Vec::new();
            along.levels(range, |levels| all.extend_from_slice(levels));
            all.sort_unstable();
            let median = (all.len() > MIN_STRIP_PIXELS).then(|| f64::from(all[all.len() / 2]));
            assert_eq!(level(&along, range), median, "{range:?}");
            compared += usize::from(median.is_some());
        }
    }
    assert!(compared > 12, "{compared}");
}

#[test]
fn what_is_met_is_the_same_when_only_changes_are_measured() {
    let image = patches();
    let map = edges(&image, &EdgeParams::default());
    let g = Gradients { image: &image, gx: map.gx(), gy: map.gy() };
    let sides = Sides::new(&g, &QUAD.map(Point2::from));
    let first: [_; 4] = std::array::from_fn(|i| sides.nearest(i));
    let met = sides.met(&first, None);
    let mut others = 0;
    for i in 0..4 {
        for line in 0..sides.lines(i).len() {
            let mut chosen = first;
            chosen[i] = Some(line);
            let changed = std::array::from_fn(|i| chosen[i] != first[i]);
            assert_eq!(sides.met(&chosen, Some((&met, &changed))), sides.met(&chosen, None));
            others += usize::from(sides.met(&chosen, None) != met);
        }
    }
    assert!(others > 4, "{others} other lines");
}
