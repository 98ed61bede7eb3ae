//! Claim: attachments are those of zenoh-ext, byte for byte, and the earlier form is read.

use crate::{hex, tokens::TALKER};
use ros2::rmw_zenoh::{Attachment, AttachmentError, Gid};

const GOLDEN: &str = "010000000000000015cd853dfe9c971710eb85fa883b7846dc448a4501890ad062";

fn golden() -> Attachment {
    Attachment { sequence: 1, source_ns: 1_700_000_000_123_456_789, source: Gid::of_token(TALKER) }
}

/// The form with names: each field after its name as a text with a length byte.
fn labelled(attachment: &Attachment) -> Vec<u8> {
    let mut bytes = Vec::new();
    let current = attachment.write();
    for (name, field) in [
        ("sequence_number", &current[..8]),
        ("source_timestamp", &current[8..16]),
        ("source_gid", &current[16..]),
    ] {
        bytes.push(name.len() as u8);
        bytes.extend(name.as_bytes());
        bytes.extend(field);
    }
    bytes
}

#[test]
fn the_measured_bytes() {
    assert_eq!(golden().write().to_vec(), hex::bytes(GOLDEN));
    assert_eq!(Attachment::read(&hex::bytes(GOLDEN)), Ok(golden()));
    let negative = Attachment { sequence: -1, source_ns: i64::MIN, ..golden() };
    assert_eq!(Attachment::read(&negative.write()), Ok(negative));
}

#[test]
fn the_earlier_form_is_read() {
    let bytes = labelled(&golden());
    assert_eq!(bytes.len(), 77);
    assert_eq!(bytes[..16], hex::bytes("0f73657175656e63655f6e756d626572"));
    assert_eq!(Attachment::read(&bytes), Ok(golden()));
}

#[test]
fn malformed_attachments_name_the_field() {
    let refused = |bytes: &[u8]| Attachment::read(bytes).unwrap_err();
    let current = golden().write();
    for length in (0..current.len()).chain([34, 76, 78]) {
        let bytes = vec![0; length];
        assert_eq!(refused(&bytes), AttachmentError::Length(length));
    }
    let mut other = current;
    other[16] = 15;
    assert_eq!(refused(&other), AttachmentError::Field("source_gid"));
    let bytes = labelled(&golden());
    for (at, field) in [
        (0, "sequence_number"),
        (3, "sequence_number"),
        (24, "source_timestamp"),
        (40, "source_timestamp"),
        (49, "source_gid"),
        (59, "source_gid"),
        (60, "source_gid"),
    ] {
        let mut other = bytes.clone();
        other[at] ^= 1;
        assert_eq!(refused(&other), AttachmentError::Field(field), "{at}");
    }
}
