//! `sensor_msgs/msg/CompressedImage`.

use super::{Header, Message};
use crate::{
    cdr::{CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// An image as the bytes of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CompressedImage<'a> {
    /// Acquisition, and the optical frame of the camera.
    pub header: Header<'a>,
    /// `jpeg`, `png`, or the longer form of `image_transport`: [`crate::convert::Compression`].
    pub format: &'a str,
    /// The file.
    pub data: &'a [u8],
}

impl<'a> Value<'a> for CompressedImage<'a> {
    const MIN_BYTES: usize = Header::MIN_BYTES + 4 + 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self {
            header: reader.value("header")?,
            format: reader.text("format")?,
            data: reader.bytes("data")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        writer.text(self.format);
        writer.bytes(self.data);
    }
}

impl<'a> Message<'a> for CompressedImage<'a> {
    const NAME: TypeName<'static> = TypeName::known("sensor_msgs", "CompressedImage");
    const HASH: &'static str = "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a";
}
