//! The landmarks expected in one image, and their corners as a function of the errors that they
//! share.

use crate::{
    extrinsics::CameraExtrinsics,
    guided::{
        expect::{search_gate::SearchGate, view::InView},
        joint::{ByCommon, CommonMatrix, CommonVector, CornerMatrix, CornerVector, Prediction},
        projection::{Camera, corner_vector, corners, derivatives},
    },
    place::LandmarkPlace,
    pose2::Pose2,
};
use nalgebra::{Point2, SMatrix};
use vision::{frame::Intrinsics, model::LandmarkId, pose::reprojection::perturbed};

/// Most landmarks expected in one image; of more, those with the largest part in the image.
pub const MAX_EXPECTED: usize = 64;

/// One landmark that is expected in the image.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// What of it is in view.
    pub view: InView,
    /// Predicted corners TL, TR, BR, BL, px; of a cut landmark some are outside the image.
    pub corners_px: [Point2<f64>; 4],
    /// Covariance of the predicted corners (u, v of TL, TR, BR, BL), px^2: prior pose, place,
    /// extrinsics, intrinsics.
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
    /// Whether it is in full view wherever within [`super::ExpectParams::sure_sigmas`] the robot
    /// is: not finding it is evidence against the prior, or against the landmark.
    pub is_sure: bool,
    /// Whether obstacles hide it from everywhere within its uncertainty: then nothing in the image
    /// can be it.
    pub(in crate::guided) is_hidden: bool,
    /// Its place in the map.
    pub(super) place: LandmarkPlace,
    /// Covariance of the corners by the errors of its place, px^2.
    pub(in crate::guided) by_place_px2: CornerMatrix,
}

/// All landmarks expected in one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Expectations {
    /// By number; at most [`MAX_EXPECTED`].
    pub landmarks: Vec<Expected>,
    /// Covariance of the errors that all of them share.
    pub(in crate::guided) common: CommonMatrix,
    /// Width and height of the image, px.
    pub(in crate::guided) image_px: [f64; 2],
    /// The prior pose and the camera that the errors refer to.
    pub(super) pose: Pose2,
    pub(super) mounting: CameraExtrinsics,
    pub(super) intrinsics: Intrinsics,
}

/// The corners of one landmark by the errors of pose, extrinsics and intrinsics.
pub(in crate::guided) struct Predicted<'a> {
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
    fn with(&self, error: &CommonVector) -> (Pose2, CameraExtrinsics, Intrinsics) {
        let Expectations { pose, mounting, intrinsics, .. } = self.expectations;
        let pose = pose.plus(&error.fixed_rows::<3>(0).into());
        let (turn, shift) = (error.fixed_rows::<3>(3).into(), error.fixed_rows::<3>(6).into());
        let robot_from_camera = perturbed(&mounting.robot_from_camera, &turn, &shift);
        let mounting = CameraExtrinsics { robot_from_camera, covariance: mounting.covariance };
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
    pub(in crate::guided) fn predicted(&self, index: usize) -> Predicted<'_> {
        Predicted { expectations: self, place: &self.landmarks[index].place }
    }

    /// Landmarks to look for, by number.
    pub fn searchable(&self) -> impl Iterator<Item = &Expected> {
        self.landmarks.iter().filter(|e| e.view.is_searchable())
    }
}
