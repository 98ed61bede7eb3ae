//! The pattern of a tiled floor: segments in the image, the same on the floor, and the accumulator of periods.

use super::{
    panels::{column, explained, row, titled},
    scene::{Rendered, SceneArgs},
};
use cli::drawing::{BLUE, CYAN, Colour, GREEN, ORANGE, Picture, RED, WHITE, YELLOW};
use nalgebra::Point2;
use vision::{
    detect::{
        DetectParams,
        edges::edge_map::edges,
        segments::{
            chains::chains,
            edge_segments::{EdgeSegment, segments},
        },
        tiling::floor_pattern::{FloorPattern, LineFamily, floor_pattern},
    },
    frame::GrayImage,
};

/// A corridor of which much of the floor is seen.
const SEED: u64 = 2;
/// Colours of the two families.
const FAMILIES: [Colour; 2] = [GREEN, ORANGE];
/// Lines of no family.
const OTHER: Colour = [120, 120, 150];
/// Size of the plan of the floor and of each accumulator.
const PLAN_PX: [usize; 2] = [380, 480];
const CHART_PX: [usize; 2] = [510, 200];

pub(crate) fn draw(args: &SceneArgs) -> anyhow::Result<Picture> {
    let work = args.image(Rendered::Floor, SEED)?;
    let p = DetectParams::default();
    let map = edges(&work, &p.edges);
    let segments = segments(&chains(&map, &p.chains), &map, &p.segments);
    let size = (work.width(), work.height());
    let pattern = floor_pattern(&segments, size, &p.tiling)
        .ok_or_else(|| anyhow::anyhow!("no floor with evenly spaced lines was found in the image"))?;
    let removed: usize = pattern.families.iter().map(|f| f.pattern.len()).sum();
    let left = titled(&in_the_image(&work, &segments, &pattern), "segments in the image", WHITE);
    let right = titled(&plan(&pattern), "on the floor, from above", WHITE);
    let charts: Vec<Picture> = pattern
        .families
        .iter()
        .zip(FAMILIES)
        .map(|(family, colour)| {
            let period = family.period_and_phase.filter(|_| !family.pattern.is_empty());
            let words = period.map_or_else(|| "none".into(), |[t, _]| format!("{t:.2}"));
            titled(&chart(family, colour), &format!("concentration by period: {words}"), colour)
        })
        .collect();
    let counts = format!("{} segments, removed as tiling: {removed}", segments.len());
    Ok(explained(
        column(&[row(&[left, right]), row(&charts)]),
        &[
            (&counts, WHITE),
            ("horizon", CYAN),
            ("other segments", OTHER),
            ("one family of parallels", FAMILIES[0]),
            ("the other", FAMILIES[1]),
            ("fitted lines", BLUE),
            ("chosen period", RED),
            ("least concentration", YELLOW),
        ],
    ))
}

/// The segments by family; those that are removed are thick.
fn in_the_image(work: &GrayImage, segments: &[EdgeSegment], pattern: &FloorPattern) -> Picture {
    let mut picture = Picture::of(work, 0.6);
    let line = |picture: &mut Picture, i: usize, width, colour| {
        let s = &segments[i];
        picture.line(s.p_px.into(), s.q_px.into(), width, colour);
    };
    for i in 0..segments.len() {
        line(&mut picture, i, 1.0, OTHER);
    }
    for (family, colour) in pattern.families.iter().zip(FAMILIES) {
        for i in &family.members {
            let width = if family.pattern.contains(i) { 2.4 } else { 1.2 };
            line(&mut picture, pattern.lines[*i].segment, width, colour);
        }
    }
    let row = pattern.horizon_px;
    picture.line([0.0, row], [work.width() as f64, row], 1.6, CYAN);
    picture
}

/// The floor from above, the camera's foot below the middle of the lower border.
fn plan(pattern: &FloorPattern) -> Picture {
    let [width, height] = PLAN_PX;
    let mut picture = Picture::black(width, height);
    let removed: Vec<usize> = pattern.families.iter().flat_map(|f| f.pattern.clone()).collect();
    let ends = || removed.iter().flat_map(|i| pattern.lines[*i].ends);
    let (low, high) = ends().fold((Point2::new(1e9, 1e9), Point2::new(-1e9, -1e9)), |(l, h), e| {
        (Point2::from(l.coords.inf(&e.coords)), Point2::from(h.coords.sup(&e.coords)))
    });
    let extent = high - low;
    let scale = ((width as f64 - 40.0) / extent.x).min((height as f64 - 40.0) / extent.y);
    let middle = nalgebra::center(&low, &high);
    let at = |p: &Point2<f64>| {
        [0.5 * width as f64 + (p.x - middle.x) * scale, 0.5 * height as f64 - (p.y - middle.y) * scale]
    };
    for family in &pattern.families {
        let Some([period, phase]) = family.period_and_phase.filter(|_| !family.pattern.is_empty()) else {
            continue;
        };
        let (sin, cos) = family.direction_rad.sin_cos();
        let reach = extent.norm() + period;
        let count = (reach / period) as i64 + 1;
        let first = ((cos * middle.y - sin * middle.x - phase) / period).round() as i64;
        for i in first - count..=first + count {
            let offset = phase + i as f64 * period;
            let foot = Point2::new(-sin * offset, cos * offset);
            let along = nalgebra::Vector2::new(cos, sin);
            let near = (middle - foot).dot(&along);
            let [from, to] = [-reach, reach].map(|d| at(&(foot + along * (near + d))));
            picture.line(from, to, 0.8, BLUE);
        }
    }
    for line in &pattern.lines {
        picture.line(at(&line.ends[0]), at(&line.ends[1]), 1.0, OTHER);
    }
    for (family, colour) in pattern.families.iter().zip(FAMILIES) {
        for i in &family.members {
            let (line, width) = (&pattern.lines[*i], if family.pattern.contains(i) { 2.4 } else { 1.2 });
            picture.line(at(&line.ends[0]), at(&line.ends[1]), width, colour);
        }
    }
    picture
}

/// Concentration by period, even in 1 / period.
fn chart(family: &LineFamily, colour: Colour) -> Picture {
    let [width, height] = CHART_PX;
    let mut picture = Picture::black(width, height);
    let (floor, top) = (height as f64 - 24.0, 8.0);
    let values = &family.concentrations;
    let (Some(first), Some(last)) = (values.first(), values.last()) else { return picture };
    let x = |period: f64| {
        let share = (period.recip() - first.0.recip()) / (last.0.recip() - first.0.recip());
        10.0 + share * (width as f64 - 20.0)
    };
    let y = |concentration: f64| floor - concentration * (floor - top);
    picture.line([10.0, y(0.0)], [width as f64 - 10.0, y(0.0)], 1.0, WHITE);
    picture.line(
        [10.0, y(family.least_concentration)],
        [width as f64 - 10.0, y(family.least_concentration)],
        1.0,
        YELLOW,
    );
    if let Some([period, _]) = family.period_and_phase.filter(|_| !family.pattern.is_empty()) {
        picture.line([x(period), y(0.0)], [x(period), y(1.0)], 2.0, RED);
    }
    for pair in values.windows(2) {
        picture.line([x(pair[0].0), y(pair[0].1)], [x(pair[1].0), y(pair[1].1)], 1.2, colour);
    }
    for (period, left) in [(first.0, 10), (last.0, width - 70)] {
        picture.text([left, height - 18], 2, &format!("{period:.2}"), WHITE);
    }
    picture
}
