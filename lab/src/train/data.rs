//! Training data of the detector's networks: the detector runs over labelled pictures, and its
//! lines and quads are compared with the labels.

use super::network_training::{ChoiceExample, LabelledExample};
use crate::evaluate::truth::{Truth, TruthImage};
use anyhow::Context as _;
use cli::{pictures, screen};
use nalgebra::Point2;
use std::collections::{BTreeMap, BTreeSet};
use vision::{
    detect::{
        DetectParams, Quad,
        border_model::choose_sides::side_candidates,
        edge_support::gradients::Gradients,
        pyramid, scored_quads,
        suppression::non_maximum::{snap_sides, suppress_overlaps},
    },
    geometry::{
        Corners,
        polygon::{self, Relation},
    },
    trace::NoTrace,
};

/// A detected quad's sides are compared with a labelled quad from this overlap on.
const SAME_OBJECT: f64 = 0.5;
/// A side without a line this near to the label is left out, px of the working image.
const MAX_OFF_PX: f64 = 4.0;
/// Overlap with a label from which a quad is an object; the second for labels that do not count.
const OBJECT: [f64; 2] = [0.6, 0.75];
/// Below this overlap with all labels a quad is no object.
const NO_OBJECT: f64 = 0.5;
/// An inner border covers at least this share of its label; it is neither object nor none.
const INNER_AREA: f64 = 0.25;
const INNER_TOLERANCE_PX: f64 = 4.0;
/// Least probability of the quad classifier while gathering: all quads are examples.
const SURE: f64 = 0.0;

/// A labelled set, and in which part of the data each of its images is.
#[derive(Debug)]
pub(super) struct Set {
    pub(super) truth: Truth,
    /// Weight of its labels.
    pub(super) weight: f64,
    /// Of each image.
    parts: Vec<usize>,
}

impl Set {
    /// Deals the images to `parts` parts of about the same size. If landmarks are taught, images of
    /// one landmark stay in one part.
    pub(super) fn new(truth: Truth, weight: f64, parts: usize) -> Self {
        let parts = if truth.teach.is_empty() {
            (0..truth.images.len()).map(|i| i % parts.max(1)).collect()
        } else {
            dealt(&truth.images, parts.max(1))
        };
        Self { truth, weight, parts }
    }

    /// The images with their part.
    pub(super) fn images(&self) -> impl Iterator<Item = (&TruthImage, usize)> {
        self.truth.images.iter().zip(self.parts.iter().copied()).filter(|(image, _)| !image.whole_image)
    }
}

/// Parts of images such that no landmark is in two: the largest groups first, each to the part that
/// has fewest.
fn dealt(images: &[TruthImage], parts: usize) -> Vec<usize> {
    let mut group: Vec<usize> = (0..images.len()).collect();
    let mut first: BTreeMap<&str, usize> = BTreeMap::new();
    for (i, image) in images.iter().enumerate() {
        for name in image.quads.iter().filter_map(|q| q.landmark.as_deref()) {
            let (from, to) = (group[i], group[*first.entry(name).or_insert(i)]);
            group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
        }
    }
    let counts =
        |g: usize| group.iter().zip(images).filter(|(x, image)| **x == g && !image.whole_image).count();
    let mut order: Vec<(usize, usize)> =
        group.iter().copied().collect::<BTreeSet<_>>().into_iter().map(|g| (counts(g), g)).collect();
    order.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut sizes = vec![0; parts];
    let mut part: BTreeMap<usize, usize> = BTreeMap::new();
    for (count, g) in order {
        let least = (0..parts).min_by_key(|p| sizes[*p]).unwrap_or(0);
        sizes[least] += count;
        part.insert(g, least);
    }
    group.iter().map(|g| part.get(g).copied().unwrap_or(0)).collect()
}

/// Examples of both networks. Groups are the parts of the data.
#[derive(Debug, Default)]
pub(super) struct Data {
    pub(super) images: usize,
    pub(super) sides: Vec<ChoiceExample>,
    pub(super) quads: Vec<LabelledExample>,
}

impl Data {
    /// Runs the detector over all sets.
    pub(super) fn gather(sets: &[Set], params: &DetectParams, min_side_px: f64) -> anyhow::Result<Self> {
        let mut data = Self::default();
        let mut params = params.clone();
        // Non-maximum suppression by rank runs first, as in the detector; the examples left overlap
        // little.
        params.quads.sure_probability = SURE;
        for set in sets {
            let progress = screen::progress(set.images().count(), "searching");
            for (image, part) in set.images() {
                progress.inc(1);
                if !image.quads.is_empty() || !image.false_quads.is_empty() {
                    data.add(image, [part as f64, set.weight], &params, min_side_px)?;
                }
            }
            progress.finish_and_clear();
        }
        Ok(data)
    }

    fn add(
        &mut self,
        image: &TruthImage,
        [part, weight]: [f64; 2],
        params: &DetectParams,
        min_side_px: f64,
    ) -> anyhow::Result<()> {
        let group = part as usize;
        let picture =
            pictures::read_picture(&image.path).with_context(|| image.path.display().to_string())?;
        let factor = pyramid::working_factor(&picture, params.quads.working_side_px);
        let work = picture.map(|plane| pyramid::reduce(plane, factor));
        let (rated, edges) = scored_quads(&work, params, &mut NoTrace);
        let g = Gradients { image: work.grey(), gx: edges.gx(), gy: edges.gy() };
        let found = suppress_overlaps(rated.clone(), &params.quads);
        for quad in image.quads.iter().filter(|q| q.counts()) {
            let Some(label) = quad.corners.scaled(1.0 / factor as f64) else { continue };
            if label.min_side_px() >= min_side_px {
                self.sides.extend(sides(&g, &found, &label, group, weight));
            }
        }
        for classified in snap_sides(rated, &g, &params.quads) {
            let Some(corners) = classified.quad.corners_px.scaled(factor as f64) else { continue };
            let Some(is_one) = is_object(&corners, image) else { continue };
            self.quads.push(LabelledExample {
                group,
                weight,
                features: classified.features.to_vec(),
                is_one,
            });
        }
        self.images += 1;
        Ok(())
    }
}

/// The lines beside each side of the quad found on a label, with their distance from the labelled
/// side.
fn sides(g: &Gradients, found: &[Quad], label: &Corners, group: usize, weight: f64) -> Vec<ChoiceExample> {
    let overlap = |q: &Quad| polygon::iou(label.points(), q.corners_px.points());
    let best = found.iter().map(|q| (overlap(q), q)).reduce(|a, b| if b.0 > a.0 { b } else { a });
    let Some((_, quad)) = best.filter(|b| b.0 > SAME_OBJECT) else { return vec![] };
    let start = quad.corners_px.points();
    let label = aligned(label, start);
    let mut all = Vec::new();
    for (side, lines) in side_candidates(g, start).iter().enumerate() {
        let off = |ends: &[Point2<f64>; 2]| {
            let along = ends[1] - ends[0];
            let beside = |p: &Point2<f64>| along.perp(&(p - ends[0])).abs() / along.norm();
            beside(&label[side]).max(beside(&label[(side + 1) % 4]))
        };
        let off: Vec<f64> = lines.iter().map(|line| off(&line.ends_px)).collect();
        if off.iter().any(|o| *o < MAX_OFF_PX) && off.iter().all(|o| o.is_finite()) {
            let features = lines.iter().map(|line| line.features.to_vec()).collect();
            all.push(ChoiceExample { group, weight, features, off });
        }
    }
    all
}

/// The label's corners, in the cyclic order that fits best.
fn aligned(label: &Corners, to: &[Point2<f64>; 4]) -> [Point2<f64>; 4] {
    let gap =
        |shift: usize| label.rotated(shift).points().iter().zip(to).map(|(a, b)| (a - b).norm()).sum::<f64>();
    let shift = (0..4).reduce(|a, b| if gap(b) < gap(a) { b } else { a }).unwrap_or(0);
    *label.rotated(shift).points()
}

/// Whether a detected quad is a labelled object; `None` if the labels do not say: it overlaps a
/// label loosely, lies off the labels of an incomplete picture, or on another real quad that is no
/// border of a label.
fn is_object(found: &Corners, image: &TruthImage) -> Option<bool> {
    let overlap = |o: &Corners| polygon::iou(o.points(), found.points());
    if image.false_quads.iter().any(|q| overlap(q) >= OBJECT[0]) {
        return Some(false);
    }
    let border = |o: &Corners| {
        let holds =
            |q: &Corners| polygon::relation(q.points(), o.points(), INNER_TOLERANCE_PX) == Relation::Contains;
        image.quads.iter().any(|q| holds(&q.corners) && o.area_px2() > INNER_AREA * q.corners.area_px2())
    };
    let labels = image.quads.iter().map(|q| (overlap(&q.corners), usize::from(!q.counted), &q.corners));
    let others = image.others.iter().map(|o| (overlap(o), if border(o) { 1 } else { 2 }, o));
    let (best, kind) =
        labels.chain(others).fold((0.0, 0), |best, x| if x.0 > best.0 { (x.0, x.1) } else { best });
    if best >= OBJECT[kind.min(1)] {
        return (kind < 2).then_some(true);
    }
    let inner = |o: &Corners| {
        polygon::relation(o.points(), found.points(), INNER_TOLERANCE_PX) == Relation::Contains
            && found.area_px2() > INNER_AREA * o.area_px2()
    };
    let unclear = best >= NO_OBJECT || !image.quads_complete || image.quads.iter().any(|q| inner(&q.corners));
    (!unclear).then_some(false)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::truth::{QuadState, TruthQuad};

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
            false_quads: vec![card(600.0, 100.0)],
        }
    }

    #[test]
    fn labels_decide_what_is_an_object() {
        let of = |x, size| is_object(&card(x, size), &image(true, true));
        assert_eq!((of(5.0, 100.0), of(200.0, 50.0)), (Some(true), Some(false)));
        // Half on the label, and an inner border.
        assert_eq!((of(29.0, 100.0), of(20.0, 60.0)), (None, None));
        // A detail is none; another real quad beside the labels has no label.
        assert_eq!((of(20.0, 30.0), of(300.0, 99.0)), (Some(false), None));
        // A listed inner border is one, a listed false quad is not.
        let mut bordered = image(true, true);
        bordered
            .others
            .push(Corners::try_from([[9.0, 9.0], [91.0, 9.0], [91.0, 91.0], [9.0, 91.0]]).unwrap());
        let inner = Corners::try_from([[12.0, 12.0], [89.0, 12.0], [89.0, 89.0], [12.0, 89.0]]).unwrap();
        assert_eq!((is_object(&inner, &image(true, true)), is_object(&inner, &bordered)), (None, Some(true)));
        assert_eq!(is_object(&card(602.0, 100.0), &image(true, false)), Some(false));
        // No label: loosely on a quad that does not count, and off the labels of an incomplete
        // picture.
        assert_eq!(is_object(&card(20.0, 100.0), &image(false, true)), None);
        assert_eq!(is_object(&card(200.0, 50.0), &image(true, false)), None);
    }

    #[test]
    fn no_landmark_is_in_two_parts_and_parts_are_of_equal_size() {
        let shows = |names: &[&str]| {
            let mut shown = image(true, true);
            let quad = shown.quads[0].clone();
            shown.quads =
                names.iter().map(|n| TruthQuad { landmark: Some((*n).to_owned()), ..quad.clone() }).collect();
            shown
        };
        let images = [
            shows(&["a"]),
            shows(&["b", "c"]),
            shows(&["a", "d"]),
            shows(&["c"]),
            shows(&["e"]),
            shows(&["d"]),
        ];
        let parts = dealt(&images, 2);
        assert_eq!(parts, [0, 1, 0, 1, 1, 0]);
    }

    #[test]
    fn a_labels_corners_start_where_they_fit() {
        let (label, found) = (card(0.0, 100.0), card(1.0, 100.0));
        assert_eq!(aligned(&label.rotated(3), found.points()), *label.points());
    }
}
