//! Claim: damaged payloads give a typed error that names field and offset; no count is believed
//! before it has been compared with the bytes that are left.

use crate::rosbags::samples;
use ros2::{
    cdr::{CdrFault, MAX_END_PADDING_BYTES},
    messages::{
        CameraInfo, CompressedImage, Header, Image, LaserScan, Message, MessageKind, TFMessage,
        TransformStamped,
    },
};

#[test]
fn a_payload_cut_anywhere_is_refused_at_a_place_inside_of_it() {
    for sample in samples() {
        for length in 0..sample.payload.len() {
            let error = sample.kind.decode(&sample.payload[..length]).expect_err("a part is no message");
            assert!(error.offset <= length, "{error}");
            let is_right = matches!(error.fault, CdrFault::Truncated { .. } | CdrFault::Count { .. });
            assert!(is_right, "{:?} {length}: {error}", sample.kind);
        }
    }
}

#[test]
fn bytes_after_the_message_are_padding_or_another_type() {
    for sample in samples() {
        let mut payload = sample.payload.clone();
        for _ in 0..MAX_END_PADDING_BYTES {
            payload.push(0xaa);
            assert!(sample.kind.decode(&payload).is_ok());
        }
        payload.push(0xaa);
        let error = sample.kind.decode(&payload).unwrap_err();
        assert_eq!(error.fault, CdrFault::Trailing(MAX_END_PADDING_BYTES + 1));
        assert_eq!((error.field.as_str(), error.offset), ("end", sample.payload.len()));
    }
}

/// The offset of a count in a payload whose only u32 of this value it is.
fn replaced(mut payload: Vec<u8>, count: u32, by: u32) -> Vec<u8> {
    let at = payload.windows(4).position(|w| w == count.to_le_bytes()).expect("the count");
    payload[at..at + 4].copy_from_slice(&by.to_le_bytes());
    payload
}

#[test]
fn counts_beyond_the_payload_are_refused_before_anything_is_allocated() {
    let scan = LaserScan { ranges: vec![0.0; 77], ..LaserScan::default() }.encode();
    let links = TFMessage { transforms: vec![TransformStamped::default(); 5] }.encode();
    let image = Image { data: &[0; 99], ..Image::default() }.encode();
    let text = CompressedImage { format: "12345678901234", ..CompressedImage::default() }.encode();
    let cases: [(MessageKind, Vec<u8>, u32, &str); 4] = [
        (MessageKind::LaserScan, scan, 77, "ranges"),
        (MessageKind::TFMessage, links, 5, "transforms"),
        (MessageKind::Image, image, 99, "data"),
        (MessageKind::CompressedImage, text, 15, "format"),
    ];
    for (kind, payload, count, field) in cases {
        assert!(kind.decode(&payload).is_ok());
        for wrong in [u32::MAX, 1 << 31, 1 << 30, 1 << 20] {
            let error = kind.decode(&replaced(payload.clone(), count, wrong)).map(|_| ()).unwrap_err();
            assert_eq!(error.field, field);
            assert!(matches!(error.fault, CdrFault::Count { count, .. } if count == wrong), "{error}");
        }
    }
    // A count that the bytes could hold were the elements shorter is refused as well.
    let links = TFMessage { transforms: vec![TransformStamped::default(); 5] }.encode();
    let error = TFMessage::decode(&replaced(links, 5, 7)).unwrap_err();
    assert!(matches!(error.fault, CdrFault::Count { count: 7, .. }), "{error}");
}

#[test]
fn a_fault_inside_of_a_list_names_its_place() {
    let link = TransformStamped { header: Header::default(), child_frame_id: "laser", ..Default::default() };
    let mut payload = TFMessage { transforms: vec![link; 3] }.encode();
    let last = payload.windows(5).rposition(|w| w == b"laser").unwrap();
    payload[last] = 0xff;
    let error = TFMessage::decode(&payload).unwrap_err();
    assert_eq!((error.field.as_str(), error.offset), ("transforms[2].child_frame_id", last));
    assert_eq!(error.fault, CdrFault::NotUtf8);
    assert_eq!(
        error.to_string(),
        format!("transforms[2].child_frame_id at byte {last}: the text is not UTF-8")
    );
}

#[test]
fn texts_and_flags_of_other_forms() {
    let payload = CompressedImage { format: "jpeg", ..CompressedImage::default() }.encode();
    let nul = payload.windows(5).position(|w| w == b"jpeg\0").unwrap() + 4;
    let mut open = payload.clone();
    open[nul] = b'x';
    assert_eq!(CompressedImage::decode(&open).unwrap_err().fault, CdrFault::Unterminated);

    // A text of length 0 instead of 1: the four bytes of its NUL and padding are gone.
    let mut none = CompressedImage::default().encode();
    let frame_id = 4 + 8;
    none[frame_id] = 0;
    none.drain(frame_id + 4..frame_id + 8);
    assert_eq!(CompressedImage::decode(&none).unwrap(), CompressedImage::default());

    let mut info = CameraInfo::default().encode();
    *info.last_mut().unwrap() = 2;
    let error = CameraInfo::decode(&info).unwrap_err();
    assert_eq!((error.field.as_str(), error.fault), ("roi.do_rectify", CdrFault::NotBool(2)));
}

#[test]
fn other_representations_are_refused() {
    for head in [[0, 2], [0, 3], [0, 6], [0, 7], [1, 0], [0xff, 0xff]] {
        let payload = [head[0], head[1], 0, 0, 0, 0, 0, 0];
        let error = TFMessage::decode(&payload).unwrap_err();
        assert_eq!((error.offset, error.fault), (0, CdrFault::Encapsulation(head)));
    }
}
