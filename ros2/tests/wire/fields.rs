//! Every field of a message by its path, for comparison with what another implementation wrote.

use crate::hex;
use ros2::messages::{
    AnyMessage, CameraInfo, Detection2D, Header, Image, LaserScan, Odometry, Pose, PoseWithCovariance,
    Quaternion, TransformStamped, Vector3,
};

/// The content of a field.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Content {
    /// Integers and lengths.
    Int(i64),
    /// Floating-point numbers as bits, so that NaN and -0 count; those of 32 bits widened.
    Floats(Vec<u64>),
    /// Texts and bools, as the file shows them.
    Text(String),
}

/// Fields in the order of the definition.
pub(crate) type Fields = Vec<(String, Content)>;

fn int(out: &mut Fields, path: &str, number: impl Into<i64>) {
    out.push((path.into(), Content::Int(number.into())));
}

fn floats(out: &mut Fields, path: &str, numbers: impl IntoIterator<Item = f64>) {
    out.push((path.into(), Content::Floats(numbers.into_iter().map(bits).collect())));
}

/// The bits of a number; every NaN is the same.
pub(crate) fn bits(number: f64) -> u64 {
    if number.is_nan() { f64::NAN.to_bits() } else { number.to_bits() }
}

fn text(out: &mut Fields, path: &str, text: &str) {
    out.push((path.into(), Content::Text(format!("\"{text}\""))));
}

fn bytes(out: &mut Fields, path: &str, bytes: &[u8]) {
    out.push((path.into(), Content::Text(hex::digits(bytes))));
}

fn header(out: &mut Fields, path: &str, header: &Header<'_>) {
    int(out, &format!("{path}.stamp.sec"), header.stamp.sec);
    int(out, &format!("{path}.stamp.nanosec"), header.stamp.nanosec);
    text(out, &format!("{path}.frame_id"), header.frame_id);
}

fn vector(out: &mut Fields, path: &str, v: &Vector3) {
    for (axis, number) in [("x", v.x), ("y", v.y), ("z", v.z)] {
        floats(out, &format!("{path}.{axis}"), [number]);
    }
}

fn quaternion(out: &mut Fields, path: &str, q: &Quaternion) {
    vector(out, path, &Vector3 { x: q.x, y: q.y, z: q.z });
    floats(out, &format!("{path}.w"), [q.w]);
}

fn pose(out: &mut Fields, path: &str, pose: &Pose) {
    vector(out, &format!("{path}.position"), &pose.position);
    quaternion(out, &format!("{path}.orientation"), &pose.orientation);
}

fn pose_with_covariance(out: &mut Fields, path: &str, value: &PoseWithCovariance) {
    pose(out, &format!("{path}.pose"), &value.pose);
    floats(out, &format!("{path}.covariance"), value.covariance);
}

fn image(out: &mut Fields, image: &Image<'_>) {
    int(out, "height", image.height);
    int(out, "width", image.width);
    text(out, "encoding", image.encoding);
    int(out, "is_bigendian", image.is_bigendian);
    int(out, "step", image.step);
    bytes(out, "data", image.data);
}

fn camera_info(out: &mut Fields, info: &CameraInfo<'_>) {
    int(out, "height", info.height);
    int(out, "width", info.width);
    text(out, "distortion_model", info.distortion_model);
    floats(out, "d", info.d.iter().copied());
    floats(out, "k", info.k);
    floats(out, "r", info.r);
    floats(out, "p", info.p);
    int(out, "binning_x", info.binning_x);
    int(out, "binning_y", info.binning_y);
    int(out, "roi.x_offset", info.roi.x_offset);
    int(out, "roi.y_offset", info.roi.y_offset);
    int(out, "roi.height", info.roi.height);
    int(out, "roi.width", info.roi.width);
    out.push(("roi.do_rectify".into(), Content::Text(info.roi.do_rectify.to_string())));
}

fn laser_scan(out: &mut Fields, scan: &LaserScan<'_>) {
    let numbers = [
        ("angle_min", scan.angle_min),
        ("angle_max", scan.angle_max),
        ("angle_increment", scan.angle_increment),
        ("time_increment", scan.time_increment),
        ("scan_time", scan.scan_time),
        ("range_min", scan.range_min),
        ("range_max", scan.range_max),
    ];
    for (path, number) in numbers {
        floats(out, path, [f64::from(number)]);
    }
    floats(out, "ranges", scan.ranges.iter().copied().map(f64::from));
    floats(out, "intensities", scan.intensities.iter().copied().map(f64::from));
}

fn odometry(out: &mut Fields, odometry: &Odometry<'_>) {
    text(out, "child_frame_id", odometry.child_frame_id);
    pose_with_covariance(out, "pose", &odometry.pose);
    vector(out, "twist.twist.linear", &odometry.twist.twist.linear);
    vector(out, "twist.twist.angular", &odometry.twist.twist.angular);
    floats(out, "twist.covariance", odometry.twist.covariance);
}

fn transform(out: &mut Fields, path: &str, link: &TransformStamped<'_>) {
    header(out, &format!("{path}.header"), &link.header);
    text(out, &format!("{path}.child_frame_id"), link.child_frame_id);
    vector(out, &format!("{path}.transform.translation"), &link.transform.translation);
    quaternion(out, &format!("{path}.transform.rotation"), &link.transform.rotation);
}

fn detection(out: &mut Fields, path: &str, detection: &Detection2D<'_>) {
    header(out, &format!("{path}.header"), &detection.header);
    int(out, &format!("{path}.results.len"), detection.results.len() as i64);
    for (i, result) in detection.results.iter().enumerate() {
        let path = format!("{path}.results[{i}]");
        text(out, &format!("{path}.hypothesis.class_id"), result.class_id);
        floats(out, &format!("{path}.hypothesis.score"), [result.score]);
        pose_with_covariance(out, &format!("{path}.pose"), &result.pose);
    }
    let bbox = &detection.bbox;
    floats(out, &format!("{path}.bbox.center.position.x"), [bbox.center.x]);
    floats(out, &format!("{path}.bbox.center.position.y"), [bbox.center.y]);
    floats(out, &format!("{path}.bbox.center.theta"), [bbox.center.theta]);
    floats(out, &format!("{path}.bbox.size_x"), [bbox.size_x]);
    floats(out, &format!("{path}.bbox.size_y"), [bbox.size_y]);
    text(out, &format!("{path}.id"), detection.id);
}

/// The fields of a message.
pub(crate) fn of(message: &AnyMessage<'_>) -> Fields {
    let mut out = Fields::new();
    if let Some(own) = message.header() {
        header(&mut out, "header", own);
    }
    match message {
        AnyMessage::Image(message) => image(&mut out, message),
        AnyMessage::CompressedImage(message) => {
            text(&mut out, "format", message.format);
            bytes(&mut out, "data", message.data);
        }
        AnyMessage::CameraInfo(message) => camera_info(&mut out, message),
        AnyMessage::LaserScan(message) => laser_scan(&mut out, message),
        AnyMessage::Odometry(message) => odometry(&mut out, message),
        AnyMessage::PoseWithCovarianceStamped(message) => {
            pose_with_covariance(&mut out, "pose", &message.pose);
        }
        AnyMessage::TFMessage(message) => {
            int(&mut out, "transforms.len", message.transforms.len() as i64);
            for (i, link) in message.transforms.iter().enumerate() {
                transform(&mut out, &format!("transforms[{i}]"), link);
            }
        }
        AnyMessage::Detection2DArray(message) => {
            int(&mut out, "detections.len", message.detections.len() as i64);
            for (i, one) in message.detections.iter().enumerate() {
                detection(&mut out, &format!("detections[{i}]"), one);
            }
        }
    }
    out
}
