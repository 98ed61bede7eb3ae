//! Training on drawn posters, thresholds against others, gates, and stored models read back.

use super::*;
use crate::{
    frame::GrayImage,
    geometry::corners::Corners,
    learn::{
        LearnRules, synthesis,
        threshold_fit::{add_negatives, fitted, unlikeness_of},
    },
    model::{
        landmark_model::{Gate, GateFailure, MAX_EXEMPLARS},
        model_bytes::{StoredModelError, components, renumbered},
        seen_from::SeenFrom,
        threshold::{LimitedBy, ThresholdError},
    },
    params::preset::Preset,
    points::taught::view_points,
    random::Random,
};
use proptest::prelude::*;

/// A procedural poster: rectangles of random grey on a random ground.
fn poster(seed: u64) -> GrayImage {
    let mut random = Random::new(seed ^ 0x5eed);
    let ground = random.range(60.0, 200.0);
    let patches: Vec<[f64; 5]> = (0..40)
        .map(|_| {
            let (w, h) = (random.range(8.0, 60.0), random.range(8.0, 60.0));
            [random.range(0.0, 300.0), random.range(0.0, 400.0), w, h, random.range(10.0, 245.0)]
        })
        .collect();
    GrayImage::from_fn(300, 400, |u, v| {
        let (u, v) = (u as f64, v as f64);
        let top = patches.iter().rev().find(|[x, y, w, h, _]| (u - x).abs() < *w && (v - y).abs() < *h);
        top.map_or(ground, |p| p[4]) as u8
    })
}

fn whole() -> Corners {
    Corners::try_from([[-0.5, -0.5], [299.5, -0.5], [299.5, 399.5], [-0.5, 399.5]]).unwrap()
}

fn lesson(seed: u64, count: usize, negatives: &[IconFeatures]) -> LandmarkModel {
    let p = Params::default();
    let views = synthesis::views(&poster(seed), &whole(), count, &p, seed);
    learn(LandmarkId(seed), &views, negatives, &p).unwrap()
}

/// The exemplars, for use as negatives of other landmarks.
fn icons(model: &LandmarkModel) -> Vec<IconFeatures> {
    model.features(&Params::default().recognise)
}

/// End to end at N = 50: every landmark is trained from one picture, then new views are compared
/// with all.
#[test]
fn fifty_landmarks_accept_their_own_views_and_no_others() {
    let p = Params::default();
    let alone: Vec<LandmarkModel> = (0..50).map(|seed| lesson(seed, 20, &[])).collect();
    let models: Vec<LandmarkModel> = (0..50)
        .map(|i| {
            let others: Vec<IconFeatures> =
                alone.iter().enumerate().filter(|(j, _)| *j != i).flat_map(|(_, m)| icons(m)).collect();
            refit_thresholds(&alone[i], &others, &p)
        })
        .collect();
    assert!(
        models.iter().filter(|m| m.is_active()).count() >= 40,
        "{:?}",
        models.iter().map(|m| &m.status).collect::<Vec<_>>()
    );
    let accepts = |m: &LandmarkModel, icon: &IconFeatures| {
        let d = m.distances(icon, &p.recognise);
        d.correlation < m.correlation.tau && d.hausdorff < m.hausdorff.tau
    };
    let (mut own, mut wrong) = (0, 0);
    for i in 0..50u64 {
        for view in synthesis::views(&poster(i), &whole(), 4, &p, 1000 + i) {
            let icon = features(view.icon, &p.recognise);
            own += usize::from(accepts(&models[i as usize], &icon));
            wrong += models.iter().filter(|m| m.id.0 != i && accepts(m, &icon)).count();
        }
    }
    assert!(own >= 170, "{own} of 200 fresh views accepted");
    assert_eq!(wrong, 0, "of 9800 comparisons with other landmarks");
    // Distractors: posters without a model.
    for seed in 500..560 {
        for view in synthesis::views(&poster(seed), &whole(), 1, &p, seed) {
            let icon = features(view.icon, &p.recognise);
            assert!(models.iter().all(|m| !accepts(m, &icon)), "distractor {seed}");
        }
    }
}

#[test]
fn tau_of_the_likeness_is_limited_by_the_nearest_negative() {
    let p = Params::default();
    let alone = lesson(3, 20, &[]);
    assert!((alone.likeness.tau - p.learn.likeness_cap).abs() < 1e-12);
    assert_eq!((alone.likeness.limited_by, alone.likeness.negatives), (LimitedBy::AbsoluteCap, 0));
    // A dissimilar negative leaves tau as it is; a look-alike (the landmark under a stain) lowers
    // it.
    let distractor = icons(&lesson(4, 20, &[])).remove(0);
    let far = add_negatives(&alone, &[distractor], &p);
    assert!((far.likeness.tau - p.learn.likeness_cap).abs() < 1e-12 && far.likeness.negatives == 1);
    let mut stained = poster(3);
    stained = GrayImage::from_fn(300, 400, |u, v| {
        if u > 110 && v > 180 { (60 + (u / 9 + v / 11) % 2 * 90) as u8 } else { stained.at(u, v) }
    });
    let view = TrainingView::photographed(&stained, &whole(), &p).unwrap();
    let near = add_negatives(&alone, &[features(view.icon, &p.recognise)], &p);
    assert_eq!(near.likeness.limited_by, LimitedBy::NearestNegative);
    assert!(near.likeness.tau < 0.9 * p.learn.likeness_cap, "{:?}", near.likeness);
    // An identical negative: no threshold separates them, so the landmark is not used.
    let twin = add_negatives(&alone, &icons(&alone), &p);
    let ModelStatus::Candidate(failures) = &twin.status else {
        panic!("an identical negative must leave no threshold")
    };
    assert!(failures.iter().any(|f| f.gate == Gate::LikenessThreshold(ThresholdError::Overlap)));
}

#[test]
fn a_model_records_its_training_data() {
    let p = Params::default();
    let mut views = synthesis::views(&poster(1), &whole(), 24, &p, 1);
    views.push(TrainingView::photographed(&poster(1), &whole(), &p).unwrap());
    let model = learn(LandmarkId(7), &views, &[], &p).unwrap();
    assert_eq!((model.id, model.views, model.generated_views), (LandmarkId(7), 25, 24));
    assert!(model.generated_views > 0 && model.v_c > 0.5 && model.photographed_v_c.abs() < 1e-12);
    assert!((1..=MAX_EXEMPLARS).contains(&model.exemplars.len()));
    assert_eq!(model.correlation.positives, 25 - model.exemplars.len());
    assert_eq!(model.params_hash, p.distance_hash());
    assert!(model.correlation.tau <= p.learn.correlation_cap && model.hausdorff.tau <= p.learn.hausdorff_cap);
}

#[test]
fn a_threshold_of_one_distance_suffices() {
    let p = Params::default();
    let model = lesson(3, 20, &[]);
    assert!(model.is_active(), "{:?}", model.status);
    // Without points H^r has no threshold, C^r still has one.
    let mut pointless = model.clone();
    (pointless.stable_points, pointless.hausdorff_evidence.own) = (0, vec![f32::INFINITY; 5]);
    let pointless = refit_thresholds(&pointless, &[], &p);
    assert!(pointless.is_active() && pointless.hausdorff.tau.abs() < 1e-12, "{:?}", pointless.status);
    // Without either the landmark is not used, and every failed gate is reported.
    let mut neither = pointless;
    neither.correlation_evidence.own = vec![1.9; 5];
    let ModelStatus::Candidate(failures) = refit_thresholds(&neither, &[], &p).status else {
        panic!("active")
    };
    let gates: Vec<Gate> = failures.iter().map(|f| f.gate).collect();
    assert!(gates.contains(&Gate::StablePoints), "{gates:?}");
    assert!(gates.contains(&Gate::HausdorffThreshold(ThresholdError::NothingFinite)), "{gates:?}");
    assert!(gates.contains(&Gate::CorrelationThreshold(ThresholdError::Overlap)), "{gates:?}");
}

#[test]
fn unlikeness_is_small_for_look_alikes_and_infinite_for_distractors() {
    let p = Params::default();
    let model = lesson(3, 20, &[]);
    let twin = icons(&lesson(3, 6, &[]));
    let distractor = icons(&lesson(4, 6, &[]));
    assert!(unlikeness_of(&model, &twin, &p) < 0.3);
    assert!(unlikeness_of(&model, &distractor, &p) > p.learn.likeness_cap);
    assert!(unlikeness_of(&model, &[], &p).is_infinite());
}

/// Look-alikes are found by all icons of a landmark, however many points it has.
#[test]
fn thresholds_of_the_icons_do_not_depend_on_points() {
    let p = Params::default();
    let model = lesson(3, 20, &[]);
    let points = view_points(&poster(3), &whole());
    assert!(points.len() > p.recognise.verdict.max_icon_points, "{} points", points.len());
    let with_points = model.clone().with_points(&[points]);
    assert!(model.exemplars.len() > 1 && with_points.exemplars == model.exemplars);
    let twin = icons(&lesson(3, 6, &[]));
    let [held, expected] = [&with_points, &model].map(|m| add_negatives(m, &twin, &p));
    assert_eq!((held.status, held.likeness), (expected.status, expected.likeness));
}

#[test]
fn folds_measure_every_view() {
    let model = lesson(2, 40, &[]);
    assert_eq!(model.correlation.positives, 40);
    assert!(model.correlation_evidence.own[0] > 0.0, "no view is compared with itself");
}

#[test]
fn a_failed_gate_is_reported_with_value_and_limit() {
    let p = Params::default();
    let blank = GrayImage::from_fn(300, 400, |u, _| 120 + (u / 60) as u8);
    let views = synthesis::views(&blank, &whole(), 20, &p, 1);
    let model = learn(LandmarkId(1), &views, &[], &p).unwrap();
    let ModelStatus::Candidate(failures) = &model.status else { panic!("a blank panel is no landmark") };
    let gates: Vec<Gate> = failures.iter().map(|f| f.gate).collect();
    // One of the paper's distances has a threshold, so the gates of both are not applied.
    let overlap = Gate::LikenessThreshold(ThresholdError::Overlap);
    assert_eq!(gates, [Gate::Saliency, Gate::Content, overlap]);
    let waived: Vec<Gate> = model.waived.iter().map(|f| f.gate).collect();
    assert_eq!(waived, [Gate::VisibilityConfidence(SeenFrom::Front), Gate::StablePoints]);
    assert!(model.hausdorff.tau.abs() < 1e-12, "accepts nothing");

    let one = TrainingView::photographed(&poster(1), &whole(), &p).unwrap();
    let model = learn(LandmarkId(1), &[one.clone(), one], &[], &p).unwrap();
    let ModelStatus::Candidate(failures) = &model.status else { panic!("two equal views are not enough") };
    let views = failures.iter().find(|f| f.gate == Gate::Views).unwrap();
    assert_eq!(views.to_string(), "2 views, at least 20 needed");
}

#[test]
fn rules_of_a_landmark_change_weights_and_gates_and_excuse_no_missing_threshold() {
    let p = Params::default();
    let blank = GrayImage::from_fn(300, 400, |u, _| 120 + (u / 60) as u8);
    let views = synthesis::views(&blank, &whole(), 20, &p, 1);
    let model = learn(LandmarkId(1), &views, &[], &p).unwrap();
    let rules = |used| LearnRules { use_despite_gates: Some(used), ..LearnRules::default() };
    let used = add_negatives(&model, &[], &rules(true).over(&p));
    let gates = |failures: &[GateFailure]| failures.iter().map(|f| f.gate).collect::<Vec<_>>();
    let ModelStatus::Candidate(failures) = &used.status else { panic!("nothing tells it apart") };
    assert_eq!(gates(failures), [Gate::LikenessThreshold(ThresholdError::Overlap)]);
    assert!(gates(&used.waived).contains(&Gate::Saliency), "{:?}", used.waived);

    let poster = lesson(3, 20, &[]);
    let strict = LearnRules { min_saliency_f: Some(900.0), ..LearnRules::default() }.over(&p);
    let refused = add_negatives(&poster, &[], &strict);
    let ModelStatus::Candidate(failures) = &refused.status else { panic!("F is below 900") };
    assert_eq!((failures[0].gate, failures[0].limit), (Gate::Saliency, 900.0));
    let again = rules(true).over(&strict);
    assert!(add_negatives(&poster, &[], &again).is_active());
    assert!(!add_negatives(&poster, &[], &rules(false).over(&again)).is_active(), "the last rules hold");
    assert_eq!(LearnRules::default().over(&p), p);
    let cheap = LearnRules { false_positive_weight: Some(0.5), ..LearnRules::default() };
    assert!((cheap.over(&p).learn.threshold.false_positive_weight - 0.5).abs() < 1e-12);
}

/// Generated views are no proof of another side; the paper refuses, the product says so.
#[test]
fn one_photograph_is_seen_from_one_side_whatever_is_generated() {
    let paper = Preset::Paper.params();
    let mut views = synthesis::views(&poster(1), &whole(), 24, &paper, 1);
    views.push(TrainingView::photographed(&poster(1), &whole(), &paper).unwrap());
    let side = GateFailure { gate: Gate::VisibilityConfidence(SeenFrom::Front), value: 0.0, limit: 0.5 };
    let model = learn(LandmarkId(1), &views, &[], &Params::default()).unwrap();
    assert!(model.is_active() && model.waived == [side], "{:?} {:?}", model.status, model.waived);
    assert!((model.v_c_for_gaze() - 0.25).abs() < 1e-12 && model.v_c > 0.5);
    let refused = learn(LandmarkId(1), &views, &[], &paper).unwrap();
    assert_eq!((refused.status, refused.waived), (ModelStatus::Candidate(vec![side]), vec![]));
    // A second photograph from elsewhere passes.
    let mut beside = views[24].clone();
    beside.corners_px =
        Corners::try_from([[20.0, 20.0], [160.0, -10.0], [160.0, 430.0], [20.0, 380.0]]).unwrap();
    views.push(beside);
    let passed = learn(LandmarkId(1), &views, &[], &paper).unwrap();
    assert_eq!((passed.status.clone(), passed.waived.clone()), (ModelStatus::Active, vec![]));
    assert!((passed.v_c_for_gaze() - passed.photographed_v_c).abs() < 1e-12);
}

#[test]
fn invalid_training_input_is_refused() {
    let p = Params::default();
    assert_eq!(learn(LandmarkId(1), &[], &[], &p), Err(LearnError::NoView));
    let view = TrainingView::photographed(&poster(1), &whole(), &p).unwrap();
    let many = vec![view.clone(); MAX_VIEWS + 1];
    assert_eq!(learn(LandmarkId(1), &many, &[], &p), Err(LearnError::TooManyViews { found: MAX_VIEWS + 1 }));
    assert!(learn(LandmarkId(1), &many[1..], &[], &p).is_ok());
    let mut other = p.clone();
    other.icon.size = 50;
    let expected = LearnError::IconSize { index: 0, found: 75, expected: 50 };
    assert_eq!(learn(LandmarkId(1), std::slice::from_ref(&view), &[], &other), Err(expected));
    let mut broken = view;
    broken.icon.pixels[3] = f32::NAN;
    assert_eq!(learn(LandmarkId(1), &[broken], &[], &p), Err(LearnError::NoComponents));
}

/// Oracle: all negatives at once.
#[test]
fn negatives_may_be_added_one_by_one() {
    let p = Params::default();
    let others: Vec<IconFeatures> = (10..22).flat_map(|seed| icons(&lesson(seed, 6, &[]))).collect();
    let model = lesson(3, 20, &others);
    let step = add_negatives(&add_negatives(&lesson(3, 20, &[]), &others[..9], &p), &others[9..], &p);
    assert_eq!(model, step);
    assert_eq!(model.correlation.negatives, others.len());
    assert_eq!(refit_thresholds(&model, &[], &p), lesson(3, 20, &[]));
    // A copy of the landmark among the negatives makes tau no looser.
    let twin = add_negatives(&model, &icons(&lesson(3, 6, &[])), &p);
    assert!(twin.correlation.tau <= model.correlation.tau);
}

#[test]
fn tau_stays_below_the_farthest_stored_negative() {
    let mut evidence = DistanceSamples { own: vec![0.1, 0.2, 0.9], ..DistanceSamples::default() };
    for i in 0..200 {
        evidence.add(0.3 + f64::from(i % 100) * 1e-3);
    }
    assert_eq!((evidence.others, evidence.nearest_others.len()), (200, DistanceSamples::MAX_NEAREST));
    assert!(evidence.nearest_others.is_sorted() && evidence.nearest_others[63] < 0.3325);
    let cheap = Params {
        learn: crate::learn::params::LearnParams {
            threshold: crate::learn::threshold::ThresholdParams {
                false_positive_weight: 0.1,
                nearest_share: 0.9,
                ..crate::learn::threshold::ThresholdParams::default()
            },
            ..Default::default()
        },
        ..Params::default()
    };
    // With almost free false positives tau would be 0.5; the negatives that were only counted keep
    // it lower.
    let held = fitted(&evidence, 0.5, &cheap).unwrap();
    assert!(held.tau <= f64::from(evidence.nearest_others[63]), "{}", held.tau);
    assert_eq!(held.limited_by, LimitedBy::AbsoluteCap);
}

#[test]
fn a_stored_model_is_the_same_bit_for_bit() {
    let p = Params::default();
    let others: Vec<IconFeatures> = (10..40).flat_map(|seed| icons(&lesson(seed, 4, &[]))).collect();
    let model = lesson(3, 20, &others);
    let bytes = model.to_bytes();
    assert!(bytes.len() < 64 * 1024, "{}", bytes.len());
    assert_eq!(LandmarkModel::from_bytes(&bytes, &p).unwrap(), model);
    assert_eq!(components(&bytes).unwrap(), model.components);
    assert_eq!(
        (model.components.size(), model.components.pictures().len()),
        (75, 1 + model.eigenvalues.len())
    );

    let mut other = p.clone();
    other.recognise.correlation.rank += 1;
    assert!(matches!(LandmarkModel::from_bytes(&bytes, &other), Err(StoredModelError::Params { .. })));
    let points = crate::points::taught::view_points(
        &crate::recognise::fixture::poster(1),
        &crate::recognise::fixture::whole(),
    );
    let with_points = model.clone().with_points(&[points]);
    assert!(with_points.points.len() > 50);
    assert_eq!(LandmarkModel::from_bytes(&with_points.to_bytes(), &p).unwrap(), with_points);

    // The same model under another number, and back.
    for kept in [&bytes, &with_points.to_bytes()] {
        let other = renumbered(kept, LandmarkId(77)).unwrap();
        let read = LandmarkModel::from_bytes(&other, &p).unwrap();
        assert_eq!(LandmarkModel { id: model.id, ..read }, LandmarkModel::from_bytes(kept, &p).unwrap());
        assert_eq!(&renumbered(&other, model.id).unwrap(), kept);
    }
    assert_eq!(renumbered(&bytes[..bytes.len() - 1], LandmarkId(77)), Err(StoredModelError::Damaged));
    assert_eq!(renumbered(&bytes[..20], LandmarkId(77)), Err(StoredModelError::NotAModel));

    let mut later = bytes.clone();
    later[4] += 1;
    assert_eq!(LandmarkModel::from_bytes(&later, &p), Err(StoredModelError::Version { found: 6 }));
    for at in (6..bytes.len()).step_by(97).chain([bytes.len() - 1]) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        assert_eq!(LandmarkModel::from_bytes(&damaged, &p), Err(StoredModelError::Damaged), "byte {at}");
        assert!(LandmarkModel::from_bytes(&bytes[..at], &p).is_err());
    }
    assert_eq!(LandmarkModel::from_bytes(b"", &p), Err(StoredModelError::NotAModel));
    assert_eq!(LandmarkModel::from_bytes(&[0; 100], &p), Err(StoredModelError::NotAModel));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    /// Invalid bytes with a valid digest: typed error or a model, never a panic.
    #[test]
    fn bytes_with_a_valid_digest_never_panic(
        edits in proptest::collection::vec((6usize..400, any::<u8>()), 1..6),
        cut in 0usize..300,
        seal in any::<bool>(),
    ) {
        use std::sync::OnceLock;
        static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
        let bytes = BYTES.get_or_init(|| lesson(3, 20, &icons(&lesson(4, 4, &[]))).to_bytes());
        let mut forged = bytes[..bytes.len() - 8 - cut].to_vec();
        for (at, value) in &edits {
            forged[*at] = *value;
        }
        if seal {
            let sum = crate::model::model_bytes::digest(&forged);
            forged.extend(sum.to_le_bytes());
        }
        if let Ok(model) = LandmarkModel::from_bytes(&forged, &Params::default()) {
            prop_assert!(model.correlation.tau.is_finite() && model.hausdorff.tau.is_finite());
            prop_assert!(!model.exemplars.is_empty());
        }
    }

    #[test]
    fn any_bytes_never_panic(mut bytes in proptest::collection::vec(any::<u8>(), 0..300), magic in any::<bool>()) {
        if magic && bytes.len() >= 6 {
            bytes[..6].copy_from_slice(b"WMLM\x01\x00");
        }
        prop_assert!(LandmarkModel::from_bytes(&bytes, &Params::default()).is_err());
    }
}
