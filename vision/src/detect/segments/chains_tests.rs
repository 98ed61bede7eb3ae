use super::*;
use crate::{
    detect::{
        edges::edge_map::{EdgeParams, edges},
        tests::rendering::{flipped, polygon, quarter_turned, rectangle},
    },
    frame::GrayImage,
};

fn found(image: &GrayImage, p: &ChainParams) -> Vec<EdgeChain> {
    chains(&edges(image, &EdgeParams::default()), p)
}

/// Successive points are neighbours, apart from bridged gaps, and the bright side stays on one
/// hand.
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
fn chains_contain_corners_and_short_chains_are_dropped() {
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
fn long_edges_are_split_at_the_bound() {
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

type Map<'a> = &'a dyn Fn(Point2<f64>) -> Point2<f64>;

/// Share of the points of `a`, mapped, that lie within a tenth of a pixel of a point of `b`.
fn shared(a: &[EdgeChain], b: &[EdgeChain], map: Map) -> f64 {
    let all = |chains: &[EdgeChain]| -> Vec<_> {
        chains.iter().flat_map(|c| c.points.iter().map(|e| e.position_px)).collect()
    };
    let (a, b) = (all(a), all(b));
    let near = |p: &&Point2<f64>| b.iter().any(|q| (map(**p) - q).norm() < 0.1);
    a.iter().filter(near).count() as f64 / a.len() as f64
}

/// Lengths and kinds of the chains, to a pixel or two: which pixel of a junction or a staircase
/// stays depends on how the image lies.
fn same_lengths(a: &[EdgeChain], b: &[EdgeChain]) -> bool {
    let lengths = |chains: &[EdgeChain]| {
        let mut all: Vec<_> = chains.iter().map(|c| (c.closed, c.points.len())).collect();
        all.sort_unstable();
        all
    };
    a.len() == b.len()
        && lengths(a).iter().zip(lengths(b)).all(|(a, b)| a.0 == b.0 && a.1.abs_diff(b.1) <= 2 + a.1 / 50)
}

/// A turned rectangle with noise, a disc that closes on itself, and a third that meets the
/// rectangle in junctions.
fn scene() -> GrayImage {
    let turned = polygon((90, 70), &rectangle((30.0, 34.0), (33.0, 31.0), 0.4), (170.0, 80.0), 1.5, 8);
    GrayImage::from_fn(90, 70, |u, v| {
        let from = |cu: f64, cv: f64| (u as f64 - cu).hypot(v as f64 - cv);
        let bright =
            (13.5 - from(68.3, 30.7)).clamp(-0.5, 0.5) + (6.5 - from(27.0, 56.4)).clamp(-0.5, 0.5) + 1.0;
        turned.at(u, v) + (70.0 * bright) as u8
    })
}

#[test]
fn chains_do_not_depend_on_flips_turns_shifts_and_contrast() {
    let image = scene();
    let p = ChainParams::default();
    let all = found(&image, &p);
    assert!(all.len() >= 3 && all.iter().any(|c| c.closed) && all.iter().any(|c| !c.closed), "{}", all.len());
    let (w, h) = (image.width(), image.height());
    let cases: [(&str, GrayImage, Map); 6] = [
        ("flip", flipped(&image), &|p| Point2::new(w as f64 - 1.0 - p.x, p.y)),
        ("turn", quarter_turned(&image), &|p| Point2::new(h as f64 - 1.0 - p.y, p.x)),
        (
            "shift",
            GrayImage::from_fn(w, h, |u, v| image.at(u.saturating_sub(2), v.saturating_sub(1))),
            &|p| Point2::new(p.x + 2.0, p.y + 1.0),
        ),
        ("brighter", GrayImage::from_fn(w, h, |u, v| image.at(u, v) + 5), &|p| p),
        ("inverted", GrayImage::from_fn(w, h, |u, v| 255 - image.at(u, v)), &|p| p),
        ("same", image.clone(), &|p| p),
    ];
    for (name, image, map) in &cases {
        let other = found(image, &p);
        let share = shared(&all, &other, map);
        let lengths = |c: &[EdgeChain]| c.iter().map(|c| (c.closed, c.points.len())).collect::<Vec<_>>();
        println!("{name}: {share:.3} {:?} {:?}", lengths(&all), lengths(&other));
        assert!(share > 0.96, "{name}: {share:.3} of the points");
        assert!(same_lengths(&all, &other), "{name}: {:?} became {:?}", lengths(&all), lengths(&other));
    }
}

#[test]
fn a_larger_copy_has_the_same_chains() {
    let copy = |scale: f64| {
        let size = ((90.0 * scale) as usize, (70.0 * scale) as usize);
        let corners = rectangle((40.0 * scale, 34.0 * scale), (40.0 * scale, 31.0 * scale), 0.3);
        found(&polygon(size, &corners, (170.0, 80.0), 0.0, 8), &ChainParams::default())
    };
    let (small, large) = (copy(1.0), copy(3.0));
    let length = |chains: &[EdgeChain]| chains.iter().map(|c| c.points.len()).sum::<usize>();
    assert_eq!((small.len(), large.len()), (1, 1));
    assert!(small[0].closed && large[0].closed);
    let ratio = length(&large) as f64 / length(&small) as f64;
    assert!((ratio - 3.0).abs() < 0.1, "{ratio}");
}
