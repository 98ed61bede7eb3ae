//! The recognition pipeline: an image, the landmarks of a map and what is known of the camera in;
//! quads, verdicts and poses out.
//!
//! Calls the stages in order. The map crate computes the robot's pose.

use crate::{
    border::{BorderError, BorderEstimate, estimate_border},
    detect::{
        detector::detect_for_recognition,
        edge_buffers::DetectBuffers,
        params::DetectParams,
        quad::{Quad, QuadKind},
    },
    frame::{GrayImage, Intrinsics, PictureRef},
    geometry::{corner_covariance::CornerCovariance, corners::Corners},
    model::{landmark_id::LandmarkId, model_set::ModelSet},
    params::Params,
    pose::{landmark_pose::LandmarkPose, measurement::LandmarkSize},
    recognise::{
        decision::{
            by_texture::by_texture,
            matched_border::texture_border,
            result::{RecognitionResult, Verdict},
            verdict::recognise,
        },
        distance_kind::DistanceKind,
    },
    seen_border::SeenBorder,
    trace::{Stage, Trace},
    up::Up,
};
use std::collections::BTreeMap;

pub use crate::recognise::decision::{
    expected::{ACCEPTED_NATS, ExpectedLandmark, expected},
    matched_border::matched_border,
};

/// Most quads of one image that are compared with the landmarks, the detector's best first.
pub const MAX_RECOGNISED_QUADS: usize = 24;

/// The part of a map that the pipeline reads. Immutable during a frame.
#[derive(Debug, Clone, Copy)]
pub struct LandmarkDatabase<'a> {
    /// Models of the landmarks to recognise.
    pub models: &'a ModelSet,
    /// Sizes of those whose size is known.
    pub sizes: &'a BTreeMap<LandmarkId, LandmarkSize>,
    /// Which distance decides.
    pub kind: DistanceKind,
}

/// What is known of the camera of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameCamera<'a> {
    /// Without them, nothing has a pose.
    pub intrinsics: Option<&'a Intrinsics>,
    /// From the camera's mounting. Where it is not known, quads are compared in all four rotations.
    pub up: Option<Up>,
    /// Height of the camera above the floor, metres, from the camera's mounting.
    pub height_m: Option<f64>,
}

impl<'a> FrameCamera<'a> {
    /// A camera that is not rolled.
    pub fn level(intrinsics: Option<&'a Intrinsics>) -> Self {
        Self { intrinsics, up: Some(Up::level()), height_m: None }
    }

    /// The detector's parameters with the floor as this camera sees it. `None` where that changes
    /// nothing, and of a camera that is not known or rolled.
    fn above_its_floor(&self, p: &DetectParams, width_px: usize) -> Option<DetectParams> {
        p.above_floor(*self.intrinsics?, width_px, self.height_m?, self.up?.tilt_without_roll_rad()?)
    }
}

/// The quads of one image with their recognition and poses.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameAnalysis {
    /// The quads, best first.
    pub quads: Vec<QuadAnalysis>,
}

/// One quad with its recognition and pose.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadAnalysis {
    /// The quad as detected.
    pub quad: Quad,
    /// The verdict; `None` for quads that were not compared (beyond [`MAX_RECOGNISED_QUADS`]), and
    /// for three-sided ones that no points identify.
    pub recognition: Option<RecognitionResult>,
    /// The corners of a landmark that was uniquely recognised, its top-left first: those that the
    /// pose rests on, or without a pose those by the picture. `None` for other quads.
    pub border_px: Option<Corners>,
    /// The landmark in the camera frame, or why not.
    pub pose: Result<LandmarkPose, PoseUnavailable>,
}

/// Why a quad has no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PoseUnavailable {
    /// It is not exactly one landmark.
    #[error("not recognised as exactly one landmark")]
    NotUnique,
    /// The image came without intrinsics.
    #[error("the camera's intrinsics are unknown")]
    NoCamera,
    /// The landmark's size is not known.
    #[error("the size of landmark {} is unknown", .0.0)]
    NoSize(LandmarkId),
    /// No border that the pose could rest on.
    #[error(transparent)]
    Border(#[from] BorderError),
}

/// The pipeline with memory reused from frame to frame: fresh planes cost more than a tenth of the
/// time to segments. One a thread. Results do not depend on the memory.
#[derive(Debug, Default)]
pub struct Pipeline {
    buffers: DetectBuffers,
}

impl Pipeline {
    /// Quads, verdicts and poses of a picture. Colour serves the detection; what a quad shows is
    /// read in grey.
    pub fn analyse<'a>(
        &mut self,
        image: impl Into<PictureRef<'a>>,
        camera: FrameCamera<'_>,
        landmarks: LandmarkDatabase<'_>,
        p: &Params,
        trace: &mut impl Trace,
    ) -> FrameAnalysis {
        let image = image.into();
        let own = camera.above_its_floor(&p.detect, image.width());
        let quads =
            detect_for_recognition(&mut self.buffers, image, own.as_ref().unwrap_or(&p.detect), trace);
        analyse(image, quads, camera, landmarks, BorderBy::Picture, (p, trace))
    }
}

/// What the border of a pose is estimated from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BorderBy {
    /// The whole picture: texture and the edges beside it.
    Picture,
    /// The quads as given: the picture may end at their borders.
    Quads,
}

/// [`Pipeline::analyse`] from given quads: found elsewhere, or drawn by hand.
pub fn analyse_quads(
    image: &GrayImage,
    quads: Vec<Quad>,
    camera: FrameCamera<'_>,
    landmarks: LandmarkDatabase<'_>,
    p: &Params,
    trace: &mut impl Trace,
) -> FrameAnalysis {
    analyse(image.into(), quads, camera, landmarks, BorderBy::Quads, (p, trace))
}

fn analyse(
    image: PictureRef<'_>,
    quads: Vec<Quad>,
    camera: FrameCamera<'_>,
    landmarks: LandmarkDatabase<'_>,
    by: BorderBy,
    (p, trace): (&Params, &mut impl Trace),
) -> FrameAnalysis {
    let FrameCamera { intrinsics, up, .. } = camera;
    let mut quads: Vec<Quad> = quads.into_iter().map(|q| q.named_by(up.as_ref(), intrinsics)).collect();
    let verdict = |(i, quad): (usize, &Quad)| {
        let is_asked = i < MAX_RECOGNISED_QUADS;
        let verdict = is_asked.then(|| recognise(image.grey(), quad, landmarks.models, landmarks.kind, p));
        // A side of a three-sided quad is a guess: an icon read from it says nothing.
        verdict.filter(|v| quad.kind == QuadKind::Full || v.points.is_some())
    };
    let mut verdicts: Vec<Option<RecognitionResult>> = quads.iter().enumerate().map(verdict).collect();
    recognise_turned(image.grey(), (&mut quads, &mut verdicts), landmarks, p);
    trace.finished(Stage::Recognition);
    if by == BorderBy::Picture {
        add_by_texture(image.grey(), (&mut quads, &mut verdicts), camera, landmarks, p);
        trace.finished(Stage::Texture);
    }
    let quads = quads
        .into_iter()
        .zip(verdicts)
        .map(|(mut quad, mut verdict)| {
            if let Some(verdict) = &mut verdict {
                turn_to_recognised(&mut quad, verdict);
            }
            let border = border(image, &quad, verdict.as_ref(), intrinsics, landmarks.sizes, (by, p));
            let border_px = match (&border, &verdict) {
                (Ok((border, ..)), _) => Some(border.corners_px),
                (Err(_), Some(v)) => recognised_border(&quad, v, p),
                (Err(_), None) => None,
            };
            let pose = border.and_then(|(border, size, camera)| Ok(border.pose(size, camera)?));
            QuadAnalysis { quad, recognition: verdict, border_px, pose }
        })
        .filter(|analysis| p.detect.quads.is_shown(&analysis.quad) || is_recognised(analysis))
        .collect();
    trace.finished(Stage::Poses);
    FrameAnalysis { quads }
}

/// The border by the picture alone, where it is exactly one landmark.
fn recognised_border(quad: &Quad, verdict: &RecognitionResult, p: &Params) -> Option<Corners> {
    let is_unique = matches!(verdict.verdict, Verdict::Unique(_));
    is_unique.then(|| matched_border(quad, verdict, p)).flatten().map(|border| border.corners_px)
}

/// Whether it is a landmark, or may be one.
fn is_recognised(analysis: &QuadAnalysis) -> bool {
    analysis.recognition.as_ref().is_some_and(|v| v.verdict != Verdict::Unknown)
}

/// Where no quad has a name, compares the first one in the rotations that up rules out. A landmark
/// may hang otherwise than it was taught, and a mounting may be wrong: then its name says so, and
/// its pose fits no robot on the floor.
fn recognise_turned(
    image: &GrayImage,
    (quads, verdicts): (&mut [Quad], &mut [Option<RecognitionResult>]),
    landmarks: LandmarkDatabase<'_>,
    p: &Params,
) {
    if verdicts.iter().flatten().any(|v| matches!(v.verdict, Verdict::Unique(_))) {
        return;
    }
    let mut compared = quads.iter_mut().zip(verdicts);
    let Some((quad, verdict)) = compared.find(|(_, verdict)| verdict.is_some()) else { return };
    if quad.upright_ambiguous {
        return;
    }
    let turned = Quad { upright_ambiguous: true, ..quad.clone() };
    let found = recognise(image, &turned, landmarks.models, landmarks.kind, p);
    if matches!(found.verdict, Verdict::Unique(_)) {
        (*quad, *verdict) = (turned, Some(found));
    }
}

/// While no pose of a robot is supported, adds those of landmarks that the texture shows without a
/// border.
fn add_by_texture(
    image: &GrayImage,
    (quads, verdicts): (&mut Vec<Quad>, &mut Vec<Option<RecognitionResult>>),
    camera: FrameCamera<'_>,
    landmarks: LandmarkDatabase<'_>,
    p: &Params,
) {
    let named: Vec<(LandmarkId, Corners)> =
        quads.iter().zip(&*verdicts).filter_map(|(quad, verdict)| named(quad, verdict.as_ref()?)).collect();
    let texture = &p.recognise.texture;
    let are_points_asked = landmarks.kind == DistanceKind::Both && p.recognise.verdict.points;
    let is_supported = camera.up.is_some() && named.len() >= texture.enough;
    if !texture.search || !are_points_asked || is_supported {
        return;
    }
    let camera = (camera.up.as_ref(), camera.intrinsics);
    for (quad, verdict) in by_texture(image, &named, camera, landmarks.models, p) {
        quads.push(quad);
        verdicts.push(Some(verdict));
    }
}

/// The landmark of a quad and where it is, if it is exactly one.
fn named(quad: &Quad, verdict: &RecognitionResult) -> Option<(LandmarkId, Corners)> {
    let Verdict::Unique(landmark) = verdict.verdict else { return None };
    Some((landmark, verdict.aligned_px.unwrap_or(quad.corners_px)))
}

/// Which of the landmarks a single quad may be, by its picture alone, and their common border in
/// the image; `None` for the border where it is none of them. For look-alikes, which a single frame
/// cannot identify.
pub fn recognise_quad(
    image: &GrayImage,
    quad: &Quad,
    models: &ModelSet,
    p: &Params,
) -> (RecognitionResult, Option<SeenBorder>) {
    let verdict = recognise(image, quad, models, DistanceKind::Both, p);
    let is_known = verdict.verdict != Verdict::Unknown;
    let border = if is_known { matched_border(quad, &verdict, p) } else { None };
    (verdict, border)
}

/// Where an alternate border was recognised, it becomes the corners of the quad: the outer border
/// may be the wall round a poster.
fn turn_to_recognised(quad: &mut Quad, verdict: &mut RecognitionResult) {
    if verdict.verdict == Verdict::Unknown || verdict.border == 0 {
        return;
    }
    if let Some(recognised) = quad.alternates.get_mut(verdict.border - 1) {
        std::mem::swap(recognised, &mut quad.corners_px);
        verdict.border = 0;
    }
}

/// The border of a uniquely recognised landmark of known size, seen by a known camera: only such a
/// landmark has a pose.
fn border<'c>(
    image: PictureRef<'_>,
    quad: &Quad,
    verdict: Option<&RecognitionResult>,
    camera: Option<&'c Intrinsics>,
    sizes: &BTreeMap<LandmarkId, LandmarkSize>,
    (by, p): (BorderBy, &Params),
) -> Result<(BorderEstimate, LandmarkSize, &'c Intrinsics), PoseUnavailable> {
    let Some(verdict @ RecognitionResult { verdict: Verdict::Unique(landmark), .. }) = verdict else {
        return Err(PoseUnavailable::NotUnique);
    };
    let camera = camera.ok_or(PoseUnavailable::NoCamera)?;
    let size = *sizes.get(landmark).ok_or(PoseUnavailable::NoSize(*landmark))?;
    let border = match by {
        BorderBy::Picture => {
            let texture = texture_border(quad, verdict, p).ok_or(PoseUnavailable::NotUnique)?;
            estimate_border(image, &texture, size, camera)?
        }
        BorderBy::Quads => {
            let border = matched_border(quad, verdict, p).ok_or(PoseUnavailable::NotUnique)?;
            let covariance_px2 = CornerCovariance::from(&border.covariance_px2);
            BorderEstimate { corners_px: border.corners_px, covariance_px2, is_mirrored: false }
        }
    };
    Ok((border, size, camera))
}

#[cfg(test)]
mod tests;
