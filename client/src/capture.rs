//! One image with its capture data, before it is numbered and sent.

use crate::ClientError;
use map::pose2::{Pose2, Pose2Covariance};
use nalgebra::Isometry3;
use protos::{
    convert::{
        frame::MAX_FRAME_PX,
        geometry::{intrinsics_wire, pose2_covariance_wire, pose2_wire, pose3_wire},
        image_header,
        quads::MAX_FOUND_QUADS,
        result,
    },
    prost::{Message, bytes::Bytes},
    v1,
};
use std::time::{SystemTime, UNIX_EPOCH};
use vision::{
    detect::quad::{Quad, QuadKind},
    frame::{GrayImage, Intrinsics},
    geometry::Corners,
};

/// One image, or the quads of one, with its capture data. Built from an image, then completed with
/// `with_...`.
#[derive(Debug, Clone)]
pub struct Capture {
    /// Without an image where there are quads.
    frame: v1::Frame,
    quads: Option<Vec<v1::FoundQuad>>,
}

/// What is sent around a quad, as a share of its width and height on each side: the learnt border
/// may lie outside of the found one.
const PATCH_MARGIN: f64 = 0.4;
/// What a message has beside its pixels, in bytes: numbers of the camera, its place, a covariance,
/// the name of a map.
pub(crate) const MESSAGE_HEAD_BYTES: usize = 1024;

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

    /// Raw pixels, sent as they are: rows from the top without padding, `encoding` GRAY8 (mono8),
    /// RGB8 or BGR8. The capture time is now. Error: not the bytes of `width_px` x `height_px`
    /// pixels of a raw encoding.
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

    /// The quads that the robot's own detector found in an image, best first, with the pixels
    /// around them in place of the image. Those with four sides are sent, at most
    /// [`MAX_FOUND_QUADS`], and as many as have together no more pixels than the largest frame. The
    /// capture time is now.
    pub fn quads(image: &GrayImage, quads: &[Quad]) -> Self {
        let mut spare_px = MAX_FRAME_PX;
        let is_room = |found: &v1::FoundQuad| {
            let area = found.patch.as_ref().map_or(0, |patch| patch.width_px * patch.height_px);
            let left = spare_px.checked_sub(area);
            spare_px = left.unwrap_or(spare_px);
            left.is_some()
        };
        let full = quads.iter().filter(|quad| quad.kind == QuadKind::Full);
        let cut = full.filter_map(|quad| found(image, quad)).filter(is_room);
        Self::found((image.width() as u32, image.height() as u32), cut.take(MAX_FOUND_QUADS).collect())
    }

    /// The same of quads whose patches are cut out and encoded already; `size_px` is that of the
    /// image.
    pub fn found((width_px, height_px): (u32, u32), quads: Vec<v1::FoundQuad>) -> Self {
        let of = Self::new(v1::ImageEncoding::Unspecified, width_px, height_px, Bytes::new());
        Self { quads: Some(quads), ..of }
    }

    /// A frame that was recorded. Epoch and number are set when it is sent; all else stays.
    pub fn recorded(frame: v1::Frame) -> Self {
        Self { frame, quads: None }
    }

    fn new(encoding: v1::ImageEncoding, width_px: u32, height_px: u32, image: Bytes) -> Self {
        let captured_ns = now_ns();
        let encoding = encoding.into();
        Self {
            frame: v1::Frame { encoding, width_px, height_px, image, captured_ns, ..v1::Frame::default() },
            quads: None,
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

    /// Whether it is quads in place of the image.
    pub fn is_quads(&self) -> bool {
        self.quads.is_some()
    }

    /// The message of the image.
    pub(crate) fn into_frame(self) -> v1::Frame {
        self.frame
    }

    /// About the bytes of the message: those of its pixels.
    pub(crate) fn pixel_bytes(&self) -> usize {
        let patches = self.quads.iter().flatten().filter_map(|quad| quad.patch.as_ref());
        self.frame.image.len() + patches.map(|patch| patch.image.len()).sum::<usize>()
    }

    /// The same, or without the image if the message would have more than `most` bytes: what is
    /// larger is dropped on the way without a word, and this is refused with its code.
    pub(crate) fn withheld(mut self, most: usize) -> Self {
        if self.pixel_bytes() + MESSAGE_HEAD_BYTES > most {
            self.frame.withheld_bytes = self.pixel_bytes() as u64;
            self.frame.image = Bytes::new();
            self.quads = None;
        }
        self
    }

    /// The message with epoch and sequence number; on `map` unless it names one.
    pub(crate) fn numbered(self, epoch: u64, seq: u64, map: String) -> Vec<u8> {
        let map = if self.frame.map.is_empty() { map } else { self.frame.map };
        let frame = v1::Frame { epoch, seq, map, ..self.frame };
        let Some(quads) = self.quads else { return frame.encode_to_vec() };
        let message = v1::Quads {
            epoch,
            seq,
            captured_ns: frame.captured_ns,
            width_px: frame.width_px,
            height_px: frame.height_px,
            quads,
            intrinsics: frame.intrinsics,
            robot_from_camera: frame.robot_from_camera,
            odometry: frame.odometry,
            prior: frame.prior,
            deadline_ms: frame.deadline_ms,
            map: frame.map,
        };
        message.encode_to_vec()
    }
}

/// A quad with the pixels around it; `None` if nothing of it lies in the image.
fn found(image: &GrayImage, quad: &Quad) -> Option<v1::FoundQuad> {
    let [columns, rows] = [(0, image.width()), (1, image.height())].map(|(axis, length)| {
        let along = quad.corners_px.points().iter().map(|corner| corner[axis]);
        let (low, high) =
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
        let margin = PATCH_MARGIN * (high - low);
        let (from, to) = ((low - margin).floor().max(0.0), (high + margin).ceil().min(length as f64 - 1.0));
        (from <= to).then_some((from as usize, to as usize))
    });
    let ((left, right), (top, bottom)) = (columns?, rows?);
    let line = |row| &image.data()[row * image.width() + left..=row * image.width() + right];
    let pixels: Vec<u8> = (top..=bottom).flat_map(line).copied().collect();
    let border = |corners: &Corners| v1::Border { corners: result::corners(corners) };
    let covariances = quad.corner_covariance_px2.iter();
    Some(v1::FoundQuad {
        border: Some(border(&quad.corners_px)),
        corner_covariance_px2: covariances.flat_map(|c| [c[(0, 0)], c[(0, 1)], c[(1, 1)]]).collect(),
        alternates: quad.alternates.iter().map(border).collect(),
        score: quad.score,
        upright_ambiguous: quad.upright_ambiguous,
        patch: Some(v1::Patch {
            left_px: left as u32,
            top_px: top as u32,
            width_px: (right - left + 1) as u32,
            height_px: (bottom - top + 1) as u32,
            encoding: v1::ImageEncoding::Gray8.into(),
            image: pixels.into(),
        }),
    })
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
    fn what_the_server_does_not_take_is_said_in_place_of_the_image() {
        let capture = || Capture::raw(v1::ImageEncoding::Bgr8, (640, 480), vec![7; 921_600]).unwrap();
        let sent =
            |most| v1::Frame::decode(&*capture().withheld(most).numbered(1, 2, String::new())).unwrap();
        let whole = sent(921_600 + MESSAGE_HEAD_BYTES);
        assert_eq!((whole.image.len(), whole.withheld_bytes), (921_600, 0));
        let withheld = sent(921_599 + MESSAGE_HEAD_BYTES);
        assert_eq!((withheld.image.len(), withheld.withheld_bytes, withheld.seq), (0, 921_600, 2));
    }

    fn quad(corners: [[f64; 2]; 4], kind: QuadKind) -> Quad {
        Quad {
            corners_px: Corners::try_from(corners).unwrap(),
            corner_covariance_px2: [nalgebra::Matrix2::identity(); 4],
            side_support: [1.0; 4],
            side_clipped: [false; 4],
            score: 0.5,
            kind,
            upright_ambiguous: false,
            alternates: Vec::new(),
        }
    }

    #[test]
    fn patches_hold_the_pixels_around_their_quads() {
        let image = GrayImage::from_fn(64, 48, |u, v| (u + 4 * v) as u8);
        let inside = quad([[20.0, 10.0], [30.0, 10.0], [30.0, 20.0], [20.0, 20.0]], QuadKind::Full);
        let at_border = quad([[-3.0, 40.0], [7.0, 40.0], [7.0, 50.0], [-3.0, 50.0]], QuadKind::Full);
        let open = quad([[1.0, 1.0], [9.0, 1.0], [9.0, 9.0], [1.0, 9.0]], QuadKind::ThreeSided);
        let message = Capture::quads(&image, &[open, inside, at_border]).with_deadline_ms(9).numbered(
            1,
            2,
            String::new(),
        );
        let message = v1::Quads::decode(message.as_slice()).unwrap();
        assert_eq!((message.epoch, message.seq, message.width_px, message.deadline_ms), (1, 2, 64, 9));
        let patches: Vec<_> = message.quads.iter().map(|found| found.patch.as_ref().unwrap()).collect();
        let rectangle = |p: &v1::Patch| [p.left_px, p.top_px, p.width_px, p.height_px];
        let rectangles: Vec<_> = patches.iter().map(|patch| rectangle(patch)).collect();
        assert_eq!(rectangles, [[16, 6, 19, 19], [0, 36, 12, 12]]);
        assert_eq!((patches[0].image[0], patches[0].image[19 + 1]), (16 + 24, 17 + 28));
        assert!(protos::CheckedFrame::try_from(message).is_ok());
    }

    #[test]
    fn quads_that_do_not_fit_are_left_out() {
        let image = GrayImage::from_fn(1920, 1200, |_, _| 7);
        let small = quad([[20.0, 10.0], [30.0, 10.0], [30.0, 20.0], [20.0, 20.0]], QuadKind::Full);
        let large = quad([[0.0, 0.0], [1900.0, 0.0], [1900.0, 1100.0], [0.0, 1100.0]], QuadKind::Full);
        let sent = |quads: &[Quad]| Capture::quads(&image, quads).quads.unwrap().len();
        assert_eq!(sent(&[large.clone(), large.clone(), small.clone()]), 1);
        assert_eq!(sent(&[small.clone(), large, small.clone()]), 2);
        assert_eq!(sent(&vec![small; MAX_FOUND_QUADS + 1]), MAX_FOUND_QUADS);
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
