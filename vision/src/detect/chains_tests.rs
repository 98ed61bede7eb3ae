use super::*;
use crate::{
    detect::{
        edges::{EdgeParams, edges},
        rendering::{polygon, rectangle},
    },
    frame::GrayImage,
};

fn found(image: &GrayImage, p: &ChainParams) -> Vec<EdgeChain> {
    chains(&edges(image, &EdgeParams::default()), p)
}

/// Successive points are neighbours, apart from bridged gaps, and the bright side stays on one hand.
fn check(chain: &EdgeChain, p: &ChainParams) {
    let reach = f64::from(p.max_gap_px) * 1.5 + 3.0;
    assert!(chain.points.len() >= p.min_points && chain.points.len() <= MAX_CHAIN_POINTS);
    for w in chain.points.windows(2) {
        assert!((w[1].position_px - w[0].position_px).norm() < reach, "{w:?}");
        assert!(w[0].gradient.dot(&w[1].gradient) > 0.0);
    }
}

#[test]
fn a_disc_is_one_closed_chain() {
    let disc: Vec<_> = (0..90)
        .map(|i| (f64::from(i) * 4.0).to_radians().sin_cos())
        .map(|(s, c)| Point2::new(40.0 + 25.0 * c, 35.0 + 25.0 * s))
        .collect();
    let image = polygon((80, 70), &disc, (180.0, 60.0), 1.0, 2);
    let p = ChainParams::default();
    let all = found(&image, &p);
    assert_eq!(all.len(), 1);
    assert!(all[0].closed);
    check(&all[0], &p);
    for e in &all[0].points {
        let radius = (e.position_px - Point2::new(40.0, 35.0)).norm();
        assert!((radius - 25.0).abs() < 0.5, "{radius}");
    }
}

#[test]
fn gaps_are_bridged_when_the_ends_agree() {
    // A horizontal step, with `gap` columns taken out of its edge.
    let lengths = |gap: usize, p: &ChainParams| {
        let image = GrayImage::from_fn(100, 40, |_, v| if v < 20 { 100 } else { 150 });
        let map = edges(&image, &EdgeParams::default()).without(|u, _| (50..50 + gap).contains(&u));
        chains(&map, p).iter().map(|c| c.points.len()).collect::<Vec<_>>()
    };
    let p = ChainParams::default();
    assert_eq!(lengths(2, &p), [94]);
    assert_eq!(lengths(3, &p), [48, 45]);
    assert_eq!(lengths(3, &ChainParams { max_gap_px: 3, ..p.clone() }), [93]);
    assert_eq!(lengths(1, &ChainParams { max_gap_px: 0, ..p }).len(), 2);
}

#[test]
fn corners_stay_inside_chains_and_short_chains_go() {
    let image = polygon((80, 60), &rectangle((40.0, 30.0), (40.0, 25.0), 0.3), (180.0, 60.0), 2.0, 2);
    let p = ChainParams::default();
    let all = found(&image, &p);
    let total: usize = all.iter().map(|c| c.points.len()).sum();
    assert!(all.len() <= 4 && total > 100, "{} chains, {total} points", all.len());
    for chain in &all {
        check(chain, &p);
    }
    assert!(found(&image, &ChainParams { min_points: 500, ..p }).is_empty());
}

#[test]
fn endless_edges_are_cut_at_the_bound() {
    // A ramp-like comb: one edge winds through the whole image.
    let image = GrayImage::from_fn(600, 400, |u, v| {
        let tooth = (u / 12) % 2 == 0;
        let inside = if tooth { v > 10 && v < 390 } else { v > 370 && v < 390 };
        if (10..590).contains(&u) && inside { 200 } else { 50 }
    });
    let p = ChainParams::default();
    let all = found(&image, &p);
    let total: usize = all.iter().map(|c| c.points.len()).sum();
    assert!(total > 3 * MAX_CHAIN_POINTS, "{total}");
    assert!(all.iter().any(|c| c.points.len() > MAX_CHAIN_POINTS / 2));
    for chain in &all {
        check(chain, &p);
    }
}
