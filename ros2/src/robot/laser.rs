//! Laser scans with the laser's place on the robot.

use super::{
    camera::Transforms,
    problem::{MissingReason, Problem},
};
use crate::{
    convert::{LaserMounting, PlanarPose, PlanarScan},
    messages::LaserScan,
};
use protos::v1;

/// A scan without number and odometry. Its time is that of the middle ray: what the robot moved
/// during the turn then counts as much before it as after it.
pub(super) fn scan(
    topic: &str,
    message: &LaserScan<'_>,
    transforms: &Transforms<'_>,
) -> Result<v1::Scan, Problem> {
    let scan = PlanarScan::of(message).map_err(|fault| Problem::Scan { topic: topic.to_owned(), fault })?;
    let captured_ns = scan.first_ray_ns + (scan.last_ray_ns - scan.first_ray_ns) / 2;
    let lacks = |reason: MissingReason| {
        let lack = Box::new(transforms.lack(captured_ns, reason));
        Problem::Lacks { topic: topic.to_owned(), lack }
    };
    let robot_from_laser = transforms.tree.lookup(transforms.base_frame, message.header.frame_id);
    let robot_from_laser = robot_from_laser.map_err(|error| lacks(error.into()))?;
    let mounting =
        LaserMounting::of(&robot_from_laser).map_err(|error| lacks(MissingReason::Laser(error)))?;
    let scan = scan.mounted(&mounting);
    Ok(v1::Scan {
        captured_ns,
        robot_from_laser: Some(planar_wire(&mounting.robot_from_laser)),
        first_bearing_rad: scan.first_bearing_rad,
        bearing_step_rad: scan.bearing_step_rad,
        max_range_m: scan.max_range_m,
        ranges_m: scan.ranges_m,
        ..v1::Scan::default()
    })
}

/// A pose on the floor as the wire has it.
pub(super) fn planar_wire(pose: &PlanarPose) -> v1::Pose2 {
    v1::Pose2 { x_m: pose.x_m, y_m: pose.y_m, theta_rad: pose.theta_rad }
}
