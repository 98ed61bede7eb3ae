//! What may be in view of a camera, and how much of it is.

use crate::{
    extrinsics::CameraExtrinsics, guided::projection::Camera, place::LandmarkPlace, visibility::VisibilityMap,
};
use nalgebra::Point2;
use vision::{frame::Intrinsics, model::LandmarkId};

/// A landmark of the map that may be in view.
#[derive(Debug, Clone, Copy)]
pub struct KnownLandmark<'a> {
    /// Number of the landmark.
    pub landmark: LandmarkId,
    /// Place of the landmark, map frame.
    pub place: &'a LandmarkPlace,
    /// Its visibility area, if it was computed. Inside this area no line of sight is tested.
    pub visible: Option<&'a VisibilityMap>,
}

/// The camera that took the image.
#[derive(Debug, Clone, Copy)]
pub struct CameraView<'a> {
    /// Extrinsics at the time of the image, pan and tilt included.
    pub mounting: &'a CameraExtrinsics,
    /// Intrinsics with lens, and with standard deviations where they are stated.
    pub intrinsics: &'a Intrinsics,
    /// Width and height of the image, px; 1 to [`vision::frame::MAX_SIDE_PX`].
    pub image_px: [f64; 2],
}

impl<'a> CameraView<'a> {
    pub(super) fn camera(&self) -> Camera<'a> {
        Camera { mounting: self.mounting, intrinsics: self.intrinsics }
    }
}

/// Visibility of a landmark from the prior pose.
#[derive(Debug, Clone, PartialEq)]
pub enum InView {
    /// The whole landmark is in view.
    Full,
    /// The image border cuts it.
    Cut {
        /// The part in the image: a convex polygon, px, in the order of the corners. Sides bent by
        /// the lens count as straight.
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
    /// The angle of view is too large.
    TooOblique {
        /// Angle against its normal, radians.
        incidence_rad: f64,
    },
    /// The prior is too uncertain to locate it.
    TooUncertain {
        /// Largest half extent of its search gates, px.
        gate_px: f64,
    },
}

impl InView {
    /// Whether the landmark is searched: in view as a whole, or cut by the border.
    pub fn is_searchable(&self) -> bool {
        matches!(self, Self::Full | Self::Cut { .. })
    }
}
