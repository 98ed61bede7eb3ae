//! Pictures side by side and one above the other, with words above them.

use cli::drawing::{Colour, Picture};
use vision::{frame::GrayImage, geometry::Corners, icon::Icon};

/// Distance from one panel to the next.
pub(crate) const GAP_PX: usize = 10;
/// Pixels a dot of the letters of titles.
const DOT_PX: usize = 2;
/// Height of a line of words.
const LINE_PX: usize = 22;

/// Words of one colour.
pub(crate) type Words<'a> = (&'a str, Colour);

/// A picture with a line of words above it.
pub(crate) fn titled(picture: &Picture, words: &str, colour: Colour) -> Picture {
    let width = picture.width().max(2 + width_px(words));
    let mut out = Picture::black(width, picture.height() + LINE_PX);
    out.text([2, 4], DOT_PX, words, colour);
    out.paste(picture, [0, LINE_PX]);
    out
}

/// Side by side, tops level.
pub(crate) fn row(pictures: &[Picture]) -> Picture {
    let gaps = GAP_PX * pictures.len().saturating_sub(1);
    let width = pictures.iter().map(Picture::width).sum::<usize>() + gaps;
    let mut out = Picture::black(width, pictures.iter().map(Picture::height).max().unwrap_or(0));
    let mut left = 0;
    for picture in pictures {
        out.paste(picture, [left, 0]);
        left += picture.width() + GAP_PX;
    }
    out
}

/// One above the other, left sides level.
pub(crate) fn column(pictures: &[Picture]) -> Picture {
    let gaps = GAP_PX * pictures.len().saturating_sub(1);
    let height = pictures.iter().map(Picture::height).sum::<usize>() + gaps;
    let mut out = Picture::black(pictures.iter().map(Picture::width).max().unwrap_or(0), height);
    let mut top = 0;
    for picture in pictures {
        out.paste(picture, [0, top]);
        top += picture.height() + GAP_PX;
    }
    out
}

/// Words below a picture, as many of them in a line as there is room for.
pub(crate) fn explained(picture: Picture, words: &[Words<'_>]) -> Picture {
    let room = picture.width() / width_px("-");
    let (mut lines, mut taken): (Vec<Vec<Words<'_>>>, usize) = (vec![vec![]], 0);
    for word in words {
        let needed = word.0.chars().count() + 2;
        if taken > 0 && taken + needed > room {
            lines.push(vec![]);
            taken = 0;
        }
        taken += needed;
        if let Some(line) = lines.last_mut() {
            line.push(*word);
        }
    }
    lines.iter().fold(picture, |picture, line| picture.with_legend(line))
}

/// Width of words as they are written above a picture.
fn width_px(words: &str) -> usize {
    words.chars().count() * (sim::font::COLUMNS + 1) * DOT_PX
}

/// A part of an image: left, top, width, height, cut at its border.
pub(crate) fn cut(image: &GrayImage, [left, top, width, height]: [usize; 4]) -> GrayImage {
    let (left, top) = (left.min(image.width() - 1), top.min(image.height() - 1));
    let (width, height) = (width.min(image.width() - left), height.min(image.height() - top));
    GrayImage::from_fn(width, height, |u, v| image.at(left + u, top + v))
}

/// Left, top, width and height of the box around corners, wider by `margin` on all sides, within an
/// image.
pub(crate) fn around(corners: &Corners, margin: f64, image: &GrayImage) -> [usize; 4] {
    let span = |axis: usize, size: usize| {
        let values = corners.points().map(|c| c[axis]);
        let low = values.into_iter().fold(f64::INFINITY, f64::min) - margin;
        let high = values.into_iter().fold(f64::NEG_INFINITY, f64::max) + margin;
        let from = low.max(0.0) as usize;
        (from, (high.min(size as f64 - 1.0) as usize + 1).saturating_sub(from).max(1))
    };
    let ((left, width), (top, height)) = (span(0, image.width()), span(1, image.height()));
    [left, top, width, height]
}

/// An icon, enlarged.
pub(crate) fn icon(icon: &Icon, factor: usize) -> Picture {
    Picture::of(&gray(icon.size, &icon.pixels), 1.0).enlarged(factor)
}

/// Square grey levels as an image.
pub(crate) fn gray(side: usize, pixels: &[f32]) -> GrayImage {
    GrayImage::from_fn(side, side, |u, v| pixels[v * side + u].round() as u8)
}

/// A point of a picture after it was enlarged.
pub(crate) fn on([x, y]: [f64; 2], factor: usize) -> [f64; 2] {
    [x, y].map(|c| (c + 0.5) * factor as f64 - 0.5)
}

/// From `low` at 0 over `middle` at a half to `high` at 1.
pub(crate) fn scale(at: f64, [low, middle, high]: [Colour; 3]) -> Colour {
    let at = at.clamp(0.0, 1.0);
    let (from, to, share) = if at < 0.5 { (low, middle, 2.0 * at) } else { (middle, high, 2.0 * at - 1.0) };
    std::array::from_fn(|i| (f64::from(from[i]) * (1.0 - share) + f64::from(to[i]) * share).round() as u8)
}

/// An ellipse with its axes along those of the picture.
pub(crate) fn ring(picture: &mut Picture, centre: [f64; 2], half: [f64; 2], width_px: f64, colour: Colour) {
    let steps = (2.0 * half[0].max(half[1])).clamp(12.0, 90.0) as usize;
    let at = |i: usize| {
        let (sin, cos) = (std::f64::consts::TAU * i as f64 / steps as f64).sin_cos();
        [centre[0] + half[0] * cos, centre[1] + half[1] * sin]
    };
    for i in 0..steps {
        picture.line(at(i), at(i + 1), width_px, colour);
    }
}
