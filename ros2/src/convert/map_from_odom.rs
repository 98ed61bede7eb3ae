//! What a localiser broadcasts: `map` to `odom`, never `map` to `base_link` (REP-105).

use super::pose::transform_of;
use crate::messages::{Header, Time, TransformStamped};
use nalgebra::Isometry3;

/// `map_from_odom` of two poses of the robot's base at one time, that of the picture. Height, roll
/// and pitch of the odometry are taken over, so that `map_from_odom * odom_from_base` is exactly
/// the pose in the map.
pub fn map_from_odom(map_from_base: &Isometry3<f64>, odom_from_base: &Isometry3<f64>) -> Isometry3<f64> {
    map_from_base * odom_from_base.inverse()
}

/// The transform as `/tf` carries it. For `map` to `odom`, AMCL stamps it ahead of the newest data
/// of the robot by a tolerance (1 s by default) and repeats it
/// (`ros-navigation/navigation2 nav2_amcl/src/amcl_node.cpp`).
pub fn transform_stamped<'a>(
    parent_frame: &'a str,
    child_frame: &'a str,
    stamp: Time,
    parent_from_child: &Isometry3<f64>,
) -> TransformStamped<'a> {
    TransformStamped {
        header: Header { stamp, frame_id: parent_frame },
        child_frame_id: child_frame,
        transform: transform_of(parent_from_child),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::{PlanarPose, isometry_of_transform};
    use nalgebra::{Translation3, UnitQuaternion};

    #[test]
    fn the_chain_gives_the_pose_in_the_map() {
        let map_from_base = PlanarPose { x_m: 5.0, y_m: 2.0, theta_rad: 1.0 }.to_isometry();
        let odom_from_base = Isometry3::from_parts(
            Translation3::new(-1.0, 0.5, 0.1),
            UnitQuaternion::from_euler_angles(0.02, -0.03, 2.0),
        );
        let sent = transform_stamped(
            "map",
            "odom",
            Time::default(),
            &map_from_odom(&map_from_base, &odom_from_base),
        );
        assert_eq!((sent.header.frame_id, sent.child_frame_id), ("map", "odom"));
        let chain = isometry_of_transform(&sent.transform).unwrap() * odom_from_base;
        assert!((chain.to_homogeneous() - map_from_base.to_homogeneous()).norm() < 1e-12);
    }

    #[test]
    fn a_known_case_by_hand() {
        // The robot stands at (3, 0) facing +y; odometry says 1 m ahead of where it began.
        let map_from_base = PlanarPose { x_m: 3.0, y_m: 0.0, theta_rad: std::f64::consts::FRAC_PI_2 };
        let odom_from_base = PlanarPose { x_m: 1.0, y_m: 0.0, theta_rad: 0.0 };
        let planar =
            PlanarPose::of(&map_from_odom(&map_from_base.to_isometry(), &odom_from_base.to_isometry()));
        assert!((planar.x_m - 3.0).abs() < 1e-12 && (planar.y_m + 1.0).abs() < 1e-12);
        assert!((planar.theta_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
