//! Images as frames: pixels, intrinsics and mounting.

use super::{
    problem::{Input, MissingInput, MissingReason, Problem},
    settings::CameraSettings,
};
use crate::{
    convert::{CameraError, CameraModel, Compression, ImageRows, TransformTree, body_from_optical},
    messages::{CameraInfo, CompressedImage, Header, Image},
};
use protos::{
    convert::{geometry, geometry::pose3_wire, image_header},
    prost::bytes::Bytes,
    v1,
};

/// What is known of a camera besides its settings.
#[derive(Debug, Clone, Default)]
pub(super) struct CameraState {
    /// The last calibration, or what is wrong with it, and its stamp.
    calibration: Option<(i64, Result<CameraModel, CameraError>)>,
    pub(super) last_seq: u64,
    /// The frame of its last picture.
    pub(super) frame_id: String,
    /// A frame that waits for odometry.
    pub(super) waiting: Option<(v1::Frame, Vec<MissingInput>)>,
}

impl CameraState {
    pub(super) fn calibrate(&mut self, settings: &CameraSettings, info: &CameraInfo<'_>) {
        let model =
            if settings.is_rectified { CameraModel::of_rectified(info) } else { CameraModel::of_raw(info) };
        self.calibration = Some((info.header.stamp.to_ns(), model));
    }

    pub(super) fn note_frame_id(&mut self, settings: &CameraSettings, header: &Header<'_>) {
        let frame_id = settings.frame.as_deref().unwrap_or(header.frame_id);
        if self.frame_id != frame_id {
            frame_id.clone_into(&mut self.frame_id);
        }
    }

    /// Intrinsics for images of this size, taken at this time.
    fn intrinsics(
        &self,
        settings: &CameraSettings,
        (given, at_ns): ((u32, u32), i64),
    ) -> Result<v1::Intrinsics, MissingInput> {
        let lack = |age_ns, reason| MissingInput {
            input: Input::CameraInfo,
            topic: settings.camera_info.clone(),
            age_ns,
            reason,
        };
        let (stamp_ns, model) =
            self.calibration.as_ref().ok_or_else(|| lack(None, MissingReason::NotReceived))?;
        let age_ns = Some(at_ns.saturating_sub(*stamp_ns));
        let model = model.clone().map_err(|error| lack(age_ns, error.into()))?;
        let calibrated = (model.width_px, model.height_px);
        if calibrated != given {
            return Err(lack(age_ns, MissingReason::ImageSize { calibrated, given }));
        }
        let wire = model.to_wire();
        // A frame with a calibration that the server refuses would be refused as a whole; without
        // it, it still names.
        geometry::intrinsics(&wire)
            .map_err(|refused| lack(age_ns, CameraError::Refused(refused.to_string()).into()))?;
        Ok(wire)
    }
}

/// Raw images of more pixels travel as grey. So many in colour, 1.6 MB, 20 times a second are what
/// a robot may send by the server's defaults (`limits.robot_bytes_per_s`); larger ones are better
/// sent compressed.
const MAX_COLOUR_PX: u32 = 960 * 540;

/// Pixels as they go on the wire.
pub(super) struct Pixels {
    encoding: v1::ImageEncoding,
    size: (u32, u32),
    bytes: Bytes,
}

impl Pixels {
    /// Of a raw image. The only place that chooses how raw pixels travel: in colour up to
    /// [`MAX_COLOUR_PX`], else as grey.
    pub(super) fn of_raw(topic: &str, image: &Image<'_>) -> Result<Self, Problem> {
        let rows = ImageRows::of(image);
        let rows = rows.map_err(|fault| Problem::Image { topic: topic.to_owned(), fault })?;
        let size = (image.width, image.height);
        let is_small = u64::from(image.width) * u64::from(image.height) <= u64::from(MAX_COLOUR_PX);
        let (encoding, bytes) = match is_small.then(|| rows.to_rgb8()).flatten() {
            Some(pixels) => (v1::ImageEncoding::Rgb8, pixels),
            None => (v1::ImageEncoding::Gray8, rows.to_gray8()),
        };
        Ok(Self { encoding, size, bytes: Bytes::from(bytes) })
    }

    /// Of a JPEG or PNG file, which stays as it is.
    pub(super) fn of_compressed(topic: &str, image: &CompressedImage<'_>) -> Result<Self, Problem> {
        Compression::of(image).map_err(|fault| Problem::Image { topic: topic.to_owned(), fault })?;
        let header = image_header(image.data);
        let (encoding, width, height) = header.ok_or_else(|| Problem::ImageHeader(topic.to_owned()))?;
        Ok(Self { encoding, size: (width, height), bytes: Bytes::copy_from_slice(image.data) })
    }
}

/// Where transforms come from, for what is said of their lack.
pub(super) struct Transforms<'a> {
    pub(super) tree: &'a TransformTree,
    pub(super) base_frame: &'a str,
    pub(super) topic: &'a str,
    pub(super) newest_ns: Option<i64>,
}

impl Transforms<'_> {
    /// Why a sensor's frame is not known on the robot.
    pub(super) fn lack(&self, at_ns: i64, reason: MissingReason) -> MissingInput {
        let reason = if self.tree.is_empty() { MissingReason::NotReceived } else { reason };
        let age_ns = self.newest_ns.map(|newest| at_ns.saturating_sub(newest));
        MissingInput { input: Input::Transforms, topic: self.topic.to_owned(), age_ns, reason }
    }
}

/// A frame without number and odometry, and what it lacks.
pub(super) fn frame(
    (settings, state): (&CameraSettings, &CameraState),
    header: &Header<'_>,
    pixels: Pixels,
    transforms: &Transforms<'_>,
) -> (v1::Frame, Vec<MissingInput>) {
    let captured_ns = header.stamp.to_ns();
    let mut lacks = Vec::new();
    let intrinsics = state.intrinsics(settings, (pixels.size, captured_ns));
    let intrinsics = intrinsics.map_err(|lack| lacks.push(lack)).ok();
    let camera_frame = settings.frame.as_deref().unwrap_or(header.frame_id);
    let mounting = transforms.tree.lookup(transforms.base_frame, camera_frame);
    let mounting = mounting.map_err(|error| lacks.push(transforms.lack(captured_ns, error.into()))).ok();
    let robot_from_camera =
        mounting.map(|m| if settings.has_body_axes { m * body_from_optical() } else { m });
    let frame = v1::Frame {
        captured_ns,
        encoding: pixels.encoding.into(),
        width_px: pixels.size.0,
        height_px: pixels.size.1,
        image: pixels.bytes,
        intrinsics,
        robot_from_camera: robot_from_camera.as_ref().map(pose3_wire),
        ..v1::Frame::default()
    };
    (frame, lacks)
}
