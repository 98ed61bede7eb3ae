//! Samples of a PNG as a picture: transparent pixels lie on white, samples of 16 bits become 8.

use super::{
    bad,
    colour::{from_rgb, plane},
};
use image::ColorType;
use protos::{Rejection, convert::sample_bits};
use vision::frame::Picture;

/// The largest sample of 8 bits: white, and opaque.
const FULL: u32 = 255;

/// A picture of the samples, 16-bit ones in native byte order. Error: colours that no PNG has.
pub(super) fn picture(size: (usize, usize), raw: &[u8], colours: ColorType) -> Result<Picture, Rejection> {
    let samples = usize::from(colours.channel_count());
    let used = samples - usize::from(colours.has_alpha());
    let narrow: Vec<u8>;
    let pixels = match colours {
        ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
            narrow = narrowed(raw, samples, used);
            &narrow[..]
        }
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => raw,
        other => return Err(bad("PNG", &format!("colours {other:?} are not supported"))),
    };
    match (used, colours.has_alpha()) {
        (1, false) => Ok(plane(size, pixels.to_vec())?.into()),
        (1, true) => Ok(plane(size, on_white::<2>(pixels).into_iter().step_by(2).collect())?.into()),
        (_, false) => from_rgb::<3>(size, pixels, [0, 1, 2]),
        (_, true) => from_rgb::<4>(size, &on_white::<4>(pixels), [0, 1, 2]),
    }
}

/// Samples of 8 bits of those of 16: the highest of the bits that the colours use. Alpha uses
/// all 16.
fn narrowed(raw: &[u8], samples: usize, used: usize) -> Vec<u8> {
    let (pairs, _) = raw.as_chunks::<2>();
    let wide = || pairs.iter().map(|pair| u16::from_ne_bytes(*pair));
    let most = wide().enumerate().filter(|(i, _)| i % samples < used).map(|(_, sample)| sample).max();
    let shift = sample_bits(most.unwrap_or(0)) - 8;
    let byte = |(i, sample): (usize, u16)| if i % samples < used { sample >> shift } else { sample >> 8 };
    wide().enumerate().map(|at| byte(at) as u8).collect()
}

/// Pixels of `N` samples, the last of them alpha, as they look on white.
fn on_white<const N: usize>(pixels: &[u8]) -> Vec<u8> {
    let (pixels, _) = pixels.as_chunks::<N>();
    let on_white = |pixel: &[u8; N]| {
        let alpha = u32::from(pixel[N - 1]);
        pixel.map(|sample| ((u32::from(sample) * alpha + FULL * (FULL - alpha) + FULL / 2) / FULL) as u8)
    };
    pixels.iter().flat_map(on_white).collect()
}
