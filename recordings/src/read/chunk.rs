//! Unpacks a chunk: zstd and lz4 without C. In: the record. Out: its content, of the stated length
//! and checksum.

use super::{MAX_CHUNK_BYTES, error::ReadFault};
use mcap::records::ChunkHeader;
use std::io::Read as _;

/// The records of a chunk.
pub(super) fn unpack(header: &ChunkHeader, packed: &[u8]) -> Result<Vec<u8>, ReadFault> {
    let bytes = header.uncompressed_size;
    if bytes > MAX_CHUNK_BYTES {
        return Err(ReadFault::TooLong { bytes, most: MAX_CHUNK_BYTES });
    }
    let mut content = Vec::new();
    match header.compression.as_str() {
        "" => content.extend(packed),
        "zstd" => {
            content = vec![0; bytes as usize];
            let mut frames = ruzstd::decoding::FrameDecoder::new();
            frames.set_max_window_size(MAX_CHUNK_BYTES);
            let length = frames.decode_all(packed, &mut content);
            content.truncate(length.map_err(|e| ReadFault::Unpack(e.to_string()))?);
        }
        "lz4" => {
            // One byte over: enough to see that there is more.
            let mut frame = lz4_flex::frame::FrameDecoder::new(packed).take(bytes + 1);
            frame.read_to_end(&mut content).map_err(|e| ReadFault::Unpack(e.to_string()))?;
        }
        other => return Err(ReadFault::Packing(other.to_owned())),
    }
    if content.len() as u64 != bytes {
        return Err(ReadFault::Unpack(format!("{} bytes instead of {bytes}", content.len())));
    }
    let mut sum = flate2::Crc::new();
    sum.update(&content);
    // 0: the writer has not computed it.
    if header.uncompressed_crc != 0 && header.uncompressed_crc != sum.sum() {
        return Err(ReadFault::Checksum { stated: header.uncompressed_crc, found: sum.sum() });
    }
    Ok(content)
}
