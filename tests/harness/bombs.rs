//! Hostile images, made by code: sizes that lie, contents that unpack to far more than the file,
//! structures that no decoder likes.

use crate::{pictures, robots};
use flate2::{Compression, Crc, write::ZlibEncoder};
use std::io::Write as _;
use vision::frame::GrayImage;

/// Claimed size of every hostile frame.
pub const CLAIMED: (u32, u32) = (64, 48);
/// What the packed contents of the worst unpack to.
const UNPACKED: usize = 64 << 20;

/// Codes with which an image may be answered; [`TAKEN`]: it is an image after all.
pub type Codes = &'static [&'static str];
/// Not a code: the image is taken.
pub const TAKEN: &str = "taken";

const BAD: Codes = &["bad_image"];
const OTHER: Codes = &["wrong_encoding"];
const HARMLESS: Codes = &[TAKEN, "bad_image"];

/// A hostile image.
#[derive(Debug)]
pub struct Bomb {
    /// What it is.
    pub name: &'static str,
    /// The file.
    pub bytes: Vec<u8>,
    /// Codes of its refusal as a photograph.
    pub upload: Codes,
    /// Codes of its refusal as a frame of [`CLAIMED`] size, of the encoding that its first bytes
    /// say.
    pub frame: Codes,
}

fn chunk(kind: [u8; 4], data: &[u8]) -> Vec<u8> {
    let mut crc = Crc::new();
    crc.update(&kind);
    crc.update(data);
    let length = (data.len() as u32).to_be_bytes();
    [&length[..], &kind, data, &crc.sum().to_be_bytes()].concat()
}

/// `width x height` px of one colour type and depth; `before` stands before the pixels, which are
/// these packed bytes.
fn png(size: [u32; 2], [depth, colour, interlace]: [u8; 3], before: &[u8], packed: &[u8]) -> Vec<u8> {
    let [width, height] = size.map(u32::to_be_bytes);
    let header = [&width[..], &height, &[depth, colour, 0, 0, interlace]].concat();
    [
        b"\x89PNG\r\n\x1a\n",
        &chunk(*b"IHDR", &header)[..],
        before,
        &chunk(*b"IDAT", packed),
        &chunk(*b"IEND", &[]),
    ]
    .concat()
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut out = ZlibEncoder::new(Vec::new(), Compression::best());
    out.write_all(bytes).expect("in memory");
    out.finish().expect("in memory")
}

/// So many zeros, packed; never held as a whole.
fn packed_zeros(count: usize) -> Vec<u8> {
    let mut out = ZlibEncoder::new(Vec::new(), Compression::best());
    let block = vec![0; 1 << 20];
    for _ in 0..count >> 20 {
        out.write_all(&block).expect("in memory");
    }
    out.finish().expect("in memory")
}

/// The packed pixels of [`CLAIMED`] size, with this filter in every row.
fn rows(bytes_per_row: usize, filter: u8) -> Vec<u8> {
    let row: Vec<u8> = std::iter::once(filter).chain(std::iter::repeat_n(0x55, bytes_per_row)).collect();
    packed(&row.repeat(CLAIMED.1 as usize))
}

#[allow(clippy::too_many_lines, reason = "a table")]
fn pngs() -> Vec<Bomb> {
    let size = [CLAIMED.0, CLAIMED.1];
    let good = rows(64, 0);
    let bomb = |name, bytes, upload, frame| Bomb { name, bytes, upload, frame };
    let grey = |before: &[u8], packed: &[u8]| png(size, [8, 0, 0], before, packed);
    let sized = |width, height| png([width, height], [8, 0, 0], &[], &good);
    let lies: Codes = &["size_mismatch"];
    let text = |keyword: &str, rest: &[u8]| [keyword.as_bytes(), rest].concat();
    let damaged = |at: usize| {
        let mut bytes = grey(&[], &good);
        bytes[at] ^= 0xff;
        bytes
    };
    let zeros = packed_zeros(UNPACKED);
    let whole = grey(&[], &good);
    vec![
        bomb("png of 16k x 16k", sized(16_384, 16_384), &["out_of_range"], lies),
        bomb("png of 65535 x 1", sized(65_535, 1), &["out_of_range"], lies),
        bomb("png of the largest size", sized(u32::MAX, u32::MAX), &["out_of_range"], lies),
        bomb("png without width", sized(0, 48), &["out_of_range"], lies),
        bomb("png without height", sized(64, 0), &["out_of_range"], lies),
        bomb("png of 8191 x 8191", sized(8191, 8191), &["too_large"], lies),
        bomb(
            "png of 4096 x 4096 in 64 bits, nearly empty",
            png([4096, 4096], [16, 6, 0], &[], &good),
            BAD,
            lies,
        ),
        bomb("png whose pixels unpack to 64 MB", grey(&[], &zeros), HARMLESS, HARMLESS),
        bomb(
            "png with a colour profile of 64 MB",
            grey(&chunk(*b"iCCP", &text("x", &[&[0, 0], &zeros[..]].concat())), &good),
            HARMLESS,
            HARMLESS,
        ),
        bomb(
            "png with a text of 64 MB",
            grey(&chunk(*b"zTXt", &text("x", &[&[0, 0], &zeros[..]].concat())), &good),
            HARMLESS,
            HARMLESS,
        ),
        bomb(
            "png with 3 MB of text",
            grey(&chunk(*b"tEXt", &text("x", &vec![0x20; 3 << 20])), &good),
            HARMLESS,
            &["too_large"],
        ),
        bomb(
            "png with 10 000 texts",
            grey(&chunk(*b"tEXt", b"a\0b").repeat(10_000), &good),
            HARMLESS,
            HARMLESS,
        ),
        bomb("png with a damaged header", damaged(30), BAD, BAD),
        bomb("png with damaged pixels", damaged(whole.len() - 20), BAD, BAD),
        bomb("png of 3 bits", png(size, [3, 0, 0], &[], &good), BAD, BAD),
        bomb("png of colour type 1", png(size, [8, 1, 0], &[], &good), BAD, BAD),
        bomb("png without its palette", png(size, [8, 3, 0], &[], &good), BAD, BAD),
        bomb(
            "png beyond its palette",
            png(size, [8, 3, 0], &chunk(*b"PLTE", &[1, 2, 3]), &good),
            HARMLESS,
            HARMLESS,
        ),
        bomb("png of an unknown interlace", png(size, [8, 0, 9], &[], &good), BAD, BAD),
        bomb("png whose interlaced pixels end early", png(size, [8, 0, 1], &[], &packed(&[0; 9])), BAD, BAD),
        bomb(
            "png with 2^31 frames",
            grey(&chunk(*b"acTL", &[0x7f, 0xff, 0xff, 0xff, 0, 0, 0, 0]), &good),
            HARMLESS,
            HARMLESS,
        ),
        bomb("png of an unknown filter", grey(&[], &rows(64, 9)), BAD, BAD),
        bomb("png whose pixels are not packed", grey(&[], &[0xff; 500]), BAD, BAD),
        bomb("png that ends in its header", whole[..20].to_vec(), BAD, BAD),
        bomb("png that ends in its pixels", whole[..whole.len() - 30].to_vec(), BAD, BAD),
        bomb(
            "png with a chunk of 4 GB",
            {
                let mut bytes = whole[..33].to_vec();
                bytes.extend([0xff, 0xff, 0xff, 0xff]);
                bytes.extend(b"IDAT and no more");
                bytes
            },
            BAD,
            BAD,
        ),
    ]
}

/// Place of a marker in a JPEG file.
fn marker(jpeg: &[u8], kind: u8) -> usize {
    jpeg.windows(2).position(|w| w == [0xff, kind]).expect("the marker")
}

/// A segment with a marker.
fn segment(kind: u8, data: &[u8]) -> Vec<u8> {
    [&[0xff, kind][..], &((data.len() + 2) as u16).to_be_bytes(), data].concat()
}

#[allow(clippy::too_many_lines, reason = "a table")]
fn jpegs() -> Vec<Bomb> {
    let blocks = pictures::blocks(3, 64, 48);
    let good = robots::jpeg(&GrayImage::from_fn(64, 48, |u, v| blocks[v * 64 + u]));
    let bomb = |name, bytes, upload, frame| Bomb { name, bytes, upload, frame };
    let frame_at = marker(&good, 0xc0);
    let changed = |at: usize, new: &[u8]| {
        let mut bytes = good.clone();
        bytes[at..at + new.len()].copy_from_slice(new);
        bytes
    };
    let sized = |[height, width]: [u16; 2]| {
        changed(frame_at + 5, &[height.to_be_bytes(), width.to_be_bytes()].concat())
    };
    let without = |kind: u8| {
        let mut bytes = good.clone();
        let at = marker(&bytes, kind);
        let length = usize::from(u16::from_be_bytes([bytes[at + 2], bytes[at + 3]]));
        bytes.drain(at..at + 2 + length);
        bytes
    };
    let after_start = |segments: &[u8]| [&good[..2], segments, &good[2..]].concat();
    let scan_at = marker(&good, 0xda);
    let (head, scan) = (&good[..scan_at], &good[scan_at..good.len() - 2]);
    let progressive = |scans: usize| {
        let mut head = head.to_vec();
        head[frame_at + 1] = 0xc2;
        [head, scan.repeat(scans), vec![0xff, 0xd9]].concat()
    };
    let loop_in_exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x08\0\0\0\x08";
    vec![
        bomb(
            "jpeg of 65535 x 65535",
            sized([0xffff, 0xffff]),
            &["bad_image", "out_of_range"],
            &["bad_image", "size_mismatch"],
        ),
        bomb("jpeg of 8191 x 8191", sized([8191, 8191]), &["too_large"], &["size_mismatch"]),
        bomb(
            "jpeg without a size",
            sized([0, 0]),
            &["bad_image", "out_of_range"],
            &["bad_image", "size_mismatch"],
        ),
        bomb("jpeg that ends in its pixels", good[..scan_at + 200].to_vec(), BAD, BAD),
        bomb("jpeg that ends in its header", good[..frame_at + 3].to_vec(), BAD, BAD),
        bomb("jpeg with 1000 scans", progressive(1_000), BAD, BAD),
        bomb("jpeg of 255 colours", changed(frame_at + 9, &[255]), BAD, BAD),
        bomb("jpeg of 12 bits", changed(frame_at + 4, &[12]), BAD, BAD),
        bomb("jpeg in arithmetic code", changed(frame_at + 1, &[0xc9]), BAD, BAD),
        bomb("jpeg without loss", changed(frame_at + 1, &[0xc3]), BAD, BAD),
        bomb("jpeg without a table of codes", without(0xc4), BAD, BAD),
        bomb("jpeg without a table of steps", without(0xdb), BAD, BAD),
        bomb("jpeg with a segment of no length", after_start(&[0xff, 0xe0, 0, 0]), BAD, BAD),
        bomb(
            "jpeg with 3 MB of comments",
            after_start(&segment(0xfe, &[0x20; 60_000]).repeat(50)),
            HARMLESS,
            &["too_large"],
        ),
        bomb(
            "jpeg with 3 MB of colour profiles",
            after_start(&segment(0xe2, &[7; 60_000]).repeat(50)),
            HARMLESS,
            &["too_large"],
        ),
        bomb("jpeg whose Exif names itself", after_start(&segment(0xe1, loop_in_exif)), HARMLESS, HARMLESS),
        bomb("jpeg with restarts that do not come", after_start(&segment(0xdd, &[0, 1])), HARMLESS, HARMLESS),
        bomb(
            "jpeg of a million beginnings",
            [0xff, 0xd8].repeat(500_000),
            &["bad_image", "wrong_encoding"],
            &["bad_image", "wrong_encoding"],
        ),
        bomb(
            "jpeg that is an archive, too",
            [&good[..], b"PK\x05\x06", &[0; 18]].concat(),
            HARMLESS,
            HARMLESS,
        ),
        bomb(
            "png that goes on as a jpeg",
            [b"\x89PNG\r\n\x1a\n", &good[..]].concat(),
            &["bad_image", "out_of_range"],
            &["bad_image", "size_mismatch"],
        ),
    ]
}

/// All of them.
pub fn bombs() -> Vec<Bomb> {
    let others: [(&'static str, &[u8]); 5] = [
        ("a page", b"<html><script>alert(1)</script></html>"),
        ("a gif", b"GIF89a\xff\xff\xff\xff\x80\0\0"),
        ("a webp", b"RIFF\xff\xff\xff\x7fWEBPVP8 "),
        ("a bmp", b"BM\xff\xff\xff\x7f\0\0\0\0\x36\0\0\0\x28\0\0\0\xff\xff\xff\x7f\xff\xff\xff\x7f"),
        ("a drawing", b"<svg xmlns='http://www.w3.org/2000/svg' width='1e9' height='1e9'/>"),
    ];
    let other = |(name, bytes): (&'static str, &[u8])| Bomb {
        name,
        bytes: bytes.to_vec(),
        upload: OTHER,
        frame: OTHER,
    };
    pngs().into_iter().chain(jpegs()).chain(others.map(other)).collect()
}
