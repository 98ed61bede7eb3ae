//! Records of MCAP: kind, length, fields. Only those are parsed that a reader needs; all others are passed over.

use super::error::ReadFault;
use mcap::records::{MessageHeader, Record, op};

/// Bytes before the fields of a record: its kind and length.
pub(super) const HEAD_BYTES: usize = 9;
/// Bytes of a message before its content.
pub(super) const MESSAGE_HEAD_BYTES: usize = 22;

/// A little-endian number.
pub(super) fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |sum, byte| (sum << 8) | u64::from(*byte))
}

/// Kind and length of a record.
pub(super) fn head(bytes: &[u8; HEAD_BYTES]) -> (u8, u64) {
    (bytes[0], number(&bytes[1..]))
}

/// Channel, number and times of a message.
pub(super) fn message_head(body: &[u8]) -> Result<MessageHeader, ReadFault> {
    let head = body.get(..MESSAGE_HEAD_BYTES).ok_or(ReadFault::Short)?;
    Ok(MessageHeader {
        channel_id: number(&head[..2]) as u16,
        sequence: number(&head[2..6]) as u32,
        log_time: number(&head[6..14]),
        publish_time: number(&head[14..22]),
    })
}

/// A schema or a channel; `None` for the other kinds.
pub(super) fn announcement(kind: u8, body: &[u8]) -> Result<Option<Record<'_>>, ReadFault> {
    match kind {
        op::SCHEMA | op::CHANNEL => Ok(Some(mcap::parse_record(kind, body)?)),
        _ => Ok(None),
    }
}

/// The records of an unpacked chunk: kind, begin and end of the fields.
pub(super) fn walk(bytes: &[u8]) -> impl Iterator<Item = Result<(u8, std::ops::Range<usize>), ReadFault>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        if at >= bytes.len() {
            return None;
        }
        let begin = at + HEAD_BYTES;
        let record = bytes[at..].first_chunk::<HEAD_BYTES>().and_then(|first| {
            let (kind, length) = head(first);
            let end = begin.checked_add(usize::try_from(length).ok()?)?;
            (end <= bytes.len()).then_some((kind, begin..end))
        });
        at = record.as_ref().map_or(bytes.len(), |(_, range)| range.end);
        Some(record.ok_or(ReadFault::Short))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_walked_and_a_cut_one_is_an_error() {
        let mut bytes = vec![5, 2, 0, 0, 0, 0, 0, 0, 0, 7, 7];
        bytes.extend([4, 0, 0, 0, 0, 0, 0, 0, 0]);
        let found: Vec<_> = walk(&bytes).map(Result::unwrap).collect();
        assert_eq!(found, [(5, 9..11), (4, 20..20)]);
        for cut in [1, 8, 10, 12] {
            assert!(walk(&bytes[..cut]).last().unwrap().is_err(), "{cut}");
        }
        let huge = [&[5_u8][..], &[0xff; 8], &[0; 4]].concat();
        assert!(walk(&huge).next().unwrap().is_err());
    }
}
