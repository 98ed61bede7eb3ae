//! The quad classifier and non-maximum suppression: what was classified, with its probability.

use super::{
    panels::{explained, on, row, titled},
    scene::{Rendered, SceneArgs},
};
use cli::drawing::{BLUE, Colour, GREEN, Picture, RED, WHITE, YELLOW};
use vision::{
    detect::{
        DetectParams, Quad,
        detector::scored_quads,
        edge_support::gradients::Gradients,
        suppression::non_maximum::{snap_sides, suppress_non_maxima},
    },
    trace::NoTrace,
};

/// A corridor with a poster, a window and tiles.
const SEED: u64 = 14;
/// Brightness of the image under the drawing.
const UNDER: f32 = 0.7;

pub(crate) fn draw(args: &SceneArgs) -> anyhow::Result<Picture> {
    let work = args.image(Rendered::Corridor, SEED)?;
    let p = DetectParams::default();
    let (scored, edges) = scored_quads(&work, &p, &mut NoTrace);
    let gradients = Gradients { image: &work, gx: edges.gx(), gy: edges.gy() };
    let classified = snap_sides(scored.clone(), &gradients, &p.quads);
    let is_likely = |q: &Quad| q.score >= p.quads.min_probability;
    let mut kept = suppress_non_maxima(classified.clone(), &p.quads);
    kept.retain(is_likely);
    let is_kept = |q: &Quad| kept.iter().any(|k| k.corners_px == q.corners_px);
    let quads: Vec<&Quad> = classified.iter().map(|c| &c.quad).collect();
    let rejected: Vec<&Quad> = quads.iter().copied().filter(|q| !is_likely(q)).collect();
    let suppressed: Vec<&Quad> = quads.iter().copied().filter(|q| is_likely(q) && !is_kept(q)).collect();

    let mut left = Picture::of(&work, UNDER);
    outlines(&mut left, &rejected, RED, 1.4);
    let mut right = Picture::of(&work, UNDER);
    outlines(&mut right, &suppressed, BLUE, 1.2);
    outlines(&mut right, &kept.iter().collect::<Vec<_>>(), GREEN, 2.4);
    Ok(both(&left, &right, [scored.len(), rejected.len(), suppressed.len(), kept.len()]))
}

fn both(left: &Picture, right: &Picture, counts: [usize; 4]) -> Picture {
    let [scored, rejected, suppressed, kept] = counts;
    let left = titled(left, &format!("rejected by the classifier: {rejected} of {scored} proposals"), WHITE);
    let right = titled(right, "taken for objects", WHITE);
    explained(
        row(&[left, right]),
        &[
            ("below 65 %", RED),
            (&format!("kept: {kept}"), GREEN),
            (&format!("suppressed by a better one: {suppressed}"), BLUE),
            ("numbers: probability in %", YELLOW),
        ],
    )
}

fn outlines(picture: &mut Picture, quads: &[&Quad], colour: Colour, width_px: f64) {
    for quad in quads {
        picture.quad(&quad.corners_px, width_px, colour);
    }
    let mut labels: Vec<[usize; 2]> = Vec::new();
    for quad in quads {
        let at = on(quad.corners_px.points()[0].into(), 1).map(|c| (c + 5.0).max(0.0) as usize);
        // Of labels over each other the first stays: that of the quad with the better support.
        if labels.iter().all(|l| l[0].abs_diff(at[0]) > 26 || l[1].abs_diff(at[1]) > 15) {
            picture.text(at, 2, &format!("{:.0}", 100.0 * quad.score), YELLOW);
            labels.push(at);
        }
    }
}
