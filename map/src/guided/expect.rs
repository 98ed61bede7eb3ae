//! Predicts landmarks in an image from a prior pose, with the covariance of every corner and the
//! visible part of each.
//!
//! In: prior pose with covariance, camera, landmarks with their places, obstacles. Out:
//! [`Expectations`], by landmark number. Corners are in the pixels of the image as it comes, lens
//! distortion included.
//!
//! The covariance is first order in pose, place, extrinsics and intrinsics, plus the error of
//! linearisation in the pose: the second moment of the linearisation error over fixed draws of the
//! pose. Errors of prior and map are taken as independent, which is cautious where the prior rests
//! on the same landmarks.

mod params;
mod view;
mod search_gate;
mod expectations;
mod frame;

pub use expectations::{Expectations, Expected, MAX_EXPECTED};
pub use params::ExpectParams;
pub use search_gate::SearchGate;
pub use view::{CameraView, InView, KnownLandmark};

use crate::{
    check,
    guided::{
        error::GuidedError,
        expect::frame::{Frame, common_covariance},
    },
    pose2::Pose2Covariance,
    visibility::Obstacle,
};
use std::collections::BTreeSet;
use vision::{frame::MAX_SIDE_PX, geometry::polygon};

/// Where each landmark is expected in the image from a prior pose. Landmarks behind the camera,
/// outside of the image, viewed from behind, or farther than [`ExpectParams::max_range_m`] are left
/// out; of two with one number the first counts.
///
/// Landmarks with a corner behind the camera plane, or where the lens cannot be modelled, are left
/// out, too: their corners have no pixel. A place that is out of range of its type is an error
/// where it is near enough to matter.
pub fn expect(
    prior: &Pose2Covariance,
    view: &CameraView<'_>,
    landmarks: &[KnownLandmark<'_>],
    obstacles: &[Obstacle],
    params: &ExpectParams,
) -> Result<Expectations, GuidedError> {
    prior.check()?;
    view.mounting.check()?;
    for side_px in view.image_px {
        check::within("image_px", side_px, 1.0, MAX_SIDE_PX as f64)?;
    }
    let frame = Frame::new(prior, view, obstacles, params);
    let mut expected: Vec<Expected> = Vec::new();
    for known in landmarks.iter().filter(|known| frame.is_near(known.place)) {
        known.place.check()?;
        expected.extend(frame.expected(known));
    }
    let in_image_px2 = |e: &Expected| match &e.view {
        InView::Cut { visible_px, .. } => polygon::area(visible_px),
        _ => polygon::area(&e.corners_px),
    };
    // Stable: of two with the same number and area the first stays first.
    expected.sort_by(|a, b| in_image_px2(b).total_cmp(&in_image_px2(a)).then(a.landmark.cmp(&b.landmark)));
    let mut numbers = BTreeSet::new();
    expected.retain(|e| numbers.insert(e.landmark));
    expected.truncate(MAX_EXPECTED);
    expected.sort_by_key(|e| e.landmark);
    Ok(Expectations {
        landmarks: expected,
        common: common_covariance(prior, view),
        image_px: view.image_px,
        pose: prior.pose,
        mounting: view.mounting.clone(),
        intrinsics: *view.intrinsics,
    })
}
