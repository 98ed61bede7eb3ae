//! The parts of a file: its chunks, and runs of messages outside of chunks. In: a file. Out: where they are and what
//! time they span, without reading their content. A file that ends inside a record is read up to there.

use super::{
    MAX_CHUNK_BYTES, MAX_PARTS, MAX_RECORD_BYTES, chunk,
    error::{ReadError, ReadFault},
    records::{HEAD_BYTES, MESSAGE_HEAD_BYTES, head, message_head},
};
use mcap::{MAGIC, records::op};
use std::io::{Read, Seek, SeekFrom};

/// A run of messages outside of chunks ends after so many bytes.
const RUN_BYTES: u64 = 4 << 20;
/// Bytes of a chunk's record before its content, with the longest name of a packing.
const MAX_CHUNK_HEAD_BYTES: u64 = 256;

/// A chunk, or a run of records outside of chunks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Part {
    /// Whether it is a chunk.
    pub(super) is_chunk: bool,
    /// Where its first record begins, bytes.
    pub(super) offset: u64,
    /// Length, heads of records included, bytes.
    pub(super) bytes: u64,
    /// Earliest log time, ns; `u64::MAX` without a message.
    pub(super) start_ns: u64,
}

/// The parts in the order of the file.
#[derive(Debug, Default)]
pub(super) struct Parts {
    pub(super) parts: Vec<Part>,
    /// Where the file ends inside a record; `None` for a whole file.
    pub(super) cut_off_at: Option<u64>,
}

/// Walks over the records of a file.
pub(super) fn parts(file: &mut (impl Read + Seek)) -> Result<Parts, ReadError> {
    let end = file.seek(SeekFrom::End(0)).map_err(|e| ReadFault::from(e).at(0))?;
    let mut magic = [0; MAGIC.len()];
    file.rewind().and_then(|()| file.read_exact(&mut magic)).map_err(|_short| ReadFault::NotMcap.at(0))?;
    if magic != MAGIC {
        return Err(ReadFault::NotMcap.at(0));
    }
    let (mut found, mut offset) = (Parts::default(), MAGIC.len() as u64);
    loop {
        let mut bytes = [0; HEAD_BYTES];
        if end - offset < HEAD_BYTES as u64 {
            found.cut_off_at = Some(offset);
            return Ok(found);
        }
        file.read_exact(&mut bytes).map_err(|e| ReadFault::from(e).at(offset))?;
        let (kind, length) = head(&bytes);
        if matches!(kind, op::DATA_END | op::FOOTER) {
            return Ok(found);
        }
        if length > end - offset - HEAD_BYTES as u64 {
            found.cut_off_at = Some(offset);
            return Ok(found);
        }
        let whole = HEAD_BYTES as u64 + length;
        found.add(file, kind, offset, whole).map_err(|fault| fault.at(offset))?;
        if found.parts.len() > MAX_PARTS {
            return Err(ReadFault::TooManyParts(MAX_PARTS).at(offset));
        }
        offset += whole;
        file.seek(SeekFrom::Start(offset)).map_err(|e| ReadFault::from(e).at(offset))?;
    }
}

impl Parts {
    /// Adds a record of `bytes`; the file stands after its head.
    fn add(&mut self, file: &mut impl Read, kind: u8, offset: u64, bytes: u64) -> Result<(), ReadFault> {
        let most = if kind == op::CHUNK { MAX_CHUNK_BYTES } else { MAX_RECORD_BYTES };
        match kind {
            op::CHUNK | op::SCHEMA | op::CHANNEL | op::MESSAGE if bytes > most => {
                Err(ReadFault::TooLong { bytes, most })
            }
            op::CHUNK => {
                let mut body = Vec::new();
                let length = (bytes - HEAD_BYTES as u64).min(MAX_CHUNK_HEAD_BYTES);
                file.take(length).read_to_end(&mut body)?;
                let start_ns = chunk::header(&body)?.0.message_start_time;
                self.parts.push(Part { is_chunk: true, offset, bytes, start_ns });
                Ok(())
            }
            op::SCHEMA | op::CHANNEL => {
                self.extend(offset, bytes, u64::MAX);
                Ok(())
            }
            op::MESSAGE => {
                let mut body = [0; MESSAGE_HEAD_BYTES];
                if bytes < (HEAD_BYTES + MESSAGE_HEAD_BYTES) as u64 {
                    return Err(ReadFault::Short);
                }
                file.read_exact(&mut body)?;
                self.extend(offset, bytes, message_head(&body)?.log_time);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Lengthens the last run, or begins one.
    fn extend(&mut self, offset: u64, bytes: u64, log_time_ns: u64) {
        if let Some(last) = self.parts.last_mut()
            && !last.is_chunk
            && last.offset + last.bytes == offset
            && last.bytes < RUN_BYTES
        {
            last.bytes += bytes;
            last.start_ns = last.start_ns.min(log_time_ns);
            return;
        }
        self.parts.push(Part { is_chunk: false, offset, bytes, start_ns: log_time_ns });
    }
}
