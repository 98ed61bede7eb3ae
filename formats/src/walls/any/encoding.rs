//! Encodings of text files. In: bytes. Out: text without a byte order mark.

use super::WallFileError;
use flate2::read::MultiGzDecoder;
use std::io::Read as _;

/// Bytes in which an XML file says its encoding.
const XML_HEAD_BYTES: usize = 200;
/// Encodings whose letters are those of Unicode, a byte each.
const LATIN: [&str; 5] = ["iso-8859-1", "iso-8859-15", "iso_8859-1", "latin1", "windows-1252"];

/// The text of bytes that may be packed by gzip, as `.svgz` is. Errors: more than `max` bytes when
/// unpacked; another encoding than UTF-8, UTF-16 with a byte order mark, and Latin-1 where XML says
/// so.
pub(super) fn decoded(bytes: Vec<u8>, max: u64) -> Result<String, WallFileError> {
    let bytes = if bytes.starts_with(&[0x1f, 0x8b]) { unpacked(&bytes, max)? } else { bytes };
    match bytes.as_slice() {
        [0xef, 0xbb, 0xbf, rest @ ..] => utf8(rest.to_vec()),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        all if is_latin(all) => Ok(all.iter().map(|byte| char::from(*byte)).collect()),
        _ => utf8(bytes),
    }
}

fn unpacked(bytes: &[u8], max: u64) -> Result<Vec<u8>, WallFileError> {
    let mut plain = Vec::new();
    MultiGzDecoder::new(bytes).take(max + 1).read_to_end(&mut plain)?;
    if plain.len() as u64 > max { Err(WallFileError::TooLarge(max)) } else { Ok(plain) }
}

fn utf8(bytes: Vec<u8>) -> Result<String, WallFileError> {
    String::from_utf8(bytes).map_err(|_place| WallFileError::Encoding)
}

fn utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Result<String, WallFileError> {
    let (pairs, []) = bytes.as_chunks::<2>() else { return Err(WallFileError::Encoding) };
    let units: Vec<u16> = pairs.iter().map(|pair| unit(*pair)).collect();
    String::from_utf16(&units).map_err(|_place| WallFileError::Encoding)
}

fn is_latin(bytes: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(XML_HEAD_BYTES)]).to_lowercase();
    let said =
        head.strip_prefix("<?xml").and_then(|rest| rest.split_once("encoding=")?.1.split(['"', '\'']).nth(1));
    said.is_some_and(|said| LATIN.contains(&said))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::Write as _;

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "<?xml version='1.0'?><svg>Büro</svg>";
        let le: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let be: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
        packed.write_all(text.as_bytes()).unwrap();
        for bytes in [
            text.as_bytes().to_vec(),
            [&[0xef, 0xbb, 0xbf], text.as_bytes()].concat(),
            [&[0xff, 0xfe], &le[..]].concat(),
            [&[0xfe, 0xff], &be[..]].concat(),
            packed.finish().unwrap(),
        ] {
            assert_eq!(decoded(bytes, 1000).unwrap(), text);
        }
        for encoding in ["ISO-8859-1", "latin1", "windows-1252"] {
            let text = format!("<?xml version=\"1.0\" encoding=\"{encoding}\"?><svg>Büro</svg>");
            let bytes: Vec<u8> = text.chars().map(|letter| letter as u8).collect();
            assert_eq!(decoded(bytes, 1000).unwrap(), text);
        }
        for bytes in [&b"B\xfcro"[..], b"\xff\xfeB", b"\xff\xfe\x00\xd8", b"<?xml encoding='utf-8'?>\xfc"] {
            assert!(matches!(decoded(bytes.to_vec(), 1000), Err(WallFileError::Encoding)), "{bytes:?}");
        }
        let mut bomb = GzEncoder::new(Vec::new(), Compression::fast());
        bomb.write_all(&[b' '; 11]).unwrap();
        assert!(matches!(decoded(bomb.finish().unwrap(), 10), Err(WallFileError::TooLarge(10))));
    }
}
