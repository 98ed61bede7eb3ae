//! What drives give: walls, objects, and the camera as it was found.

use super::objects::ObjectView;
use map::{
    joint::CameraState,
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance, laid_on},
    segments::LaserSegment,
};
use nalgebra::{Isometry3, Matrix3, Point2, Rotation3, SVector, Vector3};
use vision::frame::Intrinsics;

/// An object of a surveyed building.
#[derive(Debug, Clone)]
pub struct SurveyedObject {
    /// Where it hangs.
    pub place: LandmarkPlace,
    /// Its views.
    pub views: Vec<ObjectView>,
    /// Why it is no landmark; none where it is one.
    pub refused: Option<String>,
}

/// What drives gave.
#[derive(Debug)]
pub struct SurveyedBuilding {
    /// Walls, map frame.
    pub walls: Vec<LaserSegment>,
    /// Walls of the first laser map alone, for comparison.
    pub laser_walls: Vec<LaserSegment>,
    /// `map_from_robot` of each frame of the first drive by its laser map alone.
    pub laser_frames: Vec<Pose2>,
    /// Objects.
    pub objects: Vec<SurveyedObject>,
    /// `map_from_robot` of each frame, those of later drives after those of earlier ones.
    pub frames: Vec<Pose2Covariance>,
    /// The camera as found, without its lens, and its standard deviations.
    pub camera: (CameraState, SVector<f64, 10>),
    /// The camera as stated.
    pub stated: CameraState,
    /// Scale of odometry as found, minus 1, of each drive.
    pub odometry_scales: Vec<f64>,
    /// Loop closures of the laser maps.
    pub loops: usize,
    /// Frames that could not be decoded.
    pub undecodable: usize,
}

impl SurveyedBuilding {
    /// The same, laid where its frames are known to have been taken: positions in another frame.
    #[must_use]
    pub fn laid_on_path(self, there: &[Point2<f64>]) -> Self {
        let here: Vec<Point2<f64>> = self.frames.iter().map(|f| f.pose.position().into()).collect();
        let by = laid_on(&here, there);
        self.laid(&by)
    }

    /// The same in another frame of the floor, whose relation to this one is exact: as a person
    /// lays a map on a floor plan.
    fn laid(mut self, there_from_here: &Pose2) -> Self {
        let by = Pose2Covariance { pose: *there_from_here, covariance: Matrix3::zeros() };
        for wall in self.walls.iter_mut().chain(&mut self.laser_walls) {
            *wall = wall.transformed(&by);
        }
        self.laser_frames.iter_mut().for_each(|pose| *pose = there_from_here.compose(pose));
        self.objects.iter_mut().for_each(|object| object.place = object.place.moved(there_from_here));
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), there_from_here.theta_rad);
        for frame in &mut self.frames {
            frame.pose = there_from_here.compose(&frame.pose);
            frame.covariance = turn * frame.covariance * turn.transpose();
        }
        self
    }

    /// The mounting of a frame by the camera as found.
    pub fn mounting(&self, stated: &Isometry3<f64>) -> Isometry3<f64> {
        self.camera.0.robot_from_camera * self.stated.robot_from_camera.inverse() * stated
    }

    /// Intrinsics with the focal length as found; their lens stays.
    pub fn intrinsics(&self, stated: &Intrinsics) -> Intrinsics {
        with_focal(stated, self.camera.0.focal_px)
    }
}

/// Intrinsics with this focal length; aspect ratio and lens stay.
pub(super) fn with_focal(camera: &Intrinsics, focal_px: f64) -> Intrinsics {
    Intrinsics { fx_px: focal_px, fy_px: focal_px * camera.fy_px / camera.fx_px, ..*camera }
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::place::PlaceSigmas;
    use nalgebra::Point3;
    use vision::pose::LandmarkSize;

    #[test]
    fn a_building_is_laid_where_its_frames_were_taken() {
        let frame = |x: f64| {
            let covariance = Matrix3::from_diagonal(&Vector3::new(0.04, 0.01, 1e-4));
            Pose2Covariance { pose: Pose2::new(x, 0.0, 0.0), covariance }
        };
        let size = LandmarkSize { width_m: 0.6, height_m: 0.8 };
        let at = Vector3::new(2.0, 1.0, 1.5);
        let place = LandmarkPlace::by_hand(at, 0.0, size, PlaceSigmas::default()).unwrap();
        let camera = CameraState {
            robot_from_camera: Isometry3::identity(),
            focal_px: 500.0,
            aspect: 1.0,
            centre_px: Point2::new(320.0, 240.0),
            k1: 0.0,
        };
        let building = SurveyedBuilding {
            walls: vec![LaserSegment::by_hand(&[0.0, 1.0, 4.0, 1.0]).unwrap()],
            laser_walls: Vec::new(),
            laser_frames: vec![Pose2::default()],
            objects: vec![SurveyedObject { place, views: Vec::new(), refused: None }],
            frames: vec![frame(0.0), frame(4.0)],
            camera: (camera, SVector::zeros()),
            stated: camera,
            odometry_scales: vec![0.0],
            loops: 0,
            undecodable: 0,
        };
        // A quarter turn to the left, from (5, 5).
        let laid = building.laid_on_path(&[Point2::new(5.0, 5.0), Point2::new(5.0, 9.0)]);
        let off = |a: Point2<f64>, b: [f64; 2]| (a - Point2::from(b)).norm();
        assert!(off(laid.walls[0].a, [4.0, 5.0]) < 1e-9 && off(laid.walls[0].b, [4.0, 9.0]) < 1e-9);
        let centre = laid.objects[0].place.map_from_landmark() * Point3::origin();
        assert!((centre - Point3::new(4.0, 7.0, 1.5)).norm() < 1e-9, "{centre}");
        let last = &laid.frames[1];
        assert!(last.pose.minus(&Pose2::new(5.0, 9.0, std::f64::consts::FRAC_PI_2)).norm() < 1e-9);
        assert!(
            (last.covariance[(0, 0)] - 0.01).abs() < 1e-12 && (last.covariance[(1, 1)] - 0.04).abs() < 1e-12
        );
        assert!(off(laid.laser_frames[0].position().into(), [5.0, 5.0]) < 1e-9);
    }
}
