//! One picture: detected quads compared with labelled ones.

use super::easy::is_easy;
use crate::evaluate::{
    reviewed::ReviewedQuad,
    truth::{QuadState, TruthImage, TruthQuad},
};
use cli::clock::Clock;
use vision::{
    detect::{DetectParams, Quad, QuadKind, detect},
    frame::{GrayImage, PictureRef},
    geometry::{Corners, polygon},
    trace::NoTrace,
};

/// Overlap from which a detected quad belongs to a labelled one at all.
const IOU_SAME: f64 = 0.5;
/// A detection inside a labelled quad by this share of its area, and covering at least
/// [`INNER_AREA`] of it, is an inner border of the same object (mat, canvas).
const INNER_SHARE: f64 = 0.97;
const INNER_AREA: f64 = 0.25;

/// Overlap from which a labelled quad counts as found, and the stricter one.
pub(crate) const FOUND: f64 = 0.7;
pub(crate) const FOUND_WELL: f64 = 0.85;

/// A labelled quad that counts, and the detected quad nearest to it.
#[derive(Debug, Clone)]
pub(crate) struct LabelScore {
    pub(crate) corners: Corners,
    pub(crate) state: QuadState,
    pub(crate) class: String,
    pub(crate) stratum: String,
    pub(crate) min_side_px: f64,
    /// If the set states it.
    pub(crate) view_angle_rad: Option<f64>,
    /// With the detected quad that overlaps most.
    pub(crate) iou: f64,
    /// Mean distance of its four corners from that one's, when found.
    pub(crate) corner_error_px: Option<f64>,
    /// Not found, but an alternate of some detected quad overlaps enough.
    pub(crate) is_alternate: bool,
    /// See [`is_easy`].
    pub(crate) is_easy: bool,
}

/// A detected quad where nothing is labelled.
#[derive(Debug, Clone)]
pub(crate) struct FalseQuad {
    pub(crate) corners: Corners,
    /// Name in the reviewed list, if it is on it.
    pub(crate) reviewed: Option<String>,
}

/// One picture's results.
#[derive(Debug, Clone)]
pub(crate) struct ImageScore {
    pub(crate) file: String,
    pub(crate) stratum: String,
    pub(crate) labels: Vec<LabelScore>,
    pub(crate) found: Vec<Corners>,
    /// None where the labels are not complete.
    pub(crate) false_quads: Option<Vec<FalseQuad>>,
    /// Sets of three sides, and those of them on no labelled quad.
    pub(crate) three_sided: [usize; 2],
    /// Processor time of one thread.
    pub(crate) ms: f64,
}

impl ImageScore {
    /// Order of the worst images: missed and false quads first, then loose and inexact ones.
    pub(crate) fn badness(&self) -> f64 {
        let label = |l: &LabelScore| match l.corner_error_px {
            None => 1.0,
            Some(error) if l.iou < FOUND_WELL => 0.5 + 1e-3 * error.min(100.0),
            Some(error) => 1e-3 * error.min(100.0),
        };
        self.labels.iter().map(label).sum::<f64>() + self.false_left() as f64
    }

    pub(crate) fn missed(&self) -> usize {
        self.labels.iter().filter(|l| l.iou < FOUND).count()
    }

    /// False quads that no reviewed list explains.
    pub(crate) fn false_left(&self) -> usize {
        self.false_quads.iter().flatten().filter(|q| q.reviewed.is_none()).count()
    }
}

/// Detects on one thread and compares, in colour where the picture has colour. Quads with a side
/// shorter than `min_side_px` do not count.
pub(crate) fn score<'a>(
    image: &TruthImage,
    picture: impl Into<PictureRef<'a>>,
    params: &DetectParams,
    min_side_px: f64,
    reviewed: &[ReviewedQuad],
) -> ImageScore {
    let picture = picture.into();
    let clock = Clock::start();
    let mut found = detect(picture, params, &mut NoTrace);
    let ms = clock.ms();
    // Three-sided sets neither find nor falsify a quad.
    let open: Vec<Quad> = found.extract_if(.., |quad| quad.kind != QuadKind::Full).collect();
    let astray = open.iter().filter(|q| !is_real(&q.corners_px, image)).count();
    let counts = |l: &&TruthQuad| l.counted && l.corners.min_side_px() >= min_side_px;
    let false_quads = image.quads_complete.then(|| {
        let is_false = |q: &&Quad| !is_real(&q.corners_px, image);
        found.iter().filter(is_false).map(|q| named(&q.corners_px, reviewed)).collect()
    });
    ImageScore {
        file: image.file.clone(),
        stratum: image.stratum.clone(),
        labels: image
            .quads
            .iter()
            .filter(counts)
            .map(|l| label(l, (image, picture.grey()), &found))
            .collect(),
        found: found.iter().map(|q| q.corners_px).collect(),
        false_quads,
        three_sided: [open.len(), astray],
        ms,
    }
}

fn label(labelled: &TruthQuad, (image, gray): (&TruthImage, &GrayImage), found: &[Quad]) -> LabelScore {
    let is_it = |border: &Corners| polygon::iou(labelled.corners.points(), border.points()) >= FOUND;
    let (iou, nearest) = best(&labelled.corners, found);
    let error = nearest.map(|quad| corner_error_px(&labelled.corners, &quad.corners_px));
    let by_name = if labelled.landmark.is_some() { "landmark" } else { "distractor" };
    LabelScore {
        corners: labelled.corners,
        state: labelled.state,
        class: labelled.class.clone().unwrap_or_else(|| by_name.to_owned()),
        stratum: image.stratum.clone(),
        min_side_px: labelled.corners.min_side_px(),
        view_angle_rad: labelled.view_angle_rad,
        iou,
        corner_error_px: error.filter(|_| iou >= FOUND),
        is_alternate: iou < FOUND && found.iter().flat_map(|q| &q.alternates).any(is_it),
        is_easy: is_easy(gray, labelled),
    }
}

/// The detection that overlaps most, with its overlap.
fn best<'a>(labelled: &Corners, found: &'a [Quad]) -> (f64, Option<&'a Quad>) {
    found
        .iter()
        .map(|quad| (polygon::iou(labelled.points(), quad.corners_px.points()), Some(quad)))
        .fold((0.0, None), |best, next| if next.0 > best.0 { next } else { best })
}

/// Whether it is a labelled quad, an inner border of one, or another real quad that the set lists.
pub(crate) fn is_real(found: &Corners, image: &TruthImage) -> bool {
    let area_px2 = found.area_px2();
    let same = |o: &Corners| polygon::iou(o.points(), found.points()) >= IOU_SAME;
    let inner = |o: &Corners| {
        polygon::intersection_area(o.points(), found.points()) >= INNER_SHARE * area_px2
            && area_px2 >= INNER_AREA * o.area_px2()
    };
    image.quads.iter().any(|l| same(&l.corners) || inner(&l.corners)) || image.others.iter().any(same)
}

fn named(found: &Corners, reviewed: &[ReviewedQuad]) -> FalseQuad {
    let there = reviewed
        .iter()
        .filter(|t| t.real)
        .find(|t| polygon::iou(t.corners.points(), found.points()) >= IOU_SAME);
    FalseQuad { corners: *found, reviewed: there.map(|t| t.what.clone()) }
}

/// Mean distance of the four corners, for the best of the four start corners.
pub(crate) fn corner_error_px(labelled: &Corners, found: &Corners) -> f64 {
    (0..4)
        .map(|shift| {
            let pairs = labelled.points().iter().zip(found.rotated(shift).points().to_owned());
            pairs.map(|(a, b)| (a - b).norm()).sum::<f64>() / 4.0
        })
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn corners(x: f64, y: f64, w: f64, h: f64) -> Corners {
        Corners::try_from([[x, y], [x + w, y], [x + w, y + h], [x, y + h]]).unwrap()
    }

    fn labelled(corners: Corners, counted: bool) -> TruthQuad {
        let state = QuadState::Full;
        TruthQuad { corners, landmark: None, state, class: None, counted, view_angle_rad: None }
    }

    fn image(quads: Vec<TruthQuad>, others: Vec<Corners>) -> TruthImage {
        TruthImage {
            path: "a".into(),
            file: "a".into(),
            stratum: "all".into(),
            quads,
            others,
            quads_complete: true,
            whole_image: false,
            false_quads: vec![],
        }
    }

    /// A bright card at (60, 50), 100 x 80, and a dark one at (200, 60), 60 x 60.
    fn cards() -> GrayImage {
        GrayImage::from_fn(320, 240, |u, v| match (u, v) {
            (60..160, 50..130) => 220,
            (200..260, 60..120) => 30,
            _ => 120,
        })
    }

    const BRIGHT: [f64; 4] = [59.5, 49.5, 100.0, 80.0];
    const DARK: [f64; 4] = [199.5, 59.5, 60.0, 60.0];

    fn at([x, y, w, h]: [f64; 4]) -> Corners {
        corners(x, y, w, h)
    }

    fn scored(image: &TruthImage, min_side_px: f64, reviewed: &[ReviewedQuad]) -> ImageScore {
        score(image, &cards(), &DetectParams::default(), min_side_px, reviewed)
    }

    #[test]
    fn quads_are_found_missed_or_false() {
        let s = scored(&image(vec![labelled(at(BRIGHT), true)], vec![]), 0.0, &[]);
        assert_eq!((s.labels.len(), s.missed(), s.false_left()), (1, 0, 1));
        assert!(s.labels[0].corner_error_px.unwrap() < 0.5 && s.labels[0].iou > 0.98);
        let s = scored(&image(vec![labelled(corners(10.0, 150.0, 50.0, 50.0), true)], vec![]), 0.0, &[]);
        assert_eq!((s.missed(), s.false_left()), (1, 2));
        assert!(s.badness() > 2.9);
    }

    #[test]
    fn uncounted_labels_are_neither_missed_nor_false() {
        for (quads, others) in [
            (vec![labelled(at(BRIGHT), false), labelled(at(DARK), false)], vec![]),
            (vec![], vec![at(BRIGHT), at(DARK)]),
        ] {
            let s = scored(&image(quads, others), 0.0, &[]);
            assert_eq!((s.labels.len(), s.false_left()), (0, 0));
        }
        let small =
            scored(&image(vec![labelled(at(BRIGHT), true), labelled(at(DARK), true)], vec![]), 70.0, &[]);
        assert_eq!((small.labels.len(), small.false_left()), (1, 0));
    }

    #[test]
    fn sets_of_three_sides_are_counted_apart() {
        // A door to the lower border of the picture, and the same without a label.
        let door =
            GrayImage::from_fn(320, 240, |u, v| if (100..180).contains(&u) && v >= 60 { 40 } else { 200 });
        let mut params = DetectParams::default();
        params.quads.three_sided = true;
        let of = |quads| score(&image(quads, vec![]), &door, &params, 0.0, &[]).three_sided;
        assert_eq!(of(vec![labelled(corners(99.5, 59.5, 80.0, 180.0), true)]), [1, 0]);
        assert_eq!(of(vec![]), [1, 1]);
        assert_eq!(scored(&image(vec![], vec![]), 0.0, &[]).three_sided, [0, 0]);
    }

    #[test]
    fn reviewed_quads_are_counted_apart() {
        let mut list = [ReviewedQuad { corners: at(DARK), what: "switch".into(), real: true }];
        let s = scored(&image(vec![labelled(at(BRIGHT), true)], vec![]), 0.0, &list);
        assert_eq!((s.false_quads.as_ref().unwrap().len(), s.false_left()), (1, 0));
        assert_eq!(s.false_quads.unwrap()[0].reviewed.as_deref(), Some("switch"));
        list[0].real = false;
        assert_eq!(scored(&image(vec![labelled(at(BRIGHT), true)], vec![]), 0.0, &list).false_left(), 1);
    }

    #[test]
    fn an_inner_border_is_real_and_a_detail_is_not() {
        let frame = |[x, y, w, h]: [f64; 4], by: f64| corners(x - by, y - by, w + 2.0 * by, h + 2.0 * by);
        let half = image(vec![labelled(frame(BRIGHT, 30.0), true), labelled(at(DARK), false)], vec![]);
        assert_eq!(scored(&half, 0.0, &[]).false_left(), 0);
        let detail = image(vec![labelled(frame(BRIGHT, 60.0), true), labelled(at(DARK), false)], vec![]);
        assert_eq!(scored(&detail, 0.0, &[]).false_left(), 1);
    }

    #[test]
    fn corner_error_does_not_depend_on_the_start_corner() {
        let a = corners(0.0, 0.0, 100.0, 50.0);
        let b = corners(3.0, 4.0, 100.0, 50.0).rotated(2);
        assert!((corner_error_px(&a, &b) - 5.0).abs() < 1e-12);
    }
}
