//! Where a prior pose expects landmarks in an image, with the covariance of every corner and what is in view of each.
//!
//! In: prior pose with covariance, camera, landmarks with their places, obstacles. Out: [`Expectations`], by landmark
//! number. Corners are in the pixels of the image as it comes, lens distortion included.
//!
//! The covariance is first order in pose, place, extrinsics and intrinsics, plus what is not linear in the pose: the second
//! moment of the linearisation error over fixed draws of the pose. Errors of prior and map are taken as independent, which
//! is cautious where the prior rests on the same landmarks.

mod frame;

use super::{
    GuidedError,
    joint::{ByCommon, CommonMatrix, CommonVector, CornerMatrix, CornerVector, Prediction},
    projection::{Camera, corner_vector, corners, derivatives},
};
use crate::{
    check,
    mounting::Mounting,
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
    visibility::{Obstacle, VisibilityMap},
};
use frame::{Frame, common_covariance};
use nalgebra::{Matrix2, Point2, SMatrix, Vector2};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use vision::{
    frame::{Intrinsics, MAX_SIDE_PX},
    geometry::polygon,
    model::LandmarkId,
    pose::reprojection::perturbed,
};

/// Most landmarks expected in one image; of more, those with the largest part in the image.
pub const MAX_EXPECTED: usize = 64;

/// Limits of what is expected.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExpectParams {
    /// Landmarks further from the camera than this are left out, metres.
    pub max_range_m: f64,
    /// Shortest side in the image below which a landmark is too small, px.
    pub min_side_px: f64,
    /// Angle against the normal beyond which a landmark is too oblique, radians.
    pub max_incidence_rad: f64,
    /// Least share of a landmark's area in the image, 0 to 1; with less it is left out.
    pub min_image_share: f64,
    /// Least share of its face that obstacles leave free, 0 to 1.
    pub min_unoccluded_share: f64,
    /// Standard deviation of a measured corner that the search gates allow for, px.
    pub corner_sigma_px: f64,
    /// Size of the search gates: squared Mahalanobis distance, 2 degrees of freedom. 13.816 is 99.9 %.
    pub gate_chi2: f64,
    /// Largest half extent of a search gate, px; beyond it the prior is too uncertain to guide.
    pub max_gate_px: f64,
    /// A landmark is surely in view when it is so within this many standard deviations of the prior.
    pub sure_sigmas: f64,
    /// How far before its wall a landmark is taken to hang when lines of sight are tested, metres.
    pub standoff_m: f64,
}

impl Default for ExpectParams {
    fn default() -> Self {
        Self {
            max_range_m: 30.0,
            min_side_px: 24.0,
            max_incidence_rad: 75.0_f64.to_radians(),
            min_image_share: 0.25,
            min_unoccluded_share: 0.5,
            corner_sigma_px: 1.0,
            gate_chi2: crate::gate::CHI2_2_999,
            max_gate_px: 120.0,
            sure_sigmas: 3.0,
            standoff_m: 0.05,
        }
    }
}

/// A landmark of the map that may be in view.
#[derive(Debug, Clone, Copy)]
pub struct KnownLandmark<'a> {
    /// Its number.
    pub landmark: LandmarkId,
    /// Its place.
    pub place: &'a LandmarkPlace,
    /// From where the whole of it is visible, if that was computed. Inside this area no line of sight is tested.
    pub visible: Option<&'a VisibilityMap>,
}

/// The camera that took the image.
#[derive(Debug, Clone, Copy)]
pub struct CameraView<'a> {
    /// Extrinsics at the time of the image, pan and tilt included.
    pub mounting: &'a Mounting,
    /// Intrinsics with lens, and with standard deviations where they are stated.
    pub intrinsics: &'a Intrinsics,
    /// Width and height of the image, px; 1 to [`MAX_SIDE_PX`].
    pub image_px: [f64; 2],
}

/// What of a landmark is in view from the prior pose.
#[derive(Debug, Clone, PartialEq)]
pub enum InView {
    /// All of it.
    Full,
    /// The image border cuts it.
    Cut {
        /// The part in the image: a convex polygon, px, in the order of the corners. Sides bent by the lens count as
        /// straight.
        visible_px: Vec<Point2<f64>>,
        /// Share of its area that is in the image, 0 to 1.
        share: f64,
    },
    /// Obstacles hide too much of it.
    Occluded {
        /// Share of its face that is free, 0 to 1.
        unoccluded_share: f64,
    },
    /// Too small in the image.
    TooSmall {
        /// Its shortest side, px.
        side_px: f64,
    },
    /// Seen too obliquely.
    TooOblique {
        /// Angle against its normal, radians.
        incidence_rad: f64,
    },
    /// The prior does not say well enough where it is.
    TooUncertain {
        /// Largest half extent of its search gates, px.
        gate_px: f64,
    },
}

impl InView {
    /// Whether the image is worth looking at there: in view as a whole, or cut by the border.
    pub fn is_searchable(&self) -> bool {
        matches!(self, Self::Full | Self::Cut { .. })
    }
}

/// Where to look for one corner: an ellipse in the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchGate {
    /// Predicted corner, px.
    pub center_px: Point2<f64>,
    /// Covariance of a measured corner about it, px^2: prediction plus [`ExpectParams::corner_sigma_px`].
    pub covariance_px2: Matrix2<f64>,
    /// Squared Mahalanobis distance of the border.
    pub chi2: f64,
}

impl SearchGate {
    /// Whether a measured corner is inside.
    pub fn contains(&self, corner_px: &Point2<f64>) -> bool {
        let d = corner_px - self.center_px;
        self.covariance_px2.cholesky().is_some_and(|c| d.dot(&c.solve(&d)) <= self.chi2)
    }

    /// Half width and half height of the ellipse's bounding box, px.
    pub fn half_extent_px(&self) -> Vector2<f64> {
        self.covariance_px2.diagonal().map(|v| (self.chi2 * v).sqrt())
    }
}

/// One landmark that is expected in the image.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// Its number.
    pub landmark: LandmarkId,
    /// What of it is in view.
    pub view: InView,
    /// Predicted corners TL, TR, BR, BL, px; of a cut landmark some are outside the image.
    pub corners_px: [Point2<f64>; 4],
    /// Covariance of the predicted corners (u, v of TL, TR, BR, BL), px^2: prior pose, place, extrinsics, intrinsics.
    pub covariance_px2: SMatrix<f64, 8, 8>,
    /// A search gate for each corner.
    pub gates: [SearchGate; 4],
    /// Distance from the camera to its centre, metres.
    pub range_m: f64,
    /// Angle of view against its normal, radians.
    pub incidence_rad: f64,
    /// Shortest side in the image, px.
    pub side_px: f64,
    /// Share of its face that obstacles leave free, 0 to 1.
    pub unoccluded_share: f64,
    /// Whether it is in full view wherever within [`ExpectParams::sure_sigmas`] the robot is: not finding it speaks against
    /// the prior, or against the landmark.
    pub is_sure: bool,
    /// Whether obstacles hide it from everywhere within its uncertainty: then nothing in the image can be it.
    pub(super) is_hidden: bool,
    /// Its place in the map.
    place: LandmarkPlace,
    /// Covariance of the corners by the errors of its place, px^2.
    pub(super) by_place_px2: CornerMatrix,
}

/// All landmarks expected in one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Expectations {
    /// By number; at most [`MAX_EXPECTED`].
    pub landmarks: Vec<Expected>,
    /// Covariance of the errors that all of them share.
    pub(super) common: CommonMatrix,
    /// Width and height of the image, px.
    pub(super) image_px: [f64; 2],
    /// What the errors are errors of.
    pose: Pose2,
    mounting: Mounting,
    intrinsics: Intrinsics,
}

/// The corners of one landmark by the errors of pose, extrinsics and intrinsics.
pub(super) struct Predicted<'a> {
    expectations: &'a Expectations,
    place: &'a LandmarkPlace,
}

impl Prediction for Predicted<'_> {
    fn px(&self, error: &CommonVector) -> Option<CornerVector> {
        let (pose, mounting, intrinsics) = self.with(error);
        let camera = Camera { mounting: &mounting, intrinsics: &intrinsics };
        corners(&pose, self.place, &camera).map(|px| corner_vector(&px))
    }

    fn at(&self, error: &CommonVector) -> Option<(CornerVector, ByCommon)> {
        let (pose, mounting, intrinsics) = self.with(error);
        let camera = Camera { mounting: &mounting, intrinsics: &intrinsics };
        let px = corners(&pose, self.place, &camera)?;
        let (by_common, _) = derivatives(&pose, self.place, &camera, &px)?;
        Some((corner_vector(&px), by_common))
    }
}

impl Predicted<'_> {
    /// Pose, extrinsics and intrinsics with these errors.
    fn with(&self, error: &CommonVector) -> (Pose2, Mounting, Intrinsics) {
        let Expectations { pose, mounting, intrinsics, .. } = self.expectations;
        let pose = pose.plus(&error.fixed_rows::<3>(0).into());
        let (turn, shift) = (error.fixed_rows::<3>(3).into(), error.fixed_rows::<3>(6).into());
        let robot_from_camera = perturbed(&mounting.robot_from_camera, &turn, &shift);
        let mounting = Mounting { robot_from_camera, covariance: mounting.covariance };
        let share = 1.0 + error[9];
        let intrinsics = Intrinsics {
            fx_px: intrinsics.fx_px * share,
            fy_px: intrinsics.fy_px * share,
            cx_px: intrinsics.cx_px + error[10],
            cy_px: intrinsics.cy_px + error[11],
            ..*intrinsics
        };
        (pose, mounting, intrinsics)
    }
}

impl Expectations {
    /// The expectation of one landmark.
    pub fn of(&self, landmark: LandmarkId) -> Option<&Expected> {
        let at = self.landmarks.binary_search_by_key(&landmark, |e| e.landmark).ok()?;
        self.landmarks.get(at)
    }

    /// The expectation at an index as a function of the common errors.
    pub(super) fn predicted(&self, index: usize) -> Predicted<'_> {
        Predicted { expectations: self, place: &self.landmarks[index].place }
    }

    /// Landmarks to look for, by number.
    pub fn searchable(&self) -> impl Iterator<Item = &Expected> {
        self.landmarks.iter().filter(|e| e.view.is_searchable())
    }
}

/// Where each landmark is expected in the image from a prior pose. Landmarks behind the camera, outside of the image, seen
/// from behind, or farther than [`ExpectParams::max_range_m`] are left out; of two with one number the first counts.
///
/// Landmarks with a corner behind the camera plane, or where the lens cannot be modelled, are left out, too: their corners
/// have no pixel. A place that is out of range of its type is an error where it is near enough to matter.
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
    let mut seen = BTreeSet::new();
    expected.retain(|e| seen.insert(e.landmark));
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

impl<'a> CameraView<'a> {
    fn camera(&self) -> Camera<'a> {
        Camera { mounting: self.mounting, intrinsics: self.intrinsics }
    }
}
