//! Foxglove's messages, as `foxglove/foxglove.proto` has them, and small ways to make them.

// Written by prost-build from foxglove/foxglove.proto; `tests/generated.rs` keeps the two in step.
#[rustfmt::skip]
#[allow(missing_docs, clippy::pedantic, reason = "generated from the .proto, whose comments are its documentation")]
mod generated;

pub use generated::*;

use nalgebra::{Isometry3, Point3 as Point, Vector3 as Vector};

/// Definition of the messages as a `FileDescriptorSet`.
pub const FILE_DESCRIPTOR_SET: &[u8] = include_bytes!("descriptors.binpb");

const NS_PER_S: i64 = 1_000_000_000;

/// `google.protobuf.Timestamp`: a time since the Unix epoch.
#[derive(Clone, Copy, PartialEq, Eq, Hash, prost::Message)]
pub struct Timestamp {
    /// Whole seconds, rounded down.
    #[prost(int64, tag = "1")]
    pub seconds: i64,
    /// The rest, 0 to 999 999 999.
    #[prost(int32, tag = "2")]
    pub nanos: i32,
}

impl Timestamp {
    /// From nanoseconds since the Unix epoch.
    pub fn from_ns(ns: i64) -> Self {
        Self { seconds: ns.div_euclid(NS_PER_S), nanos: ns.rem_euclid(NS_PER_S) as i32 }
    }
}

impl From<Vector<f64>> for Vector3 {
    fn from(v: Vector<f64>) -> Self {
        Self { x: v.x, y: v.y, z: v.z }
    }
}

impl From<Point<f64>> for Point3 {
    fn from(p: Point<f64>) -> Self {
        Self { x: p.x, y: p.y, z: p.z }
    }
}

impl From<Isometry3<f64>> for Pose {
    fn from(pose: Isometry3<f64>) -> Self {
        let q = pose.rotation.quaternion();
        Self {
            position: Some(pose.translation.vector.into()),
            orientation: Some(Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }),
        }
    }
}

impl Color {
    /// An opaque colour, each part 0 to 1.
    pub const fn opaque(r: f64, g: f64, b: f64) -> Self {
        Self { r, g, b, a: 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_before_the_epoch_round_down() {
        assert_eq!(Timestamp::from_ns(1_500_000_000), Timestamp { seconds: 1, nanos: 500_000_000 });
        assert_eq!(Timestamp::from_ns(-1), Timestamp { seconds: -1, nanos: 999_999_999 });
    }
}
