//! Names of the channels for viewers, and of their coordinate frames. Our own messages have their
//! keys as topics.

use protos::Name;

/// Transforms between the coordinate frames.
pub const TRANSFORMS: &str = "/tf";

/// Images of a camera.
pub fn image(robot: &Name, camera: &Name) -> String {
    format!("/robot/{robot}/{camera}/image")
}

/// Intrinsics of a camera.
pub fn calibration(robot: &Name, camera: &Name) -> String {
    format!("/robot/{robot}/{camera}/calibration")
}

/// Quads of a camera's answers.
pub fn annotations(robot: &Name, camera: &Name) -> String {
    format!("/robot/{robot}/{camera}/annotations")
}

/// Fused poses of a robot.
pub fn pose(robot: &Name) -> String {
    format!("/robot/{robot}/pose")
}

/// Laser scans of a robot.
pub fn scan(robot: &Name) -> String {
    format!("/robot/{robot}/scan")
}

/// Walls and landmarks of a map.
pub fn scene(map: &str) -> String {
    format!("/map/{map}/scene")
}

/// The coordinate frame of a map.
pub fn map_frame(map: &str) -> String {
    format!("map/{map}")
}

/// The coordinate frame of a robot.
pub fn robot_frame(robot: &Name) -> String {
    format!("robot/{robot}")
}

/// The coordinate frame of a camera, as mounted on its robot.
pub fn camera_frame(robot: &Name, camera: &Name) -> String {
    format!("robot/{robot}/{camera}")
}
