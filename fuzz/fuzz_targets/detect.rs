//! Any bytes as an image and parameters: `detect` must not panic, hang or grow, and what it returns
//! must be sound.
//!
//! Seven bytes of header, then grey levels, repeated until the image is full. An enlarging factor
//! lets a short input draw sides long enough to become segments.

#![no_main]

use libfuzzer_sys::fuzz_target;
use vision::{
    detect::{
        DetectParams, Grouping, MAX_QUADS, MAX_SCALES, Nested, Quad, detect,
        edges::edge_map::EdgeMap,
        segments::{collinear_merge::MAX_SEGMENTS, edge_segments::EdgeSegment},
    },
    frame::{Distortion, GrayImage, Intrinsics},
    geometry::polygon,
    paper::{
        relaxation::similarity::{MAX_PAIRS, SegmentPair},
        tiling::tiling_params::FloorView,
    },
    trace::Trace,
};

fuzz_target!(|data: &[u8]| {
    let Some(([width, height, zoom, switches, more, knob, value], levels)) = data.split_first_chunk() else {
        return;
    };
    if levels.is_empty() {
        return;
    }
    let (columns, rows) = (usize::from(*width) % 48 + 1, usize::from(*height) % 48 + 1);
    let zoom = usize::from(*zoom) % 6 + 1;
    let image = GrayImage::from_fn(columns * zoom, rows * zoom, |u, v| {
        levels[(v / zoom * columns + u / zoom) % levels.len()]
    });
    let mut params = params(*switches, *more, image.width());
    turn(&mut params, *knob, *value);
    let quads = detect(&image, &params, &mut Bounds);
    assert!(quads.len() <= MAX_QUADS);
    for quad in &quads {
        check(quad);
    }
});

/// Parameters of the kinds that switch whole stages.
fn params(switches: u8, more: u8, width_px: usize) -> DetectParams {
    let on = |bit: u8| switches >> bit & 1 == 1;
    let mut p = DetectParams::default();
    p.quads.grouping = if on(0) { Grouping::Relaxation } else { Grouping::Proposals };
    p.quads.nested = if on(1) { Nested::Quads } else { Nested::Alternates };
    p.quads.three_sided = !on(2);
    p.quads.proposals.complete = !on(3);
    p.tiling.remove = on(4);
    p.quads.working_side_px = if on(5) { 100 } else { 640 };
    p.quads.scales = usize::from(more) % (MAX_SCALES + 2);
    if on(6) {
        let intrinsics = Intrinsics::new(
            width_px.max(10) as f64,
            width_px.max(10) as f64,
            0.5 * width_px as f64,
            0.3 * width_px as f64,
            Distortion::PlumbBob([-0.2, 0.05, 0.0, 0.0, 0.0]),
        );
        p.tiling.floor = intrinsics.ok().map(|intrinsics| FloorView {
            intrinsics,
            width_px,
            height_m: 1.0,
            tilt_rad: -0.2,
        });
    }
    if on(7) {
        p.edges.noise_factors = [2.5, 6.0];
    }
    p
}

/// Sets one number to something an operator might write, or should not.
fn turn(p: &mut DetectParams, knob: u8, value: u8) {
    const VALUES: [f64; 12] =
        [0.0, -1.0, 0.3, 0.5, 1.0, 2.0, 10.0, 90.0, 1e6, 1e300, f64::INFINITY, f64::NAN];
    let x = VALUES[usize::from(value) % VALUES.len()];
    match knob % 32 {
        0 => p.edges.alpha = x as f32,
        1 => p.edges.low = x as f32,
        2 => p.edges.high = x as f32,
        3 => p.chains.max_gap_px = x as u32,
        4 => p.chains.max_bend_deg = x,
        5 => p.chains.min_points = x as usize,
        6 => p.segments.split_px = x,
        7 => p.segments.merge_angle_deg = x,
        8 => p.segments.end_px = x,
        9 => p.segments.join_gap_share = x,
        10 => p.segments.min_length_range_px[0] = x,
        11 => p.similarity.min_score = x,
        12 => p.similarity.weights[usize::from(value) % 6] = x,
        13 => p.similarity.min_closing = x,
        14 => p.similarity.closing_gap = x,
        15 => p.similarity.profile_half_width_px = x as usize,
        16 => p.similarity.max_candidates = x as usize,
        17 => p.relaxation.step = x,
        18 => p.relaxation.linear_weight = x,
        19 => p.relaxation.pair_tolerance_px = x,
        20 => p.quads.refit_reach_px = x,
        21 => p.quads.min_step = x,
        22 => p.quads.min_side_support = x,
        23 => p.quads.min_score = x,
        24 => p.quads.proposals.min_support = x,
        25 => p.quads.proposals.max_gap = x,
        26 => p.quads.proposals.min_step = x,
        27 => p.tiling.max_distance = x,
        28 => p.tiling.period_range[usize::from(value) % 2] = x,
        29 => p.tiling.max_residual = x,
        _ => {}
    }
}

/// Holds what the stages hand on to their bounds.
struct Bounds;

impl Trace for Bounds {
    fn edges(&mut self, edges: &EdgeMap) {
        assert!(edges.pixels().len() <= edges.width() * edges.height());
    }
    fn segments(&mut self, segments: &[EdgeSegment]) {
        assert!(segments.len() <= MAX_SEGMENTS);
        assert!(segments.iter().all(|s| s.length_px.is_finite() && s.rho_px.is_finite()));
    }
    fn pairs(&mut self, pairs: &[SegmentPair]) {
        assert!(pairs.len() <= MAX_PAIRS);
    }
}

fn check(quad: &Quad) {
    assert!(polygon::is_convex(quad.corners_px.points()));
    assert!((0.0..=1.0).contains(&quad.score), "{quad:?}");
    assert!(quad.side_support.iter().all(|s| (0.0..=1.0).contains(s)));
    assert!(quad.corner_covariance_px2.iter().all(|c| c.iter().all(|x| x.is_finite())));
}
