//! `sensor_msgs/msg/CameraInfo` with `sensor_msgs/msg/RegionOfInterest`.

use super::{Header, Message};
use crate::{
    cdr::{CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// Calibration of a camera. [`crate::convert::CameraModel`] checks it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CameraInfo<'a> {
    /// Acquisition, and the optical frame of the camera.
    pub header: Header<'a>,
    /// Rows of the calibrated image, px.
    pub height: u32,
    /// Columns of the calibrated image, px.
    pub width: u32,
    /// `plumb_bob`, `rational_polynomial`, `equidistant`.
    pub distortion_model: &'a str,
    /// Coefficients of the model; empty for a rectified image.
    pub d: Vec<f64>,
    /// Intrinsics of the raw image, 3 x 3, row-major, px.
    pub k: [f64; 9],
    /// Rectification, 3 x 3, row-major.
    pub r: [f64; 9],
    /// Projection of the rectified image, 3 x 4, row-major, px.
    pub p: [f64; 12],
    /// Columns of the camera to a column of the image; 0 means 1.
    pub binning_x: u32,
    /// Rows of the camera to a row of the image; 0 means 1.
    pub binning_y: u32,
    /// The part of the calibrated image that is sent, before binning.
    pub roi: RegionOfInterest,
}

impl<'a> Value<'a> for CameraInfo<'a> {
    const MIN_BYTES: usize = Header::MIN_BYTES + 8 + 4 + 4 + 30 * 8 + 8 + RegionOfInterest::MIN_BYTES;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self {
            header: reader.value("header")?,
            height: reader.scalar("height")?,
            width: reader.scalar("width")?,
            distortion_model: reader.text("distortion_model")?,
            d: reader.numbers("d")?,
            k: reader.array("k")?,
            r: reader.array("r")?,
            p: reader.array("p")?,
            binning_x: reader.scalar("binning_x")?,
            binning_y: reader.scalar("binning_y")?,
            roi: reader.value("roi")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        writer.scalar(self.height);
        writer.scalar(self.width);
        writer.text(self.distortion_model);
        writer.numbers(&self.d);
        writer.array(&self.k);
        writer.array(&self.r);
        writer.array(&self.p);
        writer.scalar(self.binning_x);
        writer.scalar(self.binning_y);
        self.roi.write(writer);
    }
}

impl<'a> Message<'a> for CameraInfo<'a> {
    const NAME: TypeName<'static> = TypeName::known("sensor_msgs", "CameraInfo");
    const HASH: &'static str = "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275";
}

/// A rectangle of the calibrated image. A size of 0 x 0 means all of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RegionOfInterest {
    /// First column.
    pub x_offset: u32,
    /// First row.
    pub y_offset: u32,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Whether a rectified image is to be computed from the rectangle alone.
    pub do_rectify: bool,
}

impl Value<'_> for RegionOfInterest {
    const MIN_BYTES: usize = 17;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self {
            x_offset: reader.scalar("x_offset")?,
            y_offset: reader.scalar("y_offset")?,
            height: reader.scalar("height")?,
            width: reader.scalar("width")?,
            do_rectify: reader.flag("do_rectify")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        for number in [self.x_offset, self.y_offset, self.height, self.width] {
            writer.scalar(number);
        }
        writer.flag(self.do_rectify);
    }
}
