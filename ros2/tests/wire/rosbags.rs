//! Claim: random messages that rosbags wrote are read field by field, and written again to the same
//! bytes (`tests/golden.py` made the file).

use crate::{
    fields::{self, Content, bits},
    hex,
};
use ros2::{cdr::ByteOrder, messages::MessageKind, type_name::TypeName};

const FILE: &str = include_str!("../fixtures/rosbags.txt");

/// One message of the file.
pub(crate) struct Sample {
    /// Its type.
    pub(crate) kind: MessageKind,
    /// Byte order of the payload.
    pub(crate) order: ByteOrder,
    /// Path and content, as Python shows it.
    fields: Vec<(&'static str, &'static str)>,
    /// The CDR bytes.
    pub(crate) payload: Vec<u8>,
}

/// All messages of the file.
pub(crate) fn samples() -> Vec<Sample> {
    let mut samples = Vec::new();
    for block in FILE.split("\n\n").skip(1) {
        let mut lines = block.lines();
        let head: Vec<&str> = lines.next().expect("a head").split(' ').collect();
        let name = TypeName::from_ros(head[1]).expect("a type");
        let kind = MessageKind::of(name).expect("a known type");
        assert_eq!(kind.hash(), head[2], "{name}");
        let order = if head[3] == "little" { ByteOrder::Little } else { ByteOrder::Big };
        let (mut fields, mut payload) = (Vec::new(), Vec::new());
        for line in lines {
            match line.strip_prefix("payload ") {
                Some(digits) => payload = hex::bytes(digits),
                None => fields.push(line.split_once(" = ").expect("a field")),
            }
        }
        samples.push(Sample { kind, order, fields, payload });
    }
    samples
}

/// The content that Python shows, in the form of ours.
fn expected(shown: &str, ours: &Content) -> Content {
    match ours {
        Content::Int(_) => Content::Int(shown.parse().expect("an integer")),
        Content::Floats(_) => {
            let numbers = shown.split_whitespace().map(|n| bits(n.parse().expect("a number")));
            Content::Floats(numbers.collect())
        }
        Content::Text(_) => Content::Text(shown.to_owned()),
    }
}

#[test]
fn every_field_is_read_as_it_was_written() {
    let samples = samples();
    for kind in MessageKind::ALL {
        for order in [ByteOrder::Little, ByteOrder::Big] {
            let is_there = samples.iter().any(|s| s.kind == *kind && s.order == order);
            assert!(is_there, "{kind:?} {order:?}");
        }
    }
    for sample in &samples {
        let message = sample.kind.decode(&sample.payload).unwrap();
        let ours = fields::of(&message);
        let paths: Vec<&str> = ours.iter().map(|(path, _)| path.as_str()).collect();
        assert_eq!(paths, sample.fields.iter().map(|(path, _)| *path).collect::<Vec<_>>());
        for ((path, content), (_, shown)) in ours.iter().zip(&sample.fields) {
            assert_eq!(*content, expected(shown, content), "{:?} {path}", sample.kind);
        }
    }
}

#[test]
fn messages_are_written_to_the_same_bytes() {
    for sample in samples() {
        let message = sample.kind.decode(&sample.payload).unwrap();
        assert_eq!(message.encode_in(sample.order), sample.payload, "{:?}", sample.kind);
    }
}
