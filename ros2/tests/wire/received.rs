//! Claim: key, payload and attachment of a sample become a typed message, or a refusal that says
//! what is wrong.

use ros2::{
    messages::{AnyMessage, CompressedImage, Message, MessageKind, TFMessage},
    receive::{Refusal, receive},
    rmw_zenoh::{Attachment, AttachmentError, Channel, Gid, HASH_NOT_SUPPORTED},
};

fn key(hash: &str) -> String {
    format!("0/r1/camera/sensor_msgs::msg::dds_::CompressedImage_/{hash}")
}

#[test]
fn a_sample_becomes_its_message() {
    let image = CompressedImage { format: "jpeg", data: &[1, 2, 3], ..CompressedImage::default() };
    let payload = image.encode();
    let attachment = Attachment { sequence: 3, source_ns: 5, source: Gid([7; 16]) };
    for (key, channel) in [
        (key(CompressedImage::HASH), Channel::Topic),
        (key(HASH_NOT_SUPPORTED), Channel::Topic),
        (format!("{}/_buf_cpu", key(CompressedImage::HASH)), Channel::CpuBuffers),
    ] {
        let received = receive(&key, &payload, Some(&attachment.write())).unwrap();
        assert_eq!(received.key.topic.to_string(), "/r1/camera");
        assert_eq!(received.key.channel, channel);
        assert_eq!(received.attachment, Some(attachment));
        assert_eq!(received.message, AnyMessage::CompressedImage(image));
        assert_eq!(received.message.kind(), MessageKind::CompressedImage);
    }
    assert_eq!(receive(&key(CompressedImage::HASH), &payload, None).unwrap().attachment, None);
}

#[test]
fn each_refusal_says_what_is_wrong() {
    let payload = TFMessage::default().encode();
    let refused = |key: &str, payload: &[u8], attachment| receive(key, payload, attachment).unwrap_err();
    assert!(matches!(refused("a/b", &payload, None), Refusal::Key(_)));
    let unknown = refused("0/a/std_msgs::msg::dds_::String_/h", &payload, None);
    assert_eq!(unknown, Refusal::UnknownType("std_msgs/msg/String".into()));
    let other = refused(&key("RIHS01_00"), &payload, None);
    let expected = Refusal::OtherDefinition {
        name: "sensor_msgs/msg/CompressedImage".into(),
        hash: "RIHS01_00".into(),
        expected: CompressedImage::HASH,
    };
    assert_eq!(other, expected);
    let attachment = refused(&key(CompressedImage::HASH), &payload, Some(&[0; 5]));
    assert_eq!(attachment, Refusal::Attachment(AttachmentError::Length(5)));
    let short = refused(&key(CompressedImage::HASH), &payload, None);
    assert_eq!(
        short.to_string(),
        "the payload is malformed: header.stamp.nanosec at byte 8: 4 bytes needed, 0 left"
    );
}
