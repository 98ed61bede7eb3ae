//! `geometry_msgs/msg/PoseWithCovarianceStamped`: `/initialpose`, and a measurement for
//! `robot_localization`.

use super::{Header, Message, PoseWithCovariance};
use crate::{
    cdr::{CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// A pose with covariance, at a time, in a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PoseWithCovarianceStamped<'a> {
    /// Time, and the frame of the pose.
    pub header: Header<'a>,
    /// The pose.
    pub pose: PoseWithCovariance,
}

impl<'a> Value<'a> for PoseWithCovarianceStamped<'a> {
    const MIN_BYTES: usize = Header::MIN_BYTES + PoseWithCovariance::MIN_BYTES;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self { header: reader.value("header")?, pose: reader.value("pose")? })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        self.pose.write(writer);
    }
}

impl<'a> Message<'a> for PoseWithCovarianceStamped<'a> {
    const NAME: TypeName<'static> = TypeName::known("geometry_msgs", "PoseWithCovarianceStamped");
    const HASH: &'static str = "RIHS01_26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e";
}
