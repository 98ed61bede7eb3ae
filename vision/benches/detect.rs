//! Time of each stage from image to segments on a 640x480 scene: framed posters with texture on a
//! shaded wall, noise.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use vision::{
    detect::{
        DetectParams,
        edges::edge_map::{EdgeMap, edges, edges_into},
        segments::{chains::chains, edge_segments::segments},
    },
    frame::GrayImage,
};

/// Six framed posters, a quarter of the image each way filled with blocks of texture, noise of +-3
/// levels.
fn scene() -> GrayImage {
    GrayImage::from_fn(640, 480, |u, v| {
        let hash = |a: usize, b: usize| ((a * 73_856_093) ^ (b * 19_349_663)).wrapping_mul(83_492_791) >> 7;
        // A slight shear keeps lines off the pixel grid.
        let (x, y) = ((u + v / 17) % 213, (v + u / 23) % 240);
        let inside = (40..170).contains(&x) && (40..200).contains(&y);
        let frame = (34..176).contains(&x) && (34..206).contains(&y);
        let level = match (inside, frame) {
            (true, _) => 60 + hash(x / 9, y / 9) % 120,
            (false, true) => 45,
            _ => 150 + u / 20,
        };
        (level + hash(u, v) % 7) as u8
    })
}

fn stages(c: &mut Criterion) {
    let (image, p) = (scene(), DetectParams::default());
    let map = edges(&image, &p.edges);
    let chained = chains(&map, &p.chains);
    let mut kept = EdgeMap::default();
    c.bench_function("edges", |b| b.iter(|| edges_into(black_box(&image), &p.edges, &mut kept)));
    c.bench_function("edges_in_new_memory", |b| b.iter(|| edges(black_box(&image), &p.edges)));
    c.bench_function("chains", |b| b.iter(|| chains(black_box(&map), &p.chains)));
    c.bench_function("segments", |b| b.iter(|| segments(black_box(&chained), &map, &p.segments)));
}

criterion_group!(benches, stages);
criterion_main!(benches);
