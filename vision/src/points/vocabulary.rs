//! A coarse division of all descriptors into words, so that a point is compared with a few of a map's points only. It is
//! the same for every map: its medoids are descriptors of generated textures.

use super::{
    SeenPatch,
    descriptor::Descriptor,
    patch::{INNER_PX, Patch},
};
use crate::{detect::quads::Corners, frame::GrayImage, learn::random::Random};
use std::sync::LazyLock;

/// Number of words.
pub const VOCABULARY: usize = 64;
/// Side of a generated texture, and how many there are.
const SIDE: usize = 240;
const TEXTURES: u64 = 4;
/// Blobs and rectangles of a texture.
const SHAPES: usize = 160;
/// Rounds of choosing medoids.
const ROUNDS: usize = 4;

static MEDOIDS: LazyLock<Vec<Descriptor>> = LazyLock::new(medoids);

/// The `N` nearest words, nearest first; of equal ones the lower.
#[inline]
pub fn words<const N: usize>(descriptor: &Descriptor) -> [u8; N] {
    let mut best = [(u32::MAX, 0_u8); N];
    for (word, medoid) in MEDOIDS.iter().enumerate() {
        let mut entry = (descriptor.distance(medoid), word as u8);
        for slot in &mut best {
            if entry.0 < slot.0 {
                std::mem::swap(slot, &mut entry);
            }
        }
    }
    best.map(|b| b.1)
}

/// Medoids by a few rounds of assignment; in each the new medoid is the bitwise majority of those assigned.
fn medoids() -> Vec<Descriptor> {
    let all: Vec<Descriptor> = (0..TEXTURES).flat_map(descriptors).collect();
    if all.is_empty() {
        return Vec::new();
    }
    let mut medoids: Vec<Descriptor> = (0..VOCABULARY).map(|i| all[i * all.len() / VOCABULARY]).collect();
    for _ in 0..ROUNDS {
        let mut counts = vec![([0_u32; 256], 0_u32); VOCABULARY];
        for d in &all {
            let nearest = (0..VOCABULARY).min_by_key(|m| medoids[*m].distance(d)).unwrap_or(0);
            let (bits, count) = &mut counts[nearest];
            *count += 1;
            for (i, bit) in bits.iter_mut().enumerate() {
                *bit += ((d.0[i / 64] >> (i % 64)) & 1) as u32;
            }
        }
        for (medoid, (bits, count)) in medoids.iter_mut().zip(counts).filter(|(_, (_, count))| *count > 0) {
            let mut words = [0; 4];
            for (i, bit) in bits.iter().enumerate() {
                words[i / 64] |= u64::from(2 * bit > count) << (i % 64);
            }
            *medoid = Descriptor(words);
        }
    }
    medoids
}

/// Descriptors of a texture of overlapping shapes.
fn descriptors(seed: u64) -> Vec<Descriptor> {
    let mut random = Random::new(seed);
    let size = SIDE as f64;
    let shapes: Vec<[f64; 6]> = (0..SHAPES)
        .map(|_| {
            let radius = 3.0 * 2.0_f64.powf(random.range(0.0, 3.5));
            let round = random.range(0.0, 2.0).floor();
            [
                random.range(0.0, size),
                random.range(0.0, size),
                radius,
                radius * random.range(0.4, 1.6),
                random.range(0.0, 255.0),
                round,
            ]
        })
        .collect();
    let image = GrayImage::from_fn(SIDE, SIDE, |u, v| {
        let inside = |s: &&[f64; 6]| {
            let (dx, dy) = ((u as f64 - s[0]) / s[2], (v as f64 - s[1]) / s[3]);
            if s[5] > 0.5 { dx * dx + dy * dy < 1.0 } else { dx.abs() < 1.0 && dy.abs() < 1.0 }
        };
        shapes.iter().rev().find(inside).map_or(128.0, |s| s[4]) as u8
    });
    let (low, high) = (SIDE as f64 * 0.15, SIDE as f64 * 0.85);
    let corners = Corners::try_from([[low, low], [high, low], [high, high], [low, high]]);
    let patch = corners.ok().and_then(|c| Patch::new(&image, &c, INNER_PX[0]));
    patch.map_or_else(Vec::new, |p| SeenPatch::new(p, 1000).points.iter().map(|p| p.descriptor).collect())
}
