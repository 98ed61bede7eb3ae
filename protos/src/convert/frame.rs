//! A camera frame on arrival: everything but the pixels is checked.

pub mod quads;

use super::geometry;
use crate::{Code, Name, Rejection, v1};
use map::{
    extrinsics::CameraExtrinsics,
    pose2::{Pose2, Pose2Covariance},
};
use prost::bytes::Bytes;
use quads::CheckedQuad;
use vision::frame::Intrinsics;

/// Largest JPEG or PNG image of a frame, in bytes.
pub const MAX_ENCODED_IMAGE_BYTES: usize = 2_400_000;
/// Largest image of a frame, in bytes: raw colour of [`MAX_FRAME_PX`] pixels.
pub const MAX_FRAME_IMAGE_BYTES: usize = 3 * MAX_FRAME_PX as usize;
/// Largest frame, in pixels (1920 x 1200).
pub const MAX_FRAME_PX: u32 = 2_304_000;
/// Longest side of a frame, in pixels.
pub const MAX_FRAME_SIDE_PX: u32 = 4096;
/// Longest deadline that a robot may ask for, in milliseconds.
pub const MAX_DEADLINE_MS: u32 = 600_000;

/// Encoding of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// JPEG, greyscale or colour.
    Jpeg,
    /// PNG, greyscale or colour.
    Png,
    /// One byte per pixel, row-major, uncompressed.
    Gray8,
    /// Red, green and blue of each pixel, row-major, uncompressed.
    Rgb8,
    /// Blue, green and red of each pixel, row-major, uncompressed.
    Bgr8,
}

impl Encoding {
    /// Bytes of a pixel; `None` for a compressed image.
    pub fn bytes_per_px(self) -> Option<usize> {
        match self {
            Self::Jpeg | Self::Png => None,
            Self::Gray8 => Some(1),
            Self::Rgb8 | Self::Bgr8 => Some(3),
        }
    }
}

/// An encoded image, or a part of one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EncodedImage {
    /// How.
    pub encoding: Encoding,
    /// At most [`MAX_ENCODED_IMAGE_BYTES`], or exactly the bytes of its pixels.
    pub bytes: Bytes,
}

/// What a robot sends of an image.
#[derive(Debug, Clone, PartialEq)]
pub enum Pixels {
    /// All of it.
    Image(EncodedImage),
    /// The quads that its own detector found, best first, with the pixels around them.
    Quads(Vec<CheckedQuad>),
}

/// A checked frame. The pixels are still encoded.
#[derive(Debug, Clone)]
pub struct CheckedFrame {
    /// Epoch of the robot's software, drawn at its start.
    pub epoch: u64,
    /// Sequence number, rising within the epoch.
    pub seq: u64,
    /// Robot's clock at capture, ns since the Unix epoch.
    pub captured_ns: i64,
    /// Claimed width, px; compared with the decoded one later.
    pub width_px: u32,
    /// Claimed height, px; compared with the decoded one later.
    pub height_px: u32,
    /// The image, or its quads.
    pub pixels: Pixels,
    /// Intrinsics of the camera, where it is calibrated.
    pub intrinsics: Option<Intrinsics>,
    /// Extrinsics of the camera at capture.
    pub mounting: Option<CameraExtrinsics>,
    /// `odom_from_robot` at capture.
    pub odometry: Option<Pose2>,
    /// The robot's own estimate of `map_from_robot`, with covariance.
    pub prior: Option<Pose2Covariance>,
    /// Latest start of work after receipt, ms; `None` for the server's default.
    pub deadline_ms: Option<u32>,
    /// The requested map; `None` for the robot's.
    pub map: Option<Name>,
}

impl CheckedFrame {
    /// Whether the whole image is there: of other parts than those of its quads, nothing can be
    /// said.
    pub fn is_whole(&self) -> bool {
        matches!(self.pixels, Pixels::Image(_))
    }

    /// A message whose pixels are checked already.
    fn with_pixels(frame: &v1::Frame, pixels: Pixels) -> Result<Self, Rejection> {
        let map = match frame.map.as_str() {
            "" => None,
            name => Some(Name::new(name).map_err(|e| Rejection::new(Code::BadName, "map", e.to_string()))?),
        };
        if frame.deadline_ms > MAX_DEADLINE_MS {
            let detail = format!("{} ms is more than {MAX_DEADLINE_MS}", frame.deadline_ms);
            return Err(Rejection::new(Code::OutOfRange, "deadline_ms", detail));
        }
        let picture = [frame.width_px as usize, frame.height_px as usize];
        let camera =
            frame.intrinsics.as_ref().map(|wire| geometry::intrinsics_of_picture(wire, picture)).transpose();
        let mounting = frame.robot_from_camera.as_ref().map(geometry::mounting).transpose();
        let odometry = frame.odometry.as_ref().map(geometry::pose2).transpose();
        let prior = frame.prior.as_ref().map(geometry::pose2_covariance).transpose();
        Ok(Self {
            epoch: frame.epoch,
            seq: frame.seq,
            captured_ns: frame.captured_ns,
            width_px: frame.width_px,
            height_px: frame.height_px,
            pixels,
            intrinsics: camera.map_err(|r| r.inside("intrinsics"))?,
            mounting: mounting.map_err(|r| r.inside("robot_from_camera"))?,
            odometry: odometry.map_err(|r| r.inside("odometry"))?,
            prior: prior.map_err(|r| r.inside("prior"))?,
            deadline_ms: (frame.deadline_ms > 0).then_some(frame.deadline_ms),
            map,
        })
    }
}

impl TryFrom<v1::Frame> for CheckedFrame {
    type Error = Rejection;

    fn try_from(frame: v1::Frame) -> Result<Self, Rejection> {
        if frame.withheld_bytes > 0 {
            let detail = format!(
                "an image of {} bytes was not sent: a message with it is larger than the server takes \
                 (limits.frame_bytes)",
                frame.withheld_bytes
            );
            return Err(Rejection::new(Code::TooLarge, "image", detail));
        }
        let size = (frame.width_px, frame.height_px);
        let pixels = Pixels::Image(encoded_image(frame.encoding, size, frame.image.clone())?);
        Self::with_pixels(&frame, pixels)
    }
}

impl TryFrom<v1::Quads> for CheckedFrame {
    type Error = Rejection;

    fn try_from(quads: v1::Quads) -> Result<Self, Rejection> {
        let size = (quads.width_px, quads.height_px);
        image_area(size)?;
        let pixels = Pixels::Quads(quads::checked(quads.quads, size)?);
        let frame = v1::Frame {
            epoch: quads.epoch,
            seq: quads.seq,
            captured_ns: quads.captured_ns,
            width_px: quads.width_px,
            height_px: quads.height_px,
            intrinsics: quads.intrinsics,
            robot_from_camera: quads.robot_from_camera,
            odometry: quads.odometry,
            prior: quads.prior,
            deadline_ms: quads.deadline_ms,
            map: quads.map,
            ..v1::Frame::default()
        };
        Self::with_pixels(&frame, pixels)
    }
}

/// Encoding and bytes of an image of a claimed size, px, before anything is decoded.
fn encoded_image(encoding: i32, size: (u32, u32), bytes: Bytes) -> Result<EncodedImage, Rejection> {
    let encoding = match v1::ImageEncoding::try_from(encoding) {
        Ok(v1::ImageEncoding::Jpeg) => Encoding::Jpeg,
        Ok(v1::ImageEncoding::Png) => Encoding::Png,
        Ok(v1::ImageEncoding::Gray8) => Encoding::Gray8,
        Ok(v1::ImageEncoding::Rgb8) => Encoding::Rgb8,
        Ok(v1::ImageEncoding::Bgr8) => Encoding::Bgr8,
        Ok(v1::ImageEncoding::Unspecified) | Err(_) => {
            let known = "JPEG (1), PNG (2), GRAY8 (3), RGB8 (4), BGR8 (5)";
            let detail = format!("{encoding} is none of {known}");
            return Err(Rejection::new(Code::OutOfRange, "encoding", detail));
        }
    };
    let area = image_area(size)?;
    let length = bytes.len();
    if length == 0 {
        return Err(Rejection::new(Code::Missing, "image", "the image is empty"));
    }
    match encoding.bytes_per_px().map(|each| each * area as usize) {
        None if length > MAX_ENCODED_IMAGE_BYTES => {
            let detail = format!(
                "{length} bytes are more than {MAX_ENCODED_IMAGE_BYTES}, the most of an encoded frame: send a JPEG, or fewer pixels"
            );
            Err(Rejection::new(Code::TooLarge, "image", detail))
        }
        Some(expected) if length != expected => {
            let detail = format!("{length} bytes, {expected} expected for the claimed size");
            Err(Rejection::new(Code::SizeMismatch, "image", detail))
        }
        _ => Ok(EncodedImage { encoding, bytes }),
    }
}

/// Width times height, px, of an image of at most [`MAX_FRAME_PX`].
fn image_area((width_px, height_px): (u32, u32)) -> Result<u32, Rejection> {
    for (field, side) in [("width_px", width_px), ("height_px", height_px)] {
        if side == 0 || side > MAX_FRAME_SIDE_PX {
            let detail = format!("{side} is outside 1 to {MAX_FRAME_SIDE_PX}");
            return Err(Rejection::new(Code::OutOfRange, field, detail));
        }
    }
    let area = width_px * height_px;
    if area > MAX_FRAME_PX {
        let detail = format!(
            "{area} pixels are more than {MAX_FRAME_PX}, the most of a frame: send it smaller, with intrinsics of that size \
             (waymark robot send makes photographs smaller)"
        );
        return Err(Rejection::new(Code::OutOfRange, "width_px", detail));
    }
    Ok(area)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame() -> v1::Frame {
        v1::Frame {
            epoch: 1,
            seq: 2,
            encoding: v1::ImageEncoding::Gray8.into(),
            width_px: 4,
            height_px: 3,
            image: Bytes::from(vec![0; 12]),
            ..v1::Frame::default()
        }
    }

    fn encoding_of(frame: &CheckedFrame) -> Encoding {
        match &frame.pixels {
            Pixels::Image(image) => image.encoding,
            Pixels::Quads(_) => panic!("a whole image was sent"),
        }
    }

    fn refused(change: impl FnOnce(&mut v1::Frame)) -> (Code, String) {
        let mut wire = frame();
        change(&mut wire);
        let r = CheckedFrame::try_from(wire).unwrap_err();
        (r.code, r.field)
    }

    fn raw(width_px: u32, height_px: u32) -> v1::Frame {
        v1::Frame {
            width_px,
            height_px,
            image: Bytes::from(vec![0; (width_px * height_px) as usize]),
            ..frame()
        }
    }

    #[test]
    fn a_plain_frame_passes() {
        let checked = CheckedFrame::try_from(frame()).unwrap();
        assert_eq!((encoding_of(&checked), checked.map, checked.deadline_ms), (Encoding::Gray8, None, None));
    }

    #[test]
    fn each_fault_names_its_field() {
        assert_eq!(refused(|f| f.encoding = 0), (Code::OutOfRange, "encoding".into()));
        assert_eq!(refused(|f| f.encoding = 99), (Code::OutOfRange, "encoding".into()));
        assert_eq!(refused(|f| f.width_px = 0), (Code::OutOfRange, "width_px".into()));
        assert_eq!(refused(|f| f.height_px = u32::MAX), (Code::OutOfRange, "height_px".into()));
        assert_eq!(refused(|f| f.width_px = 5), (Code::SizeMismatch, "image".into()));
        assert_eq!(refused(|f| f.image = Bytes::new()), (Code::Missing, "image".into()));
        assert_eq!(refused(|f| f.map = "Hall 1".into()), (Code::BadName, "map".into()));
        assert_eq!(
            refused(|f| f.deadline_ms = MAX_DEADLINE_MS + 1),
            (Code::OutOfRange, "deadline_ms".into())
        );
        let camera = v1::Intrinsics { fx_px: f64::NAN, ..v1::Intrinsics::default() };
        assert_eq!(refused(|f| f.intrinsics = Some(camera)), (Code::NotFinite, "intrinsics.fx_px".into()));
        let mounting = v1::Pose3 { qw: 1.0, z_m: f64::INFINITY, ..v1::Pose3::default() };
        assert_eq!(
            refused(|f| f.robot_from_camera = Some(mounting)),
            (Code::NotFinite, "robot_from_camera.z_m".into())
        );
        let odometry = v1::Pose2 { theta_rad: f64::NAN, ..v1::Pose2::default() };
        assert_eq!(refused(|f| f.odometry = Some(odometry)), (Code::NotFinite, "odometry.theta_rad".into()));
        let prior = v1::Pose2Covariance::default();
        assert_eq!(refused(|f| f.prior = Some(prior)), (Code::Missing, "prior.pose".into()));
    }

    #[test]
    fn sizes_at_their_bounds() {
        assert!(CheckedFrame::try_from(raw(1920, 1200)).is_ok());
        assert_eq!(CheckedFrame::try_from(raw(1921, 1200)).unwrap_err().field, "width_px");
        assert!(CheckedFrame::try_from(raw(MAX_FRAME_SIDE_PX, 2)).is_ok());
        assert_eq!(CheckedFrame::try_from(raw(2, MAX_FRAME_SIDE_PX + 1)).unwrap_err().field, "height_px");
        let packed = |bytes| {
            let image = Bytes::from(vec![0; bytes]);
            CheckedFrame::try_from(v1::Frame { encoding: v1::ImageEncoding::Jpeg.into(), image, ..frame() })
        };
        assert!(packed(MAX_ENCODED_IMAGE_BYTES).is_ok());
        assert_eq!(packed(MAX_ENCODED_IMAGE_BYTES + 1).unwrap_err().code, Code::TooLarge);
    }

    #[test]
    fn raw_images_have_exactly_the_bytes_of_their_pixels() {
        for (encoding, checked, each) in [
            (v1::ImageEncoding::Gray8, Encoding::Gray8, 1),
            (v1::ImageEncoding::Rgb8, Encoding::Rgb8, 3),
            (v1::ImageEncoding::Bgr8, Encoding::Bgr8, 3),
        ] {
            let of = |(width_px, height_px): (u32, u32), bytes: usize| {
                let image = Bytes::from(vec![0; bytes]);
                let encoding = encoding.into();
                CheckedFrame::try_from(v1::Frame { encoding, width_px, height_px, image, ..frame() })
            };
            assert_eq!(encoding_of(&of((4, 3), 12 * each).unwrap()), checked);
            // The largest frame: more than an encoded image may have, where it is coloured.
            assert!(of((1920, 1200), each * MAX_FRAME_PX as usize).is_ok());
            for wrong in [12 * each - 1, 12 * each + 1, 2 * 12 * each] {
                let refusal = of((4, 3), wrong).unwrap_err();
                assert_eq!((refusal.code, refusal.field.as_str()), (Code::SizeMismatch, "image"));
            }
        }
    }

    #[test]
    fn a_deadline_at_the_bound() {
        let wire = v1::Frame { deadline_ms: MAX_DEADLINE_MS, ..frame() };
        assert_eq!(CheckedFrame::try_from(wire).unwrap().deadline_ms, Some(MAX_DEADLINE_MS));
    }
}
