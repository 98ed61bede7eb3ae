//! The map that a message names, without the rest of it; of a camera image its numbers, too. In:
//! bytes. Out: the text of its field `map`; empty where it names none, and of bytes that are no
//! message, which the receiver refuses.

use prost::Message;

macro_rules! map_of {
    ($name:ident, $part:ident, $tag:literal, $doc:literal) => {
        #[derive(Clone, PartialEq, Message)]
        struct $part {
            #[prost(string, tag = $tag)]
            map: String,
        }

        #[doc = $doc]
        pub fn $name(bytes: &[u8]) -> String {
            $part::decode(bytes).map(|part| part.map).unwrap_or_default()
        }
    };
}

/// The numbers and the map of a message of a camera image.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FrameHead {
    /// Epoch of the robot.
    pub epoch: u64,
    /// Sequence number.
    pub seq: u64,
    /// Capture time, ns.
    pub captured_ns: i64,
    /// The map that it names, if any.
    pub map: String,
}

macro_rules! head_of {
    ($name:ident, $part:ident, $tag:literal, $doc:literal) => {
        #[derive(Clone, PartialEq, Message)]
        struct $part {
            #[prost(uint64, tag = "1")]
            epoch: u64,
            #[prost(uint64, tag = "2")]
            seq: u64,
            #[prost(int64, tag = "3")]
            captured_ns: i64,
            #[prost(string, tag = $tag)]
            map: String,
        }

        #[doc = $doc]
        pub fn $name(bytes: &[u8]) -> FrameHead {
            let $part { epoch, seq, captured_ns, map } = $part::decode(bytes).unwrap_or_default();
            FrameHead { epoch, seq, captured_ns, map }
        }
    };
}

head_of!(of_frame, FramePart, "13", "Of a [`crate::v1::Frame`].");
head_of!(of_quads, QuadsPart, "12", "Of a [`crate::v1::Quads`].");
map_of!(of_odometry, OdometryPart, "5", "Of a [`crate::v1::Odometry`].");
map_of!(of_scan, ScanPart, "10", "Of a [`crate::v1::Scan`].");
map_of!(of_gaze, GazePart, "14", "Of a [`crate::v1::GazeRequest`].");
map_of!(of_localise, LocalisePart, "3", "Of a [`crate::v1::LocaliseRequest`].");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::v1;

    #[test]
    fn the_map_of_every_message_is_read() {
        let map = || "hall".to_owned();
        let frame = v1::Frame {
            epoch: 5,
            seq: 7,
            captured_ns: -9,
            image: vec![255; 5000].into(),
            map: map(),
            ..v1::Frame::default()
        };
        let quads = v1::Quads { seq: 8, map: map(), ..v1::Quads::default() };
        let odometry = v1::Odometry { map: map(), ..v1::Odometry::default() };
        let scan = v1::Scan { ranges_m: vec![1.0; 100], map: map(), ..v1::Scan::default() };
        let gaze = v1::GazeRequest { map: map(), ..v1::GazeRequest::default() };
        let localise = v1::LocaliseRequest { map: map(), ..v1::LocaliseRequest::default() };
        let head = FrameHead { epoch: 5, seq: 7, captured_ns: -9, map: map() };
        assert_eq!(of_frame(&frame.encode_to_vec()), head);
        assert_eq!(
            of_quads(&quads.encode_to_vec()),
            FrameHead { seq: 8, map: map(), ..FrameHead::default() }
        );
        assert_eq!(of_odometry(&odometry.encode_to_vec()), "hall");
        assert_eq!(of_scan(&scan.encode_to_vec()), "hall");
        assert_eq!(of_gaze(&gaze.encode_to_vec()), "hall");
        assert_eq!(of_localise(&localise.encode_to_vec()), "hall");
        assert_eq!(of_frame(&v1::Frame::default().encode_to_vec()), FrameHead::default());
        assert_eq!(of_frame(b"\xff\xff"), FrameHead::default());
    }
}
