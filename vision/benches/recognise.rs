//! Cost of recognition: features of one icon, and one quad that is no landmark against 1000 of
//! them.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Matrix2;
use std::{hint::black_box, sync::Arc};
use vision::{
    detect::{Quad, QuadKind},
    frame::GrayImage,
    geometry::Corners,
    icon::icon,
    learn::{TrainingView, learn, synthesis::views},
    model::{Exemplar, LandmarkId, LandmarkModel, ModelSet},
    params::Params,
    recognise::{DistanceKind, features, recognise},
};

const LANDMARKS: u64 = 1000;

/// Blocks of random grey, another pattern for another seed.
fn picture(seed: u64) -> GrayImage {
    GrayImage::from_fn(240, 240, |u, v| {
        let block = |size: usize| (u / size * 31 + v / size * 57 + size) as u64 + seed * 7919;
        let hash = |x: u64| (x.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 48) % 128;
        (hash(block(12)) + hash(block(40))) as u8
    })
}

fn corners() -> Corners {
    Corners::try_from([[20.0, 20.0], [220.0, 25.0], [215.0, 215.0], [25.0, 210.0]]).expect("convex")
}

/// Many landmarks from one lesson: exemplars are exchanged, thresholds stay.
fn landmarks(p: &Params) -> ModelSet {
    let mut lesson = vec![TrainingView::photographed(&picture(0), &corners(), p).expect("large enough")];
    lesson.extend(views(&picture(0), &corners(), 10, p, 1));
    let model = learn(LandmarkId(0), &lesson, &[], p).expect("textured");
    let all = (0..LANDMARKS).map(|id| {
        let exemplars = (0..3)
            .map(|i| Exemplar::new(&icon(&picture(1 + 3 * id + i), &corners(), &p.icon).expect("large")))
            .collect();
        Arc::new(LandmarkModel { id: LandmarkId(id), exemplars, ..model.clone() })
    });
    ModelSet::new(all.collect(), p).expect("one parameter set")
}

fn recognition(c: &mut Criterion) {
    let p = Params::default();
    let image = picture(9_999_999);
    let quad = Quad {
        corners_px: corners(),
        corner_covariance_px2: [Matrix2::identity(); 4],
        side_support: [1.0; 4],
        side_clipped: [false; 4],
        score: 1.0,
        kind: QuadKind::Full,
        upright_ambiguous: false,
        alternates: Vec::new(),
    };
    let cut = icon(&image, &quad.corners_px, &p.icon).expect("large enough");
    c.bench_function("icon", |b| b.iter(|| icon(black_box(&image), &quad.corners_px, &p.icon)));
    c.bench_function("features", |b| b.iter(|| features(black_box(&cut).clone(), &p.recognise)));
    let set = landmarks(&p);
    for kind in [DistanceKind::Both, DistanceKind::Hausdorff] {
        c.bench_function(&format!("recognise among 1000, {kind:?}"), |b| {
            b.iter(|| recognise(black_box(&image), &quad, &set, kind, &p));
        });
    }
}

criterion_group!(benches, recognition);
criterion_main!(benches);
