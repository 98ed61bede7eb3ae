//! The whole method on one page: an image, the landmarks of a map and perhaps a camera in; what was seen out.
//!
//! No arithmetic here, and no stage steers an earlier one. Where the robot is follows in the map crate.

use crate::{
    detect::{
        detect,
        quads::{Quad, QuadKind},
    },
    frame::{GrayImage, Intrinsics},
    localise::pose::{LandmarkPose, LandmarkSize, PoseError, landmark_pose},
    params::Params,
    recognise::{
        DistanceKind, LandmarkId, ModelSet, Recognition, Verdict, is_same_border, verdict::recognise,
    },
    seen_border::{ALIGNED_SIGMA_ICON_PX, FoundBy, SeenBorder},
    trace::{Stage, Trace},
};
use nalgebra::Matrix2;
use std::collections::BTreeMap;

/// Most quads of one image that are compared with the landmarks, the detector's best first.
pub const MAX_RECOGNISED_QUADS: usize = 24;

/// What of a map the pipeline needs. Immutable while an image is worked on.
#[derive(Debug, Clone, Copy)]
pub struct Landmarks<'a> {
    /// Models of the landmarks to recognise.
    pub models: &'a ModelSet,
    /// Sizes of those whose size is known.
    pub sizes: &'a BTreeMap<LandmarkId, LandmarkSize>,
    /// Which distance decides.
    pub kind: DistanceKind,
}

/// Everything seen in one image.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameFacts {
    /// The quads, best first.
    pub quads: Vec<QuadFacts>,
}

/// What is known of one quad.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadFacts {
    /// The quad as detected.
    pub quad: Quad,
    /// What recognition says; `None` if it was not asked (three-sided, or beyond [`MAX_RECOGNISED_QUADS`]).
    pub verdict: Option<Verdict>,
    /// The landmark in the camera frame, or why not.
    pub pose: Result<LandmarkPose, NoPose>,
}

/// Why a quad has no pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoPose {
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

/// Image in, facts out: quads, verdicts, poses.
pub fn analyse(
    image: &GrayImage,
    camera: Option<&Intrinsics>,
    landmarks: Landmarks<'_>,
    p: &Params,
    trace: &mut impl Trace,
) -> FrameFacts {
    let quads = detect(image, &p.detect, trace);
    analyse_quads(image, quads, camera, landmarks, p, trace)
}

/// The same from given quads, for those found elsewhere or drawn by hand.
pub fn analyse_quads(
    image: &GrayImage,
    quads: Vec<Quad>,
    camera: Option<&Intrinsics>,
    landmarks: Landmarks<'_>,
    p: &Params,
    trace: &mut impl Trace,
) -> FrameFacts {
    let mut asked = 0;
    let mut verdict = |quad: &Quad| {
        asked += usize::from(quad.kind == QuadKind::Full);
        (quad.kind == QuadKind::Full && asked <= MAX_RECOGNISED_QUADS)
            .then(|| recognise(image, quad, landmarks.models, landmarks.kind, p))
    };
    let verdicts: Vec<Option<Verdict>> = quads.iter().map(&mut verdict).collect();
    trace.finished(Stage::Recognition);
    let quads = quads
        .into_iter()
        .zip(verdicts)
        .map(|(mut quad, mut verdict)| {
            if let Some(verdict) = &mut verdict {
                turn_to_recognised(&mut quad, verdict);
            }
            let pose = pose(&quad, verdict.as_ref(), camera, landmarks.sizes, p);
            QuadFacts { quad, verdict, pose }
        })
        .collect();
    trace.finished(Stage::Poses);
    FrameFacts { quads }
}

/// Where another border of `quad` than its corners was recognised, that one becomes its corners: whoever reads what was
/// recognised must not take the wall round a poster for it.
fn turn_to_recognised(quad: &mut Quad, verdict: &mut Verdict) {
    if verdict.recognition == Recognition::Unknown || verdict.border == 0 {
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
    verdict: Option<&Verdict>,
    camera: Option<&Intrinsics>,
    sizes: &BTreeMap<LandmarkId, LandmarkSize>,
    p: &Params,
) -> Result<LandmarkPose, NoPose> {
    let Some(Verdict { recognition: Recognition::Unique(landmark), .. }) = verdict else {
        return Err(NoPose::NotUnique);
    };
    let seen = verdict.and_then(|v| matched(quad, v, p)).ok_or(NoPose::NotUnique)?;
    let camera = camera.ok_or(NoPose::NoCamera)?;
    let size = sizes.get(landmark).ok_or(NoPose::NoSize(*landmark))?;
    Ok(landmark_pose(&seen.corners_px, &seen.covariance_px2, *size, camera)?)
}

/// The landmark's border: as detected, or, where another border of the same thing was taught than the one detected, as
/// aligned. An alternate border has no covariances of its own: the quad's stand in, both were found by the same edges.
pub fn matched(quad: &Quad, verdict: &Verdict, p: &Params) -> Option<SeenBorder> {
    let detected_px = match verdict.border {
        0 => &quad.corners_px,
        border => quad.alternates.get(border - 1)?,
    };
    let detected_px = detected_px.rotated(verdict.rotation);
    let believed_px2 = quad.believed_covariance_px2();
    let covariance_px2 = std::array::from_fn(|i| believed_px2[(i + verdict.rotation) % 4]);
    let detected = SeenBorder { corners_px: detected_px, covariance_px2, found_by: FoundBy::Edges };
    if let Some(own) = verdict.points.as_ref().map(|evidence| evidence.border()) {
        let is_same = match own.found_by {
            FoundBy::Alignment => detected.agrees_with(&own),
            FoundBy::Points | FoundBy::Edges => is_same_border(&detected_px, &own.corners_px, p),
        };
        return Some(if is_same { detected } else { own });
    }
    let Some(aligned_px) = verdict.aligned_px else { return Some(detected) };
    if is_same_border(&detected_px, &aligned_px, p) {
        return Some(detected);
    }
    let icon_px = detected_px.area_px2().sqrt() / p.icon.size as f64;
    let sigma_px = ALIGNED_SIGMA_ICON_PX * icon_px;
    let covariance_px2 = covariance_px2.map(|c| c + Matrix2::identity() * sigma_px * sigma_px);
    Some(SeenBorder { corners_px: aligned_px, covariance_px2, found_by: FoundBy::Alignment })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::quads::{BORDER_SIGMA_PX, Corners},
        frame::Distortion,
        geometry::homography::Homography,
        learn::{model::learn, random::Random, synthesis, texture::Texture},
        points::taught::view_points,
        trace::NoTrace,
    };
    use nalgebra::{Isometry3, Point2, Point3, Rotation3, Translation3, Vector3};
    use std::sync::Arc;

    const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.8 };

    fn poster(seed: u64) -> GrayImage {
        let mut random = Random::new(seed);
        let patches: Vec<[f64; 4]> = (0..40)
            .map(|_| {
                [
                    random.range(0.0, 300.0),
                    random.range(0.0, 400.0),
                    random.range(8.0, 50.0),
                    random.range(10.0, 245.0),
                ]
            })
            .collect();
        GrayImage::from_fn(300, 400, |u, v| {
            let (u, v) = (u as f64, v as f64);
            let top = patches.iter().rev().find(|[x, y, r, _]| (u - x).abs() < *r && (v - y).abs() < *r);
            top.map_or(128.0, |p| p[3]) as u8
        })
    }

    fn whole() -> Corners {
        Corners::try_from([[-0.5, -0.5], [299.5, -0.5], [299.5, 399.5], [-0.5, 399.5]]).unwrap()
    }

    fn models() -> ModelSet {
        let p = Params::default();
        let lesson = |seed| {
            let views = synthesis::views(&poster(seed), &whole(), 20, &p, seed);
            let points = view_points(&poster(seed), &whole());
            Arc::new(learn(LandmarkId(seed), &views, &[], &p).unwrap().with_points(&[points]))
        };
        ModelSet::new(vec![lesson(1), lesson(2)], &p).unwrap()
    }

    fn camera() -> Intrinsics {
        Intrinsics::new(600.0, 600.0, 319.5, 239.5, Distortion::None).unwrap()
    }

    /// Camera 2 m in front of the landmark, 25 degrees to its side.
    fn camera_from_landmark() -> Isometry3<f64> {
        // Landmark axes (x normal, y right, z up) in a camera that looks straight at it: -z, x, -y.
        let straight = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(
            0.0, 1.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0,
        ));
        let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), 25f64.to_radians());
        Isometry3::from_parts(Translation3::new(0.1, -0.05, 2.0), (turn * straight).into())
    }

    /// The image of poster `seed` on a wall, and its true quad.
    fn scene(seed: u64) -> (GrayImage, Quad) {
        let corners = [(-0.3, 0.4), (0.3, 0.4), (0.3, -0.4), (-0.3, -0.4)]
            .map(|(y, z)| camera().project(&(camera_from_landmark() * Point3::new(0.0, y, z)).coords));
        let unit = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Point2::from);
        let image_from_unit = Homography::from_points(&unit, &corners).unwrap();
        let texture = Texture::lift(&poster(seed), &whole()).unwrap();
        let picture = texture.seen(image_from_unit.matrix(), [640, 480], 150.0).unwrap();
        let quad = Quad {
            corners_px: Corners::new(corners).unwrap(),
            corner_covariance_px2: [Matrix2::identity() * 0.04; 4],
            side_support: [1.0; 4],
            side_clipped: [false; 4],
            score: 1.0,
            kind: QuadKind::Full,
            upright_ambiguous: false,
            alternates: vec![],
        };
        (GrayImage::new(640, 480, picture.into_iter().map(|g| g.round() as u8).collect()).unwrap(), quad)
    }

    fn facts(image: &GrayImage, quad: Quad, camera: Option<&Intrinsics>) -> QuadFacts {
        let sizes = BTreeMap::from([(LandmarkId(1), SIZE)]);
        let models = models();
        let landmarks = Landmarks { models: &models, sizes: &sizes, kind: DistanceKind::Both };
        analyse_quads(image, vec![quad], camera, landmarks, &Params::default(), &mut NoTrace).quads.remove(0)
    }

    fn assert_pose(facts: &QuadFacts) {
        let pose = facts.pose.as_ref().unwrap();
        let error = pose.best.camera_from_landmark.inverse() * camera_from_landmark();
        assert!(error.translation.vector.norm() < 1e-3 && error.rotation.angle() < 1e-3, "{error:?}");
    }

    #[test]
    fn a_known_landmark_gives_its_pose() {
        let (image, quad) = scene(1);
        let facts = facts(&image, quad, Some(&camera()));
        assert_eq!(facts.verdict.as_ref().unwrap().recognition, Recognition::Unique(LandmarkId(1)));
        assert_pose(&facts);
    }

    /// From pixels alone: the poster is found, named and placed to a few centimetres, with every stage told of.
    #[test]
    fn the_whole_method() {
        #[derive(Default)]
        struct Stages(Vec<Stage>);
        impl Trace for Stages {
            fn finished(&mut self, stage: Stage) {
                self.0.push(stage);
            }
        }
        let (image, _) = scene(1);
        let (models, sizes) = (models(), BTreeMap::from([(LandmarkId(1), SIZE)]));
        let landmarks = Landmarks { models: &models, sizes: &sizes, kind: DistanceKind::Both };
        let mut stages = Stages::default();
        let facts = analyse(&image, Some(&camera()), landmarks, &Params::default(), &mut stages);
        let poses: Vec<_> = facts.quads.iter().filter_map(|q| q.pose.as_ref().ok()).collect();
        assert_eq!(poses.len(), 1, "{:?}", facts.quads);
        let error = poses[0].best.camera_from_landmark.inverse() * camera_from_landmark();
        assert!(error.translation.vector.norm() < 0.05 && error.rotation.angle() < 0.05, "{error:?}");
        for stage in Stage::ALL {
            assert_eq!(stages.0.iter().filter(|s| **s == stage).count(), 1, "{stage:?}");
        }
        assert!(stages.0.is_sorted());
    }

    #[test]
    fn corners_that_start_elsewhere_are_turned_back() {
        let (image, mut quad) = scene(1);
        quad.corners_px = quad.corners_px.rotated(3);
        quad.corner_covariance_px2 = std::array::from_fn(|i| Matrix2::identity() * (0.04 + 0.01 * i as f64));
        quad.upright_ambiguous = true;
        let facts = facts(&image, quad.clone(), Some(&camera()));
        assert_pose(&facts);
        let seen = matched(&quad, facts.verdict.as_ref().unwrap(), &Params::default()).unwrap();
        let border = BORDER_SIGMA_PX.powi(2);
        assert!(
            (seen.covariance_px2[0][(0, 0)] - 0.05 - border).abs() < 1e-12,
            "covariances turn with their corners"
        );
    }

    #[test]
    fn an_inner_border_counts_as_its_own_corners() {
        let (image, mut quad) = scene(1);
        let outer = quad
            .corners_px
            .points()
            .map(|c| Point2::from(c.coords * 1.35 - nalgebra::Vector2::new(319.5, 239.5) * 0.35));
        let (inner, outer) = (quad.corners_px, Corners::new(outer).unwrap());
        (quad.corners_px, quad.alternates) = (outer, vec![inner]);
        let facts = facts(&image, quad, Some(&camera()));
        assert_eq!((facts.quad.corners_px, &facts.quad.alternates[..]), (inner, &[outer][..]));
        assert_eq!(facts.verdict.as_ref().unwrap().border, 0);
        assert_pose(&facts);
    }

    /// A mat inside the frame was detected, the frame was taught: the identity holds, and so must the distance.
    #[test]
    fn another_border_than_the_taught_one_gives_the_same_pose() {
        let (image, mut quad) = scene(1);
        let centre =
            quad.corners_px.points().iter().fold(nalgebra::Vector2::zeros(), |m, c| m + c.coords * 0.25);
        let inner = quad.corners_px.points().map(|c| Point2::from(centre + (c.coords - centre) * 0.95));
        quad.corners_px = Corners::new(inner).unwrap();
        let facts = facts(&image, quad, Some(&camera()));
        assert_eq!(facts.verdict.as_ref().unwrap().recognition, Recognition::Unique(LandmarkId(1)));
        let pose = facts.pose.unwrap();
        let error = pose.best.camera_from_landmark.inverse() * camera_from_landmark();
        // As detected it would stand 5 % farther away: 10 cm.
        assert!(error.translation.vector.norm() < 0.03, "{error:?}");
        let sigma_m = pose.best.covariance[(5, 5)].sqrt();
        assert!(sigma_m > 3e-3, "an aligned corner is not as sure as a detected one: {sigma_m} m");
    }

    #[test]
    fn no_pose_without_its_reasons() {
        let (image, quad) = scene(1);
        assert_eq!(facts(&image, quad.clone(), None).pose, Err(NoPose::NoCamera));
        let (other, other_quad) = scene(2);
        assert_eq!(facts(&other, other_quad, Some(&camera())).pose, Err(NoPose::NoSize(LandmarkId(2))));
        let (stranger, stranger_quad) = scene(3);
        assert_eq!(facts(&stranger, stranger_quad, Some(&camera())).pose, Err(NoPose::NotUnique));
        let three_sided = facts(&image, Quad { kind: QuadKind::ThreeSided, ..quad }, Some(&camera()));
        assert_eq!((three_sided.verdict, three_sided.pose), (None, Err(NoPose::NotUnique)));
    }

    #[test]
    fn only_so_many_quads_are_asked() {
        let (image, quad) = scene(1);
        let mut quads = vec![Quad { kind: QuadKind::ThreeSided, ..quad.clone() }];
        quads.resize(MAX_RECOGNISED_QUADS + 2, quad);
        let (models, sizes) = (ModelSet::default(), BTreeMap::new());
        let landmarks = Landmarks { models: &models, sizes: &sizes, kind: DistanceKind::Both };
        let facts = analyse_quads(&image, quads, None, landmarks, &Params::default(), &mut NoTrace);
        let asked: Vec<bool> = facts.quads.iter().map(|q| q.verdict.is_some()).collect();
        assert_eq!(asked.iter().filter(|a| **a).count(), MAX_RECOGNISED_QUADS);
        assert!(!asked[0] && !asked[MAX_RECOGNISED_QUADS + 1]);
    }
}
