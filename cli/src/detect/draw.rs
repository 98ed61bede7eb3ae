//! One picture for every stage of the detector, and an overview of all. In: the recorded stages.
//! Out: pictures.

use super::record::Record;
use crate::drawing::{BLUE, CYAN, Colour, GREEN, MAGENTA, ORANGE, Picture, RED, SERIES, WHITE, YELLOW};
use nalgebra::Point2;
use std::path::Path;
use vision::detect::{Quad, QuadKind};

/// Width that stage pictures are enlarged to, and those of the overview; whole factors only.
const STAGE_WIDTH_PX: usize = 1280;
const PANEL_WIDTH_PX: usize = 640;
/// Largest enlargement.
const MAX_FACTOR: usize = 8;
/// Brightness of the image under the drawing.
const UNDER: f32 = 0.55;
/// Quad proposals that are drawn: the best supported.
const MAX_PROPOSALS: usize = 150;
/// Columns of the overview.
const COLUMNS: usize = 3;

/// A stage's drawing: the record and how many times the picture is enlarged.
type Stage = fn(&Record, usize) -> Picture;

/// The stages with the names of their files.
const STAGES: [(&str, Stage); 5] = [
    ("1-edges", edges),
    ("2-chains", chains),
    ("3-segments", segments),
    ("4-pairs", pairs),
    ("5-quads", quads),
];

/// Writes all pictures of a record; their names begin with `stem`.
pub(crate) fn write(folder: &Path, stem: &str, record: &Record) -> anyhow::Result<()> {
    let factor = |width: usize| (width / record.work.width().max(1)).clamp(1, MAX_FACTOR);
    let mut panels = vec![image(record, factor(PANEL_WIDTH_PX))];
    for (name, stage) in STAGES {
        stage(record, factor(STAGE_WIDTH_PX)).save(&folder.join(format!("{stem}-{name}.png")))?;
        panels.push(stage(record, factor(PANEL_WIDTH_PX)));
    }
    let (width, height) = (panels[0].width(), panels[0].height());
    let mut overview = Picture::black(COLUMNS * width, panels.len().div_ceil(COLUMNS) * height);
    for (i, panel) in panels.iter().enumerate() {
        overview.paste(panel, [i % COLUMNS * width, i / COLUMNS * height]);
    }
    overview.save(&folder.join(format!("{stem}-overview.png")))
}

/// The picture under a drawing, enlarged.
fn under(record: &Record, factor: usize, brightness: f32) -> Picture {
    Picture::of(&record.work, brightness).enlarged(factor)
}

/// A point of the working image on the enlarged picture.
fn on(p: &Point2<f64>, factor: usize) -> [f64; 2] {
    [p.x, p.y].map(|x| (x + 0.5) * factor as f64 - 0.5)
}

fn image(record: &Record, factor: usize) -> Picture {
    let words =
        format!("{} x {} pixels, reduced by {}", record.work.width(), record.work.height(), record.factor);
    under(record, factor, 1.0).with_legend(&[(&words, WHITE)])
}

/// Edge pixels by the direction of their gradient, brighter where it is steeper.
fn edges(record: &Record, factor: usize) -> Picture {
    let mut picture = under(record, factor, 0.25);
    let map = &record.edges;
    let width = map.width().max(1);
    for at in map.pixels().iter().map(|i| *i as usize) {
        let g = map.gradient(at % width, at / width);
        let turn = f64::from(g.y.atan2(g.x)) / std::f64::consts::TAU + 0.5;
        let dim = (0.35 + f64::from(g.norm()) / 60.0).min(1.0);
        let colour = hue(turn).map(|c| (f64::from(c) * dim) as u8);
        let centre = map.position_px(at);
        picture.disc(on(&centre, factor), 0.45 * factor as f64, colour);
    }
    let count = format!("edges: {} pixels", map.pixels().len());
    picture.with_legend(&[
        (&count, WHITE),
        ("brighter to the right", hue(0.5)),
        ("below", hue(0.75)),
        ("left", hue(0.0)),
        ("above", hue(0.25)),
    ])
}

/// A full turn through the colours.
fn hue(turn: f64) -> Colour {
    [0.0, 1.0 / 3.0, 2.0 / 3.0].map(|phase| {
        let level = 0.55 + 0.45 * ((turn - phase) * std::f64::consts::TAU).cos();
        (255.0 * level) as u8
    })
}

/// Chains in changing colours.
fn chains(record: &Record, factor: usize) -> Picture {
    let mut picture = under(record, factor, 0.25);
    for (i, chain) in record.chains.iter().enumerate() {
        let points: Vec<[f64; 2]> = chain.points.iter().map(|p| on(&p.position_px, factor)).collect();
        for step in points.windows(2) {
            picture.line(step[0], step[1], 1.4, SERIES[i % SERIES.len()]);
        }
        if let (true, Some(first), Some(last)) = (chain.closed, points.first(), points.last()) {
            picture.line(*last, *first, 1.4, SERIES[i % SERIES.len()]);
        }
    }
    let count = format!("chains: {}, a colour each", record.chains.len());
    picture.with_legend(&[(&count, WHITE)])
}

/// Segments in changing colours, their ends dotted; tiling crossed out by its colour.
fn segments(record: &Record, factor: usize) -> Picture {
    let mut picture = under(record, factor, UNDER);
    for removed in &record.tiling {
        picture.line(on(&removed.p_px, factor), on(&removed.q_px, factor), 1.2, [150, 40, 40]);
    }
    for (i, segment) in record.segments.iter().enumerate() {
        let (p, q) = (on(&segment.p_px, factor), on(&segment.q_px, factor));
        let colour = SERIES[i % SERIES.len()];
        picture.line(p, q, 1.8, colour);
        picture.disc(p, 2.5, colour);
        picture.disc(q, 2.5, colour);
    }
    let count = format!("segments: {}", record.segments.len());
    let tiling = format!("removed as tiling: {}", record.tiling.len());
    let mut words = vec![(count.as_str(), WHITE)];
    if !record.tiling.is_empty() {
        words.push((&tiling, RED));
    }
    picture.with_legend(&words)
}

/// The paper's matched pairs, or the quad proposals.
fn pairs(record: &Record, factor: usize) -> Picture {
    let mut picture = under(record, factor, UNDER);
    for segment in &record.segments {
        picture.line(on(&segment.p_px, factor), on(&segment.q_px, factor), 1.0, [130, 130, 130]);
    }
    for (i, pair) in record.pairs.iter().enumerate() {
        let colour = SERIES[i % SERIES.len()];
        for k in [pair.k, pair.l] {
            let Some(side) = record.segments.get(k) else { continue };
            picture.line(on(&side.p_px, factor), on(&side.q_px, factor), 2.2, colour);
        }
        for (from, to) in [(0, 3), (1, 2)] {
            picture.line(on(&pair.quad_px[from], factor), on(&pair.quad_px[to], factor), 0.8, colour);
        }
    }
    let mut seeds: Vec<_> = record.seeds.iter().collect();
    seeds.sort_by(|a, b| b.fit.total_cmp(&a.fit));
    seeds.truncate(MAX_PROPOSALS);
    for seed in seeds.iter().rev() {
        for i in 0..4 {
            let (from, to) = (on(&seed.corners_px[i], factor), on(&seed.corners_px[(i + 1) % 4], factor));
            let has_segment = seed.sides[i].is_some();
            picture.line(
                from,
                to,
                if has_segment { 1.2 } else { 0.8 },
                if has_segment { support_colour(seed.fit) } else { CYAN },
            );
        }
    }
    if record.pairs.is_empty() {
        let count = format!("proposals: {}, the best {}", record.seeds.len(), seeds.len());
        let half = support_colour(0.5);
        picture.with_legend(&[
            (&count, WHITE),
            ("worst side half supported", half),
            ("wholly", support_colour(1.0)),
            ("side without segment", CYAN),
        ])
    } else {
        let count = format!("pairs: {}, a colour each", record.pairs.len());
        picture.with_legend(&[(&count, WHITE)])
    }
}

/// Orange at one half, green at one.
fn support_colour(support: f64) -> Colour {
    let t = (2.0 * support - 1.0).clamp(0.0, 1.0);
    std::array::from_fn(|i| (f64::from(ORANGE[i]) * (1.0 - t) + f64::from(GREEN[i]) * t) as u8)
}

/// Quads with their alternates and scores; the missing side of a three-sided set is a broken line.
fn quads(record: &Record, factor: usize) -> Picture {
    let mut picture = under(record, factor, UNDER);
    let scale = factor as f64 / record.factor as f64;
    for quad in &record.quads {
        for alternate in quad.alternates.iter().filter_map(|a| a.scaled(scale)) {
            picture.quad(&alternate, 1.0, BLUE);
        }
    }
    for quad in &record.quads {
        draw_quad(&mut picture, quad, scale);
    }
    let full = record.quads.iter().filter(|q| q.kind == QuadKind::Full).count();
    let count = format!("quads: {full}");
    let three = format!("three sides: {}", record.quads.len() - full);
    picture.with_legend(&[
        (&count, GREEN),
        (&three, MAGENTA),
        ("alternates", BLUE),
        ("numbers: score in %", YELLOW),
    ])
}

fn draw_quad(picture: &mut Picture, quad: &Quad, scale: f64) {
    let Some(corners) = quad.corners_px.scaled(scale) else { return };
    let colour = if quad.kind == QuadKind::Full { GREEN } else { MAGENTA };
    picture.tint(&corners, colour, 0.12);
    let points = corners.points().map(|p| [p.x, p.y]);
    for (i, from) in points.into_iter().enumerate() {
        let to = points[(i + 1) % 4];
        if quad.kind == QuadKind::ThreeSided && quad.side_support[i] <= 0.0 {
            broken(picture, from, to, colour);
        } else {
            picture.line(from, to, 2.0, colour);
        }
        picture.disc(from, 3.0, WHITE);
    }
    let score = format!("{:.0}", 100.0 * quad.score);
    let at = points[0].map(|x| (x + 6.0).max(0.0) as usize);
    picture.text(at, 2, &score, YELLOW);
}

/// A broken line.
fn broken(picture: &mut Picture, from: [f64; 2], to: [f64; 2], colour: Colour) {
    let length = (to[0] - from[0]).hypot(to[1] - from[1]);
    let pieces = (length / 12.0).clamp(1.0, 200.0) as usize;
    let at = |t: f64| [0, 1].map(|i| from[i] + t * (to[i] - from[i]));
    for i in 0..pieces {
        picture.line(at(i as f64 / pieces as f64), at((i as f64 + 0.5) / pieces as f64), 1.4, colour);
    }
}
