//! Descriptors that do not identify a landmark: straight edges, bars and right angles along the
//! sides of its rectangle. Frames, mats, panels, window bars and door leaves have them, and so do
//! distractors.

use crate::points::{
    descriptor::{Descriptor, VALUES, Window, describe},
    keypoints::Octave,
};
use fearless_simd::{Level, dispatch};
use std::sync::LazyLock;

/// Side of a drawn structure, in pixels, and the scale at which it is described: a window of 12
/// scales and its rim.
const SIDE: usize = 48;
const SIGMA: f32 = 2.0;
/// Offsets of a structure from the centre of the window, in pixels.
const OFFSETS: [f32; 7] = [-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0];
/// Widths of bars, in pixels.
const WIDTHS: [f32; 3] = [4.0, 8.0, 14.0];
/// Smoothing of the drawn edges, in pixels.
const SOFT: f32 = 1.6;

/// Descriptors of plain structures.
static BANK: LazyLock<Vec<Descriptor>> = LazyLock::new(bank);

/// Distance to the most similar plain structure.
pub fn distance_to_plain(descriptor: &Descriptor) -> u32 {
    let bank = &*BANK;
    dispatch!(Level::new(), _s => nearest(descriptor, bank))
}

#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn nearest(descriptor: &Descriptor, bank: &[Descriptor]) -> u32 {
    bank.iter().fold(2 * VALUES as u32, |least, plain| least.min(descriptor.distance(plain)))
}

/// Each profile across a side: a step, or bars of some widths.
fn profile(kind: usize, at: f32) -> f32 {
    let step = |x: f32| 1.0 / (1.0 + (-1.7 * x / SOFT).exp());
    if kind == 0 { step(at) } else { step(at) - step(at - WIDTHS[kind - 1]) }
}

fn bank() -> Vec<Descriptor> {
    let mut drawn = Vec::new();
    for kind in 0..=WIDTHS.len() {
        for offset in OFFSETS {
            drawn.push(draw(&|x, _| profile(kind, x - offset)));
            // The corner of nested rectangles of this profile.
            for other in OFFSETS {
                drawn.push(draw(&|x, y| profile(kind, (x - offset).min(y - other))));
            }
        }
    }
    let mut all: Vec<Descriptor> = Vec::with_capacity(8 * drawn.len());
    for picture in drawn {
        let inverse: Vec<f32> = picture.iter().map(|g| 255.0 - g).collect();
        for levels in [picture, inverse] {
            let octave = Octave { width: SIDE, height: SIDE, step: 1.0, levels: vec![levels] };
            let centre = (SIDE as f32 - 1.0) * 0.5;
            let (d, _) = describe(&octave, &Window { x: centre, y: centre, sigma: SIGMA, level: 0 });
            all.extend((0..4).map(|shift| d.rotated(shift)));
        }
    }
    all.sort_by_key(|d| d.0);
    all.dedup();
    all
}

fn draw(of: &dyn Fn(f32, f32) -> f32) -> Vec<f32> {
    let centre = (SIDE as f32 - 1.0) * 0.5;
    (0..SIDE * SIDE).map(|i| 255.0 * of((i % SIDE) as f32 - centre, (i / SIDE) as f32 - centre)).collect()
}
