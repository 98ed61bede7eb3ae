//! Association against a dense, exhaustive oracle; look-alikes, evidence, bounds, order of input.

use super::*;
use nalgebra::{DMatrix, DVector};

fn unique(assignment: &Assignment) -> Vec<Option<u64>> {
    let of = |a: &Association| match a {
        Association::Unique { landmark, .. } => Some(landmark.0),
        Association::Ambiguous { .. } | Association::None(_) => None,
    };
    assignment.observations.iter().map(of).collect()
}

fn by_default(e: &Expectations, observations: &[Observation]) -> Assignment {
    super::super::associate(e, observations, &AssociateParams::default()).unwrap()
}

/// Joint squared distance of pairings by the stacked covariance, linearised at the prior; and with
/// the logarithm of its determinant.
fn stacked(e: &Expectations, pairs: &[(&Observation, LandmarkId)]) -> (f64, f64) {
    let n = 8 * pairs.len();
    let (mut by_common, mut own) = (DMatrix::zeros(n, joint::COMMON), DMatrix::zeros(n, n));
    let mut innovation = DVector::zeros(n);
    for (i, (observed, landmark)) in pairs.iter().enumerate() {
        let at = e.landmarks.iter().position(|l| l.landmark == *landmark).unwrap();
        let (predicted, by_errors) =
            joint::Prediction::at(&e.predicted(at), &joint::CommonVector::zeros()).unwrap();
        by_common.view_mut((8 * i, 0), (8, joint::COMMON)).copy_from(&by_errors);
        let model = joint::CornerMatrix::identity() * 0.25;
        own.view_mut((8 * i, 8 * i), (8, 8))
            .copy_from(&(e.landmarks[at].by_place_px2 + observed.covariance_px2 + model));
        let z = projection::corner_vector(observed.corners_px.points());
        innovation.rows_mut(8 * i, 8).copy_from(&(z - predicted));
    }
    let common = DMatrix::from_fn(joint::COMMON, joint::COMMON, |i, j| e.common[(i, j)]);
    let s = &by_common * common * by_common.transpose() + own;
    let factor = s.cholesky().unwrap();
    let distance2 = innovation.dot(&factor.solve(&innovation));
    (distance2, distance2 + 2.0 * factor.l().diagonal().map(f64::ln).sum())
}

#[test]
fn the_joint_distance_is_that_of_the_stacked_covariance() {
    let places = corridor(2.0);
    let mut random = Random::new(5);
    for x in [3.0, 9.0, 15.0] {
        // So certain that the derivative at the prior is exact enough for both.
        let at = prior(Pose2::new(x, 0.0, 0.0), 0.005, 0.05);
        let truth = at.pose.plus(&draw3(&at.covariance, &mut random));
        let e = expectations(&at, &places);
        let shown = full_views(&truth, &places, &mounting(), &mut random);
        let observations: Vec<_> = shown.iter().map(|(id, c)| observation(*id, *c)).collect();
        let made = by_default(&e, &observations);
        assert!(observations.len() >= 2 && made.unique().count() == observations.len(), "{made:?}");
        let pairs: Vec<_> = observations.iter().zip(&shown).map(|(o, (id, _))| (o, *id)).collect();
        let (dense, _) = stacked(&e, &pairs);
        assert!((made.distance2 / dense - 1.0).abs() < 0.01, "{} {dense}", made.distance2);
        assert_eq!(made.dof, 8 * observations.len());
    }
}

#[test]
fn the_bounded_search_finds_the_best_of_all_assignments() {
    // Doors closer than the uncertainty of the pose: several candidates for each observation.
    // Oracle: all assignments of three observations to doors by the stacked covariance, the densest
    // first; all distances are short beside the range, so that the derivative at the prior serves.
    let places: BTreeMap<_, _> =
        (1..=5).map(|i| (LandmarkId(i), on_wall(3.0 + 0.12 * i as f64, 1.0, 0.9, 2.0))).collect();
    let mut random = Random::new(8);
    let (mut several, mut decided) = (0, 0);
    for _ in 0..30 {
        let at = prior(Pose2::new(1.2, 0.0, 0.0), 0.02, 0.2);
        let truth = at.pose.plus(&draw3(&at.covariance, &mut random));
        let e = expectations(&at, &places);
        let shown: Vec<_> =
            full_views(&truth, &places, &mounting(), &mut random).into_iter().skip(1).take(3).collect();
        let observations: Vec<_> = shown.iter().map(|(id, c)| observation(*id, *c)).collect();
        let made = by_default(&e, &observations);
        let ids: Vec<LandmarkId> = e.landmarks.iter().map(|l| l.landmark).collect();
        assert_eq!((observations.len(), ids.len()), (3, 5));
        let mut all: Vec<(f64, f64, [LandmarkId; 3])> = Vec::new();
        for a in &ids {
            for b in &ids {
                for c in &ids {
                    if a != b && b != c && a != c {
                        let pairs: Vec<_> = observations.iter().zip([*a, *b, *c]).collect();
                        let (distance2, density) = stacked(&e, &pairs);
                        all.push((density, distance2, [*a, *b, *c]));
                    }
                }
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let lead = 0.5 * (all[1].0 - all[0].0);
        several += usize::from(lead < 8.0);
        // Near the margin linearisation may decide either way.
        if lead < 7.0 {
            assert!(made.unique().count() < 3, "{lead}: {made:?}");
        } else if lead > 9.0 && made.unique().count() == 3 {
            decided += 1;
            let chosen: Vec<_> = made.unique().map(|(_, id)| id).collect();
            assert_eq!(chosen, all[0].2);
            assert!((made.distance2 / all[0].1 - 1.0).abs() < 0.1, "{} {}", made.distance2, all[0].1);
        }
    }
    println!("{several} of 30 ambiguous, {decided} decided");
    assert!(several >= 5 && decided >= 5, "{several} {decided}");
}

#[test]
fn two_look_alikes_in_one_gate_are_ambiguous_and_a_neighbour_resolves_them() {
    // Two doors 1.1 m apart, a pose with 0.6 m along the wall: one observation may be either.
    let places: BTreeMap<_, _> =
        [(LandmarkId(1), on_wall(3.0, 1.0, 0.9, 2.0)), (LandmarkId(2), on_wall(4.1, 1.0, 0.9, 2.0))].into();
    let mut at = prior(Pose2::new(1.5, 0.0, 0.0), 0.05, 0.5);
    at.covariance[(0, 0)] = 0.36;
    let mut random = Random::new(2);
    let truth = at.pose.plus(&Vector3::new(0.5, 0.0, 0.0));
    let shown = full_views(&truth, &places, &mounting(), &mut random);
    let e = expectations(&at, &places);
    let one = [observation(shown[0].0, shown[0].1)];
    let both = Association::Ambiguous { landmarks: vec![LandmarkId(1), LandmarkId(2)], or_none: false };
    assert_eq!(by_default(&e, &one).observations, [both]);
    // With both in view only one assignment is jointly compatible.
    let two: Vec<_> = shown.iter().map(|(id, c)| observation(*id, *c)).collect();
    assert_eq!(unique(&by_default(&e, &two)), [Some(1), Some(2)]);
    // A pose that is known to 5 cm needs no neighbour.
    let sure = prior(truth, 0.05, 0.5);
    assert_eq!(unique(&by_default(&expectations(&sure, &places), &one)), [Some(1)]);
    // Without the other as a candidate it would be unique: the class must be listed.
    let mut alone = one.clone();
    alone[0].candidates.retain(|c| c.landmark == LandmarkId(1));
    assert_eq!(unique(&by_default(&e, &alone)), [Some(1)]);
}

#[test]
fn prior_odds_do_not_replace_picture_evidence() {
    let places: BTreeMap<_, _> =
        [(LandmarkId(1), on_wall(3.0, 1.0, 0.9, 2.0)), (LandmarkId(2), on_wall(4.1, 1.0, 0.9, 2.0))].into();
    let mut random = Random::new(4);
    let truth = Pose2::new(2.0, 0.0, 0.0);
    let shown = full_views(&truth, &places, &mounting(), &mut random);
    let e = expectations(&prior(truth, 0.02, 0.3), &places);
    let with = |picture_nats: f64, prior_nats: f64| {
        let mut made = observation(shown[0].0, shown[0].1);
        for c in &mut made.candidates {
            (c.picture_nats, c.prior_nats) = (picture_nats, prior_nats);
        }
        by_default(&e, &[made]).observations[0].clone()
    };
    assert!(matches!(with(8.0, 0.0), Association::Unique { landmark: LandmarkId(1), .. }));
    // At its predicted corners, with any odds: too little picture evidence.
    let weak = Association::None(NotAssociated::WeakEvidence { picture_nats: 4.0 });
    assert_eq!(with(4.0, 0.0), weak);
    assert_eq!(with(4.0, 1e6), weak);
    // Odds decide between two that are otherwise nearly as good, up to their limit.
    let mut at = prior(Pose2::new(1.45, 0.0, 0.0), 0.05, 0.5);
    at.covariance[(0, 0)] = 4.0;
    let e = expectations(&at, &places);
    let odds = |first: f64, second: f64| {
        let mut made = observation(shown[0].0, shown[0].1);
        made.candidates.retain(|c| c.landmark.0 <= 2);
        (made.candidates[0].prior_nats, made.candidates[1].prior_nats) = (first, second);
        by_default(&e, &[made]).observations[0].clone()
    };
    assert!(matches!(odds(0.0, 0.0), Association::Ambiguous { .. }));
    assert!(matches!(odds(1e6, 0.0), Association::Ambiguous { .. }), "4.6 nats at most");
    assert!(matches!(odds(4.6, -4.6), Association::Unique { landmark: LandmarkId(1), .. }));
}

#[test]
fn unassociated_observations_have_their_reason() {
    let places = corridor(2.0);
    let mut random = Random::new(6);
    let truth = Pose2::new(6.0, 0.0, 0.0);
    let e = expectations(&prior(truth, 0.03, 0.5), &places);
    let shown = full_views(&truth, &places, &mounting(), &mut random);
    let mut good: Vec<_> = shown.iter().map(|(id, c)| observation(*id, *c)).collect();
    // A door 0.7 m beside its place in the map.
    let off = full_views(&truth.plus(&Vector3::new(0.7, 0.0, 0.0)), &places, &mounting(), &mut random);
    good[0] = observation(off[0].0, off[0].1);
    // One that is not expected.
    let far = LandmarkId(1);
    assert!(e.of(far).is_none());
    good.push(Observation {
        candidates: vec![Candidate { landmark: far, picture_nats: 9.0, prior_nats: 0.0 }],
        ..good[1].clone()
    });
    let made = by_default(&e, &good);
    assert!(
        matches!(made.observations[0], Association::None(NotAssociated::OutsideGates { distance2 }) if distance2 > 100.0),
        "{:?}",
        made.observations[0]
    );
    assert_eq!(made.observations.last(), Some(&Association::None(NotAssociated::NotExpected)));
    assert_eq!(made.contradictions(), 1);
    assert!(made.observations[1..good.len() - 1].iter().all(|a| matches!(a, Association::Unique { .. })));
    // The same quad twice: either may be the door, so neither is unique.
    let doubled = vec![good[1].clone(), good[1].clone()];
    for a in by_default(&e, &doubled).observations {
        assert!(matches!(a, Association::Ambiguous { or_none: true, .. }), "{a:?}");
    }
}

#[test]
fn jointly_incompatible_observations_are_not_both_assigned() {
    // Each fits a pose error along the wall, in opposite directions.
    let places: BTreeMap<_, _> =
        [(LandmarkId(1), on_wall(3.0, 1.0, 0.9, 2.0)), (POSTER, on_wall(5.0, 1.5, 0.6, 0.84))].into();
    let mut random = Random::new(9);
    let mut at = prior(Pose2::new(1.8, 0.0, 0.0), 0.03, 0.3);
    at.covariance[(0, 0)] = 0.04;
    let e = expectations(&at, &places);
    let from = |dx: f64, id: LandmarkId, random: &mut Random| {
        let shown = full_views(&at.pose.plus(&Vector3::new(dx, 0.0, 0.0)), &places, &mounting(), random);
        let (id, corners) = *shown.iter().find(|s| s.0 == id).unwrap();
        observation(id, corners)
    };
    let mut door = from(0.3, LandmarkId(1), &mut random);
    door.candidates.retain(|c| c.landmark == LandmarkId(1));
    let poster = from(-0.3, POSTER, &mut random);
    let alone = |o: &Observation| unique(&by_default(&e, std::slice::from_ref(o)))[0];
    assert_eq!((alone(&door), alone(&poster)), (Some(1), Some(POSTER.0)));
    let made = by_default(&e, &[door, poster]);
    assert!(made.unique().count() <= 1, "{made:?}");
    assert!(made.dof <= 8, "{made:?}");
}

#[test]
fn order_of_observations_candidates_and_landmarks_changes_nothing() {
    let mut random = Random::new(11);
    for round in 0..30 {
        let places = corridor(random.range(1.0, 2.5));
        let sigma_m = random.range(0.02, 0.6);
        let at = prior(
            Pose2::new(random.range(0.0, 20.0), random.range(-0.5, 0.5), random.range(-0.2, 0.2)),
            sigma_m,
            1.5,
        );
        let truth = at.pose.plus(&draw3(&at.covariance, &mut random));
        let mut observations: Vec<_> = full_views(&truth, &places, &mounting(), &mut random)
            .into_iter()
            .map(|(id, c)| observation(id, c))
            .collect();
        let first = by_default(&expectations(&at, &places), &observations);
        // Rotate and reverse every list.
        let mut known = known(&places);
        known.rotate_left(round % 13);
        known.reverse();
        let (mounting, intrinsics) = (mounting(), camera());
        let view = CameraView { mounting: &mounting, intrinsics: &intrinsics, image_px: IMAGE_PX };
        let e = super::super::expect(&at, &view, &known, &[], &ExpectParams::default()).unwrap();
        observations.reverse();
        for o in &mut observations {
            let half = o.candidates.len() / 2;
            o.candidates.rotate_left(half);
            o.candidates.reverse();
        }
        let mut second = by_default(&e, &observations);
        second.observations.reverse();
        assert_eq!(first, second);
    }
}

#[test]
fn extreme_input_gives_an_error_or_a_result_and_lists_are_bounded() {
    let places = corridor(2.0);
    let mut random = Random::new(13);
    let truth = Pose2::new(6.0, 0.0, 0.0);
    let e = expectations(&prior(truth, 0.03, 0.5), &places);
    let shown = full_views(&truth, &places, &mounting(), &mut random);
    let one = observation(shown[0].0, shown[0].1);
    let p = AssociateParams::default();
    let refused = |o: Observation| match super::super::associate(&e, &[o], &p).unwrap_err() {
        GuidedError::OutOfRange(e) => e.field,
        GuidedError::TooMany { field, .. } => field,
    };
    let mut bad = one.clone();
    bad.candidates[0].picture_nats = f64::NAN;
    assert_eq!(refused(bad), "picture_nats");
    let mut bad = one.clone();
    bad.covariance_px2[(3, 3)] = -1.0;
    assert_eq!(refused(bad), "covariance_px2");
    let mut bad = one.clone();
    let candidate = bad.candidates[0];
    bad.candidates = vec![candidate; MAX_CANDIDATES];
    assert!(super::super::associate(&e, &[bad.clone()], &p).is_ok());
    bad.candidates.push(candidate);
    assert_eq!(refused(bad), "candidates");
    let many = vec![one.clone(); MAX_OBSERVATIONS];
    assert!(super::super::associate(&e, &many, &p).is_ok());
    let limit = MAX_OBSERVATIONS;
    let error = GuidedError::TooMany { field: "observations", count: limit + 1, limit };
    assert_eq!(super::super::associate(&e, &vec![one.clone(); limit + 1], &p).unwrap_err(), error);
    for scale in [0.0, 1e-12, 1e6, 1e11] {
        let mut made = one.clone();
        made.covariance_px2 = joint::CornerMatrix::identity() * scale;
        made.candidates[0].picture_nats = 1e6;
        let answer = by_default(&e, &[made]);
        assert!(answer.distance2.is_finite(), "{scale}");
    }
    assert_eq!(by_default(&e, &[]).nodes, 1);
}

#[test]
fn the_search_stops_at_its_bound_and_then_nothing_is_unique() {
    // Twenty doors in the same place to a few pixels and as many observations: factorially many
    // assignments.
    let places: BTreeMap<_, _> =
        (1..=DOORS).map(|i| (LandmarkId(i), on_wall(3.0 + 0.01 * i as f64, 1.0, 0.9, 2.0))).collect();
    let mut random = Random::new(14);
    let truth = Pose2::new(1.5, 0.0, 0.0);
    let e = expectations(&prior(truth, 0.1, 1.0), &places);
    let observations: Vec<_> = full_views(&truth, &places, &mounting(), &mut random)
        .into_iter()
        .map(|(id, c)| observation(id, c))
        .collect();
    assert_eq!(observations.len(), DOORS as usize);
    let made = by_default(&e, &observations);
    assert!(made.is_exhausted && made.nodes == MAX_NODES, "{}", made.nodes);
    assert_eq!(made.unique().count(), 0);
    let first = Association::Ambiguous { landmarks: (1..=DOORS).map(LandmarkId).collect(), or_none: true };
    assert_eq!(made.observations[0], first);
}
