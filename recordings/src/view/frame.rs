//! Image, intrinsics and mounting of a frame.

use super::{CameraState, Shown};
use crate::{
    foxglove::{
        CameraCalibration, CompressedImage, FrameTransform, FrameTransforms, Quaternion, RawImage, Timestamp,
        Vector3,
    },
    topics,
};
use protos::{Name, v1};

/// The image is moved out of the frame, unless its encoding is unknown to viewers.
pub(super) fn shown(
    robot: &Name,
    camera: &Name,
    frame: &mut v1::Frame,
    state: &mut CameraState,
) -> Vec<Shown> {
    let at = Timestamp::from_ns(frame.captured_ns);
    let mut all = Vec::new();
    let size_px = [frame.width_px, frame.height_px];
    if let Some(intrinsics) = &frame.intrinsics
        && state.intrinsics.as_ref() != Some(&(intrinsics.clone(), size_px))
    {
        let message = calibration(intrinsics, size_px, at, topics::camera_frame(robot, camera));
        all.push(Shown::new(topics::calibration(robot, camera), "foxglove.CameraCalibration", &message));
        state.intrinsics = Some((intrinsics.clone(), size_px));
    }
    if let Some(mounting) = &frame.robot_from_camera
        && state.mounting.as_ref() != Some(mounting)
    {
        let transforms = vec![transform(robot, camera, mounting, at)];
        let message = FrameTransforms { transforms };
        all.push(Shown::new(topics::TRANSFORMS.to_owned(), "foxglove.FrameTransforms", &message));
        state.mounting = Some(*mounting);
    }
    all.extend(image(robot, camera, frame, at));
    all
}

const RAW: &str = "foxglove.RawImage";

fn image(robot: &Name, camera: &Name, frame: &mut v1::Frame, at: Timestamp) -> Option<Shown> {
    let (frame_id, topic) = (topics::camera_frame(robot, camera), topics::image(robot, camera));
    let format = match frame.encoding() {
        v1::ImageEncoding::Jpeg => "jpeg",
        v1::ImageEncoding::Png => "png",
        v1::ImageEncoding::Gray8 => {
            return Some(Shown::new(topic, RAW, &raw(frame, frame_id, at, "mono8", 1)));
        }
        v1::ImageEncoding::Rgb8 => return Some(Shown::new(topic, RAW, &raw(frame, frame_id, at, "rgb8", 3))),
        v1::ImageEncoding::Bgr8 => return Some(Shown::new(topic, RAW, &raw(frame, frame_id, at, "bgr8", 3))),
        v1::ImageEncoding::Unspecified => return None,
    };
    let data = std::mem::take(&mut frame.image);
    let message = CompressedImage { timestamp: Some(at), frame_id, data, format: format.to_owned() };
    Some(Shown::new(topic, "foxglove.CompressedImage", &message))
}

/// Raw pixels, rows without padding; `bytes` a pixel.
fn raw(frame: &mut v1::Frame, frame_id: String, at: Timestamp, encoding: &str, bytes: u32) -> RawImage {
    RawImage {
        timestamp: Some(at),
        frame_id,
        width: frame.width_px,
        height: frame.height_px,
        encoding: encoding.to_owned(),
        step: frame.width_px.saturating_mul(bytes),
        data: std::mem::take(&mut frame.image),
    }
}

fn calibration(
    camera: &v1::Intrinsics,
    size_px: [u32; 2],
    at: Timestamp,
    frame_id: String,
) -> CameraCalibration {
    let (model, coefficients) = if !camera.rational_polynomial.is_empty() {
        ("rational_polynomial", &camera.rational_polynomial)
    } else if !camera.equidistant.is_empty() {
        ("kannala_brandt", &camera.equidistant)
    } else {
        ("plumb_bob", &camera.plumb_bob)
    };
    let v1::Intrinsics { fx_px, fy_px, cx_px, cy_px, .. } = *camera;
    CameraCalibration {
        timestamp: Some(at),
        frame_id,
        width: size_px[0],
        height: size_px[1],
        distortion_model: model.to_owned(),
        d: if coefficients.is_empty() { vec![0.0; 5] } else { coefficients.clone() },
        k: vec![fx_px, 0.0, cx_px, 0.0, fy_px, cy_px, 0.0, 0.0, 1.0],
        r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: vec![fx_px, 0.0, cx_px, 0.0, 0.0, fy_px, cy_px, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
}

fn transform(robot: &Name, camera: &Name, mounting: &v1::Pose3, at: Timestamp) -> FrameTransform {
    FrameTransform {
        timestamp: Some(at),
        parent_frame_id: topics::robot_frame(robot),
        child_frame_id: topics::camera_frame(robot, camera),
        translation: Some(Vector3 { x: mounting.x_m, y: mounting.y_m, z: mounting.z_m }),
        rotation: Some(Quaternion { x: mounting.qx, y: mounting.qy, z: mounting.qz, w: mounting.qw }),
    }
}
