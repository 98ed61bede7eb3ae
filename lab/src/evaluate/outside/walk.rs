//! A robot that goes from picture to picture of a world: its fused pose at every one against the
//! truth. In: a world and its map. Out: errors of the pose, and how large they are stated to be.
//!
//! The pictures are those of others. The robot is not: it turns and goes straight between them, its
//! odometry, intrinsics and mounting have errors as large as they are taken to have, and it has no
//! laser. It begins without a pose.

use super::world::{CameraTruth, World};
use crate::evaluate::experiment::{
    mixed,
    robot_server::{SentFrame, Server},
    way::way,
};
use cli::{simulated_errors::SimulatedRobotErrors, survey::believed_odometry};
use engine::{
    analysis::{StageTimes, analyse_frame, frame_camera},
    decode::ImageLimits,
    picture,
    snapshot::MapSnapshot,
};
use map::pose2::{Pose2, Pose2Covariance, wrap_rad};
use nalgebra::{Isometry3, Vector3};
use sim::odometry::Odometry;
use vision::random::Random;

/// Time of a motion between pictures.
const STEP_NS: i64 = 200_000_000;
/// A camera that looks up or down more steeply than this has no heading.
const MIN_LEVEL: f64 = 0.2;

/// The pose of a robot at a picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct WalkStop {
    /// The fused pose less the true one: x, y (metres) and heading (radians).
    pub(super) error: Option<Vector3<f64>>,
    /// Of the error, 3 expected.
    pub(super) nees: Option<f64>,
    /// This picture corrected the pose.
    pub(super) corrected: bool,
}

/// Goes through a world in the order of its pictures.
pub(super) fn walk(world: &World, map: &MapSnapshot, seed: u64) -> anyhow::Result<Vec<WalkStop>> {
    let server = Server::new(map)?;
    let mut stops = Vec::new();
    let mut robot: Option<(Pose2, Odometry)> = None;
    let mut captured_ns = 0;
    for image in world.truth.images.iter().filter(|image| !image.whole_image) {
        let Some(camera) = world.cameras.get(&image.file) else { continue };
        let Some((truth, robot_from_camera)) = standing(camera) else { continue };
        let (at, odometry) = robot.get_or_insert_with(|| {
            let errors = believed_odometry(&mut Random::new(mixed(&[seed, 1])));
            (truth, Odometry::new(errors, truth, mixed(&[seed, 2])))
        });
        for motion in way(at, &truth) {
            captured_ns += STEP_NS;
            server.travel(odometry.advance(&motion), captured_ns);
        }
        *at = truth;
        captured_ns += STEP_NS;
        let bytes = std::fs::read(&image.path)?;
        let picture = picture::decode(&bytes, ImageLimits::UPLOAD)
            .map_err(|refused| anyhow::anyhow!("{}: {}", image.path.display(), refused.detail))?;
        let wrong = SimulatedRobotErrors::drawn(&camera.intrinsics, mixed(&[seed, 3]));
        let mounting = wrong.extrinsics(&robot_from_camera).ok();
        let now = server.map()?;
        let seen_by = frame_camera(Some(&wrong.camera), mounting.as_ref(), &now);
        let analysis = analyse_frame(&picture, seen_by, &now, &mut StageTimes::start());
        let before = server.corrections();
        let frame = SentFrame {
            image: picture.grey(),
            camera: &wrong.camera,
            mounting: mounting.as_ref(),
            odom_from_robot: odometry.pose(),
            captured_ns,
        };
        let (changes, _) = server.frame(&now, &analysis, &frame);
        if !changes.is_empty() {
            server.change(&now, &changes);
        }
        stops.push(stop(server.pose().as_ref(), &truth, server.corrections() > before));
    }
    Ok(stops)
}

fn stop(fused: Option<&Pose2Covariance>, truth: &Pose2, corrected: bool) -> WalkStop {
    let error = fused.map(|fused| {
        let [x, y] = [fused.pose.x_m - truth.x_m, fused.pose.y_m - truth.y_m];
        Vector3::new(x, y, wrap_rad(fused.pose.theta_rad - truth.theta_rad))
    });
    let squared = |(fused, error): (&Pose2Covariance, Vector3<f64>)| {
        fused.covariance.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)))
    };
    WalkStop { error, nees: fused.zip(error).map(squared), corrected }
}

/// A robot below the camera that faces where the camera looks, and the camera on it.
fn standing(camera: &CameraTruth) -> Option<(Pose2, Isometry3<f64>)> {
    let world_from_camera = camera.camera_from_world.inverse();
    let (at, ahead) = (world_from_camera.translation.vector, world_from_camera.rotation * Vector3::z());
    if ahead.xy().norm() < MIN_LEVEL {
        return None;
    }
    let robot = Pose2::new(at.x, at.y, ahead.y.atan2(ahead.x));
    Some((robot, robot.to_isometry3().inverse() * world_from_camera))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion};
    use vision::frame::{Distortion, Intrinsics};

    fn camera(yaw: f64, down: f64) -> CameraTruth {
        // Optical axes: x right, y down, z forward, looking along the world's x.
        let ahead =
            Rotation3::from_matrix_unchecked(Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0));
        let turn = Rotation3::from_euler_angles(0.0, down, yaw) * ahead;
        let world_from_camera = Isometry3::from_parts(
            Vector3::new(2.0, 3.0, 1.4).into(),
            UnitQuaternion::from_rotation_matrix(&turn),
        );
        let intrinsics = Intrinsics::new(500.0, 500.0, 320.0, 240.0, Distortion::None).unwrap();
        CameraTruth { camera_from_world: world_from_camera.inverse(), intrinsics }
    }

    #[test]
    fn a_robot_stands_below_its_camera_and_faces_where_it_looks() {
        let camera_there = camera(0.7, 0.2);
        let (robot, mounting) = standing(&camera_there).unwrap();
        assert!((robot.minus(&Pose2::new(2.0, 3.0, 0.7))).norm() < 1e-9, "{robot:?}");
        let seat = mounting * Point3::origin();
        assert!((seat - Point3::new(0.0, 0.0, 1.4)).norm() < 1e-9, "{seat}");
        assert!(standing(&camera(0.0, 1.5)).is_none(), "it looks at the floor");
    }

    #[test]
    fn the_error_of_a_heading_is_the_shorter_way_round() {
        let fused =
            Pose2Covariance { pose: Pose2::new(1.0, 0.0, 3.1), covariance: Matrix3::identity() * 0.01 };
        let there = stop(Some(&fused), &Pose2::new(1.1, 0.0, -3.1), true);
        let turn = 2.0 * std::f64::consts::PI - 6.2;
        assert!((there.error.unwrap() - Vector3::new(-0.1, 0.0, -turn)).norm() < 1e-9, "{:?}", there.error);
        assert!((there.nees.unwrap() - (0.01 + turn * turn) / 0.01).abs() < 1e-9);
        assert!(stop(None, &Pose2::default(), false).nees.is_none());
    }
}
