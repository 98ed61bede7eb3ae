//! The quads of a drive's frames. In: the drive. Out: for each frame its full quads, with what they
//! show.

use super::{
    drive::{Drive, DriveFrame},
    parallel::Effort,
};
use crate::frame::decode::{ImageLimits, decode_frame};
use nalgebra::{Matrix2, Point2};
use protos::Rejection;
use std::collections::BTreeMap;
use vision::{
    detect::{Quad, QuadKind},
    frame::{Intrinsics, Picture},
    geometry::Corners,
    icon::icon,
    model::ModelSet,
    params::Params,
    pipeline::{FrameAnalysis, FrameCamera, LandmarkDatabase, Pipeline},
    recognise::{DistanceKind, IconFeatures, features},
    trace::NoTrace,
    up::Up,
};

/// Most quads of a frame, the detector's best first.
const MAX_QUADS: usize = 24;
/// Smaller quads say too little of what they show, px.
const MIN_SIDE_PX: f64 = 24.0;

/// A quad of a frame.
#[derive(Debug, Clone)]
pub(super) struct Sighting {
    /// In the image.
    pub(super) corners_px: Corners,
    /// Of the fitted edges alone.
    pub(super) covariance_px2: [Matrix2<f64>; 4],
    pub(super) icon: IconFeatures,
}

/// Sightings of each frame; none of one that cannot be decoded. Also how many of these there are.
pub(super) fn sightings(drive: &Drive, params: &Params, effort: Effort<'_>) -> (Vec<Vec<Sighting>>, usize) {
    let seen = effort.of_each(&drive.frames, "looking", |_, frame| of_frame(frame, params));
    let lost = seen.iter().filter(|seen| seen.is_err()).count();
    (seen.into_iter().map(Result::unwrap_or_default).collect(), lost)
}

/// The picture of a frame. Errors: it is too large, or cannot be decoded.
pub fn picture(frame: &DriveFrame) -> Result<Picture, Rejection> {
    decode_frame(&frame.frame, ImageLimits::UPLOAD)
}

fn of_frame(frame: &DriveFrame, params: &Params) -> Result<Vec<Sighting>, Rejection> {
    let picture = picture(frame)?;
    // Nothing is known yet.
    let analysed = analysed(frame, &picture, &ModelSet::default(), params);
    let is_whole = |quad: &Quad| quad.kind == QuadKind::Full && !quad.side_clipped.contains(&true);
    let is_large = |quad: &Quad| quad.corners_px.area_px2().sqrt() >= MIN_SIDE_PX;
    let quads = analysed.quads.into_iter().map(|analysis| analysis.quad);
    let sighting = |quad: Quad| {
        let icon = icon(picture.grey(), &quad.corners_px, &params.icon).ok()?;
        let icon = features(icon, &params.recognise);
        Some(Sighting { corners_px: quad.corners_px, covariance_px2: quad.corner_covariance_px2, icon })
    };
    Ok(quads.filter(is_whole).filter(is_large).take(MAX_QUADS).filter_map(sighting).collect())
}

/// Quads and names of a frame.
pub(super) fn analysed(
    frame: &DriveFrame,
    picture: &Picture,
    models: &ModelSet,
    params: &Params,
) -> FrameAnalysis {
    let mounting = frame.frame.mounting.as_ref();
    let camera = FrameCamera {
        intrinsics: frame.frame.intrinsics.as_ref(),
        up: mounting.and_then(|mounting| Up::new(mounting.camera_up())),
        height_m: mounting.map(|mounting| mounting.robot_from_camera.translation.vector.z),
    };
    let sizes = BTreeMap::new();
    let known = LandmarkDatabase { models, sizes: &sizes, kind: DistanceKind::default() };
    Pipeline::default().analyse(picture, camera, known, params, &mut NoTrace)
}

/// Corners as a camera without a lens sees them; `None` where the lens is not invertible.
pub(super) fn straight(corners: &Corners, camera: &Intrinsics) -> Option<[Point2<f64>; 4]> {
    let [a, b, c, d] = corners.points().each_ref().map(|corner| camera.undistort(corner));
    Some([a?, b?, c?, d?])
}
