//! The messages that robots and a server exchange, field by field as in their definitions. Texts
//! and the bytes of images are borrowed from the payload.
//!
//! Definitions: `ros2/common_interfaces` (`sensor_msgs`, `nav_msgs`, `geometry_msgs`, `std_msgs`),
//! `ros2/rcl_interfaces` (`builtin_interfaces`), `ros2/geometry2` (`tf2_msgs`),
//! `ros-perception/vision_msgs` 4.1.1; the `.msg` files named at each type. The hashes (REP-2011,
//! `RIHS01_`) are equal for Humble, Jazzy, Kilted and Lyrical.
//!
//! A definition whose hash is another one would have other bytes, so [`Message::HASH`] stands
//! beside the fields.

mod header;
mod geometry;
mod image;
mod compressed_image;
mod camera_info;
mod laser_scan;
mod odometry;
mod pose_with_covariance_stamped;
mod tf_message;
mod detection_2d_array;
mod any;

pub use any::{AnyMessage, MessageKind};
pub use camera_info::{CameraInfo, RegionOfInterest};
pub use compressed_image::CompressedImage;
pub use detection_2d_array::{
    BoundingBox2D, Detection2D, Detection2DArray, ObjectHypothesisWithPose, Pose2D,
};
pub use geometry::{Pose, PoseWithCovariance, Quaternion, Transform, Twist, TwistWithCovariance, Vector3};
pub use header::{Header, Time};
pub use image::Image;
pub use laser_scan::LaserScan;
pub use odometry::Odometry;
pub use pose_with_covariance_stamped::PoseWithCovarianceStamped;
pub use tf_message::{TFMessage, TransformStamped};

use crate::{
    cdr::{ByteOrder, CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// A message that has a topic of its own.
pub trait Message<'a>: Value<'a> {
    /// Its type.
    const NAME: TypeName<'static>;
    /// Hash of its definition, `RIHS01_` and 64 hexadecimal digits.
    const HASH: &'static str;

    /// Reads a payload to its end.
    fn decode(payload: &'a [u8]) -> Result<Self, CdrError> {
        let mut reader = Reader::new(payload)?;
        let message = Self::read(&mut reader)?;
        reader.finish()?;
        Ok(message)
    }

    /// The payload, little endian, as all current implementations send it.
    fn encode(&self) -> Vec<u8> {
        self.encode_in(ByteOrder::Little)
    }

    /// The payload in a given byte order.
    fn encode_in(&self, order: ByteOrder) -> Vec<u8> {
        let mut writer = Writer::new(order);
        self.write(&mut writer);
        writer.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_take_at_most_twice_the_memory_of_their_bytes() {
        fn check<'a, T: Value<'a>>() {
            assert!(size_of::<T>() <= 2 * T::MIN_BYTES, "{} over {}", size_of::<T>(), T::MIN_BYTES);
        }
        check::<TransformStamped<'_>>();
        check::<Detection2D<'_>>();
        check::<ObjectHypothesisWithPose<'_>>();
    }
}
