//! Claim: what stands in padding and in the header's options does not matter, and is written as
//! zero.

use crate::rosbags::samples;
use ros2::{
    cdr::{ByteOrder, HEADER_BYTES},
    messages::{
        CameraInfo, CompressedImage, Header, Image, Message, MessageKind, TFMessage, TransformStamped,
    },
};

/// Places of padding: bytes that, changed, leave the message as it was.
fn padding(kind: MessageKind, payload: &[u8]) -> Vec<usize> {
    let canonical = kind.decode(payload).map(|m| m.encode_in(ByteOrder::Little)).expect("a message");
    let is_padding = |at: &usize| {
        let mut changed = payload.to_vec();
        changed[*at] ^= 0x55;
        let again = kind.decode(&changed).map(|m| m.encode_in(ByteOrder::Little));
        again.is_ok_and(|bytes| bytes == canonical)
    };
    (HEADER_BYTES..payload.len()).filter(is_padding).collect()
}

#[test]
fn garbage_in_padding_is_read_past() {
    // A frame of three letters needs no padding before a number of four bytes, one of four letters
    // three bytes.
    let image = Image {
        header: Header { frame_id: "abcd", ..Header::default() },
        encoding: "mono8",
        data: &[1, 2],
        ..Image::default()
    };
    let payload = image.encode();
    // Header 12 bytes with the length, `abcd` and its NUL to 17, padding to 20; height, width,
    // length to 32; `mono8` and its NUL to 38, is_bigendian, padding to 40.
    let expected: Vec<usize> = [17, 18, 19, 39].iter().map(|at| at + HEADER_BYTES).collect();
    assert_eq!(padding(MessageKind::Image, &payload), expected);
    let mut dirty = payload.clone();
    for at in expected {
        assert_eq!(payload[at], 0);
        dirty[at] = 0xcd;
    }
    assert_eq!(Image::decode(&dirty).unwrap(), image);
    assert_eq!(Image::decode(&dirty).unwrap().encode(), payload);
}

#[test]
fn every_message_with_dirty_padding_reads_the_same() {
    let mut dirtied = 0;
    for sample in samples() {
        let mut dirty = sample.payload.clone();
        for at in padding(sample.kind, &sample.payload) {
            dirty[at] = 0xcd;
            dirtied += 1;
        }
        assert_eq!(sample.kind.decode(&dirty).unwrap().encode_in(sample.order), sample.payload);
    }
    assert!(dirtied > 50, "only {dirtied} bytes of padding");
}

#[test]
fn options_of_any_value_are_passed_over() {
    let image = CompressedImage { format: "png", data: &[7; 5], ..CompressedImage::default() };
    let mut payload = image.encode();
    for options in [[0, 3], [0xff, 0xff], [0x12, 0x02]] {
        payload[2..4].copy_from_slice(&options);
        assert_eq!(CompressedImage::decode(&payload).unwrap(), image);
    }
    assert_eq!(image.encode()[..4], [0, 1, 0, 0]);
}

#[test]
fn an_empty_list_has_no_padding_of_elements() {
    let payload = TFMessage::default().encode();
    assert_eq!(payload, [0, 1, 0, 0, 0, 0, 0, 0]);
    let one = TFMessage { transforms: vec![TransformStamped::default()] };
    assert!(one.encode().len() > payload.len());
    // `d` of a camera without lens ends right after its count; `k` is aligned for itself.
    let info = CameraInfo::default();
    let with_d = CameraInfo { d: vec![0.0], ..info.clone() };
    assert_eq!(CameraInfo::decode(&info.encode()).unwrap(), info);
    assert!(with_d.encode().len() - info.encode().len() <= 16);
}
