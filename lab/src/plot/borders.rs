//! The border model: the lines beside the sides of one quad, how much each looks like a border, and which are chosen.

use super::{
    panels::{around, column, cut, explained, on, row, scale, titled},
    scene::{Rendered, SceneArgs},
};
use anyhow::Context as _;
use cli::drawing::{Colour, GREEN, Picture, WHITE, YELLOW};
use nalgebra::{Point2, Vector2};
use vision::{
    detect::{
        DetectParams,
        border_model::choose_sides::{SideCandidate, SnappedSides, choose_sides, side_candidates},
        detector::scored_quads,
        edge_support::gradients::Gradients,
        suppression::non_maximum::{snap_sides, suppress_non_maxima},
    },
    frame::GrayImage,
    geometry::Corners,
    trace::NoTrace,
};

/// A room with a window whose proposal reached over the wall below it.
const SEED: u64 = 18;
/// Corners this near to those of a quad that was kept are its corners.
const SAME_PX: f64 = 3.0;
/// Smallest side of the quad that is drawn.
const MIN_SIDE_PX: f64 = 60.0;
/// Colours of outputs from the smallest of a side to the largest.
const COLOURS: [Colour; 3] = [[120, 40, 40], [230, 150, 30], [120, 230, 120]];
/// Size of the unrolled band of a side.
const BAND_PX: [usize; 2] = [420, 104];

/// A quad before and after its sides were chosen.
struct Moved {
    before: [Point2<f64>; 4],
    after: SnappedSides,
    candidates: [Vec<(SideCandidate, f64)>; 4],
}

pub(crate) fn draw(args: &SceneArgs) -> anyhow::Result<Picture> {
    let work = args.image(Rendered::Room, SEED)?;
    let moved = moved_most(&work).context("no quad of the image was kept")?;
    let corners = Corners::from_unordered(moved.before)?;
    let box_px = around(&corners, 0.25 * corners.area_px2().sqrt() + 6.0, &work);
    let bands: Vec<Picture> = (0..4).map(|side| band(&work, &moved, side)).collect();
    let wanted = bands.iter().map(Picture::height).sum::<usize>() + 30;
    let factor = (wanted / box_px[3].max(1)).clamp(1, 4).min(460 / box_px[2].max(1)).max(1);
    let left = in_the_image(&work, &moved, box_px, factor);
    let count: usize = moved.candidates.iter().map(Vec::len).sum();
    let lines = format!("lines beside the sides: {count}");
    Ok(explained(
        row(&[titled(&left, "quad in the image", WHITE), column(&bands)]),
        &[
            ("the proposal", WHITE),
            ("chosen border", GREEN),
            (&lines, COLOURS[1]),
            ("output of the model: smallest of the side", [200, 60, 60]),
            ("middle", COLOURS[1]),
            ("largest", COLOURS[2]),
            ("number: output", YELLOW),
        ],
    ))
}

/// Of the quads that are kept in the end, the one whose corners the model moved furthest, in shares of its size.
fn moved_most(work: &GrayImage) -> Option<Moved> {
    let p = DetectParams::default();
    let (scored, edges) = scored_quads(work, &p, &mut NoTrace);
    let gradients = Gradients { image: work, gx: edges.gx(), gy: edges.gy() };
    let kept = suppress_non_maxima(snap_sides(scored.clone(), &gradients, &p.quads), &p.quads);
    let model = p.quads.side_network();
    let mut best: Option<(f64, Moved)> = None;
    for quad in scored.iter().map(|s| &s.quad) {
        let before = *quad.corners_px.points();
        if quad.corners_px.min_side_px() < MIN_SIDE_PX {
            continue;
        }
        let Some(after) = choose_sides(&gradients, &before, model) else { continue };
        let is_kept = kept.iter().any(|k| {
            let corners = k.corners_px.points();
            after.corners_px.iter().all(|a| corners.iter().any(|b| (a - b).norm() < SAME_PX))
        });
        let off = before.iter().zip(&after.corners_px).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        let share = off / quad.corners_px.area_px2().sqrt();
        if is_kept && best.as_ref().is_none_or(|(most, _)| share > *most) {
            let candidates = side_candidates(&gradients, &before)
                .map(|side| side.into_iter().map(|c| (c.clone(), model.output(&c.features))).collect());
            best = Some((share, Moved { before, after, candidates }));
        }
    }
    best.map(|(_, moved)| moved)
}

/// Smallest and largest output of a side.
fn range(candidates: &[(SideCandidate, f64)]) -> (f64, f64) {
    candidates.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c.1), h.max(c.1)))
}

fn colour(output: f64, (low, high): (f64, f64)) -> Colour {
    scale((output - low) / (high - low).max(1e-9), COLOURS)
}

fn in_the_image(work: &GrayImage, moved: &Moved, box_px: [usize; 4], factor: usize) -> Picture {
    let mut picture = Picture::of(&cut(work, box_px), 0.6).enlarged(factor);
    let place = |p: &Point2<f64>| on([p.x - box_px[0] as f64, p.y - box_px[1] as f64], factor);
    for side in &moved.candidates {
        for (line, output) in side {
            let [from, to] = line.ends_px.map(|e| place(&e));
            picture.line(from, to, 1.0, colour(*output, range(side)));
        }
    }
    for i in 0..4 {
        let next = (i + 1) % 4;
        picture.line(place(&moved.before[i]), place(&moved.before[next]), 1.6, WHITE);
        picture.line(place(&moved.after.corners_px[i]), place(&moved.after.corners_px[next]), 2.6, GREEN);
    }
    for (i, name) in ["1", "2", "3", "4"].into_iter().enumerate() {
        let middle = nalgebra::center(&moved.before[i], &moved.before[(i + 1) % 4]);
        let [x, y] = place(&middle).map(|c| c.max(0.0) as usize);
        picture.text([x, y], 3, name, YELLOW);
    }
    picture
}

/// The band around a side, unrolled: along the side to the right, outwards up.
fn band(work: &GrayImage, moved: &Moved, side: usize) -> Picture {
    let [width, height] = BAND_PX;
    let (from, to) = (moved.before[side], moved.before[(side + 1) % 4]);
    let along = to - from;
    let length = along.norm();
    let outwards = Vector2::new(along.y, -along.x) / length;
    let candidates = &moved.candidates[side];
    let offset = |p: &Point2<f64>| (p - from).dot(&outwards);
    let furthest = candidates.iter().flat_map(|c| &c.0.ends_px).map(|e| offset(e).abs()).fold(4.0, f64::max);
    let reach = furthest * 1.15;
    let image = GrayImage::from_fn(width, height, |u, v| {
        let share = (u as f64 + 0.5) / width as f64;
        let across = reach * (1.0 - 2.0 * (v as f64 + 0.5) / height as f64);
        let at = from + along * share + outwards * across;
        (0.75 * work.sample(at.x, at.y)) as u8
    });
    let mut picture = Picture::of(&image, 1.0);
    let place = |p: &Point2<f64>| {
        let share = (p - from).dot(&along) / (length * length);
        [share * width as f64, 0.5 * height as f64 * (1.0 - offset(p) / reach)]
    };
    for (line, output) in candidates {
        let [a, b] = line.ends_px.map(|e| place(&e));
        picture.line(a, b, 1.0, colour(*output, range(candidates)));
    }
    picture.line([0.0, 0.5 * height as f64], [width as f64, 0.5 * height as f64], 1.4, WHITE);
    let chosen = [side, side + 1].map(|i| place(&moved.after.corners_px[i % 4]));
    picture.line(chosen[0], chosen[1], 2.4, GREEN);
    let (_, high) = range(candidates);
    if let Some((line, _)) = candidates.iter().find(|c| c.1 >= high) {
        let [_, y] = place(&line.ends_px[1]);
        let y = (y - 18.0).clamp(0.0, height as f64 - 16.0) as usize;
        picture.text([width - 70, y], 2, &format!("{high:.1}"), YELLOW);
    }
    titled(&picture, &format!("side {}: band, outwards up, {} lines", side + 1, candidates.len()), WHITE)
}
