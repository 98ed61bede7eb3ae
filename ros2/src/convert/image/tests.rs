//! Pixels of each encoding.

use super::*;

fn image<'a>(encoding: &'a str, width: u32, height: u32, step: u32, data: &'a [u8]) -> Image<'a> {
    Image { height, width, encoding, step, data, ..Image::default() }
}

#[test]
fn pixels_become_grey_and_padding_is_left_out() {
    let gray = |image: &Image<'_>| ImageRows::of(image).unwrap().to_gray8();
    assert_eq!(gray(&image("mono8", 2, 2, 3, &[1, 2, 99, 3, 4])), [1, 2, 3, 4]);
    assert_eq!(gray(&image("mono16", 1, 2, 2, &[1, 2, 3, 64])), [2, 64]);
    let big = Image { is_bigendian: 1, ..image("mono16", 1, 2, 2, &[1, 2, 64, 4]) };
    assert_eq!(gray(&big), [1, 64]);
    assert_eq!(gray(&image("yuv422", 2, 1, 4, &[9, 1, 9, 2])), [1, 2]);
    assert_eq!(gray(&image("yuv422_yuy2", 2, 1, 4, &[1, 9, 2, 9])), [1, 2]);
    let red = [76, 76, 76];
    assert_eq!(gray(&image("rgb8", 1, 1, 3, &[255, 0, 0]))[0], red[0]);
    assert_eq!(gray(&image("bgr8", 1, 1, 3, &[0, 0, 255]))[0], red[1]);
    assert_eq!(gray(&image("bgra8", 1, 1, 4, &[0, 0, 255, 255]))[0], red[2]);
    assert_eq!(gray(&image("rgba8", 1, 1, 4, &[255, 255, 255, 0])), [255]);
}

#[test]
fn colours_stay_and_padding_is_left_out() {
    let rgb = |encoding, width, step, data: &[u8]| {
        ImageRows::of(&image(encoding, width, 2, step, data)).unwrap().to_rgb8()
    };
    assert_eq!(rgb("rgb8", 1, 4, &[1, 2, 3, 99, 4, 5, 6]), Some(vec![1, 2, 3, 4, 5, 6]));
    assert_eq!(rgb("bgr8", 1, 3, &[3, 2, 1, 6, 5, 4]), Some(vec![1, 2, 3, 4, 5, 6]));
    assert_eq!(rgb("bgra8", 1, 4, &[3, 2, 1, 9, 6, 5, 4, 9]), Some(vec![1, 2, 3, 4, 5, 6]));
    assert_eq!(rgb("mono8", 1, 1, &[1, 2]), None);
    assert_eq!(rgb("mono16", 1, 2, &[1, 2, 3, 4]), None);
    // Cb 128, Cr 228 of two pixels: red above luma by 140, green below by 71; held to 0 to 255.
    let row = [128, 100, 228, 150];
    let pixels = [240, 29, 100, 255, 79, 150];
    assert_eq!(rgb("uyvy", 2, 4, &row.repeat(2)), Some(pixels.repeat(2)));
    let row = [100, 128, 150, 228];
    assert_eq!(rgb("yuv422_yuy2", 2, 4, &row.repeat(2)), Some(pixels.repeat(2)));
    // Three columns: the last pixel has Cb alone.
    let row = [128, 100, 228, 150, 128, 60];
    assert_eq!(rgb("yuv422", 3, 6, &row.repeat(2)).unwrap()[6..9], [60, 60, 60]);
}

#[test]
fn sizes_that_do_not_agree_are_refused() {
    let of = |w, h, step, data: &[u8]| ImageRows::of(&image("rgb8", w, h, step, data)).unwrap_err();
    assert_eq!(of(2, 1, 5, &[0; 6]), ImageError::Step { row: 6, step: 5 });
    assert_eq!(of(2, 2, 6, &[0; 11]), ImageError::Short { needed: 12, given: 11 });
    assert_eq!(of(0, 2, 6, &[0; 12]), ImageError::Empty { width: 0, height: 2 });
    let huge = of(u32::MAX / 3, u32::MAX, u32::MAX, &[0; 12]);
    assert!(matches!(huge, ImageError::Short { .. }));
    assert!(matches!(of(u32::MAX, 1, u32::MAX, &[]), ImageError::Step { .. }));
    let depth = ImageRows::of(&image("16UC1", 1, 1, 2, &[0; 2]));
    assert_eq!(depth, Err(ImageError::Encoding("16UC1".into())));
}

#[test]
fn compression_is_told_by_the_bytes() {
    let of = |format, data| Compression::of(&CompressedImage { format, data, ..CompressedImage::default() });
    assert_eq!(of("rgb8; jpeg compressed bgr8", &[0xff, 0xd8, 0xff, 0xe0]), Ok(Compression::Jpeg));
    assert_eq!(of("", b"\x89PNG\r\n"), Ok(Compression::Png));
    assert_eq!(of("webp", b"RIFF"), Err(ImageError::Format("webp".into())));
    assert!(of("16UC1; compressedDepth png", b"\x89PNG").is_err());
    assert!(of("jpeg", &[]).is_err());
}

#[test]
fn ten_and_twelve_bits_in_sixteen_are_not_black() {
    let gray = |encoding, levels: &[u16]| {
        let data: Vec<u8> = levels.iter().flat_map(|level| level.to_le_bytes()).collect();
        ImageRows::of(&image(encoding, 1, 2, data.len() as u32 / 2, &data)).unwrap().to_gray8()
    };
    assert_eq!(gray("mono16", &[1023, 512]), [255, 128]);
    assert_eq!(gray("mono16", &[4095, 1024]), [255, 64]);
    assert_eq!(gray("mono16", &[16_383, 8192]), [255, 128]);
    assert_eq!(gray("mono16", &[65_535, 8192]), [255, 32]);
    // Alpha does not count.
    assert_eq!(gray("rgba16", &[4095, 4095, 4095, 65_535, 0, 0, 0, 65_535]), [255, 0]);
}

#[test]
fn colours_that_pixels_share_are_theirs() {
    let rows =
        |encoding, height, data: &'static [u8]| ImageRows::of(&image(encoding, 2, height, 3, data)).unwrap();
    // Two rows of luma, one of Cb and Cr, each with a byte of padding; as in `uyvy` above.
    let nv12 = rows("nv12", 2, &[100, 150, 0, 100, 150, 0, 128, 228]);
    assert_eq!(nv12.to_gray8(), [100, 150, 100, 150]);
    assert_eq!(nv12.to_rgb8().unwrap(), [240, 29, 100, 255, 79, 150].repeat(2));
    let nv21 = rows("nv21", 2, &[100, 150, 0, 100, 150, 0, 228, 128]);
    assert_eq!(nv21.to_rgb8(), nv12.to_rgb8());
    let bayer = rows("bayer_grbg8", 2, &[20, 200, 0, 40, 20]);
    assert_eq!(bayer.to_rgb8().unwrap(), [200, 20, 40].repeat(4));
    assert_eq!(bayer.to_gray8(), [76; 4]);
    let odd = ImageRows::of(&image("nv12", 3, 2, 3, &[0; 9]));
    assert_eq!(odd, Err(ImageError::Odd { encoding: "nv12".into(), width: 3, height: 2 }));
    let short = ImageRows::of(&image("nv12", 2, 2, 2, &[0; 5]));
    assert_eq!(short, Err(ImageError::Short { needed: 6, given: 5 }));
}
