//! A division of all descriptors into words, so that a point is compared with few points of a map.
//! The same for every map: its medoids are descriptors of generated textures, in two levels.

use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    points::{
        descriptor::Descriptor,
        patch::{INNER_PX, Patch},
        point::SeenPatch,
    },
    random::Random,
};
use fearless_simd::{Level, dispatch};
use std::sync::LazyLock;

/// Medoids of the first level, and of the second below each of them.
const ROOTS: usize = 64;
const LEAVES: usize = 32;
/// Number of words.
pub const VOCABULARY: usize = ROOTS * LEAVES;
/// Roots below which words are searched.
const BRANCHES: usize = 3;
/// Side of a generated texture, and how many there are.
const SIDE: usize = 240;
const TEXTURES: u64 = 48;
/// Blobs and rectangles of a texture.
const SHAPES: usize = 160;
/// Rounds of choosing medoids.
const ROUNDS: usize = 4;

/// The medoids, those of the second level below each root in a row.
struct Tree {
    roots: Vec<Descriptor>,
    leaves: Vec<Descriptor>,
}

static TREE: LazyLock<Tree> = LazyLock::new(|| dispatch!(Level::new(), _s => tree()));

/// The word of a descriptor.
pub fn word(descriptor: &Descriptor) -> u16 {
    let tree = &*TREE;
    dispatch!(Level::new(), _s => {
        let [root] = nearest::<1>(descriptor, tree.roots.iter().enumerate());
        let [leaf] = nearest::<1>(descriptor, below(tree, root));
        leaf
    })
}

/// The `N` nearest words below the nearest roots, nearest first; of equal ones the lower.
#[inline]
pub fn words<const N: usize>(descriptor: &Descriptor) -> [u16; N] {
    let tree = &*TREE;
    let roots = nearest::<BRANCHES>(descriptor, tree.roots.iter().enumerate());
    nearest::<N>(descriptor, roots.into_iter().flat_map(|root| below(tree, root)))
}

/// The words below a root.
#[inline]
fn below(tree: &Tree, root: u16) -> impl Iterator<Item = (usize, &Descriptor)> {
    let first = usize::from(root) * LEAVES;
    (first..).zip(&tree.leaves[first..first + LEAVES])
}

#[expect(
    clippy::inline_always,
    reason = "an instruction set holds only in what is inlined where it was chosen"
)]
#[inline(always)]
fn nearest<'a, const N: usize>(
    descriptor: &Descriptor,
    medoids: impl Iterator<Item = (usize, &'a Descriptor)>,
) -> [u16; N] {
    let mut best = [(u32::MAX, 0_u16); N];
    for (number, medoid) in medoids {
        let mut entry = (descriptor.distance(medoid), number as u16);
        if entry.0 >= best[N - 1].0 {
            continue;
        }
        for slot in &mut best {
            if entry.0 < slot.0 {
                std::mem::swap(slot, &mut entry);
            }
        }
    }
    best.map(|b| b.1)
}

#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn tree() -> Tree {
    let all: Vec<Descriptor> = (0..TEXTURES).flat_map(descriptors).collect();
    let roots = medoids(&all, ROOTS);
    let mut parts: Vec<Vec<Descriptor>> = vec![Vec::new(); ROOTS];
    for d in &all {
        let [root] = nearest::<1>(d, roots.iter().enumerate());
        parts[usize::from(root)].push(*d);
    }
    let leaves = parts.iter().zip(&roots).flat_map(|(part, root)| {
        let mut leaves = medoids(part, LEAVES);
        leaves.resize(LEAVES, *root);
        leaves
    });
    let leaves = leaves.collect();
    Tree { roots, leaves }
}

/// `count` medoids, fewer of fewer descriptors, by a few rounds of assignment; in each the new
/// medoid is the bitwise majority of those assigned.
#[expect(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn medoids(all: &[Descriptor], count: usize) -> Vec<Descriptor> {
    let count = count.min(all.len());
    let mut medoids: Vec<Descriptor> = (0..count).map(|i| all[i * all.len() / count]).collect();
    for _ in 0..ROUNDS {
        let mut counts = vec![([0_u32; 256], 0_u32); count];
        for d in all {
            let [near] = nearest::<1>(d, medoids.iter().enumerate());
            let (bits, count) = &mut counts[usize::from(near)];
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
