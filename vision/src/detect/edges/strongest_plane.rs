//! The gradients of a colour picture: at each pixel those of the plane with the strongest step
//! (method 1.1). In: red, green and blue. Out: two gradient planes, as of a grey image. Three
//! planes are filtered side by side, and their rows combined while they are in the cache.

#![expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]

use crate::{
    detect::edges::deriche::{FilterMemory, GradientRows, PlaneFilter, Planes, load, rest, vectors},
    frame::{COLOUR_PLANES, GrayImage},
};
use fearless_simd::{Select, Simd, prelude::*};

/// Weights of red, green and blue in the gradient of the grey image, [`crate::frame::luma`].
const GREY: [f32; COLOUR_PLANES] = [0.299, 0.587, 0.114];
/// Where grey falls along the gradient of the strongest plane by more than this share of it, the
/// gradient is turned round. Equal and opposite steps of two planes, one of them green, leave grey
/// 0.17 of their height: there the plane that happens to be the stronger must not decide.
const GREY_DECIDES: f32 = 1.0 / 6.0;

/// Working memory, reused from picture to picture.
#[derive(Debug, Clone, Default)]
pub(crate) struct ColourMemory {
    filters: [FilterMemory; COLOUR_PLANES],
    /// One row of gx and gy of each plane.
    rows: [[Vec<f32>; 2]; COLOUR_PLANES],
}

/// Fills the planes (gx, gy) as [`crate::detect::edges::deriche::gradients`] does. Where all three
/// planes are equal the gradient is that of the grey image, bit for bit.
///
/// A gradient has one direction for all planes, and two signs. It points to the side that is
/// brighter in grey; where that side is hardly brighter, to the one where the strongest plane
/// rises. So it is the same all along the edge between two colours.
#[inline(always)]
pub(crate) fn colour_gradients<S: Simd>(
    s: S,
    planes: &[GrayImage; COLOUR_PLANES],
    alpha: f32,
    memory: &mut ColourMemory,
    [gx, gy]: Planes,
    visitor: &mut impl GradientRows<S>,
) {
    let (width, filter) = (planes[0].width(), PlaneFilter::new(alpha));
    let ColourMemory { filters, rows } = memory;
    for (plane, memory) in planes.iter().zip(filters.iter_mut()) {
        filter.start(s, plane, memory);
    }
    for row in rows.iter_mut().flatten() {
        row.resize(width, 0.0);
    }
    for v in 0..planes[0].height() {
        for ([x, y], memory) in rows.iter_mut().zip(filters.iter_mut()) {
            filter.row(s, v, memory, [x, y]);
        }
        let row = v * width..(v + 1) * width;
        strongest(s, rows, [&mut gx[row.clone()], &mut gy[row.clone()]]);
        visitor.row(s, v, [&gx[..row.end], &gy[..row.end]]);
    }
}

/// One row of the strongest gradients.
#[inline(always)]
fn strongest<S: Simd>(s: S, rows: &[[Vec<f32>; 2]; COLOUR_PLANES], [gx, gy]: Planes) {
    let n = gx.len();
    let [red, green, blue] = rows.each_ref().map(|plane| plane.each_ref().map(|row| &row[..n]));
    for u in vectors::<S>(n) {
        let [r, g, b] = [red, green, blue].map(|plane| plane.map(|row| load(s, row, u)));
        let square = |[x, y]: [S::f32s; 2]| x * x + y * y;
        let stronger = |(best, most): ([S::f32s; 2], S::f32s), next: [S::f32s; 2]| {
            let other = square(next);
            let wins = other.simd_gt(most);
            ([wins.select(next[0], best[0]), wins.select(next[1], best[1])], wins.select(other, most))
        };
        let ([x, y], most) = stronger(stronger((g, square(g)), r), b);
        let grey = |k: usize| (r[k] * GREY[0] + g[k] * GREY[1]) + b[k] * GREY[2];
        let turned = (x * grey(0) + y * grey(1)).simd_lt(most * -GREY_DECIDES);
        turned.select(-x, x).store_slice(&mut gx[u..u + S::f32s::LEN]);
        turned.select(-y, y).store_slice(&mut gy[u..u + S::f32s::LEN]);
    }
    for u in rest::<S>(n) {
        [gx[u], gy[u]] = strongest_of([red, green, blue].map(|plane| plane.map(|row| row[u])));
    }
}

/// The strongest of the gradients of red, green and blue at one pixel, green before red before blue
/// of equal ones.
#[inline(always)]
fn strongest_of([r, g, b]: [[f32; 2]; COLOUR_PLANES]) -> [f32; 2] {
    let square = |[x, y]: [f32; 2]| x * x + y * y;
    let stronger = |best: [f32; 2], next: [f32; 2]| if square(next) > square(best) { next } else { best };
    let [x, y] = stronger(stronger(g, r), b);
    let grey = |k: usize| (r[k] * GREY[0] + g[k] * GREY[1]) + b[k] * GREY[2];
    let turned = x * grey(0) + y * grey(1) < square([x, y]) * -GREY_DECIDES;
    if turned { [-x, -y] } else { [x, y] }
}

#[cfg(test)]
#[path = "strongest_plane_tests.rs"]
mod tests;
