use super::*;
use crate::{
    detect::{
        detector::detect,
        tests::{
            fixtures::{render, segment},
            rendering::{flipped, quarter_turned},
        },
    },
    frame::GrayImage,
    trace::NoTrace,
};

type Quadrangle = [[f64; 2]; 4];
/// Maps a point, given the largest coordinates.
type Mapping = fn(&Point2<f64>, f64, f64) -> [f64; 2];

const DOOR: Quadrangle = [[150.0, 60.0], [260.0, 70.0], [260.0, 360.0], [150.0, 380.0]];

/// A door before a floor as dark as itself: its lower end is not visible.
fn door() -> GrayImage {
    let floor = [[-10.0, 330.0], [510.0, 330.0], [510.0, 430.0], [-10.0, 430.0]];
    render(500, 420, 200, &[(DOOR, 90), (floor, 90)])
}

fn found(image: &GrayImage) -> (Vec<Quad>, Vec<Quad>) {
    let quads = detect(image, &DetectParams::default(), &mut NoTrace);
    quads.into_iter().partition(|q| q.kind == QuadKind::Full)
}

/// Distance of a point from the nearest corner.
fn off(quad: &Quad, corner: [f64; 2]) -> f64 {
    let corner = Point2::from(corner);
    quad.corners_px.points().iter().map(|c| (c - corner).norm()).fold(f64::INFINITY, f64::min)
}

fn one_set(image: &GrayImage) -> Quad {
    let (full, open) = found(image);
    assert!(full.is_empty(), "{full:#?}");
    assert_eq!(open.len(), 1, "{open:#?}");
    open.into_iter().next().unwrap()
}

#[test]
fn a_door_without_a_visible_lower_end_is_three_sided() {
    let set = one_set(&door());
    assert!(off(&set, DOOR[0]) < 0.5 && off(&set, DOOR[1]) < 0.5, "{set:#?}");
    // The sides end where the floor begins.
    assert!(off(&set, [150.0, 330.0]) < 5.0 && off(&set, [260.0, 330.0]) < 5.0, "{set:#?}");
    assert!(set.side_support[0] > 0.9 && set.side_support[1] > 0.9 && set.side_support[3] > 0.9);
    assert!((0.5..=1.0).contains(&set.score) && set.side_clipped == [false; 4]);
    // The covariance is small at corners and large along the sides at the free ends.
    let deviation = |i: usize, j: usize| set.corner_covariance_px2[i][(j, j)].sqrt();
    for i in [0, 1] {
        assert!(deviation(i, 0) < 0.5 && deviation(i, 1) < 0.5, "{set:#?}");
    }
    for i in [2, 3] {
        assert!(deviation(i, 0) < 0.5 && (1.5..2.5).contains(&deviation(i, 1)), "{set:#?}");
    }
}

#[test]
fn a_partly_hidden_poster_is_three_sided() {
    let poster = [[120.0, 100.0], [330.0, 100.0], [330.0, 260.0], [120.0, 260.0]];
    // A person hides its right side, from floor to ceiling and as dark as the poster.
    let person = [[270.0, -10.0], [345.0, -10.0], [385.0, 430.0], [230.0, 430.0]];
    let set = one_set(&render(500, 420, 200, &[(poster, 80), (person, 80)]));
    assert!(off(&set, poster[0]) < 0.5 && off(&set, poster[3]) < 0.5, "{set:#?}");
}

#[test]
fn a_poster_cut_by_the_image_border_is_clipped() {
    for (poster, clipped) in [
        ([[380.0, 100.0], [560.0, 100.0], [560.0, 260.0], [380.0, 260.0]], [true, true, true, false]),
        ([[-60.0, 110.0], [90.0, 100.0], [90.0, 260.0], [-60.0, 250.0]], [true, false, true, true]),
        ([[150.0, 300.0], [300.0, 300.0], [300.0, 500.0], [150.0, 500.0]], [false, true, true, true]),
    ] {
        let set = one_set(&render(500, 420, 200, &[(poster, 80)]));
        assert_eq!(set.side_clipped, clipped, "{set:#?}");
        // Its free ends lie on the border.
        let on_border = |c: &&Point2<f64>| c.x.min(c.y).min(499.0 - c.x).min(419.0 - c.y).abs() < 0.5;
        assert_eq!(set.corners_px.points().iter().filter(on_border).count(), 2, "{set:#?}");
    }
}

#[test]
fn complete_quads_leave_no_three_sided_set() {
    let quads = [
        ([[60.0, 60.0], [250.0, 85.0], [240.0, 300.0], [70.0, 330.0]], 70),
        ([[330.0, 100.0], [440.0, 90.0], [450.0, 360.0], [325.0, 350.0]], 40),
        ([[352.0, 124.0], [418.0, 116.0], [426.0, 333.0], [348.0, 326.0]], 220),
    ];
    let (full, open) = found(&render(500, 420, 200, &quads));
    assert_eq!((full.len(), open.len()), (2, 0), "{open:#?}");
}

#[test]
fn the_parameter_disables_three_sided_sets() {
    let mut p = DetectParams::default();
    p.quads.three_sided = false;
    assert!(detect(&door(), &p, &mut NoTrace).is_empty());
}

#[test]
fn mixed_polarity_gives_no_set() {
    // A corner of shadow and a bright strip: the third side is bright where the others are dark.
    let mut segments = vec![
        segment([50.0, 200.0], [50.0, 50.0]),
        segment([50.0, 50.0], [150.0, 50.0]),
        segment([150.0, 50.0], [150.0, 200.0]),
    ];
    let image =
        GrayImage::from_fn(300, 300, |u, v| if (50..=150).contains(&u) && v >= 50 { 60 } else { 200 });
    let zeros = vec![0.0_f32; 300 * 300];
    let g = Gradients { image: &image, gx: &zeros, gy: &zeros };
    let p = DetectParams::default();
    let count = |segments: &[EdgeSegment]| open_sets(segments, &[0, 1, 2], &g, &p).len();
    assert_eq!(count(&segments), 1);
    segments[2] = segment([150.0, 200.0], [150.0, 50.0]);
    assert_eq!(count(&segments), 0);
}

#[test]
fn flips_turns_and_inversion_keep_the_set() {
    let image = door();
    let (w, h) = (499.0, 419.0);
    let inverted = GrayImage::from_fn(500, 420, |u, v| 255 - image.at(u, v));
    let base = one_set(&image);
    let cases: [(GrayImage, Mapping); 4] = [
        (flipped(&image), |c, w, _| [w - c.x, c.y]),
        (quarter_turned(&image), |c, _, h| [h - c.y, c.x]),
        (quarter_turned(&quarter_turned(&image)), |c, w, h| [w - c.x, h - c.y]),
        (inverted, |c, _, _| [c.x, c.y]),
    ];
    for (changed, map) in cases {
        let set = one_set(&changed);
        for c in base.corners_px.points() {
            // Free ends are searched in steps of 2 px from the end of the segment.
            assert!(off(&set, map(c, w, h)) < 2.5, "{base:#?} {set:#?}");
        }
        assert!((set.score - base.score).abs() < 0.03);
    }
}

#[test]
fn the_number_of_measured_sets_is_bounded() {
    // A comb: every tooth could be a side of many sets.
    let mut segments: Vec<EdgeSegment> = Vec::new();
    for i in 0..MAX_LEFT_SEGMENTS + 30 {
        let u = i as f64 * 4.0;
        let (low, high) = ([u, 70.0], [u, 10.0]);
        segments.push(if i % 2 == 0 { segment(low, high) } else { segment(high, low) });
        segments.push(segment([u, 10.0], [u + 60.0, 10.0]));
    }
    assert_eq!(unexplained(&segments, &[]).len(), MAX_LEFT_SEGMENTS);
    let image = GrayImage::from_fn(700, 200, |_, _| 0);
    let zeros = vec![0.0_f32; 700 * 200];
    let g = Gradients { image: &image, gx: &zeros, gy: &zeros };
    let p = DetectParams::default();
    let sets = open_sets(&segments, &unexplained(&segments, &[]), &g, &p);
    assert!(sets.len() > 10 && sets.len() <= MAX_LEFT_SEGMENTS * MAX_CORNERS * MAX_CORNERS, "{}", sets.len());
    assert!(find_three_sided(&segments, &[], &g, &p).is_empty());
}
