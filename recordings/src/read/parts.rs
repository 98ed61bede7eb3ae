//! The parts of a file: its chunks, and runs of messages outside of chunks. In: a file. Out: where
//! they are and what time they span, without reading their content. A file that ends inside a
//! record is read up to there.

use super::{
    MAX_CHUNK_BYTES, MAX_PARTS, MAX_RECORD_BYTES,
    error::{ReadError, ReadFault},
};
use mcap::{MAGIC, records::op};
use protos::prost::bytes::{Buf as _, Bytes};
use std::io::{Read, Seek, SeekFrom};

/// A run of messages outside of chunks ends after so many bytes.
const RUN_BYTES: u64 = 4 << 20;
/// Bytes before the fields of a record: its kind and length.
pub(super) const HEAD_BYTES: u64 = 9;

/// A chunk, or a run of records outside of chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Part {
    /// Whether it is a chunk.
    pub(super) is_chunk: bool,
    /// Where its first record begins, bytes.
    pub(super) offset: u64,
    /// Length, heads of records included, bytes.
    pub(super) bytes: u64,
    /// Earliest log time of it and of all parts that follow, ns; `u64::MAX` without a message.
    pub(super) earliest_ns: u64,
}

/// Walks over the records of a file. Out: the parts in the order of the file, and where it ends
/// inside a record.
pub(super) fn parts(file: &mut (impl Read + Seek)) -> Result<(Vec<Part>, Option<u64>), ReadError> {
    let end = file.seek(SeekFrom::End(0)).map_err(|e| ReadFault::from(e).at(0))?;
    let mut magic = [0; MAGIC.len()];
    if file.rewind().and_then(|()| file.read_exact(&mut magic)).is_err() || magic != MAGIC {
        return Err(ReadFault::NotMcap.at(0));
    }
    let (mut parts, mut offset) = (Vec::<Part>::new(), MAGIC.len() as u64);
    let cut_off_at = loop {
        let Some(left) = (end - offset).checked_sub(HEAD_BYTES) else { break Some(offset) };
        let mut head = [0; HEAD_BYTES as usize];
        file.read_exact(&mut head).map_err(|e| ReadFault::from(e).at(offset))?;
        let (kind, length) = (head[0], (&head[1..]).get_u64_le());
        if matches!(kind, op::DATA_END | op::FOOTER) {
            break None;
        }
        if length > left {
            break Some(offset);
        }
        let part = part(file, kind, offset, HEAD_BYTES + length).map_err(|fault| fault.at(offset))?;
        if let Some(part) = part {
            add(&mut parts, part);
        }
        if parts.len() > MAX_PARTS {
            return Err(ReadFault::TooManyParts(MAX_PARTS).at(offset));
        }
        offset += HEAD_BYTES + length;
        file.seek(SeekFrom::Start(offset)).map_err(|e| ReadFault::from(e).at(offset))?;
    };
    for i in (1..parts.len()).rev() {
        parts[i - 1].earliest_ns = parts[i - 1].earliest_ns.min(parts[i].earliest_ns);
    }
    Ok((parts, cut_off_at))
}

/// A record as a part; `None` for one that is passed over. The file stands after the record's head.
fn part(file: &mut impl Read, kind: u8, offset: u64, bytes: u64) -> Result<Option<Part>, ReadFault> {
    // How long the fixed fields are, and where a log time stands in them: the earliest of a chunk,
    // or a message's own.
    let (most, fixed, time_at) = match kind {
        op::CHUNK => (MAX_CHUNK_BYTES, 40, 0),
        op::MESSAGE => (MAX_RECORD_BYTES, 22, 6),
        op::SCHEMA | op::CHANNEL => (MAX_RECORD_BYTES, 0, 0),
        _ => return Ok(None),
    };
    if bytes > most {
        return Err(ReadFault::TooLong { bytes, most });
    }
    if bytes - HEAD_BYTES < fixed as u64 {
        return Err(ReadFault::Short);
    }
    let mut fields = [0; 40];
    file.read_exact(&mut fields[..fixed])?;
    let earliest_ns = (&fields[time_at..fixed]).try_get_u64_le().unwrap_or(u64::MAX);
    Ok(Some(Part { is_chunk: kind == op::CHUNK, offset, bytes, earliest_ns }))
}

/// Adds a part, or lengthens the last run by it.
fn add(parts: &mut Vec<Part>, part: Part) {
    match parts.last_mut() {
        Some(last)
            if !(last.is_chunk || part.is_chunk)
                && last.offset + last.bytes == part.offset
                && last.bytes < RUN_BYTES =>
        {
            last.bytes += part.bytes;
            last.earliest_ns = last.earliest_ns.min(part.earliest_ns);
        }
        _ => parts.push(part),
    }
}

/// The records of a part: kind and fields.
pub(super) fn records(mut rest: Bytes) -> impl Iterator<Item = Result<(u8, Bytes), ReadFault>> {
    std::iter::from_fn(move || {
        let (kind, length) = (rest.try_get_u8().ok()?, rest.try_get_u64_le().ok());
        let length = length.and_then(|n| usize::try_from(n).ok()).filter(|n| *n <= rest.len());
        Some(length.map(|length| (kind, rest.split_to(length))).ok_or(ReadFault::Short))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_are_walked_and_a_cut_one_is_an_error() {
        let bytes = [&[5, 2, 0, 0, 0, 0, 0, 0, 0, 7, 7][..], &[4, 0, 0, 0, 0, 0, 0, 0, 0]].concat();
        let bytes = Bytes::from(bytes);
        let found: Vec<_> = records(bytes.clone()).map(Result::unwrap).collect();
        assert_eq!(found, [(5, bytes.slice(9..11)), (4, Bytes::new())]);
        for cut in [1, 8, 10, 12] {
            assert!(records(bytes.slice(..cut)).any(|record| record.is_err()), "{cut}");
        }
        let huge = [&[5_u8][..], &[0xff; 8], &[0; 4]].concat();
        assert!(records(huge.into()).next().unwrap().is_err());
    }
}
