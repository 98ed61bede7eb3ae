use super::*;
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png::PngEncoder};
use protos::{prost::bytes::Bytes, v1};

/// A smooth picture, so that JPEG keeps it within a few levels.
fn rgb(width: u32, height: u32) -> Vec<u8> {
    let pixel = |i: u32| [(i % width * 3) as u8 / 2 + 40, (i / width * 2) as u8 + 30, (i % 7) as u8 + 100];
    (0..width * height).flat_map(pixel).collect()
}

fn as_png(raw: &[u8], width: u32, height: u32, colours: ExtendedColorType) -> Vec<u8> {
    let mut out = Vec::new();
    PngEncoder::new(&mut out).write_image(raw, width, height, colours).unwrap();
    out
}

fn as_jpeg(raw: &[u8], width: u32, height: u32, colours: ExtendedColorType) -> Vec<u8> {
    let mut out = Vec::new();
    JpegEncoder::new_with_quality(&mut out, 95).write_image(raw, width, height, colours).unwrap();
    out
}

fn frame(encoding: v1::ImageEncoding, width_px: u32, height_px: u32, image: Vec<u8>) -> CheckedFrame {
    let image = Bytes::from(image);
    let wire = v1::Frame { encoding: encoding.into(), width_px, height_px, image, ..v1::Frame::default() };
    CheckedFrame::try_from(wire).unwrap()
}

fn refused(result: Result<Picture, Rejection>) -> (Code, String) {
    let r = result.unwrap_err();
    (r.code, r.field)
}

#[test]
fn jpeg_and_png_of_one_picture_give_the_same_grey() {
    let raw = rgb(64, 48);
    let png = decode_upload(&as_png(&raw, 64, 48, ExtendedColorType::Rgb8), ImageLimits::UPLOAD).unwrap();
    let jpeg = decode_upload(&as_jpeg(&raw, 64, 48, ExtendedColorType::Rgb8), ImageLimits::UPLOAD).unwrap();
    assert_eq!((png.width(), png.height()), (64, 48));
    let worst = png.grey().data().iter().zip(jpeg.grey().data()).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(worst <= 4, "{worst} levels apart");
    // Against the weights in floating point.
    for (p, y) in raw.chunks_exact(3).zip(png.grey().data()) {
        let exact = 0.299 * f64::from(p[0]) + 0.587 * f64::from(p[1]) + 0.114 * f64::from(p[2]);
        assert!((exact - f64::from(*y)).abs() < 0.51);
    }
}

#[test]
fn every_depth_and_colour_of_png_is_read() {
    let grey: Vec<u8> = (0..12).map(|i| i * 20).collect();
    let l8 = as_png(&grey, 4, 3, ExtendedColorType::L8);
    assert_eq!(decode_upload(&l8, ImageLimits::UPLOAD).unwrap().grey().data(), grey);
    let la8: Vec<u8> = grey.iter().flat_map(|g| [*g, 255]).collect();
    let la8 = as_png(&la8, 4, 3, ExtendedColorType::La8);
    assert_eq!(decode_upload(&la8, ImageLimits::UPLOAD).unwrap().grey().data(), grey);
    let wide: Vec<u8> = grey.iter().flat_map(|g| u16::from_be_bytes([*g, 77]).to_ne_bytes()).collect();
    let l16 = as_png(&wide, 4, 3, ExtendedColorType::L16);
    assert_eq!(decode_upload(&l16, ImageLimits::UPLOAD).unwrap().grey().data(), grey);
    let rgba: Vec<u8> = grey.iter().flat_map(|g| [*g, *g, *g, 255]).collect();
    let rgba = as_png(&rgba, 4, 3, ExtendedColorType::Rgba8);
    assert_eq!(decode_upload(&rgba, ImageLimits::UPLOAD).unwrap().grey().data(), grey);
    let rgb16: Vec<u8> = wide.chunks_exact(2).flat_map(|s| s.repeat(3)).collect();
    let rgb16 = as_png(&rgb16, 4, 3, ExtendedColorType::Rgb16);
    assert_eq!(decode_upload(&rgb16, ImageLimits::UPLOAD).unwrap().grey().data(), grey);
}

/// A logo on nothing is taught as it is printed: on white.
#[test]
fn what_is_transparent_is_white() {
    let decode = |raw: &[u8], colours| {
        decode_upload(&as_png(raw, 3, 1, colours), ImageLimits::UPLOAD).unwrap().into_grey().data().to_vec()
    };
    assert_eq!(decode(&[100, 255, 100, 0, 0, 128], ExtendedColorType::La8), [100, 255, 127]);
    let rgba = [0, 0, 0, 0, 200, 200, 200, 255, 255, 0, 0, 0];
    assert_eq!(decode(&rgba, ExtendedColorType::Rgba8), [255, 200, 255]);
    let wide: Vec<u8> =
        [20_000_u16, 65_535, 20_000, 0, 65_535, 65_535].iter().flat_map(|s| s.to_ne_bytes()).collect();
    assert_eq!(decode(&wide, ExtendedColorType::La16), [78, 255, 255]);
}

#[test]
fn ten_and_twelve_bits_in_sixteen_are_not_black() {
    let decode = |samples: [u16; 3], colours| {
        let raw: Vec<u8> = samples.iter().flat_map(|sample| sample.to_ne_bytes()).collect();
        let width = if colours == ExtendedColorType::L16 { 3 } else { 1 };
        decode_upload(&as_png(&raw, width, 1, colours), ImageLimits::UPLOAD)
            .unwrap()
            .into_grey()
            .data()
            .to_vec()
    };
    assert_eq!(decode([1023, 512, 0], ExtendedColorType::L16), [255, 128, 0]);
    assert_eq!(decode([4095, 2048, 16], ExtendedColorType::L16), [255, 128, 1]);
    assert_eq!(decode([65_535, 2048, 0], ExtendedColorType::L16), [255, 8, 0]);
    assert_eq!(decode([4095, 4095, 4095], ExtendedColorType::Rgb16), [255]);
}

/// USB cameras' MJPEG: the tables are those of the standard, and left out.
#[test]
fn a_jpeg_without_huffman_tables_has_the_standard_ones() {
    let raw = rgb(64, 48);
    let whole = as_jpeg(&raw, 64, 48, ExtendedColorType::Rgb8);
    let (mut bare, mut at) = (whole[..2].to_vec(), 2);
    while whole[at + 1] != 0xda {
        let end = at + 2 + usize::from(u16::from_be_bytes([whole[at + 2], whole[at + 3]]));
        if whole[at + 1] != 0xc4 {
            bare.extend_from_slice(&whole[at..end]);
        }
        at = end;
    }
    bare.extend_from_slice(&whole[at..]);
    assert!(bare.len() + 400 < whole.len());
    let decode = |bytes: &[u8]| decode_upload(bytes, ImageLimits::UPLOAD).unwrap();
    assert_eq!(decode(&bare), decode(&whole));
    let frame = frame(v1::ImageEncoding::Jpeg, 64, 48, bare);
    assert_eq!(decode_frame(&frame, ImageLimits::FRAME).unwrap(), decode(&whole));
}

/// First bytes of files of other formats, and words of the refusal.
#[test]
fn other_formats_are_refused_by_name() {
    let heic = b"\0\0\0\x18ftypheic\0\0\0\0mif1heic".as_slice();
    for (bytes, words) in [
        (heic, "Most Compatible"),
        (b"\0\0\0\x18ftypmif1", "HEIC"),
        (b"\0\0\0\x18ftypavif", "AVIF"),
        (b"BM\x36\0", "BMP file; only JPEG and PNG are read. Save it as one of them"),
        (b"II*\0\x08\0", "TIFF"),
        (b"MM\0*\0\0", "TIFF"),
        (b"RIFF\x10\0\0\0WEBPVP8 ", "WebP"),
        (b"GIF89a", "GIF"),
        (b"\xff\x0a\xfa", "JPEG XL"),
        (b"\0\0\0\x0cJXL \x0d", "JPEG XL"),
        (b"%PDF-1.7", "PDF"),
        (b"<svg xmlns", "SVG"),
        (b"<?xml version", "XML"),
        (b"", "empty"),
        (b"hello", "neither a JPEG nor a PNG"),
        (b"\xff\xd8", "neither a JPEG nor a PNG"),
    ] {
        let refused = decode_upload(bytes, ImageLimits::UPLOAD).unwrap_err();
        assert_eq!((refused.code, &*refused.field), (Code::WrongEncoding, "image"), "{words}");
        assert!(refused.detail.contains(words), "{refused}");
    }
}

#[test]
fn a_photograph_over_the_limit_is_told_its_size() {
    let mut png = as_png(&[0; 12], 4, 3, ExtendedColorType::L8);
    png[16..24].copy_from_slice(&[0, 0, 0x1f, 0x40, 0, 0, 0x17, 0x70]);
    let refused = decode_upload(&png, ImageLimits::UPLOAD).unwrap_err();
    assert_eq!(refused.code, Code::TooLarge);
    assert!(
        refused
            .detail
            .ends_with("8000x6000 px are more than 16777216 in all: shrink it to 4729x3547 px or less"),
        "{refused}"
    );
}

/// Every level of each colour, and mixtures.
#[test]
fn raw_colour_gives_the_planes_of_the_same_png() {
    let rgb: Vec<u8> = (0..64 * 48_u32)
        .flat_map(|i| [(i % 256) as u8, (i * 7 / 3 % 256) as u8, (i * i % 251) as u8])
        .collect();
    let bgr: Vec<u8> = rgb.chunks_exact(3).flat_map(|p| [p[2], p[1], p[0]]).collect();
    let png = as_png(&rgb, 64, 48, ExtendedColorType::Rgb8);
    let decode = |encoding, image| decode_frame(&frame(encoding, 64, 48, image), ImageLimits::FRAME).unwrap();
    let expected = decode(v1::ImageEncoding::Png, png);
    let planes = expected.colour().unwrap().each_ref().map(|plane| plane.data().to_vec());
    for (place, plane) in planes.iter().enumerate() {
        assert!(plane.iter().eq(rgb.iter().skip(place).step_by(3)));
    }
    assert_eq!(decode(v1::ImageEncoding::Rgb8, rgb.clone()), expected);
    assert_eq!(decode(v1::ImageEncoding::Bgr8, bgr), expected);
    let with_alpha = |high: u8| -> Vec<u8> {
        let sample =
            |s: u8| if high == 0 { vec![s] } else { u16::from_be_bytes([s, high]).to_ne_bytes().to_vec() };
        rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255].into_iter().flat_map(sample)).collect()
    };
    for (colours, raw) in
        [(ExtendedColorType::Rgba8, with_alpha(0)), (ExtendedColorType::Rgba16, with_alpha(77))]
    {
        let image = as_png(&raw, 64, 48, colours);
        assert_eq!(decode(v1::ImageEncoding::Png, image), expected, "{colours:?}");
    }
}

#[test]
fn a_colour_jpeg_gives_the_colours_and_the_luma_that_it_has() {
    let raw = rgb(64, 48);
    let file = as_jpeg(&raw, 64, 48, ExtendedColorType::Rgb8);
    let picture = decode_upload(&file, ImageLimits::UPLOAD).unwrap();
    let planes = picture.colour().unwrap();
    let worst = raw.chunks_exact(3).enumerate().flat_map(|(i, pixel)| {
        let (u, v) = (i % 64, i / 64);
        planes.iter().zip(pixel).map(move |(plane, level)| plane.at(u, v).abs_diff(*level))
    });
    let worst = worst.max().unwrap();
    assert!(worst <= 12, "{worst} levels apart");
    // Grey is luma, bit for bit, as a decoder gives it that leaves the colours out.
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::Luma);
    let luma = JpegDecoder::new_with_options(ZCursor::new(&file[..]), options).decode().unwrap();
    assert_eq!(picture.grey().data(), luma);
}

#[test]
fn grey_files_and_colour_files_of_grey_give_grey_pictures() {
    let grey: Vec<u8> = (0..64 * 48_u32).map(|i| (i % 64 * 3) as u8).collect();
    let tripled: Vec<u8> = grey.iter().flat_map(|g| [*g; 3]).collect();
    let (l8, rgb8) = (ExtendedColorType::L8, ExtendedColorType::Rgb8);
    let files = [as_png(&grey, 64, 48, l8), as_png(&tripled, 64, 48, rgb8), as_jpeg(&grey, 64, 48, l8)];
    for file in files.iter().chain([&as_jpeg(&tripled, 64, 48, rgb8)]) {
        let picture = decode_upload(file, ImageLimits::UPLOAD).unwrap();
        assert!(picture.colour().is_none());
        assert_eq!(picture.bytes(), 64 * 48);
    }
    let raw = decode_frame(&frame(v1::ImageEncoding::Rgb8, 64, 48, tripled), ImageLimits::FRAME).unwrap();
    assert_eq!(raw.grey().data(), grey);
    assert!(raw.colour().is_none());
}

/// What `memory_ceiling_mb` counts on.
#[test]
fn a_colour_picture_takes_four_bytes_a_pixel() {
    let picture = decode_upload(&as_jpeg(&rgb(64, 48), 64, 48, ExtendedColorType::Rgb8), ImageLimits::UPLOAD);
    assert_eq!(picture.unwrap().bytes(), PICTURE_BYTES_PER_PX * 64 * 48);
}

/// The server's own limits hold for raw frames as for others.
#[test]
fn raw_frames_at_the_bounds_of_the_server() {
    let wire = frame(v1::ImageEncoding::Rgb8, 4, 3, vec![9; 36]);
    let decode = |bytes, pixels| decode_frame(&wire, ImageLimits { bytes, pixels });
    assert!(decode(36, 12).is_ok());
    assert_eq!(refused(decode(35, 12)), (Code::TooLarge, "image".into()));
    assert_eq!(refused(decode(36, 11)), (Code::TooLarge, "image".into()));
}

#[test]
fn frames_must_be_what_they_claim() {
    let raw = rgb(40, 30);
    let jpeg = as_jpeg(&raw, 40, 30, ExtendedColorType::Rgb8);
    let png = as_png(&raw, 40, 30, ExtendedColorType::Rgb8);
    let decode = |encoding, w, h, image: &[u8]| {
        decode_frame(&frame(encoding, w, h, image.to_vec()), ImageLimits::FRAME)
    };
    assert_eq!(decode(v1::ImageEncoding::Jpeg, 40, 30, &jpeg).unwrap().width(), 40);
    assert_eq!(decode(v1::ImageEncoding::Png, 40, 30, &png).unwrap().height(), 30);
    assert_eq!(decode(v1::ImageEncoding::Gray8, 3, 2, &[7; 6]).unwrap().grey().data(), [7; 6]);
    let wrong = |w, h| refused(decode(v1::ImageEncoding::Jpeg, w, h, &jpeg));
    assert_eq!(wrong(41, 30), (Code::SizeMismatch, "width_px".into()));
    assert_eq!(wrong(40, 31), (Code::SizeMismatch, "height_px".into()));
    assert_eq!(
        refused(decode(v1::ImageEncoding::Png, 30, 40, &png)),
        (Code::SizeMismatch, "width_px".into())
    );
    assert_eq!(refused(decode(v1::ImageEncoding::Jpeg, 40, 30, &png)), (Code::WrongEncoding, "image".into()));
    assert_eq!(refused(decode(v1::ImageEncoding::Png, 40, 30, &jpeg)), (Code::WrongEncoding, "image".into()));
    assert_eq!(
        refused(decode(v1::ImageEncoding::Jpeg, 40, 30, b"not an image")),
        (Code::WrongEncoding, "image".into())
    );
}

#[test]
fn sizes_and_bytes_at_their_bounds() {
    let png = as_png(&[0; 12], 4, 3, ExtendedColorType::L8);
    let limits = |bytes, pixels| ImageLimits { bytes, pixels };
    assert!(decode_upload(&png, limits(png.len(), 12)).is_ok());
    assert_eq!(refused(decode_upload(&png, limits(png.len() - 1, 12))), (Code::TooLarge, "image".into()));
    assert_eq!(refused(decode_upload(&png, limits(png.len(), 11))), (Code::TooLarge, "image".into()));
    let jpeg = as_jpeg(&[0; 12], 4, 3, ExtendedColorType::L8);
    assert!(decode_upload(&jpeg, limits(jpeg.len(), 12)).is_ok());
    assert_eq!(refused(decode_upload(&jpeg, limits(jpeg.len(), 11))), (Code::TooLarge, "image".into()));
}

/// Headers that promise more than the limits, on small files: refused before anything is unpacked.
#[test]
fn bombs_are_refused_by_their_header() {
    let mut png = as_png(&[0; 12], 4, 3, ExtendedColorType::L8);
    png[16..20].copy_from_slice(&60_000_u32.to_be_bytes());
    assert_eq!(refused(decode_upload(&png, ImageLimits::UPLOAD)), (Code::OutOfRange, "image".into()));
    png[16..24].copy_from_slice(&[0, 0, 0x1f, 0xff, 0, 0, 0x1f, 0xff]);
    assert_eq!(refused(decode_upload(&png, ImageLimits::UPLOAD)), (Code::TooLarge, "image".into()));
    let mut jpeg = as_jpeg(&[0; 12], 4, 3, ExtendedColorType::L8);
    let sof = jpeg.windows(2).position(|w| w == [0xFF, 0xC0]).unwrap();
    jpeg[sof + 5..sof + 9].copy_from_slice(&[0x1f, 0xff, 0x1f, 0xff]);
    assert_eq!(refused(decode_upload(&jpeg, ImageLimits::UPLOAD)), (Code::TooLarge, "image".into()));
    jpeg[sof + 5..sof + 9].copy_from_slice(&[0xff, 0xff, 0xff, 0xff]);
    assert!(decode_upload(&jpeg, ImageLimits::UPLOAD).is_err());
    jpeg[sof + 5..sof + 9].copy_from_slice(&[0, 0, 0, 0]);
    assert!(decode_upload(&jpeg, ImageLimits::UPLOAD).is_err());
}

#[test]
fn every_truncation_is_refused() {
    let raw = rgb(40, 30);
    for whole in
        [as_jpeg(&raw, 40, 30, ExtendedColorType::Rgb8), as_png(&raw, 40, 30, ExtendedColorType::Rgb8)]
    {
        // A whole file without its end marker still holds every pixel: cut at least into the data.
        for cut in (0..whole.len() - 20).step_by(7) {
            let r = decode_upload(&whole[..cut], ImageLimits::UPLOAD).expect_err("truncated");
            assert!(matches!(r.code, Code::BadImage | Code::WrongEncoding), "{cut}: {r}");
            assert!(!r.detail.contains('\n'), "{cut}: {r}");
        }
    }
}

#[test]
fn damaged_bytes_never_panic() {
    let raw = rgb(40, 30);
    for whole in
        [as_jpeg(&raw, 40, 30, ExtendedColorType::Rgb8), as_png(&raw, 40, 30, ExtendedColorType::Rgb8)]
    {
        for at in 0..whole.len() {
            for value in [0, 0x7f, 0xff, whole[at] ^ 0x10] {
                let mut damaged = whole.clone();
                damaged[at] = value;
                match decode_upload(&damaged, ImageLimits::UPLOAD) {
                    Ok(image) => assert_eq!(image.grey().data().len(), image.width() * image.height()),
                    Err(refused) => assert!(!refused.detail.is_empty(), "{at}: {value}"),
                }
            }
        }
    }
}

/// Found by fuzzing: the decoder of png 0.18.1 panics on it.
#[test]
fn a_palette_of_no_whole_colours_is_refused() {
    let mut file =
        b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x08\0\0\0\x08\x08\x03\0\0\0\xf3\xd1\xb5\xb9".to_vec();
    file.extend(b"\0\0\0\x0dPLTE\0\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b\xdc\x4c\x61\0\0");
    let refusal = decode_upload(&file, ImageLimits { bytes: 1 << 16, pixels: 1 << 16 }).unwrap_err();
    assert_eq!(refusal.code, Code::BadImage);
    assert!(refusal.detail.contains("13 bytes of palette"), "{refusal:?}");
}
