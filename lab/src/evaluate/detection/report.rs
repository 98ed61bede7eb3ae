//! All pictures of a set together: figures with their 95 % confidence intervals, for everything and
//! for groups.

use super::score::{FOUND, FOUND_WELL, ImageScore, LabelScore};
use crate::evaluate::{
    statistics::{Interval, bootstrap, median, quantile, wilson},
    truth::QuadState,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// Quantile that is given beside a median.
const MOST: f64 = 0.9;
/// Lower ends of the groups by shortest side, px.
const SIDES_PX: [u32; 6] = [0, 20, 30, 50, 100, 200];
/// Lower ends of the groups by view angle, degrees.
const ANGLES_DEG: [u32; 5] = [0, 30, 50, 60, 70];
/// A quad whose normal points at most this far away from the camera is seen from ahead, degrees.
pub(super) const AHEAD_DEG: f64 = 50.0;

/// Figures of labelled quads.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Group {
    pub(crate) quads: usize,
    pub(crate) recall_70: f64,
    pub(crate) recall_85: f64,
    /// By Wilson's score.
    pub(crate) recall_70_interval: Interval,
    pub(crate) recall_85_interval: Interval,
    /// Missed, but an alternate of some detected quad overlaps by 0.7.
    pub(crate) missed_but_alternate: usize,
    /// Median over found quads (`IoU` 0.7) of the mean distance of their four corners; `null` when
    /// none is found.
    pub(crate) corner_error_px: Option<f64>,
    /// 90 % quantile of them.
    pub(crate) corner_error_90_px: Option<f64>,
    /// By resampling images, as for everything below.
    pub(crate) corner_error_interval: Option<Interval>,
}

/// False quads and time of images.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ImageFigures {
    pub(crate) images: usize,
    /// Over images whose labels are complete; `null` where there is none.
    pub(crate) false_per_image: Option<f64>,
    pub(crate) false_per_image_interval: Option<Interval>,
    /// Without those that the reviewed list explains.
    pub(crate) false_per_image_reviewed: Option<f64>,
    pub(crate) false_per_image_reviewed_interval: Option<Interval>,
    pub(crate) false_quads: usize,
    pub(crate) reviewed_quads: usize,
    pub(crate) images_complete: usize,
    /// Sets of three sides, and those of them on no labelled quad.
    pub(crate) three_sided: [usize; 2],
    /// Median processor time of one thread.
    pub(crate) ms_per_image: f64,
    pub(crate) ms_per_image_90: f64,
    pub(crate) ms_per_image_interval: Option<Interval>,
}

/// The figures of one set under one set of parameters. Quads are those labelled fully in view,
/// unless a group says otherwise.
#[derive(Debug, Serialize)]
pub(crate) struct Report {
    pub(crate) set: String,
    pub(crate) params: String,
    pub(crate) unreadable: usize,
    #[serde(flatten)]
    pub(crate) all: Group,
    #[serde(flatten)]
    pub(crate) images: ImageFigures,
    /// Quads that are easy to see; `null` if there is none.
    pub(crate) easy: Option<Group>,
    pub(crate) by_state: BTreeMap<String, Group>,
    pub(crate) by_class: BTreeMap<String, Group>,
    /// Of those seen from ahead.
    pub(crate) by_class_ahead: BTreeMap<String, Group>,
    pub(crate) by_stratum: BTreeMap<String, Group>,
    pub(crate) by_shortest_side: Vec<(String, Group)>,
    pub(crate) by_view_angle: Vec<(String, Group)>,
    pub(crate) images_by_stratum: BTreeMap<String, ImageFigures>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) worst: Vec<WorstImage>,
    #[serde(skip)]
    pub(crate) scores: Vec<ImageScore>,
}

/// An image among the worst.
#[derive(Debug, Serialize)]
pub(crate) struct WorstImage {
    pub(crate) file: String,
    pub(crate) missed: usize,
    /// Found at `IoU` 0.7, not at 0.85.
    pub(crate) loose: usize,
    pub(crate) false_quads: usize,
    pub(crate) corner_error_px: Option<f64>,
}

impl Report {
    /// The figures; of the worst images `worst` are named.
    pub(crate) fn new(
        set: &str,
        params: &str,
        scores: Vec<ImageScore>,
        unreadable: usize,
        worst: usize,
    ) -> Self {
        let full = |l: &LabelScore| l.state == QuadState::Full;
        let by = |key: fn(&LabelScore) -> String, of: fn(&LabelScore) -> bool| {
            let keys = scores.iter().flat_map(|s| &s.labels).filter(|l| full(l) && of(l)).map(key);
            let keys: std::collections::BTreeSet<String> = keys.collect();
            let figures = |k: String| {
                let group = Group::of(&scores, |l| full(l) && of(l) && key(l) == k)?;
                Some((k, group))
            };
            keys.into_iter().filter_map(figures).collect()
        };
        let states = [QuadState::Full, QuadState::Truncated, QuadState::Occluded];
        let by_state = states
            .into_iter()
            .filter_map(|state| Some((state.name().to_owned(), Group::of(&scores, |l| l.state == state)?)))
            .collect();
        let strata: std::collections::BTreeSet<&String> = scores.iter().map(|s| &s.stratum).collect();
        let of_stratum = |stratum: &String| {
            let images: Vec<&ImageScore> = scores.iter().filter(|s| s.stratum == *stratum).collect();
            (stratum.clone(), ImageFigures::of(&images))
        };
        Self {
            set: set.to_owned(),
            params: params.to_owned(),
            unreadable,
            all: Group::of(&scores, full).unwrap_or_else(Group::empty),
            images: ImageFigures::of(&scores.iter().collect::<Vec<_>>()),
            easy: Group::of(&scores, |l| l.is_easy),
            by_state,
            by_class: by(|l| l.class.clone(), |_| true),
            by_class_ahead: by(
                |l| l.class.clone(),
                |l| l.view_angle_rad.is_some_and(|angle| angle.to_degrees() <= AHEAD_DEG),
            ),
            by_stratum: by(|l| l.stratum.clone(), |_| true),
            by_shortest_side: binned(&scores, &SIDES_PX, "px", |l| Some(l.min_side_px)),
            by_view_angle: binned(&scores, &ANGLES_DEG, "deg", |l| Some(l.view_angle_rad?.to_degrees())),
            images_by_stratum: strata.into_iter().map(of_stratum).collect(),
            worst: worst_images(&scores, worst),
            scores,
        }
    }
}

/// Indices of the worst images, the worst first; of equals the earlier.
pub(crate) fn worst(scores: &[ImageScore], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..scores.len()).collect();
    order.sort_by(|a, b| scores[*b].badness().total_cmp(&scores[*a].badness()).then(a.cmp(b)));
    order.truncate(count);
    order
}

fn worst_images(scores: &[ImageScore], count: usize) -> Vec<WorstImage> {
    let line = |i: usize| {
        let s = &scores[i];
        let loose = |l: &&LabelScore| (FOUND..FOUND_WELL).contains(&l.iou);
        WorstImage {
            file: s.file.clone(),
            missed: s.missed(),
            loose: s.labels.iter().filter(loose).count(),
            false_quads: s.false_left(),
            corner_error_px: s.labels.iter().filter_map(|l| l.corner_error_px).reduce(f64::max),
        }
    };
    worst(scores, count).into_iter().map(line).collect()
}

fn binned(
    scores: &[ImageScore],
    lows: &[u32],
    unit: &str,
    value: impl Fn(&LabelScore) -> Option<f64>,
) -> Vec<(String, Group)> {
    let bin = |i: usize| {
        let (low, high) = (lows[i], lows.get(i + 1));
        let inside = |x: f64| x >= f64::from(low) && high.is_none_or(|h| x < f64::from(*h));
        let group = Group::of(scores, |l| l.state == QuadState::Full && value(l).is_some_and(inside))?;
        let name = high.map_or(format!("from {low} {unit}"), |h| format!("{low} to {h} {unit}"));
        Some((name, group))
    };
    (0..lows.len()).filter_map(bin).collect()
}

impl Group {
    /// None when no label is picked.
    fn of(scores: &[ImageScore], pick: impl Fn(&LabelScore) -> bool) -> Option<Self> {
        let picked: Vec<&LabelScore> = scores.iter().flat_map(|s| &s.labels).filter(|l| pick(l)).collect();
        let quads = picked.len();
        if quads == 0 {
            return None;
        }
        let hits = |least: f64| picked.iter().filter(|l| l.iou >= least).count();
        // Only images with a picked label are resampled.
        let errors: Vec<Vec<f64>> = scores
            .iter()
            .map(|s| s.labels.iter().filter(|l| pick(l)).filter_map(|l| l.corner_error_px).collect())
            .filter(|e: &Vec<f64>| !e.is_empty())
            .collect();
        let together = |images: &[&Vec<f64>]| images.iter().copied().flatten().copied().collect::<Vec<f64>>();
        let mut all = together(&errors.iter().collect::<Vec<_>>());
        Some(Self {
            quads,
            recall_70: hits(FOUND) as f64 / quads as f64,
            recall_85: hits(FOUND_WELL) as f64 / quads as f64,
            recall_70_interval: wilson(hits(FOUND), quads),
            recall_85_interval: wilson(hits(FOUND_WELL), quads),
            missed_but_alternate: picked.iter().filter(|l| l.is_alternate).count(),
            corner_error_px: median(&mut all),
            corner_error_90_px: quantile(&mut all, MOST),
            corner_error_interval: bootstrap(&errors, |drawn| median(&mut together(drawn))),
        })
    }

    fn empty() -> Self {
        Self {
            quads: 0,
            recall_70: 0.0,
            recall_85: 0.0,
            recall_70_interval: wilson(0, 0),
            recall_85_interval: wilson(0, 0),
            missed_but_alternate: 0,
            corner_error_px: None,
            corner_error_90_px: None,
            corner_error_interval: None,
        }
    }
}

impl ImageFigures {
    fn of(scores: &[&ImageScore]) -> Self {
        let complete: Vec<[usize; 2]> =
            scores.iter().filter_map(|s| Some([s.false_quads.as_ref()?.len(), s.false_left()])).collect();
        let mean = |column: usize| {
            move |images: &[&[usize; 2]]| {
                let sum: usize = images.iter().map(|counts| counts[column]).sum();
                (!images.is_empty()).then(|| sum as f64 / images.len() as f64)
            }
        };
        let everyone: Vec<&[usize; 2]> = complete.iter().collect();
        let mut ms: Vec<f64> = scores.iter().map(|s| s.ms).collect();
        let false_quads = complete.iter().map(|c| c[0]).sum();
        let left: usize = complete.iter().map(|c| c[1]).sum();
        Self {
            images: scores.len(),
            false_per_image: mean(0)(&everyone),
            false_per_image_interval: bootstrap(&complete, mean(0)),
            false_per_image_reviewed: mean(1)(&everyone),
            false_per_image_reviewed_interval: bootstrap(&complete, mean(1)),
            false_quads,
            reviewed_quads: false_quads - left,
            images_complete: complete.len(),
            three_sided: [0, 1].map(|i| scores.iter().map(|s| s.three_sided[i]).sum()),
            ms_per_image: median(&mut ms).unwrap_or(0.0),
            ms_per_image_90: quantile(&mut ms, MOST).unwrap_or(0.0),
            ms_per_image_interval: bootstrap(&ms, |drawn| {
                median(&mut drawn.iter().map(|m| **m).collect::<Vec<f64>>())
            }),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::{
        super::score::{FalseQuad, tests::corners},
        *,
    };

    pub(crate) fn label(iou: f64, side: f64, error: f64) -> LabelScore {
        LabelScore {
            corners: corners(0.0, 0.0, side, side),
            state: QuadState::Full,
            class: "poster".into(),
            stratum: "plain".into(),
            min_side_px: side,
            view_angle_rad: Some(0.6),
            iou,
            corner_error_px: (iou >= FOUND).then_some(error),
            is_alternate: false,
            is_easy: side > super::super::easy::MIN_SIDE_PX,
        }
    }

    pub(crate) fn image(file: &str, labels: Vec<LabelScore>, reviewed: &[Option<&str>]) -> ImageScore {
        let quad = |what: Option<&str>| FalseQuad {
            corners: corners(0.0, 0.0, 9.0, 9.0),
            reviewed: what.map(str::to_owned),
        };
        ImageScore {
            file: file.into(),
            stratum: "plain".into(),
            labels,
            found: vec![],
            false_quads: Some(reviewed.iter().copied().map(quad).collect()),
            three_sided: [3, 2],
            ms: 2.0,
        }
    }

    #[test]
    fn sums_by_hand() {
        let scores = vec![
            image("a", vec![label(0.9, 25.0, 1.0), label(0.75, 40.0, 3.0)], &[None, Some("switch")]),
            image("b", vec![label(0.2, 40.0, 0.0), label(0.85, 250.0, 2.0)], &[]),
        ];
        let r = Report::new("set", "default", scores, 1, 1);
        assert_eq!((r.all.quads, r.images.images, r.unreadable), (4, 2, 1));
        assert!((r.all.recall_70 - 0.75).abs() < 1e-12 && (r.all.recall_85 - 0.5).abs() < 1e-12);
        assert_eq!((r.all.corner_error_px, r.all.corner_error_90_px), (Some(2.0), Some(3.0)));
        assert_eq!(r.images.false_per_image, Some(1.0));
        assert_eq!(r.images.false_per_image_reviewed, Some(0.5));
        assert_eq!((r.images.false_quads, r.images.reviewed_quads), (2, 1));
        let sides: Vec<(&str, usize)> =
            r.by_shortest_side.iter().map(|(name, g)| (name.as_str(), g.quads)).collect();
        assert_eq!(sides, [("20 to 30 px", 1), ("30 to 50 px", 2), ("from 200 px", 1)]);
        assert_eq!(r.by_view_angle.len(), 1);
        assert_eq!(r.by_class["poster"].quads, 4);
        assert_eq!(r.easy.as_ref().map(|easy| easy.quads), Some(1));
        // A missed quad is worse than a loose one and a false one together; reviewed ones do not
        // count.
        assert_eq!(r.worst.len(), 1);
        assert_eq!((r.worst[0].file.as_str(), r.worst[0].false_quads, r.worst[0].loose), ("a", 1, 1));
    }

    #[test]
    fn other_states_are_a_group_of_their_own() {
        let mut hidden = label(0.1, 50.0, 0.0);
        hidden.state = QuadState::Occluded;
        let mut slanted = label(0.1, 50.0, 0.0);
        slanted.view_angle_rad = Some(1.0);
        let labels = vec![hidden, label(0.9, 50.0, 1.0), slanted];
        let r = Report::new("set", "default", vec![image("a", labels, &[])], 0, 0);
        assert_eq!((r.all.quads, r.by_state["occluded"].quads, r.by_class["poster"].quads), (2, 1, 2));
        let ahead = &r.by_class_ahead["poster"];
        assert_eq!((ahead.quads, ahead.recall_70), (1, 1.0));
    }

    #[test]
    fn without_labels_nothing_is_claimed() {
        let mut incomplete = image("a", vec![], &[]);
        incomplete.false_quads = None;
        let r = Report::new("set", "default", vec![incomplete], 0, 5);
        assert_eq!((r.all.quads, r.all.corner_error_px, r.images.false_per_image), (0, None, None));
    }
}
