//! Three-sided sets: the segments that no chosen quad explains, and the sets of three sides among them.

use super::{
    panels::{explained, row, titled},
    scene::{Rendered, SceneArgs},
};
use cli::drawing::{Colour, GREEN, MAGENTA, Picture, WHITE, YELLOW};
use vision::{
    detect::{
        DetectParams, Quad, QuadKind, detect, proposals::three_sided::unexplained,
        segments::edge_segments::EdgeSegment,
    },
    trace::Trace,
};

/// A corridor with a door that the image cuts.
const SEED: u64 = 6;
/// Segments that a chosen quad explains.
const EXPLAINED: Colour = [110, 110, 110];

/// What the detector says of its segments and quads.
#[derive(Default)]
struct DetectorOutput {
    segments: Vec<EdgeSegment>,
    quads: Vec<Quad>,
}

impl Trace for DetectorOutput {
    fn segments(&mut self, segments: &[EdgeSegment]) {
        self.segments = segments.to_vec();
    }

    fn quads(&mut self, quads: &[Quad]) {
        self.quads = quads.to_vec();
    }
}

pub(crate) fn draw(args: &SceneArgs) -> anyhow::Result<Picture> {
    let work = args.image(Rendered::Corridor, SEED)?;
    let mut found = DetectorOutput::default();
    detect(&work, &DetectParams::default(), &mut found);
    let (full, open): (Vec<Quad>, Vec<Quad>) =
        found.quads.into_iter().partition(|q| q.kind == QuadKind::Full);
    let left_over = unexplained(&found.segments, &full);

    let mut left = Picture::of(&work, 0.5);
    for (i, segment) in found.segments.iter().enumerate() {
        let is_left = left_over.binary_search(&i).is_ok();
        let (width, colour) = if is_left { (2.0, YELLOW) } else { (1.2, EXPLAINED) };
        left.line(segment.p_px.into(), segment.q_px.into(), width, colour);
    }
    let mut right = Picture::of(&work, 0.5);
    for quad in &full {
        right.quad(&quad.corners_px, 1.6, GREEN);
    }
    for quad in &open {
        three_sides(&mut right, quad);
    }
    let counts = [
        format!("segments left over: {} of {}", left_over.len(), found.segments.len()),
        format!("quads: {}", full.len()),
        format!("sets of three sides: {}", open.len()),
    ];
    Ok(explained(
        row(&[
            titled(&left, "segments that no quad explains", WHITE),
            titled(&right, "what three of them make", WHITE),
        ]),
        &[
            (&counts[0], YELLOW),
            ("explained by a quad", EXPLAINED),
            (&counts[1], GREEN),
            (&counts[2], MAGENTA),
        ],
    ))
}

/// Three sides, and the chord of their free ends broken.
fn three_sides(picture: &mut Picture, quad: &Quad) {
    picture.tint(&quad.corners_px, MAGENTA, 0.15);
    let corners: [[f64; 2]; 4] = quad.corners_px.into();
    let weakest = |a: &usize, b: &usize| quad.side_support[*a].total_cmp(&quad.side_support[*b]);
    let chord = (0..4).min_by(weakest).unwrap_or(0);
    for (i, from) in corners.into_iter().enumerate() {
        let to = corners[(i + 1) % 4];
        let at = |t: f64| [0, 1].map(|axis| from[axis] + t * (to[axis] - from[axis]));
        if i == chord {
            let pieces = 8.0;
            for k in 0..8 {
                picture.line(at(f64::from(k) / pieces), at((f64::from(k) + 0.5) / pieces), 1.6, MAGENTA);
            }
        } else {
            picture.line(from, to, 2.6, MAGENTA);
        }
    }
    let [x, y] = corners[0].map(|c| (c + 6.0).max(0.0) as usize);
    picture.text([x, y], 2, &format!("{:.0}", 100.0 * quad.score), WHITE);
}
