//! Claim: the images of other people's cameras are read, or refused with what is wrong with them.

use super::robot::{IMAGE, OPTICAL, frames, header, robot};
use protos::{CheckedFrame, v1};
use ros2::messages::{AnyMessage, Image};

/// Encoding, bytes of one pixel (or of 2 x 2 where pixels share colours), grey level, whether it
/// has colour.
const READ: &[(&str, &[u8], u8, bool)] = &[
    ("mono8", &[90], 90, false),
    ("8UC1", &[90], 90, false),
    ("mono16", &[0, 90], 90, false),
    ("rgb8", &[255, 0, 0], 76, true),
    ("bgr8", &[0, 0, 255], 76, true),
    ("8UC3", &[0, 0, 255], 76, true),
    ("rgba8", &[255, 0, 0, 0], 76, true),
    ("bgra8", &[0, 0, 255, 255], 76, true),
    ("8UC4", &[0, 0, 255, 9], 76, true),
    ("rgb16", &[0, 255, 0, 0, 0, 0], 76, true),
    ("bgr16", &[0, 0, 0, 0, 0, 255], 76, true),
    ("16UC3", &[0, 0, 0, 0, 0, 255], 76, true),
    ("rgba16", &[0, 255, 0, 0, 0, 0, 255, 255], 76, true),
    ("bgra16", &[0, 0, 0, 0, 0, 255, 255, 255], 76, true),
    ("16UC4", &[0, 0, 0, 0, 0, 255, 255, 255], 76, true),
    // Levels of 10, 12 and 14 bits.
    ("mono16", &[0xff, 0x03], 255, false),
    ("mono16", &[0xff, 0x0f], 255, false),
    ("mono16", &[0xff, 0x3f], 255, false),
    ("rgb16", &[0xff, 0x0f, 0, 0, 0, 0], 76, true),
    ("yuv422", &[128, 76], 76, true),
    ("uyvy", &[128, 76], 76, true),
    ("yuv422_yuy2", &[76, 128], 76, true),
    ("yuyv", &[76, 128], 76, true),
];

/// Those whose pixels share colours, with the rows of 4 x 2 pixels, and the grey of the first.
const SHARED: &[(&str, &[&[u8]], u8)] = &[
    ("bayer_rggb8", &[&[255, 0, 255, 0], &[0, 0, 0, 0]], 76),
    ("bayer_grbg8", &[&[0, 255, 0, 255], &[0, 0, 0, 0]], 76),
    ("bayer_gbrg8", &[&[0, 0, 0, 0], &[255, 0, 255, 0]], 76),
    ("bayer_bggr8", &[&[0, 0, 0, 0], &[0, 255, 0, 255]], 76),
    ("bayer_rggb16", &[&[0, 255, 0, 0, 0, 255, 0, 0], &[0, 0, 0, 0, 0, 0, 0, 0]], 76),
    ("bayer_grbg16", &[&[0xff, 3, 0, 0, 0xff, 3, 0, 0], &[0, 0, 0, 0, 0, 0, 0, 0]], 150),
    ("bayer_gbrg16", &[&[0, 0, 0, 0, 0, 0, 0, 0], &[0xff, 15, 0, 0, 0xff, 15, 0, 0]], 76),
    ("bayer_bggr16", &[&[0, 255, 0, 0, 0, 255, 0, 0], &[0, 0, 0, 0, 0, 0, 0, 0]], 29),
    ("nv12", &[&[76, 76, 76, 76], &[76, 76, 76, 76], &[85, 255, 85, 255]], 76),
    ("nv21", &[&[76, 76, 76, 76], &[76, 76, 76, 76], &[255, 85, 255, 85]], 76),
];

type Change = fn(&mut Image<'static>);

const REFUSED: &[(&str, Change, &str)] = &[
    ("depth", |i| (i.encoding, i.step) = ("16UC1", 8), "encoding `16UC1`"),
    ("depth as numbers", |i| i.encoding = "32FC1", "encoding `32FC1`"),
    ("no encoding", |i| i.encoding = "", "encoding ``"),
    ("another case", |i| i.encoding = "RGB8", "encoding `RGB8`"),
    ("no columns", |i| i.width = 0, "0 x 2"),
    ("no rows", |i| i.height = 0, "4 x 0"),
    ("step of a grey row for colours", |i| i.encoding = "rgb8", "rows of 12 bytes in a step of 4"),
    ("no step", |i| i.step = 0, "rows of 4 bytes in a step of 0"),
    ("fewer bytes", |i| i.height = 3, "12 bytes of pixels needed, 8 given"),
    ("no chroma", |i| i.encoding = "nv12", "12 bytes of pixels needed, 8 given"),
    ("a pattern of odd rows", |i| (i.encoding, i.height) = ("bayer_rggb8", 1), "even sides"),
];

fn image(encoding: &'static str, data: &'static [u8], step: u32) -> Image<'static> {
    let header = header(1500, OPTICAL);
    Image { header, height: 2, width: 4, encoding, is_bigendian: 0, step, data }
}

/// The frame, checked as the server checks it.
fn frame(image: Image<'_>) -> Result<v1::Frame, String> {
    let taken = robot().take(IMAGE, &AnyMessage::Image(image));
    if let [problem] = &taken.problems[..] {
        assert_eq!(problem.word(), "bad_image");
        return Err(problem.to_string());
    }
    let frame = frames(&taken)[0].0.clone();
    CheckedFrame::try_from(frame.clone()).map_err(|refused| format!("by the server: {refused}"))?;
    Ok(frame)
}

fn is_read(encoding: &'static str, data: Vec<u8>, step: usize, gray: u8, has_colour: bool) {
    let frame =
        frame(image(encoding, data.leak(), step as u32)).unwrap_or_else(|e| panic!("{encoding}: {e}"));
    assert_eq!(frame.encoding() == v1::ImageEncoding::Rgb8, has_colour, "{encoding}");
    let level = match frame.image[..] {
        [r, g, b, ..] if has_colour => 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b),
        [level, ..] => f64::from(level),
        [] => panic!("{encoding}: no pixels"),
    };
    assert!((level - f64::from(gray)).abs() < 1.5, "{encoding}: {level}, not {gray}");
}

#[test]
fn each_encoding_is_read() {
    for (encoding, pixel, gray, has_colour) in READ {
        is_read(encoding, pixel.repeat(8), pixel.len() * 4, *gray, *has_colour);
        // With padding.
        let row = [&pixel.repeat(4)[..], &[7; 3]].concat();
        is_read(encoding, row.repeat(2), row.len(), *gray, *has_colour);
    }
    for (encoding, rows, gray) in SHARED {
        is_read(encoding, rows.concat(), rows[0].len(), *gray, true);
    }
}

#[test]
fn what_is_not_read_is_refused_by_name() {
    for (name, change, words) in REFUSED {
        let mut image = image("mono8", &[9; 8], 4);
        change(&mut image);
        let refusal = frame(image).expect_err(name);
        assert!(refusal.contains(words), "{name}: {refusal}");
    }
}
