//! The corners of a landmark in a frame, and where keyframe, landmark and camera put them.

use super::Terms;
use crate::{
    joint::variables::{CameraState, LandmarkState, State},
    localise::derivatives::{point_by_mounting, point_by_pose},
    pose2::Pose2,
};
use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix2, Matrix2x3, Matrix3, Point2, Point3, SMatrix, Vector2, Vector3,
};

/// Nearer points are put at this depth: a step of the solver may lead behind the camera. Metres.
const MIN_DEPTH_M: f64 = 0.1;

/// Measured corners of a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LandmarkView {
    /// Keyframe of the frame.
    pub keyframe: usize,
    /// Landmark.
    pub landmark: usize,
    /// Camera.
    pub camera: usize,
    /// The camera in its mounting, by a head that turns it; identity where it is fixed.
    pub mounting_from_camera: Isometry3<f64>,
    /// Corners TL, TR, BR, BL as measured, with distortion; px.
    pub corners_px: [Point2<f64>; 4],
    /// Root of the information of each corner, 1/px.
    pub sqrt_information: [Matrix2<f64>; 4],
}

/// A projected corner with its derivatives by keyframe, landmark and camera.
struct Corner {
    px: Point2<f64>,
    by_keyframe: Matrix2x3<f64>,
    by_landmark: SMatrix<f64, 2, 8>,
    by_camera: SMatrix<f64, 2, 10>,
}

/// What all four corners of a view share.
struct Setting {
    turns: [Matrix3<f64>; 3],
    robot_from_map: Matrix3<f64>,
    mounting_from_robot: Matrix3<f64>,
    camera_from_mounting: Isometry3<f64>,
}

impl LandmarkView {
    pub(in crate::joint) fn is_valid(&self) -> bool {
        let roots = self.sqrt_information.iter().flat_map(|w| w.iter());
        self.corners_px.iter().flat_map(|p| p.coords.iter()).chain(roots).all(|v| v.is_finite())
    }

    pub(in crate::joint) fn linearised(&self, state: &State) -> Terms {
        let (x, landmark) = (&state.keyframes[self.keyframe], &state.landmarks[self.landmark]);
        let camera = &state.cameras[self.camera];
        let mut residual = DVector::zeros(8);
        let [mut by_x, mut by_m, mut by_c] = [3, 8, 10].map(|columns| DMatrix::zeros(8, columns));
        let corners = projected(x, landmark, camera, &self.mounting_from_camera);
        for (i, (corner, w)) in corners.iter().zip(&self.sqrt_information).enumerate() {
            residual.fixed_rows_mut::<2>(2 * i).copy_from(&(w * (corner.px - self.corners_px[i])));
            by_x.fixed_rows_mut::<2>(2 * i).copy_from(&(w * corner.by_keyframe));
            by_m.fixed_rows_mut::<2>(2 * i).copy_from(&(w * corner.by_landmark));
            by_c.fixed_rows_mut::<2>(2 * i).copy_from(&(w * corner.by_camera));
        }
        (residual, vec![by_x, by_m, by_c])
    }
}

fn projected(
    x: &Pose2,
    landmark: &LandmarkState,
    camera: &CameraState,
    mounting_from_camera: &Isometry3<f64>,
) -> [Corner; 4] {
    let rotation = |m: nalgebra::UnitQuaternion<f64>| m.to_rotation_matrix().into_inner();
    let setting = Setting {
        turns: landmark.turns(),
        robot_from_map: rotation(x.to_isometry3().rotation.inverse()),
        mounting_from_robot: rotation(camera.robot_from_camera.rotation.inverse()),
        camera_from_mounting: mounting_from_camera.inverse(),
    };
    vision::pose::reprojection::corner_points(&landmark.size())
        .map(|local| corner(&setting, x, landmark, camera, &local))
}

fn corner(
    setting: &Setting,
    x: &Pose2,
    landmark: &LandmarkState,
    camera: &CameraState,
    local: &Vector3<f64>,
) -> Corner {
    let Setting { turns: [turn, tilt, roll], robot_from_map, mounting_from_robot, camera_from_mounting } =
        setting;
    let map_from_landmark = turn * tilt * roll;
    let arm = map_from_landmark * local;
    let from_robot = landmark.centre + arm - Vector3::new(x.x_m, x.y_m, 0.0);
    let from_mounting = robot_from_map * from_robot - camera.robot_from_camera.translation.vector;
    let in_mounting = Point3::from(mounting_from_robot * from_mounting);
    let (px, by_point, by_lens) = pixel(&(camera_from_mounting * in_mounting).coords, camera);
    let by_point = by_point * camera_from_mounting.rotation.to_rotation_matrix();
    let mounting_from_map = mounting_from_robot * robot_from_map;
    let by_map_point = by_point * mounting_from_map;
    let mut by_camera = SMatrix::<f64, 2, 10>::zeros();
    let by_mounting = by_point * point_by_mounting(mounting_from_robot, &from_mounting);
    by_camera.fixed_columns_mut::<6>(0).copy_from(&by_mounting);
    by_camera.fixed_columns_mut::<4>(6).copy_from(&by_lens);
    let axis = |m: &Matrix3<f64>, k: usize| m.column(k).into_owned();
    let by_arm = SMatrix::<f64, 3, 8>::from_columns(&[
        Vector3::x(),
        Vector3::y(),
        Vector3::z().cross(&arm),
        Vector3::z(),
        axis(turn, 1).cross(&arm),
        axis(&(turn * tilt), 0).cross(&arm),
        axis(&map_from_landmark, 1) * local.y,
        axis(&map_from_landmark, 2) * local.z,
    ]);
    Corner {
        px,
        by_keyframe: by_point * point_by_pose(&mounting_from_map, &from_robot),
        by_landmark: by_map_point * by_arm,
        by_camera,
    }
}

/// Pixel of a point in the camera, with the derivatives by the point and by (focal length, centre,
/// k1).
fn pixel(p: &Vector3<f64>, camera: &CameraState) -> (Point2<f64>, Matrix2x3<f64>, SMatrix<f64, 2, 4>) {
    let depth = p.z.max(MIN_DEPTH_M);
    let a = Vector2::new(p.x / depth, p.y / depth);
    let (r2, k1) = (a.norm_squared(), camera.k1);
    let stretch = 1.0 + k1 * r2;
    let scale = Matrix2::from_diagonal(&Vector2::new(1.0, camera.aspect));
    let bent = stretch * Matrix2::identity() + 2.0 * k1 * a * a.transpose();
    let by_depth = Matrix2x3::new(1.0, 0.0, -a.x, 0.0, 1.0, -a.y) / depth;
    let offset = scale * a * stretch;
    let by_k1 = scale * a * (camera.focal_px * r2);
    let by_lens = SMatrix::<f64, 2, 4>::from_columns(&[offset, Vector2::x(), Vector2::y(), by_k1]);
    (camera.centre_px + camera.focal_px * offset, camera.focal_px * scale * bent * by_depth, by_lens)
}
