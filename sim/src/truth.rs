//! Ground truth of an image: corners, visible share and angle of each landmark. Corners are
//! projected; the shares come from the depth buffer.

use nalgebra::{Isometry3, Point2, Point3};
use vision::geometry::{Corners, polygon};

use crate::building::{LandmarkKind, LandmarkTruth};
use crate::camera::Camera;

/// Least depth at which a corner counts as in front of the camera.
const NEAR_M: f64 = 0.01;
/// Hidden share from which a landmark counts as occluded.
pub const OCCLUDED_SHARE: f64 = 0.02;

/// How much of a landmark a picture shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewState {
    /// The whole landmark is visible.
    Full,
    /// The image border cuts it.
    Truncated,
    /// It is within the image, but partly hidden.
    Occluded,
}

/// One landmark in one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkView {
    /// Name of the landmark.
    pub name: String,
    /// Kind of the landmark.
    pub kind: LandmarkKind,
    /// Corners in pixels, distortion included. They may lie outside the image.
    pub corners_px: Corners,
    /// Full, truncated or occluded.
    pub state: ViewState,
    /// Hidden share of the part within the image, 0 to 1.
    pub occluded_share: f64,
    /// Visible area, px^2.
    pub visible_px2: f64,
    /// Angle between its normal and the direction to the camera, 0 frontal.
    pub view_angle_rad: f64,
    /// From the camera to its centre.
    pub distance_m: f64,
    /// Lengths of TL-TR, TR-BR, BR-BL, BL-TL.
    pub sides_px: [f64; 4],
    /// Maps landmark coordinates to camera coordinates.
    pub camera_from_landmark: Isometry3<f64>,
}

impl LandmarkView {
    /// Length of its shortest side.
    pub fn min_side_px(&self) -> f64 {
        self.sides_px.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Intersection over union of its outline and a quad, 0 to 1. If the border of an image of
    /// `size_px` (width, height) cuts it, the parts inside count: the quad then ends near the
    /// border. What of the quad lies outside is taken to overlap there, so the overlap inside is
    /// never overestimated.
    pub fn visible_iou(&self, quad: &Corners, size_px: [usize; 2]) -> f64 {
        let (found, real) = (quad.points(), self.corners_px.points());
        let whole = polygon::iou(found, real);
        if self.state != ViewState::Truncated {
            return whole;
        }
        let [right, bottom] = size_px.map(|px| px as f64 - 0.5);
        let image = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]].map(Point2::from);
        let inside_px2 = |polygon: &[Point2<f64>]| polygon::intersection_area(polygon, &image);
        let outside_px2 = polygon::area(found) - inside_px2(found);
        let common_px2 = polygon::intersection_area(found, real) - outside_px2;
        whole.max(common_px2 / (inside_px2(found) + inside_px2(real) - common_px2))
    }
}

/// The truth of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameTruth {
    /// Pose of the camera.
    pub map_from_camera: Isometry3<f64>,
    /// Landmarks of which a part is visible and whose corners all lie in front of the camera, in
    /// the building's order.
    pub landmarks: Vec<LandmarkView>,
}

impl FrameTruth {
    /// The view of a landmark, if it is visible.
    pub fn landmark(&self, name: &str) -> Option<&LandmarkView> {
        self.landmarks.iter().find(|l| l.name == name)
    }
}

/// The truth of one landmark; `None` if it is invisible or partly behind the camera.
pub(crate) fn landmark_view(
    landmark: &LandmarkTruth,
    camera: &Camera,
    map_from_camera: &Isometry3<f64>,
    [covered_px2, visible_px2]: [f64; 2],
) -> Option<LandmarkView> {
    if visible_px2 <= 0.0 || covered_px2 <= 0.0 {
        return None;
    }
    let camera_from_landmark = map_from_camera.inverse() * landmark.map_from_landmark;
    let corners =
        crate::building::rectangle(landmark.width_m, landmark.height_m).map(|p| camera_from_landmark * p);
    if corners.iter().any(|c| c.z < NEAR_M) {
        return None;
    }
    let corners_px = corners.map(|c| camera.intrinsics().project(&c.coords));
    let within = |c: &Point2<f64>| {
        c.x >= -0.5
            && c.y >= -0.5
            && c.x <= camera.width_px() as f64 - 0.5
            && c.y <= camera.height_px() as f64 - 0.5
    };
    let occluded_share = (1.0 - visible_px2 / covered_px2).clamp(0.0, 1.0);
    let state = if !corners_px.iter().all(within) {
        ViewState::Truncated
    } else if occluded_share > OCCLUDED_SHARE {
        ViewState::Occluded
    } else {
        ViewState::Full
    };
    let to_camera = camera_from_landmark.inverse() * Point3::origin();
    Some(LandmarkView {
        name: landmark.name.clone(),
        kind: landmark.kind,
        corners_px: Corners::new(corners_px).ok()?,
        state,
        occluded_share,
        visible_px2,
        view_angle_rad: to_camera.coords.yz().norm().atan2(to_camera.x),
        distance_m: to_camera.coords.norm(),
        sides_px: std::array::from_fn(|i| (corners_px[(i + 1) % 4] - corners_px[i]).norm()),
        camera_from_landmark,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_landmark_that_the_border_cuts_is_overlapped_by_its_visible_part() {
        let quad = |corners: [[f64; 2]; 4]| Corners::try_from(corners).unwrap();
        // A poster of the demo, half of it left of the image, and what was found of it.
        let cut = LandmarkView {
            name: "poster".into(),
            kind: LandmarkKind::Poster,
            corners_px: quad([[-51.3, 155.7], [65.7, 168.4], [60.0, 302.3], [-60.6, 304.5]]),
            state: ViewState::Truncated,
            occluded_share: 0.0,
            visible_px2: 8758.0,
            view_angle_rad: 0.1,
            distance_m: 3.6,
            sides_px: [118.0, 134.0, 121.0, 149.0],
            camera_from_landmark: Isometry3::identity(),
        };
        let size_px = [640, 480];
        let visible = quad([[0.0, 165.9], [60.5, 172.2], [55.2, 298.5], [-5.4, 298.6]]);
        assert!(cut.visible_iou(&visible, size_px) > 0.8);
        let full = LandmarkView { state: ViewState::Full, ..cut.clone() };
        assert!(full.visible_iou(&visible, size_px) < 0.5);
        let elsewhere = quad([[20.0, 290.0], [120.0, 290.0], [120.0, 400.0], [20.0, 400.0]]);
        let a_part = quad([[0.0, 170.0], [20.0, 170.0], [20.0, 200.0], [0.0, 200.0]]);
        assert!(cut.visible_iou(&elsewhere, size_px) < 0.1 && cut.visible_iou(&a_part, size_px) < 0.1);
    }
}
