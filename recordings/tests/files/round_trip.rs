//! Claim: what is written is read back, message by message; viewers get the channels that the crate
//! promises.

use crate::drive::{START_NS, file, landmark, messages, read};
use protos::prost::Message as _;
use recordings::{
    foxglove::{CameraCalibration, ImageAnnotations, LaserScan, SceneUpdate},
    read::MessageReader,
};
use std::{collections::BTreeMap, io::Cursor};

#[test]
fn every_message_comes_back() {
    for image_bytes in [12, 100_000] {
        let written = messages(image_bytes);
        assert_eq!(read(&file(&written)).unwrap(), written);
    }
}

#[test]
fn messages_come_back_in_the_order_of_time() {
    let mut written = messages(100_000);
    let in_order = written.clone();
    // A chunk holds ten of the images: pieces of several chunks change places.
    written[0..60].rotate_left(25);
    assert_eq!(read(&file(&written)).unwrap(), in_order);
}

/// The last message of each channel, and how many there are.
fn channels(file: &[u8]) -> BTreeMap<(String, String), (usize, Vec<u8>)> {
    let mut reader = MessageReader::open(Cursor::new(file)).expect("a file");
    let mut found: BTreeMap<_, (usize, Vec<u8>)> = BTreeMap::new();
    while let Some(raw) = reader.next_message().expect("a message") {
        assert_eq!(raw.channel.encoding, "protobuf");
        let entry = found.entry((raw.channel.topic.clone(), raw.channel.schema.clone())).or_default();
        *entry = (entry.0 + 1, raw.data.to_vec());
    }
    found
}

#[test]
fn viewers_get_every_channel() {
    let found = channels(&file(&messages(12)));
    let of_viewers: Vec<_> = found
        .iter()
        .filter(|((_, schema), _)| schema.starts_with("foxglove."))
        .map(|((topic, schema), (count, _))| (topic.as_str(), schema.as_str(), *count))
        .collect();
    assert_eq!(
        of_viewers,
        [
            ("/map/office/scene", "foxglove.SceneUpdate", 1),
            ("/robot/r1/front/annotations", "foxglove.ImageAnnotations", 15),
            ("/robot/r1/front/calibration", "foxglove.CameraCalibration", 1),
            ("/robot/r1/front/image", "foxglove.CompressedImage", 10),
            ("/robot/r1/front/image", "foxglove.RawImage", 5),
            ("/robot/r1/pose", "foxglove.PoseInFrame", 15),
            ("/robot/r1/scan", "foxglove.LaserScan", 15),
            ("/tf", "foxglove.FrameTransforms", 16),
        ]
    );
    let last = |topic: &str| &found.iter().find(|((t, _), _)| t == topic).unwrap().1.1[..];
    let annotations = ImageAnnotations::decode(last("/robot/r1/front/annotations")).unwrap();
    let corner = annotations.points[0].points[1];
    assert!(
        (corner.x - 3.5).abs() < 1e-12 && (corner.y - 0.5).abs() < 1e-12,
        "from the first pixel's corner"
    );
    assert_eq!(annotations.texts[0].text, "poster");
    let calibration = CameraCalibration::decode(last("/robot/r1/front/calibration")).unwrap();
    assert_eq!(
        (calibration.k.len(), calibration.p.len(), calibration.distortion_model.as_str()),
        (9, 12, "plumb_bob")
    );
    let scan = LaserScan::decode(last("/robot/r1/scan")).unwrap();
    assert!((scan.end_angle - 1.0).abs() < 1e-12 && scan.ranges.len() == 5);
}

#[test]
fn a_landmark_stands_where_the_map_says() {
    let found = channels(&file(&messages(12)));
    let scene = SceneUpdate::decode(
        &found[&("/map/office/scene".to_owned(), "foxglove.SceneUpdate".to_owned())].1[..],
    );
    let scene = scene.unwrap();
    assert_eq!(scene.entities[0].timestamp.unwrap().seconds, (START_NS / 1_000_000_000) as i64);
    assert_eq!(scene.entities[0].lines[0].points.len(), 4);
    let poster = scene.entities.iter().find(|e| e.id == "landmark/poster").unwrap();
    let pose = poster.lines[0].pose.as_ref().unwrap();
    let (p, q) = (pose.position.unwrap(), pose.orientation.unwrap());
    let turn = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
    let corner = poster.lines[0].points[0];
    let corner = turn * nalgebra::Vector3::new(corner.x, corner.y, corner.z);
    // On the north wall, seen from the south: its top-left corner is in the west.
    let size = landmark().size.unwrap();
    let expected = nalgebra::Vector3::new(1.0 - size.width_m / 2.0, 2.0, 1.5 + size.height_m / 2.0);
    assert!((nalgebra::Vector3::new(p.x, p.y, p.z) + corner - expected).norm() < 1e-9);
}
