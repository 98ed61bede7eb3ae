//! A scan or a frame of a robot that makes a map, and its form in the journal.

use crate::scan_job::ScanJob;
use protos::{
    CheckedFrame, Name,
    convert::{
        CheckedScan,
        frame::{Encoding, Pixels},
        geometry::{intrinsics_wire, pose2_wire, pose3_wire},
    },
    prost::{Message, bytes::Bytes},
    v1,
};

/// First byte of a record.
const SCAN: u8 = 1;
const FRAME: u8 = 2;

/// What a robot sends while it makes a map.
#[derive(Debug, Clone)]
pub(super) enum Record {
    Scan(ScanJob),
    /// Of this camera.
    Frame(Name, Box<CheckedFrame>),
}

impl Record {
    /// One byte of its kind, and the message of the wire; of a frame, between the two, the length
    /// and the name of its camera.
    pub(super) fn bytes(&self) -> Vec<u8> {
        match self {
            Self::Scan(job) => [&[SCAN], &scan_wire(job).encode_to_vec()[..]].concat(),
            Self::Frame(camera, frame) => {
                let name = camera.as_str().as_bytes();
                [&[FRAME, name.len() as u8], name, &frame_wire(frame).encode_to_vec()].concat()
            }
        }
    }

    /// A record of a map's journal; checked again.
    pub(super) fn parsed(bytes: &[u8], map: &Name) -> Option<Self> {
        let (kind, wire) = bytes.split_first()?;
        match *kind {
            SCAN => {
                let checked = CheckedScan::try_from(v1::Scan::decode(wire).ok()?).ok()?;
                let CheckedScan { epoch, captured_ns, odom_from_robot, scan, .. } = checked;
                Some(Self::Scan(ScanJob { map: map.to_string(), epoch, captured_ns, odom_from_robot, scan }))
            }
            FRAME => {
                let (length, rest) = wire.split_first()?;
                let (name, wire) = rest.split_at_checked(usize::from(*length))?;
                let camera = Name::new(str::from_utf8(name).ok()?).ok()?;
                let frame = CheckedFrame::try_from(v1::Frame::decode(wire).ok()?).ok()?;
                Some(Self::Frame(camera, Box::new(frame)))
            }
            _ => None,
        }
    }

    /// Epoch of a scan.
    pub(super) fn epoch(&self) -> Option<u64> {
        match self {
            Self::Scan(job) => Some(job.epoch),
            Self::Frame(..) => None,
        }
    }
}

fn scan_wire(job: &ScanJob) -> v1::Scan {
    let scan = &job.scan;
    v1::Scan {
        epoch: job.epoch,
        captured_ns: job.captured_ns,
        odom_from_robot: Some(pose2_wire(&job.odom_from_robot)),
        robot_from_laser: Some(pose2_wire(scan.robot_from_laser())),
        first_bearing_rad: scan.bearing_rad(0),
        bearing_step_rad: scan.bearing_step_rad(),
        max_range_m: scan.max_range_m(),
        ranges_m: scan.ranges_m().to_vec(),
        ..v1::Scan::default()
    }
}

fn encoding_wire(encoding: Encoding) -> v1::ImageEncoding {
    match encoding {
        Encoding::Jpeg => v1::ImageEncoding::Jpeg,
        Encoding::Png => v1::ImageEncoding::Png,
        Encoding::Gray8 => v1::ImageEncoding::Gray8,
        Encoding::Rgb8 => v1::ImageEncoding::Rgb8,
        Encoding::Bgr8 => v1::ImageEncoding::Bgr8,
    }
}

/// What a survey needs of a frame.
fn frame_wire(frame: &CheckedFrame) -> v1::Frame {
    let (encoding, image) = match &frame.pixels {
        Pixels::Image(image) => (encoding_wire(image.encoding), image.bytes.clone()),
        Pixels::Quads(_) => (v1::ImageEncoding::Unspecified, Bytes::new()),
    };
    v1::Frame {
        epoch: frame.epoch,
        seq: frame.seq,
        captured_ns: frame.captured_ns,
        width_px: frame.width_px,
        height_px: frame.height_px,
        encoding: encoding.into(),
        image,
        intrinsics: frame.intrinsics.as_ref().map(intrinsics_wire),
        robot_from_camera: frame.mounting.as_ref().map(|m| pose3_wire(&m.robot_from_camera)),
        odometry: frame.odometry.as_ref().map(pose2_wire),
        ..v1::Frame::default()
    }
}
