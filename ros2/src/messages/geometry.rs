//! `geometry_msgs/msg/{Vector3, Point, Quaternion, Pose, PoseWithCovariance, Twist, TwistWithCovariance, Transform}`.
//! `Point` has the fields of `Vector3` and is the same type here.

use crate::cdr::{CdrError, Reader, Value, Writer};

/// Three coordinates: metres, metres a second or radians a second.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vector3 {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

impl Value<'_> for Vector3 {
    const MIN_BYTES: usize = 24;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { x: reader.scalar("x")?, y: reader.scalar("y")?, z: reader.scalar("z")? })
    }

    fn write(&self, writer: &mut Writer) {
        writer.array(&[self.x, self.y, self.z]);
    }
}

/// A rotation, not checked: [`crate::convert::rotation`] does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quaternion {
    /// Imaginary part i.
    pub x: f64,
    /// Imaginary part j.
    pub y: f64,
    /// Imaginary part k.
    pub z: f64,
    /// Real part.
    pub w: f64,
}

/// No rotation, as the definition has it.
impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

impl Value<'_> for Quaternion {
    const MIN_BYTES: usize = 32;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self {
            x: reader.scalar("x")?,
            y: reader.scalar("y")?,
            z: reader.scalar("z")?,
            w: reader.scalar("w")?,
        })
    }

    fn write(&self, writer: &mut Writer) {
        writer.array(&[self.x, self.y, self.z, self.w]);
    }
}

/// Position, metres, and orientation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// Position, metres.
    pub position: Vector3,
    /// Orientation.
    pub orientation: Quaternion,
}

impl Value<'_> for Pose {
    const MIN_BYTES: usize = Vector3::MIN_BYTES + Quaternion::MIN_BYTES;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { position: reader.value("position")?, orientation: reader.value("orientation")? })
    }

    fn write(&self, writer: &mut Writer) {
        self.position.write(writer);
        self.orientation.write(writer);
    }
}

/// A pose and how sure it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseWithCovariance {
    /// The mean.
    pub pose: Pose,
    /// 6 x 6, row-major, over x, y, z (metres) and rotations about the fixed axes x, y, z
    /// (radians).
    pub covariance: [f64; 36],
}

impl Default for PoseWithCovariance {
    fn default() -> Self {
        Self { pose: Pose::default(), covariance: [0.0; 36] }
    }
}

impl Value<'_> for PoseWithCovariance {
    const MIN_BYTES: usize = Pose::MIN_BYTES + 36 * 8;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { pose: reader.value("pose")?, covariance: reader.array("covariance")? })
    }

    fn write(&self, writer: &mut Writer) {
        self.pose.write(writer);
        writer.array(&self.covariance);
    }
}

/// Velocities.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twist {
    /// Metres a second.
    pub linear: Vector3,
    /// Radians a second.
    pub angular: Vector3,
}

impl Value<'_> for Twist {
    const MIN_BYTES: usize = 2 * Vector3::MIN_BYTES;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { linear: reader.value("linear")?, angular: reader.value("angular")? })
    }

    fn write(&self, writer: &mut Writer) {
        self.linear.write(writer);
        self.angular.write(writer);
    }
}

/// Velocities and how sure they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwistWithCovariance {
    /// The mean.
    pub twist: Twist,
    /// 6 x 6, row-major, over linear and angular velocities.
    pub covariance: [f64; 36],
}

impl Default for TwistWithCovariance {
    fn default() -> Self {
        Self { twist: Twist::default(), covariance: [0.0; 36] }
    }
}

impl Value<'_> for TwistWithCovariance {
    const MIN_BYTES: usize = Twist::MIN_BYTES + 36 * 8;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { twist: reader.value("twist")?, covariance: reader.array("covariance")? })
    }

    fn write(&self, writer: &mut Writer) {
        self.twist.write(writer);
        writer.array(&self.covariance);
    }
}

/// `parent_from_child`: what takes coordinates of the child frame to those of the parent frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Transform {
    /// Origin of the child in the parent frame, metres.
    pub translation: Vector3,
    /// Orientation of the child in the parent frame.
    pub rotation: Quaternion,
}

impl Value<'_> for Transform {
    const MIN_BYTES: usize = Vector3::MIN_BYTES + Quaternion::MIN_BYTES;

    fn read(reader: &mut Reader<'_>) -> Result<Self, CdrError> {
        Ok(Self { translation: reader.value("translation")?, rotation: reader.value("rotation")? })
    }

    fn write(&self, writer: &mut Writer) {
        self.translation.write(writer);
        self.rotation.write(writer);
    }
}
