//! One image with its capture data, before it is numbered and sent.

use crate::ClientError;
use map::pose2::{Pose2, Pose2Covariance};
use nalgebra::Isometry3;
use protos::{
    convert::{
        geometry::{intrinsics_wire, pose2_covariance_wire, pose2_wire, pose3_wire},
        image_header,
    },
    prost::bytes::Bytes,
    v1,
};
use std::time::{SystemTime, UNIX_EPOCH};
use vision::frame::{GrayImage, Intrinsics};

/// One image with its capture data. Built from an image, then completed with `with_...`.
#[derive(Debug, Clone)]
pub struct Capture {
    frame: v1::Frame,
}

impl Capture {
    /// An encoded photograph; its size is read from its header. The capture time is now.
    pub fn encoded(image: impl Into<Bytes>) -> Result<Self, ClientError> {
        let image = image.into();
        let (encoding, width_px, height_px) = header(&image)?;
        Ok(Self::new(encoding, width_px, height_px, image))
    }

    /// A grey image, sent raw. The capture time is now.
    pub fn gray(image: &GrayImage) -> Self {
        let bytes = Bytes::copy_from_slice(image.data());
        Self::new(v1::ImageEncoding::Gray8, image.width() as u32, image.height() as u32, bytes)
    }

    /// Raw pixels, sent as they are: rows from the top without padding, `encoding` GRAY8 (mono8), RGB8 or BGR8. The
    /// capture time is now. Error: not the bytes of `width_px` x `height_px` pixels of a raw encoding.
    pub fn raw(
        encoding: v1::ImageEncoding,
        (width_px, height_px): (u32, u32),
        pixels: impl Into<Bytes>,
    ) -> Result<Self, ClientError> {
        let each = match encoding {
            v1::ImageEncoding::Gray8 => 1,
            v1::ImageEncoding::Rgb8 | v1::ImageEncoding::Bgr8 => 3,
            other => {
                let detail = format!("{} is not an encoding of raw pixels", other.as_str_name());
                return Err(ClientError::Image(detail));
            }
        };
        let pixels = pixels.into();
        let expected = (u64::from(width_px) * u64::from(height_px)).saturating_mul(each);
        if expected == 0 || pixels.len() as u64 != expected {
            let given = pixels.len();
            let detail =
                format!("{given} bytes of pixels, {expected} expected for {width_px} x {height_px} px");
            return Err(ClientError::Image(detail));
        }
        Ok(Self::new(encoding, width_px, height_px, pixels))
    }

    /// A frame that was recorded. Epoch and number are set when it is sent; all else stays.
    pub fn recorded(frame: v1::Frame) -> Self {
        Self { frame }
    }

    fn new(encoding: v1::ImageEncoding, width_px: u32, height_px: u32, image: Bytes) -> Self {
        let captured_ns = now_ns();
        let encoding = encoding.into();
        Self {
            frame: v1::Frame { encoding, width_px, height_px, image, captured_ns, ..v1::Frame::default() },
        }
    }

    /// Sets the intrinsics; without them there is recognition but no pose.
    #[must_use]
    pub fn with_intrinsics(mut self, camera: &Intrinsics) -> Self {
        self.frame.intrinsics = Some(intrinsics_wire(camera));
        self
    }

    /// Sets `robot_from_camera` at capture; without it there is no robot pose.
    #[must_use]
    pub fn with_mounting(mut self, robot_from_camera: &Isometry3<f64>) -> Self {
        self.frame.robot_from_camera = Some(pose3_wire(robot_from_camera));
        self
    }

    /// Sets `odom_from_robot` at capture.
    #[must_use]
    pub fn with_odometry(mut self, odom_from_robot: &Pose2) -> Self {
        self.frame.odometry = Some(pose2_wire(odom_from_robot));
        self
    }

    /// Sets the robot's own pose estimate, with covariance over (x, y, theta).
    #[must_use]
    pub fn with_prior(mut self, map_from_robot: &Pose2Covariance) -> Self {
        self.frame.prior = Some(pose2_covariance_wire(map_from_robot));
        self
    }

    /// Sets the robot's clock at capture, ns since the Unix epoch.
    #[must_use]
    pub fn captured_at_ns(mut self, captured_ns: i64) -> Self {
        self.frame.captured_ns = captured_ns;
        self
    }

    /// Sets the latest start of work after receipt, ms.
    #[must_use]
    pub fn with_deadline_ms(mut self, deadline_ms: u32) -> Self {
        self.frame.deadline_ms = deadline_ms;
        self
    }

    /// Selects a map other than the robot's own.
    #[must_use]
    pub fn against_map(mut self, map: impl Into<String>) -> Self {
        self.frame.map = map.into();
        self
    }

    /// Width and height, px.
    pub fn size_px(&self) -> (u32, u32) {
        (self.frame.width_px, self.frame.height_px)
    }

    /// The message with epoch and sequence number.
    pub(crate) fn numbered(self, epoch: u64, seq: u64) -> v1::Frame {
        v1::Frame { epoch, seq, ..self.frame }
    }
}

/// The system clock, ns since the Unix epoch.
pub(crate) fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// Encoding, width and height from the first bytes.
fn header(image: &[u8]) -> Result<(v1::ImageEncoding, u32, u32), ClientError> {
    image_header(image).ok_or_else(|| {
        let first: Vec<u8> = image.iter().take(8).copied().collect();
        ClientError::Image(format!("it begins with {first:02x?} and is no JPEG or PNG with a size"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    // The beginning of a real 64x48 JPEG: SOI, APP0 of 16 bytes, SOF0.
    fn jpeg() -> Vec<u8> {
        let mut bytes = vec![0xFF, 0xD8, 0xFF, 0xE0, 0, 16];
        bytes.extend([0; 14]);
        bytes.extend([0xFF, 0xFF, 0xC0, 0, 17, 8, 0, 48, 0, 64, 3]);
        bytes
    }

    #[test]
    fn sizes_come_from_headers() {
        let capture = Capture::encoded(jpeg()).unwrap();
        assert_eq!((capture.size_px(), capture.frame.encoding()), ((64, 48), v1::ImageEncoding::Jpeg));
        let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
        png.extend([0, 0, 1, 0, 0, 0, 0, 200]);
        let capture = Capture::encoded(png).unwrap();
        assert_eq!((capture.size_px(), capture.frame.encoding()), ((256, 200), v1::ImageEncoding::Png));
    }

    #[test]
    fn raw_pixels_are_counted() {
        use v1::ImageEncoding::{Bgr8, Gray8, Jpeg, Rgb8};
        for (encoding, each) in [(Gray8, 1), (Rgb8, 3), (Bgr8, 3)] {
            let of = |bytes: usize| Capture::raw(encoding, (4, 3), vec![7; bytes]);
            let capture = of(12 * each).unwrap();
            assert_eq!((capture.size_px(), capture.frame.encoding()), ((4, 3), encoding));
            assert!(of(12 * each + 1).is_err() && of(12 * each - 1).is_err());
        }
        assert!(Capture::raw(Rgb8, (0, 3), Vec::new()).is_err());
        assert!(Capture::raw(Jpeg, (4, 3), vec![0; 12]).is_err());
        assert!(Capture::raw(Rgb8, (u32::MAX, u32::MAX), vec![0; 12]).is_err());
    }

    #[test]
    fn every_truncated_header_is_refused() {
        let whole = jpeg();
        for cut in 0..whole.len() - 1 {
            assert!(Capture::encoded(whole[..cut].to_vec()).is_err(), "{cut}");
        }
        assert!(Capture::encoded(b"GIF89a".to_vec()).is_err());
        // A segment of length 0 does not loop forever.
        let mut stuck = vec![0xFF, 0xD8];
        stuck.extend([0xFF, 0xE0, 0, 0].repeat(1000));
        assert!(Capture::encoded(stuck).is_err());
    }
}
