//! No panic, no work beyond the stated bounds and no disagreement between threads, whatever the
//! image. Work is counted by the outputs of each stage, not timed.

use crate::{
    detect::{
        detector::{MAX_QUADS, detect, scored_quads},
        edge_buffers::MAX_SCALES,
        edge_support::gradients::Gradients,
        edges::edge_map::{EdgeMap, MAX_EDGE_POINTS},
        params::{DetectParams, Grouping},
        proposals::quad_proposals::{MAX_PROPOSALS, proposals},
        pyramid,
        quad::Quad,
        refine::rating::MAX_REFITTED,
        segments::{
            chains::{EdgeChain, MAX_CHAIN_POINTS},
            collinear_merge::MAX_SEGMENTS,
            edge_segments::EdgeSegment,
        },
        tests::rendering::Noise,
    },
    frame::{GrayImage, MAX_AREA_PX, MAX_SIDE_PX},
    geometry::polygon,
    paper::relaxation::similarity::{MAX_PAIRS, SegmentPair},
    trace::{NoTrace, Trace},
};

/// Checks the bound of every stage.
#[derive(Default)]
struct Counted {
    area: usize,
    edge_points: usize,
    segments: Vec<EdgeSegment>,
    stages: usize,
}

impl Trace for Counted {
    fn edges(&mut self, edges: &EdgeMap) {
        self.stages += 1;
        self.edge_points = edges.pixels().len();
        assert!(self.edge_points <= MAX_EDGE_POINTS.min(self.area));
    }
    fn chains(&mut self, chains: &[EdgeChain]) {
        self.stages += 1;
        assert!(chains.iter().all(|c| c.points.len() <= MAX_CHAIN_POINTS));
        // A junction may belong to each of the chains that meet there, at most four.
        let points: usize = chains.iter().map(|c| c.points.len()).sum();
        assert!(points <= 4 * self.edge_points, "{points} of {}", self.edge_points);
    }
    fn segments(&mut self, segments: &[EdgeSegment]) {
        self.stages += 1;
        assert!(segments.len() <= MAX_SEGMENTS);
        self.segments = segments.to_vec();
    }
    fn pairs(&mut self, pairs: &[SegmentPair]) {
        assert!(pairs.len() <= MAX_PAIRS && 2 * pairs.len() <= self.segments.len());
    }
    fn quads(&mut self, quads: &[Quad]) {
        self.stages += 1;
        assert!(quads.len() <= MAX_QUADS);
        quads.iter().for_each(check);
    }
}

fn check(quad: &Quad) {
    assert!(polygon::is_convex(quad.corners_px.points()));
    assert!((0.0..=1.0).contains(&quad.score), "{quad:?}");
    assert!(quad.side_support.iter().all(|s| (0.0..=1.0).contains(s)));
    assert!(
        quad.corner_covariance_px2.iter().all(|c| c.iter().all(|x| x.is_finite()) && c.determinant() >= 0.0)
    );
}

fn both() -> [DetectParams; 2] {
    let mut paper = DetectParams::default();
    paper.quads.grouping = Grouping::Relaxation;
    // The default detector with every option on.
    let mut search = DetectParams::default();
    search.tiling.remove = true;
    search.quads.scales = MAX_SCALES;
    [search, paper]
}

/// Detects with both groupings and checks the bound of every stage.
fn check_bounds(image: &GrayImage) {
    for p in both() {
        let mut counted = Counted { area: image.width() * image.height(), ..Counted::default() };
        let quads = detect(image, &p, &mut counted);
        assert_eq!(counted.stages, 4);
        quads.iter().for_each(check);
    }
    let p = DetectParams::default();
    let work = pyramid::reduce(image, pyramid::working_factor(image, p.quads.working_side_px));
    let mut counted = Counted { area: work.width() * work.height(), ..Counted::default() };
    let (rated, edges) = scored_quads(&work, &p, &mut counted);
    assert!(rated.len() <= (MAX_REFITTED + MAX_REFITTED / 2) * p.quads.scales);
    let g = Gradients { image: &work, gx: edges.gx(), gy: edges.gy() };
    assert!(proposals(&counted.segments, &g, &p.quads.proposals).len() <= MAX_PROPOSALS);
}

fn checkerboard(width: usize, height: usize, period: usize) -> GrayImage {
    GrayImage::from_fn(
        width,
        height,
        |u, v| if (u / period + v / period).is_multiple_of(2) { 30 } else { 220 },
    )
}

fn noise(width: usize, height: usize, grain: usize, seed: u64) -> GrayImage {
    let columns = width / grain + 1;
    let mut random = Noise(seed);
    let levels: Vec<u8> =
        (0..columns * (height / grain + 1)).map(|_| (random.uniform() * 256.0) as u8).collect();
    GrayImage::from_fn(width, height, |u, v| levels[v / grain * columns + u / grain])
}

/// Upright rectangles of any size, one on the other.
fn rectangles(width: usize, height: usize, count: usize, seed: u64) -> GrayImage {
    let mut random = Noise(seed);
    let mut below = |n: usize| (random.uniform() * n as f64) as usize;
    let placed: Vec<[usize; 5]> = (0..count)
        .map(|_| [below(width), below(height), below(width / 2) + 1, below(height / 2) + 1, below(256)])
        .collect();
    GrayImage::from_fn(width, height, |u, v| {
        let on = |[x, y, w, h, _]: &&[usize; 5]| (*x..x + w).contains(&u) && (*y..y + h).contains(&v);
        placed.iter().rev().find(on).map_or(128, |r| r[4] as u8)
    })
}

#[test]
fn checkerboards_of_every_period() {
    for period in 1..=64 {
        check_bounds(&checkerboard(320, 240, period));
    }
}

#[test]
fn stripes_of_every_period() {
    for period in 1..=32 {
        let stripes =
            GrayImage::from_fn(320, 240, |u, _| if (u / period).is_multiple_of(2) { 30 } else { 220 });
        check_bounds(&stripes);
        check_bounds(&crate::detect::tests::rendering::quarter_turned(&stripes));
    }
}

#[test]
fn flat_and_graded_images_have_no_quads() {
    for level in [0, 1, 127, 255] {
        let image = GrayImage::from_fn(200, 150, |_, _| level);
        check_bounds(&image);
        assert!(both().iter().all(|p| detect(&image, p, &mut NoTrace).is_empty()));
    }
    // Slopes of up to a grey level a pixel, and the wrapped ones beyond.
    for slope in [1, 2, 3, 5, 9, 50, 128] {
        check_bounds(&GrayImage::from_fn(200, 150, |u, v| ((u + 2 * v) * slope / 4) as u8));
    }
    let gentle = GrayImage::from_fn(200, 150, |u, v| (u / 2 + v / 3) as u8);
    assert!(both().iter().all(|p| detect(&gentle, p, &mut NoTrace).is_empty()));
}

#[test]
fn noise_of_every_grain() {
    for grain in [1, 2, 3, 5, 8, 13, 21, 34] {
        check_bounds(&noise(300, 220, grain, grain as u64));
    }
}

#[test]
fn rectangles_upon_rectangles() {
    for seed in 0..12 {
        check_bounds(&rectangles(330, 250, 10 + 40 * seed, seed as u64));
    }
}

#[test]
fn images_of_every_small_size_and_of_one_pixel_across() {
    for width in 1..=9 {
        for height in 1..=9 {
            check_bounds(&noise(width, height, 1, 3));
        }
    }
    for length in [10, 300, MAX_SIDE_PX] {
        for across in [1, 2, 3, 5] {
            check_bounds(&noise(length, across, 2, 4));
            check_bounds(&noise(across, length, 2, 5));
        }
    }
}

#[test]
fn images_of_the_maximum_area() {
    let side = 4096;
    assert_eq!(side * side, MAX_AREA_PX);
    check_bounds(&noise(side, side, 40, 6));
    check_bounds(&checkerboard(MAX_SIDE_PX, MAX_AREA_PX / MAX_SIDE_PX, 7));
}

#[test]
#[expect(clippy::disallowed_methods, reason = "the threads of the caller")]
fn all_threads_find_the_same_bit_for_bit() {
    let images = [rectangles(400, 300, 60, 1), noise(400, 300, 20, 2), checkerboard(400, 300, 37)];
    for p in both() {
        let run = || images.each_ref().map(|image| format!("{:?}", detect(image, &p, &mut NoTrace)));
        let alone = run();
        assert!(alone.iter().any(|quads| quads.len() > 1000), "some quads");
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(run)).collect();
            for thread in threads {
                assert_eq!(thread.join().expect("no panic"), alone);
            }
        });
    }
}
