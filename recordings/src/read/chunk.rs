//! Unpacks a chunk: zstd and lz4 without C. In: the record. Out: its content, of the stated length and checksum.

use super::{MAX_CHUNK_BYTES, error::ReadFault, records::number};
use mcap::records::ChunkHeader;
use ruzstd::decoding::{
    StreamingDecoder,
    errors::{FrameDecoderError, ReadFrameHeaderError},
};
use std::io::Read;

/// Bytes of the fields before the name of the packing, and of its length.
const FIXED_BYTES: usize = 28;

/// The head of a chunk, and where its content begins in the record.
pub(super) fn header(body: &[u8]) -> Result<(ChunkHeader, usize), ReadFault> {
    let field = |at: usize, bytes: usize| Some(number(body.get(at..at.checked_add(bytes)?)?));
    let read = || {
        let name_bytes = usize::try_from(field(FIXED_BYTES, 4)?).ok()?;
        let name_end = (FIXED_BYTES + 4).checked_add(name_bytes)?;
        let compression = String::from_utf8(body.get(FIXED_BYTES + 4..name_end)?.to_vec()).ok()?;
        let header = ChunkHeader {
            message_start_time: field(0, 8)?,
            message_end_time: field(8, 8)?,
            uncompressed_size: field(16, 8)?,
            uncompressed_crc: field(24, 4)? as u32,
            compression,
            compressed_size: field(name_end, 8)?,
        };
        Some((header, name_end + 8))
    };
    read().ok_or(ReadFault::Short)
}

/// The records of a chunk.
pub(super) fn unpack(body: &[u8]) -> Result<Vec<u8>, ReadFault> {
    let (header, begin) = header(body)?;
    let bytes = header.uncompressed_size;
    if bytes > MAX_CHUNK_BYTES {
        return Err(ReadFault::TooLong { bytes, most: MAX_CHUNK_BYTES });
    }
    let size = bytes as usize;
    let packed = &body[begin..];
    let packed_bytes = usize::try_from(header.compressed_size).ok().and_then(|n| packed.get(..n));
    let packed = packed_bytes.ok_or(ReadFault::Short)?;
    let content = match header.compression.as_str() {
        "" => packed.to_vec(),
        "zstd" => unzstd(packed, size)?,
        "lz4" => at_most(lz4_flex::frame::FrameDecoder::new(packed), size)?,
        other => return Err(ReadFault::Packing(other.to_owned())),
    };
    if content.len() != size {
        let detail = format!("{} bytes instead of {size}", content.len());
        return Err(ReadFault::Unpack(detail));
    }
    let mut sum = flate2::Crc::new();
    sum.update(&content);
    // 0: the writer has not computed it.
    if header.uncompressed_crc != 0 && header.uncompressed_crc != sum.sum() {
        return Err(ReadFault::Checksum { stated: header.uncompressed_crc, found: sum.sum() });
    }
    Ok(content)
}

/// One or more frames, some of them to be skipped.
fn unzstd(mut packed: &[u8], size: usize) -> Result<Vec<u8>, ReadFault> {
    let mut content = Vec::new();
    while !packed.is_empty() && content.len() <= size {
        match StreamingDecoder::new_with_max_window_size(&mut packed, MAX_CHUNK_BYTES) {
            Ok(decoder) => content.extend(at_most(decoder, size - content.len())?),
            Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame {
                length, ..
            })) => packed = packed.get(length as usize..).ok_or(ReadFault::Short)?,
            Err(error) => return Err(ReadFault::Unpack(error.to_string())),
        }
    }
    Ok(content)
}

/// Reads to the end, and one byte over `size` at most: enough to see that there is more.
fn at_most(reader: impl Read, size: usize) -> Result<Vec<u8>, ReadFault> {
    let mut content = Vec::new();
    let most = size as u64 + 1;
    reader.take(most).read_to_end(&mut content).map_err(|e| ReadFault::Unpack(e.to_string()))?;
    Ok(content)
}
