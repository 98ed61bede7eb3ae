use super::*;
use crate::learn::random::Random;

/// Candidates with random features whose true rank is linear: the one that a rank with Gumbel noise picks is right.
fn rivals(count: usize, truth: &[f64], seed: u64) -> Vec<Rivals> {
    let mut random = Random::new(seed);
    (0..count)
        .map(|group| {
            let features: Vec<Vec<f64>> =
                (0..6).map(|_| truth.iter().map(|_| random.range(-1.0, 1.0)).collect()).collect();
            let noisy: Vec<f64> =
                features.iter().map(|f| rank(truth, f) - (-random.range(1e-12, 1.0).ln()).ln()).collect();
            let best = noisy.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let overlap = noisy.iter().map(|n| if *n >= best { 0.9 } else { 0.3 }).collect();
            Rivals { group, features, overlap }
        })
        .collect()
}

#[test]
fn the_weights_that_made_the_choices_come_back() {
    let truth = [2.0, -1.0, 0.0, 3.0];
    let found = fit(&rivals(6000, &truth, 1), &FitParams { ridge: 1e-3, ..FitParams::default() }).unwrap();
    for (f, t) in found.iter().zip(truth) {
        assert!((f - t).abs() < 0.2, "{found:?}");
    }
}

#[test]
fn at_the_optimum_the_objective_is_flat() {
    // Independent of the solver: finite differences of the objective, written out once more.
    let all = rivals(60, &[1.0, -2.0, 0.5], 2);
    let p = FitParams::default();
    let weights = fit(&all, &p).unwrap();
    let refs: Vec<&Rivals> = all.iter().collect();
    let deviation = spread(&refs).1;
    let objective = |w: &[f64]| {
        let likelihood: f64 = all
            .iter()
            .map(|r| {
                let right = r.overlap.iter().position(|o| *o > 0.5).unwrap();
                let sum: f64 = r.features.iter().map(|f| rank(w, f).exp()).sum();
                rank(w, &r.features[right]) - sum.ln()
            })
            .sum();
        let ridge: f64 = w.iter().zip(&deviation).map(|(w, d)| (w * d).powi(2)).sum();
        likelihood - 0.5 * p.ridge * ridge
    };
    let best = objective(&weights);
    for i in 0..weights.len() {
        for step in [-1e-2, 1e-2] {
            let mut moved = weights.clone();
            moved[i] += step;
            assert!(objective(&moved) < best, "weight {i}");
        }
    }
}

#[test]
fn the_unit_of_a_feature_does_not_matter() {
    let all = rivals(80, &[1.5, -1.0], 3);
    let mut other = all.clone();
    for f in other.iter_mut().flat_map(|r| &mut r.features) {
        f[1] = 1000.0 * f[1] + 7.0;
    }
    let (a, b) = (fit(&all, &FitParams::default()).unwrap(), fit(&other, &FitParams::default()).unwrap());
    assert!((a[0] - b[0]).abs() < 1e-6 && (a[1] - 1000.0 * b[1]).abs() < 1e-6, "{a:?} {b:?}");
}

#[test]
fn a_feature_that_never_varies_gets_no_weight() {
    let mut all = rivals(40, &[1.5], 4);
    all.iter_mut().flat_map(|r| &mut r.features).for_each(|f| f.push(3.0));
    assert!(fit(&all, &FitParams::default()).unwrap()[1].abs() < f64::MIN_POSITIVE);
}

#[test]
fn what_is_held_out_is_judged_by_the_others() {
    // The right rank is turned round in every second group, which is fold 1 of 2: weights of the one fail on the other.
    let mut all = rivals(60, &[40.0], 5);
    for r in all.iter_mut().filter(|r| r.group % 2 == 1) {
        r.features.iter_mut().flatten().for_each(|x| *x = -*x);
    }
    let seen = fit(&all[..1], &FitParams::default()).unwrap();
    assert_eq!(Choice::of(&all[..1], |r, i| rank(&seen, &r.features[i])).found_85, 1);
    let held_out = cross_validate(&all, 2, &FitParams::default()).unwrap();
    assert_eq!((held_out.rivals, held_out.found_85), (60, 0));
    let same = cross_validate(&rivals(60, &[40.0], 5), 5, &FitParams::default()).unwrap();
    assert!(same.found_85 > 50, "{same:?}");
}

#[test]
fn ties_are_as_right_as_the_best() {
    assert_eq!(wanted(&[0.9, 0.89, 0.5], 0.02), Some(vec![0.5, 0.5, 0.0]));
    assert_eq!(wanted(&[0.9, 0.88, 0.5], 0.02), Some(vec![1.0, 0.0, 0.0]));
    assert_eq!(wanted(&[0.9, 0.89], 0.02), None);
    assert_eq!(wanted(&[], 0.02), None);
}

#[test]
fn of_equal_ranks_the_earlier_is_chosen() {
    let r = Rivals { group: 0, features: vec![vec![1.0], vec![1.0]], overlap: vec![0.8, 0.95] };
    let choice = Choice::of([&r], |r, i| r.features[i][0]);
    assert_eq!((choice.found_70, choice.found_85), (1, 0));
    assert!((choice.mean_overlap - 0.8).abs() < 1e-12);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let p = FitParams::default();
    let good = rivals(4, &[1.0], 6);
    assert_eq!(fit(&[], &p), Err(FitError::NoRivals));
    let mut bad = good.clone();
    bad[2].features[0][0] = f64::NAN;
    assert_eq!(fit(&bad, &p), Err(FitError::Malformed(2)));
    bad = good.clone();
    bad[1].overlap.pop();
    assert_eq!(fit(&bad, &p), Err(FitError::Malformed(1)));
    bad = good.clone();
    bad[3].features[1].push(0.0);
    assert_eq!(fit(&bad, &p), Err(FitError::Malformed(3)));
    assert_eq!(fit(&good, &FitParams { ridge: 0.0, ..p.clone() }), Err(FitError::Ridge(0.0)));
    assert_eq!(cross_validate(&good[..1], 5, &p), Err(FitError::Folds { groups: 1, folds: 1 }));
    assert_eq!(cross_validate(&good, 1, &p), Err(FitError::Folds { groups: 4, folds: 1 }));
}
