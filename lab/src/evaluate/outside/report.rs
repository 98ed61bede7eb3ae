//! The figures of all pictures together. Shares and errors are `null` where nothing was counted.

use super::bound::drawn_m;
use super::peer::PeerReport;
use super::poses::CameraScore;
use super::score::{FOUND, FOUND_WELL, LabelScore, PICTURES, PictureScore, PoseOutcome, View};
use super::sizes::SizeReport;
use super::walk::WalkStop;
use crate::evaluate::statistics::{median, quantile};
use serde::Serialize;
use std::collections::BTreeMap;

/// Quantile that stands beside a median.
const MOST: f64 = 0.9;
/// 95 % quantile of chi squared with three degrees of freedom.
const CHI2_3_95: f64 = 7.815;
/// Share of the largest values that the second mean of the NEES leaves out.
const OUTLIERS: f64 = 0.01;
/// Standard deviations from which a pose does not fit its corners.
const MISFIT_SIGMAS: f64 = 3.0;
/// Lower ends of the groups by shortest side, px.
const SIDES_PX: [u32; 4] = [30, 50, 100, 200];
/// Lower ends of the groups by view angle, degrees.
const ANGLES_DEG: [u32; 4] = [0, 30, 50, 60];
/// Lower ends of the groups by distance of the nearest landmark, metres.
const DISTANCES_M: [f64; 4] = [0.0, 2.0, 3.0, 4.0];
/// Kinds whose border lies in one plane with the picture.
const FLAT: [&str; 2] = ["poster", "canvas"];

/// Median, 90 % quantile and largest of some errors.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct Errors {
    pub(super) count: usize,
    pub(super) median: Option<f64>,
    pub(super) most: Option<f64>,
    pub(super) worst: Option<f64>,
}

/// Mean of a normalised estimation error squared.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct Nees {
    pub(super) expected: u32,
    pub(super) mean: Option<f64>,
    /// Without the largest 1 %, at least one value.
    pub(super) mean_without_largest: Option<f64>,
    pub(super) median: Option<f64>,
}

/// Full views of one group.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Group {
    pub(super) full_views: usize,
    /// By a quad that the detector shows, at `IoU` 0.7 and 0.85.
    pub(super) shown: Option<f64>,
    pub(super) shown_well: Option<f64>,
    /// By a border that recognition is asked for.
    pub(super) asked: Option<f64>,
    pub(super) asked_well: Option<f64>,
    /// Of shown quads that are found, px.
    pub(super) corner_error_px: Errors,
    /// Those of landmarks that have their right name.
    pub(super) named: Option<f64>,
    /// Corners of the answer under that name, px.
    pub(super) answer_error_px: Errors,
}

/// Landmarks that are cut by the image border, or hidden in part.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Partial {
    pub(super) views: usize,
    pub(super) named: usize,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct CameraFigures {
    /// Pictures with a true pose and at least one full view; of those, how many got a pose.
    pub(super) pictures: usize,
    pub(super) pictures_with_pose: usize,
    /// All given poses.
    pub(super) position_m: Errors,
    pub(super) direction_deg: Errors,
    /// As stated: with the error that a place by hand is taken to have.
    pub(super) nees: Nees,
    /// By the covariance of the landmark's pose alone: places are exact here.
    pub(super) nees_of_view: Nees,
    /// Standard deviation of the position by that covariance.
    pub(super) stated_m: Errors,
    /// All of them, by the number of landmarks that give the pose, and by the distance of the
    /// nearest one.
    pub(super) groups: Vec<(String, PositionFigures)>,
    /// Why pictures have no pose, by the word.
    pub(super) refusals: Vec<(String, usize)>,
}

/// Errors of the camera's position, and what corners with 0.3 px can tell.
#[derive(Debug, Clone, Serialize)]
#[expect(clippy::struct_field_names, reason = "all are in metres")]
pub(super) struct PositionFigures {
    pub(super) position_m: Errors,
    pub(super) stated_m: Errors,
    /// Errors drawn from the bound by the landmarks that give the pose.
    pub(super) bound_m: Errors,
    /// The same by all landmarks in full view.
    pub(super) bound_of_all_m: Errors,
}

impl PositionFigures {
    fn of<'a>(scores: impl Iterator<Item = &'a CameraScore>) -> Self {
        let scores: Vec<&CameraScore> = scores.collect();
        let all = || scores.iter();
        Self {
            position_m: Errors::of(all().map(|s| s.position_m)),
            stated_m: Errors::of(all().filter_map(|s| s.stated_m)),
            bound_m: Errors::of(drawn_m(all().filter_map(|s| s.bound)).into_iter()),
            bound_of_all_m: Errors::of(drawn_m(all().filter_map(|s| s.bound_of_all)).into_iter()),
        }
    }
}

/// Poses of named landmarks in the camera frame, with the stated camera; their place plays no part.
#[derive(Debug, Clone, Serialize)]
pub(super) struct MeasurementFigures {
    pub(super) position_m: Errors,
    pub(super) direction_deg: Errors,
    pub(super) nees_3: Nees,
    pub(super) nees_6: Nees,
    pub(super) ambiguous: usize,
    pub(super) reprojection_px: Errors,
    /// Share of poses that put a corner of their answer more than 3 standard deviations off.
    pub(super) misfit: Option<f64>,
}

/// Fused poses of a robot that goes from picture to picture.
#[derive(Debug, Clone, Serialize)]
pub(super) struct WalkFigures {
    pub(super) pictures: usize,
    /// Pictures that corrected the pose.
    pub(super) corrections: usize,
    /// Of pictures at which there is a pose.
    pub(super) position_m: Errors,
    pub(super) direction_deg: Errors,
    pub(super) nees: Nees,
    /// Share of poses within what is stated to be their 95 %.
    pub(super) within_95: Option<f64>,
}

#[derive(Debug, Clone, Serialize)]
pub(super) struct Report {
    pub(super) worlds: usize,
    pub(super) pictures: usize,
    pub(super) unreadable: usize,
    pub(super) all: Group,
    /// Without doors and windows.
    pub(super) pictures_and_boards: Group,
    pub(super) flat: Group,
    pub(super) by_kind: BTreeMap<String, Group>,
    pub(super) by_shortest_side: Vec<(String, Group)>,
    pub(super) by_view_angle: Vec<(String, Group)>,
    pub(super) partial: Partial,
    pub(super) false_quads: usize,
    /// Over pictures whose labels are complete.
    pub(super) false_per_picture: Option<f64>,
    pub(super) asked_per_picture: Option<f64>,
    pub(super) wrong_names: usize,
    pub(super) camera: CameraFigures,
    pub(super) measurements: MeasurementFigures,
    /// Median processor time of recognition on one thread.
    pub(super) ms_per_picture: Option<f64>,
    /// Why full views have no name, most frequent first.
    pub(super) missed: Vec<(String, usize)>,
    /// How often the check of sizes is right; `None` without true sizes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) sizes: Option<SizeReport>,
    /// A robot that goes from picture to picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) walk: Option<WalkFigures>,
    /// SIFT on the same pictures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) peer: Option<PeerReport>,
}

impl WalkFigures {
    pub(super) fn new(stops: &[WalkStop]) -> Self {
        let errors = || stops.iter().filter_map(|stop| stop.error);
        let squares = || stops.iter().filter_map(|stop| stop.nees);
        let within = squares().filter(|squared| *squared < CHI2_3_95).count();
        Self {
            pictures: stops.len(),
            corrections: stops.iter().filter(|stop| stop.corrected).count(),
            position_m: Errors::of(errors().map(|error| error.xy().norm())),
            direction_deg: Errors::of(errors().map(|error| error.z.abs().to_degrees())),
            nees: Nees::of(3, squares()),
            within_95: share(within, squares().count()),
        }
    }
}

impl Errors {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.collect();
        Self {
            count: values.len(),
            median: median(&mut values),
            most: quantile(&mut values, MOST),
            worst: values.last().copied(),
        }
    }
}

impl Nees {
    fn of(expected: u32, values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.collect();
        let median = median(&mut values);
        let kept = values.len() - (OUTLIERS * values.len() as f64).ceil() as usize;
        Self { expected, mean: mean(&values), mean_without_largest: mean(&values[..kept]), median }
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn share(hits: usize, of: usize) -> Option<f64> {
    (of > 0).then(|| hits as f64 / of as f64)
}

impl Group {
    fn of<'a>(labels: impl Iterator<Item = &'a LabelScore>) -> Self {
        let labels: Vec<&LabelScore> = labels.filter(|l| l.view == View::Full).collect();
        let of = |pick: &dyn Fn(&LabelScore) -> bool| {
            share(labels.iter().filter(|l| pick(l)).count(), labels.len())
        };
        let landmarks: Vec<&&LabelScore> = labels.iter().filter(|l| l.landmark.is_some()).collect();
        Self {
            full_views: labels.len(),
            shown: of(&|l| l.shown_iou >= FOUND),
            shown_well: of(&|l| l.shown_iou >= FOUND_WELL),
            asked: of(&|l| l.asked_iou >= FOUND),
            asked_well: of(&|l| l.asked_iou >= FOUND_WELL),
            corner_error_px: Errors::of(labels.iter().filter_map(|l| l.corner_error_px)),
            named: share(landmarks.iter().filter(|l| l.is_named()).count(), landmarks.len()),
            answer_error_px: Errors::of(landmarks.iter().filter_map(|l| l.answer_error_px)),
        }
    }
}

impl Report {
    pub(super) fn new(worlds: usize, scores: &[PictureScore], unreadable: usize) -> Self {
        let labels = || scores.iter().flat_map(|s| &s.labels);
        let kinds: std::collections::BTreeSet<&String> = labels().map(|l| &l.kind).collect();
        let of_kinds = |kinds: &[&str]| Group::of(labels().filter(|l| kinds.contains(&l.kind.as_str())));
        let partial = || labels().filter(|l| l.view == View::Partial && l.landmark.is_some());
        let complete: Vec<usize> =
            scores.iter().filter_map(|s| Some(s.false_quads.as_ref()?.len())).collect();
        let false_quads = complete.iter().sum();
        Self {
            worlds,
            pictures: scores.len(),
            unreadable,
            all: Group::of(labels()),
            pictures_and_boards: of_kinds(&PICTURES),
            flat: of_kinds(&FLAT),
            by_kind: kinds.iter().map(|kind| ((*kind).clone(), of_kinds(&[kind]))).collect(),
            by_shortest_side: binned(scores, &SIDES_PX, "px", |l| Some(l.side_px)),
            by_view_angle: binned(scores, &ANGLES_DEG, "deg", |l| Some(l.angle_rad?.to_degrees())),
            partial: Partial { views: partial().count(), named: partial().filter(|l| l.is_named()).count() },
            false_quads,
            false_per_picture: share(false_quads, complete.len()),
            asked_per_picture: share(scores.iter().map(|s| s.asked).sum(), scores.len()),
            wrong_names: scores.iter().map(|s| s.wrong.len()).sum(),
            camera: camera(scores),
            measurements: measurements(scores),
            ms_per_picture: median(&mut scores.iter().map(|s| s.ms).collect::<Vec<_>>()),
            missed: missed(scores),
            sizes: None,
            walk: None,
            peer: None,
        }
    }
}

fn binned(
    scores: &[PictureScore],
    lows: &[u32],
    unit: &str,
    value: impl Fn(&LabelScore) -> Option<f64>,
) -> Vec<(String, Group)> {
    let bin = |i: usize| {
        let (low, high) = (lows[i], lows.get(i + 1));
        let inside = |x: f64| x >= f64::from(low) && high.is_none_or(|h| x < f64::from(*h));
        let labels = scores.iter().flat_map(|s| &s.labels);
        let group = Group::of(labels.filter(|l| value(l).is_some_and(inside)));
        let name = high.map_or(format!("from {low} {unit}"), |h| format!("{low} to {h} {unit}"));
        (group.full_views > 0).then_some((name, group))
    };
    (0..lows.len()).filter_map(bin).collect()
}

fn camera(scores: &[PictureScore]) -> CameraFigures {
    let given = || {
        scores.iter().filter_map(|s| match &s.pose {
            PoseOutcome::Given(score) => Some(&**score),
            PoseOutcome::NoTruth | PoseOutcome::Refused(_) => None,
        })
    };
    let mut refusals: BTreeMap<String, usize> = BTreeMap::new();
    for score in scores {
        if let PoseOutcome::Refused(word) = &score.pose {
            let word = if word.is_empty() { "nothing_recognised" } else { word };
            *refusals.entry(word.to_owned()).or_default() += 1;
        }
    }
    let has_view = |s: &&PictureScore| {
        !matches!(s.pose, PoseOutcome::NoTruth) && s.labels.iter().any(|l| l.view == View::Full)
    };
    let is_given = |s: &&PictureScore| matches!(s.pose, PoseOutcome::Given(_));
    CameraFigures {
        pictures: scores.iter().filter(has_view).count(),
        pictures_with_pose: scores.iter().filter(has_view).filter(is_given).count(),
        position_m: Errors::of(given().map(|s| s.position_m)),
        direction_deg: Errors::of(given().map(|s| s.direction_rad.to_degrees())),
        nees: Nees::of(3, given().map(|s| s.nees)),
        nees_of_view: Nees::of(3, given().filter_map(|s| s.nees_of_view)),
        stated_m: Errors::of(given().filter_map(|s| s.stated_m)),
        groups: position_groups(&given().collect::<Vec<_>>()),
        refusals: refusals.into_iter().collect(),
    }
}

fn position_groups(given: &[&CameraScore]) -> Vec<(String, PositionFigures)> {
    let of =
        |pick: &dyn Fn(&CameraScore) -> bool| PositionFigures::of(given.iter().copied().filter(|s| pick(s)));
    let mut groups = vec![
        ("all".to_owned(), of(&|_| true)),
        ("one landmark".to_owned(), of(&|s| s.names.len() == 1)),
        ("two and more".to_owned(), of(&|s| s.names.len() > 1)),
    ];
    for (i, low) in DISTANCES_M.iter().enumerate() {
        let high = DISTANCES_M.get(i + 1);
        let inside = |s: &CameraScore| s.distance_m >= *low && high.is_none_or(|h| s.distance_m < *h);
        let name = high.map_or(format!("from {low} m"), |h| format!("{low} to {h} m"));
        groups.push((name, of(&inside)));
    }
    groups.retain(|(_, figures)| figures.position_m.count > 0);
    groups
}

fn measurements(scores: &[PictureScore]) -> MeasurementFigures {
    let all = || scores.iter().flat_map(|s| &s.labels).filter_map(|l| l.measurement.as_ref());
    let misfits = all().filter(|m| m.reprojection_sigmas > MISFIT_SIGMAS).count();
    MeasurementFigures {
        position_m: Errors::of(all().map(|m| m.position_m)),
        direction_deg: Errors::of(all().map(|m| m.direction_rad.to_degrees())),
        nees_3: Nees::of(3, all().map(|m| m.nees_3)),
        nees_6: Nees::of(6, all().map(|m| m.nees_6)),
        ambiguous: all().filter(|m| m.is_ambiguous).count(),
        reprojection_px: Errors::of(all().map(|m| m.reprojection_px)),
        misfit: share(misfits, all().count()),
    }
}

fn missed(scores: &[PictureScore]) -> Vec<(String, usize)> {
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    let full = scores.iter().flat_map(|s| &s.labels).filter(|l| l.view == View::Full);
    for label in full.filter(|l| l.landmark.is_some() && !l.is_named()) {
        *counts.entry(&label.miss.reason).or_default() += 1;
    }
    let mut counts: Vec<(String, usize)> = counts.into_iter().map(|(r, n)| (r.to_owned(), n)).collect();
    counts.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_percent_of_the_largest_is_left_out_and_at_least_one_value() {
        let nees = Nees::of(3, (1..=200).map(f64::from));
        assert_eq!((nees.mean, nees.mean_without_largest), (Some(100.5), Some(99.5)));
        let few = Nees::of(3, [2.0, 100.0, 4.0].into_iter());
        assert_eq!((few.mean_without_largest, few.median), (Some(3.0), Some(4.0)));
        let none = Nees::of(3, std::iter::empty());
        assert_eq!((none.mean, none.mean_without_largest), (None, None));
    }

    #[test]
    fn errors_are_sorted_before_they_are_named() {
        let errors = Errors::of([3.0, 1.0, 9.0, 2.0].into_iter());
        assert_eq!((errors.median, errors.most, errors.worst), (Some(2.5), Some(9.0), Some(9.0)));
    }
}
