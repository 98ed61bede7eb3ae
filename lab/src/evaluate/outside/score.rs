//! One picture: quads, names and poses of its answer against the truth.

use super::{
    poses::{CameraScore, Evidence, MeasurementScore, camera_score, measurement_score},
    recognise::Recognised,
    world::{LandmarkTruth, World},
};
use crate::evaluate::{
    detection::score::{corner_error_px, is_real},
    recognition::is_on,
    truth::{QuadState, TruthImage, TruthQuad},
};
use client::{
    quad_corners,
    v1::{self, QuadAnswer, Verdict},
};
use engine::snapshot::MapSnapshot;
use vision::{
    detect::QuadKind,
    geometry::{Corners, polygon},
    pose::LandmarkPose,
};

/// Kinds without doors and windows, which hardly differ from one another.
pub(super) const PICTURES: [&str; 4] = ["poster", "canvas", "framed", "board"];
/// Overlap from which a border is that of a labelled quad, and the stricter one.
pub(super) const FOUND: f64 = 0.7;
pub(super) const FOUND_WELL: f64 = 0.85;
/// Smallest side and largest angle of a full view.
const MIN_SIDE_PX: f64 = 30.0;
const MAX_ANGLE_DEG: f64 = 70.0;

/// What can be asked of a labelled quad.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum View {
    /// Wholly in view, large enough and near enough to its normal.
    Full,
    /// Cut by the image border, or hidden in part.
    Partial,
}

/// A labelled quad and what the answer says of it.
#[derive(Debug, Clone)]
pub(super) struct LabelScore {
    pub(super) kind: String,
    /// `None`: a distractor, which has no name.
    pub(super) landmark: Option<String>,
    pub(super) corners: Corners,
    pub(super) view: View,
    pub(super) side_px: f64,
    pub(super) angle_rad: Option<f64>,
    /// With the nearest quad that the detector shows.
    pub(super) shown_iou: f64,
    /// That quad's corners in the order of the label's, if it is found.
    pub(super) found: Option<Corners>,
    /// Their mean distance from the label's.
    pub(super) corner_error_px: Option<f64>,
    /// With the nearest border that recognition was asked for.
    pub(super) asked_iou: f64,
    /// Mean distance of the answer's corners, if it has the right name.
    pub(super) answer_error_px: Option<f64>,
    /// Its pose in the camera frame, if it has the right name and a pose.
    pub(super) measurement: Option<MeasurementScore>,
    /// Why it has no name; empty if it has.
    pub(super) miss: Miss,
}

/// Why a labelled quad has no name: a word for counting, and details for people.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Miss {
    pub(super) reason: String,
    pub(super) detail: String,
}

/// A name where that landmark is not.
#[derive(Debug, Clone)]
pub(super) struct WrongName {
    pub(super) named: String,
    pub(super) corners: Corners,
    /// The labelled landmark that is there.
    pub(super) is: Option<String>,
}

/// The camera pose of an answer.
#[derive(Debug, Clone)]
pub(super) enum PoseOutcome {
    /// The set has no poses.
    NoTruth,
    Given(Box<CameraScore>),
    /// With the word of the answer; empty where nothing was recognised.
    Refused(String),
}

/// One picture's results.
#[derive(Debug, Clone)]
pub(super) struct PictureScore {
    pub(super) world: String,
    pub(super) file: String,
    /// Width and height of the picture, px.
    pub(super) size_px: [usize; 2],
    pub(super) labels: Vec<LabelScore>,
    /// Borders that recognition was asked for.
    pub(super) asked: usize,
    /// Shown quads where nothing is labelled; `None` where the labels are not complete.
    pub(super) false_quads: Option<Vec<Corners>>,
    pub(super) wrong: Vec<WrongName>,
    pub(super) pose: PoseOutcome,
    /// Processor time of recognition.
    pub(super) ms: f64,
}

impl LabelScore {
    pub(super) fn is_named(&self) -> bool {
        self.answer_error_px.is_some()
    }
}

pub(super) fn score(world: &World, image: &TruthImage, map: &MapSnapshot, r: &Recognised) -> PictureScore {
    let is_false = |corners: &Corners| !is_real(corners, image);
    let shown = || r.shown.iter().map(|quad| quad.corners_px);
    let pose = match world.cameras.get(&image.file) {
        None => PoseOutcome::NoTruth,
        Some(camera) => match r.answer.camera_pose.as_ref() {
            Some(pose) => camera_score(pose, camera, &evidence(world, image, pose, r)).map_or_else(
                || PoseOutcome::Refused("no_pose".to_owned()),
                |s| PoseOutcome::Given(Box::new(s)),
            ),
            None => PoseOutcome::Refused(r.answer.camera_pose_refusal.clone()),
        },
    };
    PictureScore {
        world: world.truth.name.clone(),
        file: image.file.clone(),
        size_px: [r.image.width(), r.image.height()],
        labels: image.quads.iter().filter_map(|quad| label(world, image, quad, map, r)).collect(),
        asked: r.asked().count(),
        false_quads: image.quads_complete.then(|| shown().filter(is_false).collect()),
        wrong: wrong_names(world, image, r),
        pose,
        ms: r.ms,
    }
}

/// What can be asked of it; `None` where it is too small or too oblique.
pub(super) fn view(quad: &TruthQuad) -> Option<View> {
    let is_large = quad.corners.min_side_px() >= MIN_SIDE_PX;
    let is_near_normal = quad.view_angle_rad.is_none_or(|angle| angle.to_degrees() <= MAX_ANGLE_DEG);
    match quad.state {
        _ if !is_large || !is_near_normal => None,
        QuadState::Full => quad.counted.then_some(View::Full),
        QuadState::Truncated | QuadState::Occluded => Some(View::Partial),
    }
}

fn label(
    world: &World,
    image: &TruthImage,
    quad: &TruthQuad,
    map: &MapSnapshot,
    r: &Recognised,
) -> Option<LabelScore> {
    let view = view(quad)?;
    let overlap = |border: &Corners| polygon::iou(quad.corners.points(), border.points());
    let shown = r.shown.iter().map(|q| (overlap(&q.corners_px), &q.corners_px));
    let nearest = shown.max_by(|a, b| a.0.total_cmp(&b.0));
    let found = nearest.filter(|(iou, _)| *iou >= FOUND);
    let named = unique(r).find(|(_, answer, corners)| {
        let is_it = quad.landmark.as_ref().is_some_and(|l| world.truth.same_landmark(l, &answer.landmark));
        is_it && is_on(&quad.corners, corners)
    });
    let measurement = named.as_ref().and_then(|(i, answer, corners)| {
        let pose = r.analysis.quads[*i].pose.as_ref().ok()?;
        let camera = world.cameras.get(&image.file)?;
        measurement_score(pose, corners, world.landmarks.get(&answer.landmark)?, camera)
    });
    Some(LabelScore {
        kind: quad.class.clone().unwrap_or_else(|| "any".to_owned()),
        landmark: quad.landmark.clone(),
        corners: quad.corners,
        view,
        side_px: quad.corners.min_side_px(),
        angle_rad: quad.view_angle_rad,
        shown_iou: nearest.map_or(0.0, |(iou, _)| iou),
        found: found.map(|(_, corners)| in_order_of(&quad.corners, corners)),
        corner_error_px: found.map(|(_, corners)| corner_error_px(&quad.corners, corners)),
        asked_iou: r.asked().map(overlap).fold(0.0, f64::max),
        answer_error_px: named.as_ref().map(|(_, _, corners)| corner_error_px(&quad.corners, corners)),
        measurement,
        miss: if named.is_some() { Miss::default() } else { miss(quad, map, r) },
    })
}

/// The corners in the order of `truth`'s: turned so that they are nearest to it.
fn in_order_of(truth: &Corners, corners: &Corners) -> Corners {
    let turned = (0..4).map(|shift| corners.rotated(shift));
    let nearest = turned.min_by(|a, b| truth.furthest_px(a).total_cmp(&truth.furthest_px(b)));
    nearest.unwrap_or(*corners)
}

fn evidence<'a>(
    world: &'a World,
    image: &TruthImage,
    pose: &v1::CameraPose,
    r: &'a Recognised,
) -> Evidence<'a> {
    let full_views = image.quads.iter().filter(|q| view(q) == Some(View::Full));
    Evidence {
        decisive: decisive(world, pose, r),
        used: pose.landmarks.iter().filter_map(|name| world.landmarks.get(name)).collect(),
        in_view: full_views.filter_map(|q| world.landmarks.get(q.landmark.as_ref()?)).collect(),
    }
}

/// The landmark that gives the camera's pose, as it was seen and as it hangs.
fn decisive<'a>(
    world: &'a World,
    pose: &v1::CameraPose,
    r: &'a Recognised,
) -> Option<(&'a LandmarkPose, &'a LandmarkTruth)> {
    let name = pose.landmarks.first()?;
    let (i, ..) =
        unique(r).find(|(i, quad, _)| quad.landmark == *name && r.analysis.quads[*i].pose.is_ok())?;
    Some((r.analysis.quads[i].pose.as_ref().ok()?, world.landmarks.get(name)?))
}

/// Quads of the answer with one name, by their place in it.
fn unique(r: &Recognised) -> impl Iterator<Item = (usize, &QuadAnswer, Corners)> {
    let quads = r.answer.quads.iter().enumerate();
    quads
        .filter(|(_, quad)| quad.verdict() == Verdict::Unique)
        .filter_map(|(i, quad)| Some((i, quad, quad_corners(quad)?)))
}

fn wrong_names(world: &World, image: &TruthImage, r: &Recognised) -> Vec<WrongName> {
    let wrong = |(_, answer, corners): (usize, &QuadAnswer, Corners)| {
        let there: Vec<&TruthQuad> = image.quads.iter().filter(|l| is_on(&l.corners, &corners)).collect();
        let is_right = |l: &&TruthQuad| {
            l.landmark.as_ref().is_some_and(|l| world.truth.same_landmark(l, &answer.landmark))
        };
        (!there.iter().any(is_right)).then(|| WrongName {
            named: answer.landmark.clone(),
            corners,
            is: there.iter().find_map(|l| l.landmark.clone()),
        })
    };
    unique(r).filter_map(wrong).collect()
}

/// Why a labelled quad has no name.
fn miss(label: &TruthQuad, map: &MapSnapshot, r: &Recognised) -> Miss {
    let made = |reason: &str, detail: String| Miss { reason: reason.to_owned(), detail };
    let Some(landmark) = &label.landmark else { return made("distractor", String::new()) };
    let overlap = |border: &Corners| polygon::iou(label.corners.points(), border.points());
    let of_quad = |i: usize| {
        let quad = &r.analysis.quads[i].quad;
        std::iter::once(&quad.corners_px).chain(&quad.alternates).map(overlap).fold(0.0, f64::max)
    };
    let nearest = (0..r.analysis.quads.len()).map(|i| (of_quad(i), i)).max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((iou, i)) = nearest.filter(|(iou, _)| *iou >= FOUND) else {
        return made("no_quad", format!("best IoU {:.2}", nearest.map_or(0.0, |n| n.0)));
    };
    if !map.models.iter().any(|m| map.landmarks.get(&m.id).is_some_and(|l| l.name == *landmark)) {
        return made("not_active", format!("IoU {iou:.2}"));
    }
    if r.analysis.quads[i].recognition.is_none() && r.analysis.quads[i].quad.kind == QuadKind::ThreeSided {
        return made("three_sided", format!("IoU {iou:.2}"));
    }
    if r.analysis.quads[i].recognition.is_none() {
        return made("not_asked", format!("IoU {iou:.2}, quad {i} of {}", r.analysis.quads.len()));
    }
    let answer = &r.answer.quads[i];
    let verdict = answer.verdict();
    if verdict == Verdict::Unique {
        return made("named_otherwise", format!("IoU {iou:.2}, named {}", answer.landmark));
    }
    let Some(candidate) = answer.candidates.iter().find(|c| c.landmark == *landmark) else {
        return made("no_candidate", format!("IoU {iou:.2}"));
    };
    let word = if candidate.refusal.is_empty() {
        verdict.as_str_name().to_lowercase()
    } else {
        candidate.refusal.clone()
    };
    let points =
        answer.points.as_ref().map_or(String::new(), |p| format!(", {} of {} points", p.inliers, p.matches));
    let likeness = candidate.gradient_similarity.map_or(String::new(), |l| format!(", similarity {l:.2}"));
    made(
        &word,
        format!(
            "IoU {iou:.2}, correlation {:.2?}, ratio {:.2?}{likeness}{points}",
            candidate.correlation, candidate.ratio
        ),
    )
}
