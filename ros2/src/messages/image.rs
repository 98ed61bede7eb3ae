//! `sensor_msgs/msg/Image`.

use super::{Header, Message};
use crate::{
    cdr::{CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// Pixels without compression. Nothing is checked here but the length of the payload:
/// [`crate::convert::ImageRows`] compares the sizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Image<'a> {
    /// Acquisition, and the optical frame of the camera.
    pub header: Header<'a>,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// What a pixel is: `mono8`, `rgb8`, `bgr8` ... (`include/sensor_msgs/image_encodings.hpp`).
    pub encoding: &'a str,
    /// Whether samples of more than one byte are big endian.
    pub is_bigendian: u8,
    /// Bytes from one row to the next.
    pub step: u32,
    /// The rows, `step * height` bytes.
    pub data: &'a [u8],
}

impl<'a> Value<'a> for Image<'a> {
    const MIN_BYTES: usize = Header::MIN_BYTES + 8 + 4 + 1 + 4 + 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self {
            header: reader.value("header")?,
            height: reader.scalar("height")?,
            width: reader.scalar("width")?,
            encoding: reader.text("encoding")?,
            is_bigendian: reader.scalar("is_bigendian")?,
            step: reader.scalar("step")?,
            data: reader.bytes("data")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        writer.scalar(self.height);
        writer.scalar(self.width);
        writer.text(self.encoding);
        writer.scalar(self.is_bigendian);
        writer.scalar(self.step);
        writer.bytes(self.data);
    }
}

impl<'a> Message<'a> for Image<'a> {
    const NAME: TypeName<'static> = TypeName::known("sensor_msgs", "Image");
    const HASH: &'static str = "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47";
}
