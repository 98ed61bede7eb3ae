//! Every gate refuses at its limit: tau, content, margin, the size of the map, points.

use super::*;
use crate::recognise::verification::content::Content;

#[test]
fn gates_refuse_at_tau() {
    let model = SIX.get(LandmarkId(1)).unwrap();
    let anywhere = Corners::try_from([[0.0, 0.0], [90.0, 0.0], [90.0, 90.0], [0.0, 90.0]]).unwrap();
    let verified_landmark = |correlation: f64, hausdorff: f64, moved: bool| VerifiedLandmark {
        near: NearLandmark {
            model: Arc::clone(model),
            reading: 0,
            exemplar: 0,
            correlation,
            hausdorff,
            likeness: None,
            signature: 1.0,
        },
        moved: moved.then_some(anywhere),
        contradicting: 0.0,
        content: JUST_ENOUGH,
    };
    let (c, h, v) = (model.correlation.tau, model.hausdorff.tau, &PARAMS.recognise.verdict);
    let tight = v.verified_share;
    let alone = |kind, c, h, moved| verified_landmark(c, h, moved).refusal(kind, 1.0, v);
    assert_eq!(alone(DistanceKind::Correlation, 0.99 * c, f64::NAN, false), None);
    assert_eq!(alone(DistanceKind::Correlation, c, 0.0, false), Some(MatchRefusal::Correlation));
    assert_eq!(alone(DistanceKind::Correlation, 0.99 * tight * c, h, true), None);
    assert_eq!(
        alone(DistanceKind::Correlation, 1.01 * tight * c, 0.0, true),
        Some(MatchRefusal::Correlation)
    );
    assert_eq!(alone(DistanceKind::Hausdorff, c, 0.99 * h, false), None);
    assert_eq!(alone(DistanceKind::Hausdorff, 0.0, h, false), Some(MatchRefusal::Hausdorff));
    assert_eq!(alone(DistanceKind::Hausdorff, 0.0, f64::NAN, false), Some(MatchRefusal::Hausdorff));
    assert_eq!(alone(DistanceKind::Hausdorff, 0.0, 1.01 * tight * h, true), Some(MatchRefusal::Hausdorff));
    // Both: the likeness, and one of the two.
    let least = 1.0 - model.likeness.tau;
    let both = |likeness: Option<f64>, c, h| {
        let mut verified_landmark = verified_landmark(c, h, true);
        verified_landmark.near.likeness = likeness;
        verified_landmark.refusal(DistanceKind::Both, 1.0, v)
    };
    let alike = Some(least + 1e-6);
    assert_eq!(both(alike, 0.99 * tight * c, f64::INFINITY), None);
    assert_eq!(both(alike, c, 0.99 * tight * h), None);
    assert_eq!(both(alike, 1.01 * tight * c, f64::NAN), Some(MatchRefusal::Correlation));
    for refused in [Some(least), Some(f64::NAN), None] {
        assert_eq!(both(refused, 0.0, 0.0), Some(MatchRefusal::Similarity));
    }
    // Near the threshold, contradicting buckets decide.
    let contradicted = |ratio: f64, share: f64| {
        let mut verified_landmark = verified_landmark(0.0, 0.0, true);
        verified_landmark.near.likeness = Some(1.0 - ratio * model.likeness.tau);
        verified_landmark.contradicting = share;
        verified_landmark.refusal(DistanceKind::Both, 1.0, v)
    };
    assert_eq!(contradicted(0.99, v.max_contradicting), None);
    assert_eq!(contradicted(0.99, v.max_contradicting + 1e-9), Some(MatchRefusal::Mismatch));
    assert_eq!(contradicted(0.99, f64::NAN), Some(MatchRefusal::Mismatch));
    assert_eq!(contradicted(v.doubtful_share - 1e-6, 1.0), None);
    assert_eq!(contradicted(v.doubtful_share + 1e-6, 1.0), Some(MatchRefusal::Mismatch));
    // Content beyond the frame must agree; where it agrees very well, neither distance is required.
    let beyond = |likeness: f64, shown: f64, c: f64| {
        let mut verified_landmark = verified_landmark(c, f64::INFINITY, true);
        verified_landmark.near.likeness = alike;
        verified_landmark.content = Content { likeness, shown };
        verified_landmark.refusal(DistanceKind::Both, 1.0, v)
    };
    let (least, enough) = (v.min_content_likeness, v.min_content);
    assert_eq!(beyond(least, enough, 0.0), None);
    assert_eq!(beyond(least - 1e-9, 20.0, 0.0), Some(MatchRefusal::LowContent));
    assert_eq!(beyond(1.0, enough - 1e-9, 0.0), Some(MatchRefusal::LowContent));
    assert_eq!(beyond(f64::NAN, 20.0, 0.0), Some(MatchRefusal::LowContent));
    let (sure, well) = (v.sure_content_likeness, v.sure_content);
    assert_eq!(beyond(sure, well, 2.0 * c), None);
    assert_eq!(beyond(sure - 1e-9, well, 2.0 * c), Some(MatchRefusal::Correlation));
    assert_eq!(beyond(sure, well - 1e-9, 2.0 * c), Some(MatchRefusal::Correlation));
}

/// Content just above the gate.
const JUST_ENOUGH: Content = Content { likeness: 0.45, shown: 1.5 };

/// A dark frame and a mat, empty or with a poster inside.
fn framed(inside: Option<u64>) -> GrayImage {
    let picture = inside.map(poster);
    GrayImage::from_fn(240, 240, |u, v| match u.min(239 - u).min(v).min(239 - v) {
        depth if depth < 20 => 30,
        depth if depth < 70 => 215,
        _ => picture.as_ref().map_or(170, |p| p.at(u, v)),
    })
}

#[test]
fn a_frame_without_content_is_not_accepted() {
    let trained = |image: &GrayImage| {
        let mut all = vec![TrainingView::photographed(image, &whole(), &PARAMS).unwrap()];
        all.extend(views(image, &whole(), 20, &PARAMS, 5));
        learn(LandmarkId(9), &all, &[], &PARAMS).unwrap()
    };
    // A blank panel is not learnt, whatever its frame.
    let blank = trained(&framed(None));
    let ModelStatus::Candidate(failures) = &blank.status else { panic!("{:?}", blank.status) };
    assert!(failures.iter().any(|f| f.gate == Gate::Content), "{failures:?}");
    // A picture in that frame is a landmark, distinct from the empty frame and from another picture
    // in it.
    let taught = trained(&framed(Some(3)));
    assert!(taught.is_active(), "{:?}", taught.status);
    let set = ModelSet::new(vec![Arc::new(taught)], &PARAMS).unwrap();
    let asked = |inside: Option<u64>| {
        let image = photograph(&framed(inside), &oblique(), 0.9, 10.0);
        recognise(&image, &quad(oblique()), &set, DistanceKind::Both, &PARAMS)
    };
    assert_eq!(asked(Some(3)).verdict, Verdict::Unique(LandmarkId(9)));
    for (inside, refusal) in [(None, MatchRefusal::LowContent), (Some(4), MatchRefusal::LowContent)] {
        let v = asked(inside);
        assert_eq!(v.verdict, Verdict::Unknown, "{inside:?}");
        let reported = v.candidates[0].refusal;
        assert!(
            reported == Some(refusal) || reported == Some(MatchRefusal::Similarity),
            "{inside:?} {reported:?}"
        );
    }
}

#[test]
fn the_margin_is_over_the_nearest_other() {
    let models = trained_models(2, &PARAMS);
    let verified_landmark = |i: usize, c: f64, h: f64, l: f64| VerifiedLandmark {
        near: NearLandmark {
            model: Arc::clone(&models[i]),
            reading: 0,
            exemplar: 0,
            correlation: c * models[i].correlation.tau,
            hausdorff: h * models[i].hausdorff.tau,
            likeness: Some(1.0 - l * models[i].likeness.tau),
            signature: 1.0,
        },
        moved: None,
        contradicting: 0.0,
        content: JUST_ENOUGH,
    };
    let found = [verified_landmark(0, 0.4, 0.1, 0.3), verified_landmark(1, 0.5, 1.0, 1.5)];
    assert!((margin(&found, 0, DistanceKind::Correlation) - 0.8).abs() < 1e-9);
    assert!((margin(&found, 0, DistanceKind::Hausdorff) - 0.1).abs() < 1e-9);
    assert!((margin(&found, 0, DistanceKind::Both) - 0.2).abs() < 1e-9);
    assert!(margin(&found[..1], 0, DistanceKind::Both).abs() < 1e-12);
    // A runner-up without points does not count.
    let found = [verified_landmark(0, 0.4, 0.1, 0.3), verified_landmark(1, 0.5, f64::INFINITY, 1.5)];
    assert!((margin(&found, 0, DistanceKind::Hausdorff) - 1.0).abs() < 1e-12);
}

#[test]
fn tau_shrinks_in_large_maps() {
    let v = &PARAMS.recognise.verdict;
    let exact = |n: usize, share: f64| assert!((v.tau_share(n) - share).abs() < 1e-12, "{n}");
    exact(0, 1.0);
    exact(v.crowd, 1.0);
    exact(10 * v.crowd, 1.0 - 0.08 * 10.0_f64.ln());
    exact(usize::MAX, crate::recognise::params::LEAST_TAU_SHARE);
    assert!(v.tau_share(v.crowd + 1) < 1.0);

    let image = photograph(&poster(2), &oblique(), 1.0, 0.0);
    let read = quad_readings(&image, &quad(oblique()), &PARAMS);
    let model = SIX.get(LandmarkId(2)).unwrap();
    let near = NearLandmark {
        model: Arc::clone(model),
        reading: 0,
        exemplar: 0,
        correlation: 0.0,
        hausdorff: 0.0,
        likeness: Some(1.0 - 0.9 * model.likeness.tau),
        signature: 1.0,
    };
    let found = [VerifiedLandmark { near, moved: Some(oblique()), contradicting: 0.0, content: JUST_ENOUGH }];
    let among = |n: usize| decide(&found, &read, DistanceKind::Both, n, v);
    assert_eq!(among(v.crowd).verdict, Verdict::Unique(LandmarkId(2)));
    let large = among(10 * v.crowd);
    assert_eq!(
        (large.verdict, large.candidates[0].refusal),
        (Verdict::Unknown, Some(MatchRefusal::Similarity))
    );
    // What is reported is what decided.
    let reported = &large.candidates[0];
    let Evidence::Icon(icon) = reported.evidence else { panic!("{reported:?}") };
    assert!(reported.ratio > 1.0 && (icon.distance / icon.tau - reported.ratio).abs() < 1e-9);
}

/// A picture that identifies a landmark where icons decide does not where points decide and give no
/// evidence.
#[test]
fn where_points_decide_icons_alone_do_not_identify() {
    let image = photograph(&poster(1), &oblique(), 0.8, 20.0);
    let v = recognise(&image, &quad(oblique()), &SIX, DistanceKind::Both, &Params::default());
    assert_eq!(v.verdict, Verdict::Ambiguous(LandmarkId(1)));
    assert_eq!((v.candidates[0].refusal, v.confidence), (Some(MatchRefusal::Plain), 0.0));
    let by_icon = recognise(&image, &quad(oblique()), &SIX, DistanceKind::Both, &PARAMS);
    assert_eq!(by_icon.verdict, Verdict::Unique(LandmarkId(1)));
}

#[test]
fn landmarks_with_few_points_are_excluded_from_the_papers_distances_only() {
    let image = photograph(&poster(1), &oblique(), 1.0, 0.0);
    let mut few = (**SIX.get(LandmarkId(1)).unwrap()).clone();
    few.stable_points = PARAMS.learn.gates.min_stable_points - 1;
    for (stable_points, known) in [(few.stable_points, false), (few.stable_points + 1, true)] {
        let model = Arc::new(crate::model::landmark_model::LandmarkModel { stable_points, ..few.clone() });
        let set = ModelSet::new(vec![model], &PARAMS).unwrap();
        for kind in KINDS {
            let v = recognise(&image, &quad(oblique()), &set, kind, &PARAMS);
            let expected = known || kind == DistanceKind::Both;
            assert_eq!(v.verdict == Verdict::Unique(LandmarkId(1)), expected, "{kind:?} {stable_points}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn never_panics(
        seed in any::<u64>(),
        corners in proptest::array::uniform8(-60.0..200.0_f64),
        ambiguous in any::<bool>(),
        max_shift in prop_oneof![Just(0.0), Just(f64::NAN), Just(9.0), 0.0..0.3_f64],
        steps in 0_usize..9,
    ) {
        let mut dice = Dice::new(seed);
        let image = GrayImage::from_fn(150, 130, |_, _| (dice.roll() * 256.0) as u8);
        let points = [0, 2, 4, 6].map(|i| Point2::new(corners[i], corners[i + 1]));
        if let Ok(corners) = Corners::from_unordered(points) {
            let mut p = PARAMS.clone();
            p.recognise.verdict.verify_reach = 9.0;
            p.recognise.verdict.align.max_shift = max_shift;
            p.recognise.verdict.align.steps = steps;
            let mut q = quad(corners);
            q.upright_ambiguous = ambiguous;
            for kind in KINDS {
                let v = recognise(&image, &q, &SIX, kind, &p);
                prop_assert_eq!(v.verdict, Verdict::Unknown);
                prop_assert!(v.candidates.len() <= MAX_CANDIDATES);
                prop_assert!(v.candidates.iter().all(|c| c.refusal.is_some() && !c.ratio.is_nan()));
            }
        }
    }
}
