//! `tf2_msgs/msg/TFMessage` with `geometry_msgs/msg/TransformStamped`: `/tf` and `/tf_static`.

use super::{Header, Message, Transform};
use crate::{
    cdr::{CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// Several transforms.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TFMessage<'a> {
    /// The transforms, each with its own time.
    pub transforms: Vec<TransformStamped<'a>>,
}

impl<'a> Value<'a> for TFMessage<'a> {
    const MIN_BYTES: usize = 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self { transforms: reader.values("transforms")? })
    }

    fn write(&self, writer: &mut Writer) {
        writer.values(&self.transforms);
    }
}

impl<'a> Message<'a> for TFMessage<'a> {
    const NAME: TypeName<'static> = TypeName::known("tf2_msgs", "TFMessage");
    const HASH: &'static str = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
}

/// `parent_from_child` at a time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TransformStamped<'a> {
    /// Time, and the parent frame.
    pub header: Header<'a>,
    /// The child frame.
    pub child_frame_id: &'a str,
    /// `parent_from_child`.
    pub transform: Transform,
}

impl<'a> Value<'a> for TransformStamped<'a> {
    const MIN_BYTES: usize = Header::MIN_BYTES + 4 + Transform::MIN_BYTES;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self {
            header: reader.value("header")?,
            child_frame_id: reader.text("child_frame_id")?,
            transform: reader.value("transform")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        writer.text(self.child_frame_id);
        self.transform.write(writer);
    }
}
