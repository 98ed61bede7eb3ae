//! `nav_msgs/msg/Odometry`.

use super::{Header, Message, PoseWithCovariance, TwistWithCovariance};
use crate::{
    cdr::{CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// Where the robot's wheels say that it is.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Odometry<'a> {
    /// Time, and the frame of the pose: usually `odom`.
    pub header: Header<'a>,
    /// The frame whose pose it is, and that of the twist: usually `base_link`.
    pub child_frame_id: &'a str,
    /// Pose of the child frame in the frame of the header.
    pub pose: PoseWithCovariance,
    /// Velocities in the child frame.
    pub twist: TwistWithCovariance,
}

impl<'a> Value<'a> for Odometry<'a> {
    const MIN_BYTES: usize =
        Header::MIN_BYTES + 4 + PoseWithCovariance::MIN_BYTES + TwistWithCovariance::MIN_BYTES;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self {
            header: reader.value("header")?,
            child_frame_id: reader.text("child_frame_id")?,
            pose: reader.value("pose")?,
            twist: reader.value("twist")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        writer.text(self.child_frame_id);
        self.pose.write(writer);
        self.twist.write(writer);
    }
}

impl<'a> Message<'a> for Odometry<'a> {
    const NAME: TypeName<'static> = TypeName::known("nav_msgs", "Odometry");
    const HASH: &'static str = "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0";
}
