//! What the networks of the search learn from: the detector runs over labelled pictures, and its lines and quads are
//! compared with the labels.

use crate::cli::{
    evaluate::truth::{Truth, TruthImage},
    pictures, screen,
};
use anyhow::Context as _;
use nalgebra::Point2;
use std::collections::BTreeMap;
use vision::{
    detect::{
        candidates,
        evidence::Gradients,
        fitting::{Example, Rivals},
        pyramid,
        quads::{Corners, Quad},
        selection::{resolve, settle},
        side_model::rivals,
    },
    geometry::polygon::{self, Relation},
    params::DetectParams,
    trace::NoTrace,
};

/// A found quad belongs to a labelled one from this overlap on, as far as its sides are concerned.
const SAME_THING: f64 = 0.5;
/// A side of which no line is this near to the label teaches nothing, px of the working image.
const MAX_OFF_PX: f64 = 4.0;
/// From this overlap with a label on a quad is a thing; with a label that does not count, from the second.
const THING: [f64; 2] = [0.6, 0.75];
/// Below this overlap with all labels it is none.
const NO_THING: f64 = 0.5;
/// An inner border covers at least this share of its label: neither the one nor the other.
const INNER_AREA: f64 = 0.25;
const INNER_TOLERANCE_PX: f64 = 4.0;

/// All that is to be learnt from.
#[derive(Debug, Default)]
pub(super) struct Data {
    pub(super) images: usize,
    pub(super) sides: Vec<Rivals>,
    pub(super) things: Vec<Example>,
    /// Groups by name: images, or landmarks that several images show.
    groups: BTreeMap<String, usize>,
}

impl Data {
    /// Adds a set, whose labels count `weight` times.
    pub(super) fn add(
        &mut self,
        truth: &Truth,
        weight: f64,
        params: &DetectParams,
        min_side_px: f64,
    ) -> anyhow::Result<()> {
        let mut params = params.clone();
        params.quads.min_probability = 0.0;
        let progress = screen::progress(truth.images.len(), "searching");
        for image in &truth.images {
            progress.inc(1);
            if image.whole_image || image.quads.is_empty() {
                continue;
            }
            let gray = pictures::read(&image.path).with_context(|| image.path.display().to_string())?;
            let factor = pyramid::working_factor(&gray, params.quads.working_side_px);
            let work = pyramid::reduce(&gray, factor);
            let (rated, edges) = candidates(&work, &params, &mut NoTrace);
            let g = Gradients { image: &work, gx: edges.gx(), gy: edges.gy() };
            let found = resolve(rated.clone(), &params.quads);
            // Where pictures are taught, several images show one landmark: it is held out as a whole.
            let by_landmark = !truth.teach.is_empty();
            for quad in image.quads.iter().filter(|q| q.counts()) {
                let name = quad.landmark.as_deref().filter(|_| by_landmark);
                let group = self.group(&format!("{} {}", truth.name, name.unwrap_or(&image.file)));
                let Some(label) = quad.corners.scaled(1.0 / factor as f64) else { continue };
                if label.min_side_px() >= min_side_px {
                    self.sides.extend(sides(&g, &found, &label, group, weight));
                }
            }
            let group = self.group(&format!("{} {}", truth.name, image.file));
            for settled in settle(rated, &g, &params.quads) {
                let Some(corners) = settled.quad.corners_px.scaled(factor as f64) else { continue };
                let Some(is_one) = is_thing(&corners, image) else { continue };
                self.things.push(Example { group, weight, features: settled.features.to_vec(), is_one });
            }
            self.images += 1;
        }
        progress.finish_and_clear();
        Ok(())
    }

    fn group(&mut self, name: &str) -> usize {
        let next = self.groups.len();
        *self.groups.entry(name.to_owned()).or_insert(next)
    }
}

/// The lines beside each side of the quad found on a label, with their distance from the labelled side.
fn sides(g: &Gradients, found: &[Quad], label: &Corners, group: usize, weight: f64) -> Vec<Rivals> {
    let overlap = |q: &Quad| polygon::iou(label.points(), q.corners_px.points());
    let best = found.iter().map(|q| (overlap(q), q)).reduce(|a, b| if b.0 > a.0 { b } else { a });
    let Some((_, quad)) = best.filter(|b| b.0 > SAME_THING) else { return vec![] };
    let start = quad.corners_px.points();
    let label = aligned(label, start);
    let mut all = Vec::new();
    for (side, lines) in rivals(g, start).iter().enumerate() {
        let off = |ends: &[Point2<f64>; 2]| {
            let along = ends[1] - ends[0];
            let beside = |p: &Point2<f64>| along.perp(&(p - ends[0])).abs() / along.norm();
            beside(&label[side]).max(beside(&label[(side + 1) % 4]))
        };
        let off: Vec<f64> = lines.iter().map(|line| off(&line.ends_px)).collect();
        if off.iter().any(|o| *o < MAX_OFF_PX) && off.iter().all(|o| o.is_finite()) {
            let features = lines.iter().map(|line| line.features.to_vec()).collect();
            all.push(Rivals { group, weight, features, off });
        }
    }
    all
}

/// The label's corners, named from the one that fits best.
fn aligned(label: &Corners, to: &[Point2<f64>; 4]) -> [Point2<f64>; 4] {
    let gap =
        |shift: usize| label.rotated(shift).points().iter().zip(to).map(|(a, b)| (a - b).norm()).sum::<f64>();
    let shift = (0..4).reduce(|a, b| if gap(b) < gap(a) { b } else { a }).unwrap_or(0);
    *label.rotated(shift).points()
}

/// Whether a found quad is a labelled thing; none where the labels do not say.
fn is_thing(found: &Corners, image: &TruthImage) -> Option<bool> {
    let overlap = |o: &Corners| polygon::iou(o.points(), found.points());
    let labels = image.quads.iter().map(|q| (overlap(&q.corners), q.counted, &q.corners));
    let others = image.others.iter().map(|o| (overlap(o), false, o));
    let all: Vec<(f64, bool, &Corners)> = labels.chain(others).collect();
    let (best, counted) =
        all.iter().fold((0.0, true), |best, x| if x.0 > best.0 { (x.0, x.1) } else { best });
    if best >= THING[usize::from(!counted)] {
        return Some(true);
    }
    let inner = |o: &Corners| {
        polygon::relation(o.points(), found.points(), INNER_TOLERANCE_PX) == Relation::Contains
            && found.area_px2() > INNER_AREA * o.area_px2()
    };
    let unclear = best >= NO_THING || !image.quads_complete || image.quads.iter().any(|q| inner(&q.corners));
    (!unclear).then_some(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::evaluate::truth::{QuadState, TruthQuad};

    fn card(x: f64, size: f64) -> Corners {
        Corners::try_from([[x, 0.0], [x + size, 0.0], [x + size, size], [x, size]]).unwrap()
    }

    fn image(counted: bool, complete: bool) -> TruthImage {
        let corners = card(0.0, 100.0);
        let state = QuadState::Full;
        let quad = TruthQuad { corners, landmark: None, state, class: None, counted, view_angle_rad: None };
        TruthImage {
            path: "a".into(),
            file: "a".into(),
            stratum: "all".into(),
            quads: vec![quad],
            others: vec![card(300.0, 100.0)],
            quads_complete: complete,
            whole_image: false,
        }
    }

    #[test]
    fn things_are_told_from_labels() {
        let of = |x, size| is_thing(&card(x, size), &image(true, true));
        assert_eq!((of(5.0, 100.0), of(200.0, 50.0)), (Some(true), Some(false)));
        // Half on the label, and an inner border.
        assert_eq!((of(29.0, 100.0), of(20.0, 60.0)), (None, None));
        // A detail is none, a listed other thing is one.
        assert_eq!((of(20.0, 30.0), of(300.0, 99.0)), (Some(false), Some(true)));
        // Loosely on what does not count: not said. Off an incomplete picture's labels: not said.
        assert_eq!(is_thing(&card(20.0, 100.0), &image(false, true)), None);
        assert_eq!(is_thing(&card(200.0, 50.0), &image(true, false)), None);
    }

    #[test]
    fn a_label_is_named_from_the_corner_that_fits() {
        let (label, found) = (card(0.0, 100.0), card(1.0, 100.0));
        assert_eq!(aligned(&label.rotated(3), found.points()), *label.points());
    }
}
