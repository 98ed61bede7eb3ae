//! The decision on drawn posters: right, unknown, ambiguous; rotations, borders, light, occlusion;
//! every refusal.

use super::*;
use crate::{
    geometry::corners::Corners,
    learn::{lesson::learn, synthesis::views, training_view::TrainingView},
    model::{
        landmark_id::LandmarkId,
        landmark_model::{Gate, ModelStatus},
    },
    recognise::{
        fixture::{Dice, model_set, oblique, photograph, poster, quad, trained_model, trained_models, whole},
        retrieval::nearest,
    },
};
use nalgebra::Point2;
use proptest::prelude::*;
use std::sync::{Arc, LazyLock};

mod gates;
mod unknowns;

const KINDS: [DistanceKind; 3] = [DistanceKind::Hausdorff, DistanceKind::Correlation, DistanceKind::Both];

/// Parameters with which the icons decide.
static PARAMS: LazyLock<Params> = LazyLock::new(|| {
    let mut p = Params::default();
    p.recognise.verdict.points = false;
    p
});
static SIX: LazyLock<ModelSet> = LazyLock::new(|| model_set(6, &PARAMS));

#[test]
fn each_poster_is_recognised_and_distractors_are_unknown() {
    for seed in 1..=6 {
        let image = photograph(&poster(seed), &oblique(), 0.8, 20.0);
        for kind in KINDS {
            let v = recognise(&image, &quad(oblique()), &SIX, kind, &PARAMS);
            assert_eq!(v.verdict, Verdict::Unique(LandmarkId(seed)), "{kind:?} {:?}", v.candidates);
            assert!(v.confidence > 0.2 && v.confidence <= 1.0);
            assert_eq!((v.rotation, v.border, v.landmarks), (0, 0, 6));
            assert!((v.candidates[0].probability - 1.0).abs() < 1e-12);
        }
    }
    for seed in 101..=110 {
        let image = photograph(&poster(seed), &oblique(), 0.8, 20.0);
        for kind in KINDS {
            let v = recognise(&image, &quad(oblique()), &SIX, kind, &PARAMS);
            assert_eq!(v.verdict, Verdict::Unknown, "{seed} {kind:?} {:?}", v.candidates);
            assert!(
                v.confidence.abs() < 1e-12 && (v.possibilities.entropy_m(v.landmarks) - 1.0).abs() < 1e-12
            );
            assert!(v.candidates.iter().all(|c| c.refusal.is_some() && c.probability.abs() < 1e-12));
        }
    }
}

#[test]
fn all_corner_rotations_are_recognised_when_the_orientation_is_ambiguous() {
    let image = photograph(&poster(3), &oblique(), 1.0, 0.0);
    for turn in 0..4 {
        let mut q = quad(oblique().rotated(turn));
        q.upright_ambiguous = true;
        for kind in KINDS {
            let v = recognise(&image, &q, &SIX, kind, &PARAMS);
            assert_eq!(v.verdict, Verdict::Unique(LandmarkId(3)));
            assert_eq!(v.rotation, (4 - turn) % 4);
        }
        q.upright_ambiguous = false;
        let v = recognise(&image, &q, &SIX, DistanceKind::Both, &PARAMS);
        assert_eq!(v.verdict == Verdict::Unknown, turn != 0, "{turn}");
    }
}

#[test]
fn an_inner_border_is_recognised() {
    let image = photograph(&poster(2), &oblique(), 1.0, 0.0);
    // Too far apart for alignment to bridge.
    let outer = [[4.0, 4.0], [390.0, 10.0], [385.0, 380.0], [8.0, 395.0]];
    let mut q = quad(Corners::try_from(outer).unwrap());
    assert_eq!(recognise(&image, &q, &SIX, DistanceKind::Both, &PARAMS).verdict, Verdict::Unknown);
    q.alternates = vec![oblique()];
    let v = recognise(&image, &q, &SIX, DistanceKind::Both, &PARAMS);
    assert_eq!((v.verdict, v.border), (Verdict::Unique(LandmarkId(2)), 1));
    // Borders beyond the limit are ignored.
    let mut many = vec![q.corners_px; nearest::MAX_BORDERS - 2];
    many.push(oblique());
    q.alternates = many;
    let v = recognise(&image, &q, &SIX, DistanceKind::Both, &PARAMS);
    assert_eq!(v.border, nearest::MAX_BORDERS - 1);
    q.alternates.insert(0, q.corners_px);
    let v = recognise(&image, &q, &SIX, DistanceKind::Both, &PARAMS);
    assert_eq!(v.verdict, Verdict::Unknown);
}

#[test]
fn a_landmark_covered_by_a_third_is_recognised() {
    let image = photograph(&poster(5), &oblique(), 1.0, 0.0);
    let covered = GrayImage::from_fn(400, 400, |u, v| {
        let inside = (120..260).contains(&u) && (170..260).contains(&v);
        if inside { if (u / 9 + v / 9) % 2 == 0 { 250 } else { 10 } } else { image.at(u, v) }
    });
    let v = recognise(&covered, &quad(oblique()), &SIX, DistanceKind::Both, &PARAMS);
    assert_eq!(v.verdict, Verdict::Unique(LandmarkId(5)), "{:?}", v.candidates);
}

#[test]
fn look_alikes_are_ambiguous() {
    let mut models = trained_models(4, &PARAMS);
    let mut twin = (*models[1]).clone();
    twin.id = LandmarkId(9);
    models.push(Arc::new(twin));
    let set = ModelSet::new(models, &PARAMS).unwrap();
    let image = photograph(&poster(2), &oblique(), 1.0, 0.0);
    for kind in KINDS {
        let v = recognise(&image, &quad(oblique()), &set, kind, &PARAMS);
        assert_eq!(v.verdict, Verdict::Ambiguous(LandmarkId(2)));
        assert_eq!(v.candidates[0].refusal, Some(MatchRefusal::Margin));
        assert!((v.candidates[1].probability - 0.5).abs() < 1e-12);
        assert!((v.candidates.iter().map(|c| c.probability).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(
            (v.possibilities.entropy_norm(v.landmarks) - (1.0 - 2.0_f64.ln() / 6.0_f64.ln())).abs() < 1e-12
        );
        assert!(v.confidence.abs() < 1e-12);
    }
}

#[test]
fn without_comparable_landmarks_the_verdict_is_unknown() {
    let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
    let empty = ModelSet::default();
    assert_eq!(recognise(&image, &quad(oblique()), &empty, DistanceKind::Both, &PARAMS).landmarks, 0);
    // The set was made for other parameters.
    let mut p = PARAMS.clone();
    p.recognise.descriptor.sigma = 2.1;
    let v = recognise(&image, &quad(oblique()), &SIX, DistanceKind::Both, &p);
    assert!(v.verdict == Verdict::Unknown && v.candidates.is_empty());
    // Too small a quad has no icon.
    let small = Corners::try_from([[90.0, 80.0], [110.0, 80.0], [110.0, 100.0], [90.0, 100.0]]).unwrap();
    assert!(recognise(&image, &quad(small), &SIX, DistanceKind::Both, &PARAMS).candidates.is_empty());
}

#[test]
fn the_only_landmark_needs_no_margin() {
    let set = ModelSet::new(vec![Arc::new(trained_model(7, 4, &PARAMS))], &PARAMS).unwrap();
    let image = photograph(&poster(4), &oblique(), 1.0, 0.0);
    let v = recognise(&image, &quad(oblique()), &set, DistanceKind::Both, &PARAMS);
    assert_eq!(v.verdict, Verdict::Unique(LandmarkId(7)), "{:?}", v.candidates);
}
