use super::*;
use crate::{
    detect::{
        edges::edge_map::{EdgeParams, edges},
        segments::{chains::chains, gap_closing::ChainParams},
        tests::rendering::{Noise, flipped, polygon, quarter_turned, rectangle},
    },
    frame::GrayImage,
    geometry::line::Line,
};
use proptest::prelude::*;

fn found(image: &GrayImage) -> Vec<EdgeSegment> {
    let edges = edges(image, &EdgeParams::default());
    segments(&chains(&edges, &ChainParams::default()), &edges, &SegmentParams::default())
}

/// The longest segment along the side a-b.
fn along<'a>(all: &'a [EdgeSegment], a: &Point2<f64>, b: &Point2<f64>) -> Option<&'a EdgeSegment> {
    let side = Line::from_points(a, b)?;
    all.iter().find(|s| {
        let mid = nalgebra::center(&s.p_px, &s.q_px);
        let t = (mid - a).dot(&(b - a)) / (b - a).norm_squared();
        side.distance(&mid).abs() < 3.0 && (0.1..0.9).contains(&t) && side.normal.perp(&s.normal).abs() < 0.1
    })
}

#[test]
fn sides_of_rendered_polygons_are_found_within_a_third_of_a_pixel() {
    let mut noise = Noise(11);
    let (mut worst_mid, mut worst_angle) = (0.0_f64, 0.0_f64);
    for round in 0..40 {
        let centre = (160.0 + 4.0 * noise.uniform(), 120.0 + 4.0 * noise.uniform());
        let size = (40.0 + 120.0 * noise.uniform(), 40.0 + 80.0 * noise.uniform());
        let corners = rectangle(centre, size, std::f64::consts::PI * noise.uniform());
        let levels = if round % 2 == 0 { (170.0, 90.0) } else { (60.0, 140.0) };
        let all = found(&polygon((320, 240), &corners, levels, 4.0, round));
        for i in 0..4 {
            let (a, b) = (corners[i], corners[(i + 1) % 4]);
            let s = along(&all, &a, &b).unwrap_or_else(|| panic!("side {i} of round {round} is missing"));
            let truth = Line::from_points(&a, &b).unwrap();
            let mid = truth.distance(&nalgebra::center(&s.p_px, &s.q_px)).abs();
            let angle = truth.normal.perp(&s.normal).abs().asin().to_degrees();
            assert!(mid < 0.3, "round {round} side {i}: mid point {mid:.3} px off");
            assert!(angle < 0.5, "round {round} side {i}: {angle:.3} deg off, {s:?}");
            assert!(
                s.length_px > (b - a).norm() - 8.0,
                "round {round} side {i} of {:.1} px: {s:?}\n{all:#?}",
                (b - a).norm()
            );
            assert!((s.contrast - 80.0).abs() < 12.0, "contrast {}", s.contrast);
            // Outward normals of a rectangle that runs clockwise on screen lie left of its sides.
            let inward = truth.normal;
            assert_eq!(inward.dot(&s.normal) > 0.0, round % 2 == 0, "the normal points to the bright side");
            (worst_mid, worst_angle) = (worst_mid.max(mid), worst_angle.max(angle));
        }
    }
    println!("worst mid point {worst_mid:.3} px, worst angle {worst_angle:.3} deg");
}

#[test]
fn conventions_of_a_segment_hold() {
    let corners = rectangle((80.0, 60.0), (90.0, 60.0), 0.3);
    for s in found(&polygon((160, 120), &corners, (200.0, 50.0), 2.0, 5)) {
        let d = (s.q_px - s.p_px) / s.length_px;
        assert!((s.normal.norm() - 1.0).abs() < 1e-12);
        assert!((Vector2::new(-d.y, d.x) - s.normal).norm() < 1e-9, "bright side on the right from p to q");
        assert!((s.normal.dot(&s.p_px.coords) - s.rho_px).abs() < 1e-9);
        assert!((s.normal.dot(&s.q_px.coords) - s.rho_px).abs() < 1e-9);
        assert!((0.0..std::f64::consts::PI).contains(&s.theta_rad));
        assert!((s.theta_rad.cos() * d.y - s.theta_rad.sin() * d.x).abs() < 1e-9);
        // Floor of 0.2 px: sigma^2 / n and sigma^2 / sum of squares of n successive points.
        let n = s.support as f64;
        assert!(s.offset_variance >= 0.04 / n && s.offset_variance < 0.5 / n, "{s:?}");
        assert!(s.theta_variance > 0.0 && s.theta_variance < 12.0 * 0.5 / n.powi(3) * 2.0, "{s:?}");
        assert!(!s.clipped);
    }
}

#[test]
fn a_side_that_leaves_the_image_is_clipped() {
    let corners = rectangle((10.0, 60.0), (90.0, 60.0), 0.0);
    let all = found(&polygon((160, 120), &corners, (200.0, 50.0), 0.0, 1));
    let top = along(&all, &Point2::new(0.0, 30.0), &corners[1]).unwrap();
    let right = along(&all, &corners[1], &corners[2]).unwrap();
    assert!(top.clipped && !right.clipped);
}

#[test]
fn a_side_broken_by_clutter_is_joined() {
    let corners = rectangle((150.0, 100.0), (200.0, 120.0), 0.05);
    let clean = polygon((300, 200), &corners, (180.0, 80.0), 2.0, 3);
    // A dark bar crosses the top side.
    let image =
        GrayImage::from_fn(300, 200, |u, v| if (140..146).contains(&u) { 20 } else { clean.at(u, v) });
    let all = found(&image);
    let top = along(&all, &corners[0], &corners[1]).unwrap();
    assert!(top.length_px > 185.0, "{top:?}");
    let apart = SegmentParams { join_gap_share: 0.0, ..SegmentParams::default() };
    let edges = edges(&image, &EdgeParams::default());
    let all = segments(&chains(&edges, &ChainParams::default()), &edges, &apart);
    assert!(along(&all, &corners[0], &corners[1]).is_none_or(|s| s.length_px < 120.0));
}

#[test]
fn the_shortest_length_depends_on_the_image_width() {
    let p = SegmentParams::default();
    for (width, expected) in [(100, 12.0), (320, 12.8), (640, 25.0), (4000, 25.0)] {
        assert!((p.min_length_px(width) - expected).abs() < 0.61, "{width}: {}", p.min_length_px(width));
    }
    let corners = rectangle((60.0, 40.0), (20.0, 20.0), 0.1);
    let all = found(&polygon((320, 100), &corners, (180.0, 80.0), 3.0, 3));
    assert_eq!(all.len(), 4, "{all:?}");
    let wide = found(&polygon((900, 100), &corners, (180.0, 80.0), 3.0, 3));
    assert!(wide.is_empty(), "{wide:?}");
}

#[test]
fn the_longest_five_hundred_are_kept() {
    // Bars of growing height: two long sides each.
    let image = GrayImage::from_fn(3000, 120, |u, v| {
        let bar = u / 10;
        if u % 10 < 5 && (10..50 + bar / 5).contains(&v) { 200 } else { 40 }
    });
    let all = found(&image);
    assert_eq!(all.len(), MAX_SEGMENTS);
    assert!(all.windows(2).all(|w| w[0].length_px >= w[1].length_px));
    let edges = edges(&image, &EdgeParams::default());
    let more = SegmentParams { max_segments: usize::MAX, ..SegmentParams::default() };
    assert_eq!(segments(&chains(&edges, &ChainParams::default()), &edges, &more).len(), MAX_SEGMENTS);
    let fewer = SegmentParams { max_segments: 3, ..SegmentParams::default() };
    assert_eq!(segments(&chains(&edges, &ChainParams::default()), &edges, &fewer), all[..3]);
}

/// Every segment of `a`, mapped, has a partner in `b`, and there are equally many.
fn same_up_to(a: &[EdgeSegment], b: &[EdgeSegment], map: impl Fn(&Point2<f64>) -> Point2<f64>) {
    assert!(!a.is_empty());
    assert_eq!(a.len(), b.len());
    for s in a {
        let ends = [map(&s.p_px), map(&s.q_px)];
        let near = |t: &EdgeSegment| {
            let direct = (t.p_px - ends[0]).norm().max((t.q_px - ends[1]).norm());
            direct.min((t.p_px - ends[1]).norm().max((t.q_px - ends[0]).norm()))
        };
        let best = b.iter().map(near).fold(f64::INFINITY, f64::min);
        assert!(best < 1.5, "no partner within 1.5 px ({best:.2}) of {s:?} at {ends:?}");
    }
}

#[test]
fn segments_do_not_depend_on_flips_turns_shifts_and_contrast() {
    let corners = rectangle((81.0, 62.0), (90.0, 50.0), 0.35);
    let image = polygon((160, 120), &corners, (170.0, 90.0), 0.0, 9);
    let all = found(&image);
    same_up_to(&all, &found(&flipped(&image)), |p| Point2::new(159.0 - p.x, p.y));
    same_up_to(&all, &found(&quarter_turned(&image)), |p| Point2::new(119.0 - p.y, p.x));
    let shifted = GrayImage::from_fn(160, 120, |u, v| image.at(u.saturating_sub(7), v.saturating_sub(3)));
    same_up_to(&all, &found(&shifted), |p| Point2::new(p.x + 7.0, p.y + 3.0));
    let brighter =
        GrayImage::from_fn(160, 120, |u, v| (f64::from(image.at(u, v)) * 1.3 + 11.0).round() as u8);
    same_up_to(&all, &found(&brighter), |p| *p);
    let inverted = GrayImage::from_fn(160, 120, |u, v| 255 - image.at(u, v));
    let inverse = found(&inverted);
    same_up_to(&all, &inverse, |p| *p);
    let side = along(&all, &corners[0], &corners[1]).unwrap();
    let other = along(&inverse, &corners[0], &corners[1]).unwrap();
    assert!((side.normal + other.normal).norm() < 0.02);
}

#[test]
fn checkerboards_of_every_period_pass() {
    for period in 1..40 {
        let image =
            GrayImage::from_fn(97, 64, |u, v| if (u / period + v / period) % 2 == 0 { 30 } else { 220 });
        assert!(found(&image).len() <= MAX_SEGMENTS);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_image_gives_valid_segments(
        width in 1_usize..70, height in 1_usize..70, seed: u64, levels in 1_u32..256,
    ) {
        let mut noise = Noise(seed);
        let image = GrayImage::from_fn(width, height, |_, _| (noise.uniform() * f64::from(levels)) as u8);
        for s in found(&image) {
            prop_assert!(s.p_px.coords.iter().chain(s.q_px.coords.iter()).all(|x| x.is_finite()));
            prop_assert!(s.theta_variance.is_finite() && s.offset_variance.is_finite() && s.contrast.is_finite());
            prop_assert!(s.length_px >= SegmentParams::default().min_length_px(width));
        }
    }

    #[test]
    fn any_parameters_give_valid_segments(alpha: f32, low: f32, high: f32, split_px: f64, share: f64, gap: u32) {
        let image = polygon((64, 48), &rectangle((30.0, 22.0), (30.0, 20.0), 0.4), (200.0, 60.0), 6.0, 1);
        let edges = edges(&image, &EdgeParams { alpha, low, high, noise_factors: [0.0; 2] });
        let chain_params = ChainParams { max_gap_px: gap, min_points: 0, ..ChainParams::default() };
        let p = SegmentParams { split_px, join_gap_share: share, min_fragment_px: 0.0, ..SegmentParams::default() };
        prop_assert!(segments(&chains(&edges, &chain_params), &edges, &p).len() <= MAX_SEGMENTS);
    }
}
