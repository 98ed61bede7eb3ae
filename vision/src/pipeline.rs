//! The recognition pipeline: an image, the landmarks of a map and optionally a camera in; quads, verdicts and poses
//! out.
//!
//! Calls the stages in order. The map crate computes the robot's pose.

use crate::{
    detect::{
        detector::detect_with,
        edge_buffers::DetectBuffers,
        quad::{Quad, QuadKind},
    },
    frame::{GrayImage, Intrinsics},
    model::{landmark_id::LandmarkId, model_set::ModelSet},
    params::Params,
    pose::{
        landmark_pose::{LandmarkPose, landmark_pose},
        measurement::{LandmarkSize, PoseError},
    },
    recognise::{
        decision::{
            result::{RecognitionResult, Verdict},
            verdict::recognise,
        },
        distance_kind::DistanceKind,
    },
    seen_border::SeenBorder,
    trace::{Stage, Trace},
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
    /// The verdict; `None` for quads that were not compared (three-sided, or beyond [`MAX_RECOGNISED_QUADS`]).
    pub recognition: Option<RecognitionResult>,
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
    /// The corners give no pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// The pipeline with memory reused from frame to frame: fresh planes cost more than a tenth of the time to
/// segments. One a thread. Results do not depend on the memory.
#[derive(Debug, Default)]
pub struct Pipeline {
    buffers: DetectBuffers,
}

impl Pipeline {
    /// Quads, verdicts and poses of an image.
    pub fn analyse(
        &mut self,
        image: &GrayImage,
        camera: Option<&Intrinsics>,
        landmarks: LandmarkDatabase<'_>,
        p: &Params,
        trace: &mut impl Trace,
    ) -> FrameAnalysis {
        let quads = detect_with(&mut self.buffers, image, &p.detect, trace);
        analyse_quads(image, quads, camera, landmarks, p, trace)
    }
}

/// [`Pipeline::analyse`] from given quads: found elsewhere, or drawn by hand.
pub fn analyse_quads(
    image: &GrayImage,
    quads: Vec<Quad>,
    camera: Option<&Intrinsics>,
    landmarks: LandmarkDatabase<'_>,
    p: &Params,
    trace: &mut impl Trace,
) -> FrameAnalysis {
    let mut asked = 0;
    let mut verdict = |quad: &Quad| {
        asked += usize::from(quad.kind == QuadKind::Full);
        (quad.kind == QuadKind::Full && asked <= MAX_RECOGNISED_QUADS)
            .then(|| recognise(image, quad, landmarks.models, landmarks.kind, p))
    };
    let verdicts: Vec<Option<RecognitionResult>> = quads.iter().map(&mut verdict).collect();
    trace.finished(Stage::Recognition);
    let quads = quads
        .into_iter()
        .zip(verdicts)
        .map(|(mut quad, mut verdict)| {
            if let Some(verdict) = &mut verdict {
                turn_to_recognised(&mut quad, verdict);
            }
            let pose = pose(&quad, verdict.as_ref(), camera, landmarks.sizes, p);
            QuadAnalysis { quad, recognition: verdict, pose }
        })
        .collect();
    trace.finished(Stage::Poses);
    FrameAnalysis { quads }
}

/// Which of the landmarks a single quad may be, by its picture alone, and their common border in the image; `None`
/// for the border where it is none of them. For look-alikes, which a single frame cannot identify.
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

/// Where an alternate border was recognised, it becomes the corners of the quad: the outer border may be the wall
/// round a poster.
fn turn_to_recognised(quad: &mut Quad, verdict: &mut RecognitionResult) {
    if verdict.verdict == Verdict::Unknown || verdict.border == 0 {
        return;
    }
    if let Some(recognised) = quad.alternates.get_mut(verdict.border - 1) {
        std::mem::swap(recognised, &mut quad.corners_px);
        verdict.border = 0;
    }
}

/// Only a unique recognition of a landmark of known size, seen by a known camera, has a pose.
fn pose(
    quad: &Quad,
    verdict: Option<&RecognitionResult>,
    camera: Option<&Intrinsics>,
    sizes: &BTreeMap<LandmarkId, LandmarkSize>,
    p: &Params,
) -> Result<LandmarkPose, PoseUnavailable> {
    let Some(RecognitionResult { verdict: Verdict::Unique(landmark), .. }) = verdict else {
        return Err(PoseUnavailable::NotUnique);
    };
    let border = verdict.and_then(|v| matched_border(quad, v, p)).ok_or(PoseUnavailable::NotUnique)?;
    let camera = camera.ok_or(PoseUnavailable::NoCamera)?;
    let size = sizes.get(landmark).ok_or(PoseUnavailable::NoSize(*landmark))?;
    Ok(landmark_pose(&border.corners_px, &border.covariance_px2, *size, camera)?)
}

#[cfg(test)]
mod tests;
