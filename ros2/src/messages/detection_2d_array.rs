//! `vision_msgs/msg/Detection2DArray` with `Detection2D`, `ObjectHypothesisWithPose`,
//! `BoundingBox2D` and `Pose2D`: what was recognised in an image. `ObjectHypothesis` and `Point2D`
//! are written as the fields they have.

use super::{Header, Message, PoseWithCovariance};
use crate::{
    cdr::{CdrError, Reader, Value, Writer},
    type_name::TypeName,
};

/// The detections of one image.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detection2DArray<'a> {
    /// Acquisition, and the optical frame of the camera.
    pub header: Header<'a>,
    /// The detections.
    pub detections: Vec<Detection2D<'a>>,
}

impl<'a> Value<'a> for Detection2DArray<'a> {
    const MIN_BYTES: usize = Header::MIN_BYTES + 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self { header: reader.value("header")?, detections: reader.values("detections")? })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        writer.values(&self.detections);
    }
}

impl<'a> Message<'a> for Detection2DArray<'a> {
    const NAME: TypeName<'static> = TypeName::known("vision_msgs", "Detection2DArray");
    const HASH: &'static str = "RIHS01_214274120007f4a683866481336b70310268cfa107aebe9d594a6acf75bda968";
}

/// One object in an image.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detection2D<'a> {
    /// As that of the array.
    pub header: Header<'a>,
    /// What it may be, best first.
    pub results: Vec<ObjectHypothesisWithPose<'a>>,
    /// Where it is in the image.
    pub bbox: BoundingBox2D,
    /// Name of the track, the same from image to image; may be empty.
    pub id: &'a str,
}

impl<'a> Value<'a> for Detection2D<'a> {
    const MIN_BYTES: usize = Header::MIN_BYTES + 4 + BoundingBox2D::MIN_BYTES + 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self {
            header: reader.value("header")?,
            results: reader.values("results")?,
            bbox: reader.value("bbox")?,
            id: reader.text("id")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        self.header.write(writer);
        writer.values(&self.results);
        self.bbox.write(writer);
        writer.text(self.id);
    }
}

/// A class and, where it is known, the pose of the object.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ObjectHypothesisWithPose<'a> {
    /// `hypothesis.class_id`: the name of the class.
    pub class_id: &'a str,
    /// `hypothesis.score`: confidence, 0 to 1.
    pub score: f64,
    /// Pose of the object in the frame of the header.
    pub pose: PoseWithCovariance,
}

impl<'a> Value<'a> for ObjectHypothesisWithPose<'a> {
    const MIN_BYTES: usize = 4 + 8 + PoseWithCovariance::MIN_BYTES;

    fn read(reader: &mut Reader<'a>) -> Result<Self, CdrError> {
        Ok(Self {
            class_id: reader.text("hypothesis.class_id")?,
            score: reader.scalar("hypothesis.score")?,
            pose: reader.value("pose")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        writer.text(self.class_id);
        writer.scalar(self.score);
        self.pose.write(writer);
    }
}

/// A rectangle in an image, turned about its centre.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BoundingBox2D {
    /// Centre and turn.
    pub center: Pose2D,
    /// Width before the turn, px.
    pub size_x: f64,
    /// Height before the turn, px.
    pub size_y: f64,
}

impl Value<'_> for BoundingBox2D {
    const MIN_BYTES: usize = Pose2D::MIN_BYTES + 16;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self {
            center: reader.value("center")?,
            size_x: reader.scalar("size_x")?,
            size_y: reader.scalar("size_y")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        self.center.write(writer);
        writer.array(&[self.size_x, self.size_y]);
    }
}

/// A place in an image.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose2D {
    /// `position.x`: column, px.
    pub x: f64,
    /// `position.y`: row, px.
    pub y: f64,
    /// Turn, radians.
    pub theta: f64,
}

impl Value<'_> for Pose2D {
    const MIN_BYTES: usize = 24;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self {
            x: reader.scalar("position.x")?,
            y: reader.scalar("position.y")?,
            theta: reader.scalar("theta")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        writer.array(&[self.x, self.y, self.theta]);
    }
}
