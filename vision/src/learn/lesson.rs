//! The lesson: views of one landmark in, its model out (method 7 to 9 on one page); and fitting tau anew when the
//! other landmarks change. Collecting views, storing models and telling look-alikes apart is the caller's.

use super::{
    gates::{saliency, saliency_f, stable_points, v_c},
    model::{
        Evidence, Gate, GateFailure, LandmarkModel, LearnError, MAX_VIEWS, ModelStatus, View, distances,
    },
    pca::{exemplars, modes},
    threshold::{LimitedBy, Threshold, ThresholdError, threshold},
};
use crate::{
    icon::Icon,
    params::{Params, RecogniseParams},
    recognise::{
        IconFeatures, LandmarkId,
        align::{Aligner, Surroundings, Template},
        features,
        likeness::likeness,
        signature,
    },
};

/// Learns a landmark. `negatives` are icons of everything it must be told from: other landmarks, and quads that are
/// no landmark. Without any, the absolute caps of [`super::model::LearnParams`] stand in for them.
pub fn learn(
    id: LandmarkId,
    views: &[View],
    negatives: &[IconFeatures],
    p: &Params,
) -> Result<LandmarkModel, LearnError> {
    check(views, p)?;
    let icons: Vec<IconFeatures> = views.iter().map(|v| features(whole(&v.icon), &p.recognise)).collect();
    let pixels: Vec<&[f32]> = icons.iter().map(|i| i.icon.pixels.as_slice()).collect();
    let components = modes(&pixels).ok_or(LearnError::NoComponents)?;
    let chosen: Vec<usize> = exemplars(&components).iter().map(|e| e.index).collect();
    let own = own_distances(&icons, &chosen, p).ok_or(LearnError::NoComponents)?;

    let saliency_f = saliency_f(&pixels);
    let points: Vec<_> = icons.iter().map(|i| &i.points).collect();
    let stable_points = chosen.first().map_or(0, |mean| stable_points(*mean, &points, &p.learn.gates));
    let model = LandmarkModel {
        id,
        params_hash: p.distance_hash(),
        views: views.len(),
        generated_views: views.iter().filter(|v| v.generated).count(),
        exemplars: chosen.iter().map(|i| icons[*i].clone()).collect(),
        eigenvalues: components.eigenvalues,
        total_variance: components.total_variance,
        correlation: Threshold::NEVER,
        hausdorff: Threshold::NEVER,
        correlation_evidence: Evidence { own: rising(own.iter().map(|d| d.0)), ..Evidence::default() },
        hausdorff_evidence: Evidence { own: rising(own.iter().map(|d| d.1)), ..Evidence::default() },
        likeness: Threshold::NEVER,
        likeness_evidence: Evidence {
            own: rising(own_unlikeness(&icons, &chosen, p).into_iter()),
            ..Evidence::default()
        },
        saliency_f,
        stable_points,
        saliency: saliency(saliency_f, stable_points),
        v_c: v_c(&seen_at(views, true)),
        photographed_v_c: v_c(&seen_at(views, false)),
        status: ModelStatus::Candidate(vec![]),
    };
    Ok(refit_thresholds(&model, negatives, p))
}

/// The same model with tau fitted to its own distances and to `negatives`, forgetting earlier ones. Cheap: the own
/// distances are kept in the model.
#[must_use]
pub fn refit_thresholds(model: &LandmarkModel, negatives: &[IconFeatures], p: &Params) -> LandmarkModel {
    let mut model = model.clone();
    let LandmarkModel { correlation_evidence, hausdorff_evidence, likeness_evidence, .. } = &mut model;
    for evidence in [correlation_evidence, hausdorff_evidence, likeness_evidence] {
        (evidence.nearest_others, evidence.others) = (vec![], 0);
    }
    add_negatives(&model, negatives, p)
}

/// The same model with `negatives` added to those it was fitted to: one new landmark costs one comparison with its
/// icons, not with everybody's.
#[must_use]
pub fn add_negatives(model: &LandmarkModel, negatives: &[IconFeatures], p: &Params) -> LandmarkModel {
    let mut model = model.clone();
    let exemplars = model.exemplars.clone();
    let templates = templates(&exemplars);
    for negative in negatives {
        let d = model.distances(negative, &p.recognise);
        model.correlation_evidence.add(d.correlation);
        model.hausdorff_evidence.add(d.hausdorff);
        model.likeness_evidence.add(unlikeness(&templates, negative, MIN_SIGNATURE, p));
    }
    let correlation = fitted(&model.correlation_evidence, p.learn.correlation_cap, p);
    let hausdorff = fitted(&model.hausdorff_evidence, p.learn.hausdorff_cap, p);
    let likeness = fitted_likeness(&model.likeness_evidence, p);
    model.correlation = correlation.unwrap_or(Threshold::NEVER);
    model.hausdorff = hausdorff.unwrap_or(Threshold::NEVER);
    model.likeness = likeness.unwrap_or(Threshold::NEVER);
    let missing = [
        correlation.err().map(Gate::CorrelationThreshold),
        hausdorff.err().map(Gate::HausdorffThreshold),
        likeness.err().map(Gate::LikenessThreshold),
    ];
    model.status = status(&model, missing, p);
    model
}

impl Evidence {
    /// Counts a distance of something else, and keeps it if it is among the nearest.
    fn add(&mut self, distance: f64) {
        self.others += 1;
        let distance = distance as f32;
        let at = self.nearest_others.partition_point(|d| *d <= distance);
        if at < Self::MAX_NEAREST {
            self.nearest_others.insert(at, distance);
            self.nearest_others.truncate(Self::MAX_NEAREST);
        }
    }
}

/// tau from the evidence. Distances that were only counted lie beyond the farthest one kept, so tau stays below it.
fn fitted(evidence: &Evidence, cap: f64, p: &Params) -> Result<Threshold, ThresholdError> {
    let own: Vec<f64> = evidence.own.iter().map(|d| f64::from(*d)).collect();
    let mut others: Vec<f64> = evidence.nearest_others.iter().map(|d| f64::from(*d)).collect();
    let counted_only = evidence.others > others.len();
    let cap = others.last().filter(|_| counted_only).map_or(cap, |farthest| cap.min(*farthest));
    others.resize(evidence.others, f64::INFINITY);
    threshold(&own, &others, cap, &p.learn.threshold)
}

/// Negatives whose signatures are less alike are not laid on the exemplars: they count as infinitely far.
const MIN_SIGNATURE: f32 = 0.45;

fn templates(exemplars: &[IconFeatures]) -> Vec<(&IconFeatures, Template<'_>)> {
    exemplars.iter().map(|e| (e, Template::new(&e.icon, &e.coarse))).collect()
}

/// The smallest 1 minus likeness of `icon` to the exemplars after alignment, of those whose signatures are alike enough.
fn unlikeness(
    templates: &[(&IconFeatures, Template<'_>)],
    icon: &IconFeatures,
    min_signature: f32,
    p: &Params,
) -> f64 {
    let (c, a) = (&p.recognise.correlation, &p.recognise.verdict.align);
    let aligner = Aligner::new(p.icon.size, c, a);
    let mut around = None;
    let mut least = f64::INFINITY;
    for (exemplar, template) in templates {
        if signature::likeness(exemplar.signature.values(), icon.signature.values()) < min_signature {
            continue;
        }
        let around = around.get_or_insert_with(|| Surroundings::of_icon(&icon.icon, a));
        let laid = around.as_ref().and_then(|s| aligner.align(s, template));
        let laid = laid.as_ref().map_or(&icon.icon, |l| &l.icon);
        least = least.min(1.0 - likeness(laid, &exemplar.icon, c));
    }
    least
}

/// Own icons that are laid on the exemplars, evenly chosen: only their median counts.
const MAX_OWN_LAID: usize = 9;

/// The same of the landmark's own icons that are no exemplars.
fn own_unlikeness(icons: &[IconFeatures], chosen: &[usize], p: &Params) -> Vec<f64> {
    let exemplars: Vec<IconFeatures> = chosen.iter().map(|i| icons[*i].clone()).collect();
    let templates = templates(&exemplars);
    let others: Vec<_> = icons.iter().enumerate().filter(|(i, _)| !chosen.contains(i)).collect();
    let every = others.len().div_ceil(MAX_OWN_LAID).max(1);
    others.into_iter().step_by(every).map(|(_, icon)| unlikeness(&templates, icon, -1.0, p)).collect()
}

/// tau of the likeness: the cap, or a share of the nearest of everything else. None where the greater part of the
/// landmark's own views would be refused.
// Departs from method 8: own distances have no say in tau but that. Those of generated views, or of one robot's drive,
// are far smaller than another day's (reflections, dust, another camera); what is safe is said by the others alone.
fn fitted_likeness(evidence: &Evidence, p: &Params) -> Result<Threshold, ThresholdError> {
    let mut own: Vec<f64> = evidence.own.iter().map(|d| f64::from(*d)).collect();
    own.sort_by(f64::total_cmp);
    let median = own.get(own.len() / 2).copied().ok_or(ThresholdError::NoPositive)?;
    let nearest = evidence.nearest_others.first().map_or(f64::INFINITY, |d| f64::from(*d));
    let share = p.learn.threshold.nearest_share * nearest;
    let (tau, limited_by) = if share < p.learn.likeness_cap {
        (share, LimitedBy::NearestNegative)
    } else {
        (p.learn.likeness_cap, LimitedBy::AbsoluteCap)
    };
    if median >= tau {
        return Err(ThresholdError::Overlap);
    }
    let missed = own.iter().filter(|d| **d >= tau).count();
    Ok(Threshold {
        tau,
        // tau is below the nearest of them.
        false_positive_rate: 0.0,
        false_negative_rate: missed as f64 / own.len() as f64,
        positives: own.len(),
        negatives: evidence.others,
        limited_by,
    })
}

/// Method 9: what the model fails, if anything.
fn status(model: &LandmarkModel, missing: [Option<Gate>; 3], p: &Params) -> ModelStatus {
    let g = &p.learn.gates;
    let observed = model.views - model.generated_views > 1;
    let min_saliency_f = if observed { g.min_saliency_f } else { g.min_saliency_f_generated };
    let measured = [
        (Gate::Views, model.views as f64, g.min_views as f64),
        (Gate::Saliency, model.saliency_f, min_saliency_f),
        (Gate::StablePoints, model.stable_points as f64, g.min_stable_points as f64),
        (Gate::VisibilityConfidence, model.v_c, g.min_v_c),
    ];
    let mut failures: Vec<GateFailure> = measured
        .into_iter()
        .filter(|(_, value, limit)| value < limit)
        .map(|(gate, value, limit)| GateFailure { gate, value, limit })
        .collect();
    failures.extend(missing.into_iter().flatten().map(|gate| GateFailure { gate, value: 0.0, limit: 0.0 }));
    if failures.is_empty() { ModelStatus::Active } else { ModelStatus::Candidate(failures) }
}

/// Distances (C^r, H^r) of the landmark's own icons, none to a model that holds the icon itself (A19): by folds with
/// many views, otherwise of the icons that are no exemplars. `None` if a fold has no components.
fn own_distances(icons: &[IconFeatures], chosen: &[usize], p: &Params) -> Option<Vec<(f64, f64)>> {
    let to = |exemplars: &[IconFeatures], icon: &IconFeatures, p: &RecogniseParams| {
        let d = distances(exemplars, icon, p);
        (d.correlation, d.hausdorff)
    };
    if icons.len() < p.learn.min_views_for_folds.max(2) {
        let model: Vec<IconFeatures> = chosen.iter().map(|i| icons[*i].clone()).collect();
        let others = icons.iter().enumerate().filter(|(i, _)| !chosen.contains(i));
        return Some(others.map(|(_, icon)| to(&model, icon, &p.recognise)).collect());
    }
    let folds = p.learn.folds.clamp(2, icons.len());
    let mut own = Vec::with_capacity(icons.len());
    for fold in 0..folds {
        let taught: Vec<&IconFeatures> =
            icons.iter().enumerate().filter(|(i, _)| i % folds != fold).map(|(_, icon)| icon).collect();
        let pixels: Vec<&[f32]> = taught.iter().map(|i| i.icon.pixels.as_slice()).collect();
        let model: Vec<IconFeatures> =
            exemplars(&modes(&pixels)?).iter().map(|e| taught[e.index].clone()).collect();
        own.extend(icons.iter().skip(fold).step_by(folds).map(|icon| to(&model, icon, &p.recognise)));
    }
    Some(own)
}

/// The icon in whole grey levels, so that a model in memory and the same model stored agree bit for bit.
fn whole(icon: &Icon) -> Icon {
    let pixels = icon.pixels.iter().map(|g| g.round().clamp(0.0, 255.0)).collect();
    Icon { pixels, ..*icon }
}

fn rising(distances: impl Iterator<Item = f64>) -> Vec<f32> {
    let mut rising: Vec<f32> = distances.map(|d| d as f32).collect();
    rising.sort_by(f32::total_cmp);
    rising
}

/// Corners and image sizes of all views, or of the photographed ones.
fn seen_at(views: &[View], generated: bool) -> Vec<([nalgebra::Point2<f64>; 4], [f64; 2])> {
    let of_interest = views.iter().filter(|v| generated || !v.generated);
    of_interest.map(|v| (*v.corners_px.points(), v.image_size_px.map(|s| s as f64))).collect()
}

fn check(views: &[View], p: &Params) -> Result<(), LearnError> {
    if views.is_empty() {
        return Err(LearnError::NoView);
    }
    if views.len() > MAX_VIEWS {
        return Err(LearnError::TooManyViews { found: views.len() });
    }
    let expected = p.icon.size;
    match views.iter().position(|v| v.icon.size != expected || v.icon.pixels.len() != expected * expected) {
        Some(index) => Err(LearnError::IconSize { index, found: views[index].icon.size, expected }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        detect::quads::Corners,
        frame::GrayImage,
        learn::{
            model::{MAX_EXEMPLARS, StoredModelError},
            random::Random,
            synthesis,
            threshold::LimitedBy,
        },
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

    /// End to end at N = 50: every landmark is taught from one picture, then fresh views are compared with all.
    #[test]
    fn fifty_landmarks_know_themselves_and_refuse_the_others() {
        let p = Params::default();
        let alone: Vec<LandmarkModel> = (0..50).map(|seed| lesson(seed, 20, &[])).collect();
        let models: Vec<LandmarkModel> = (0..50)
            .map(|i| {
                let others: Vec<IconFeatures> = alone
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| *j != i)
                    .flat_map(|(_, m)| m.exemplars.clone())
                    .collect();
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
        // Strangers: posters that nobody taught.
        for seed in 500..560 {
            for view in synthesis::views(&poster(seed), &whole(), 1, &p, seed) {
                let icon = features(view.icon, &p.recognise);
                assert!(models.iter().all(|m| !accepts(m, &icon)), "stranger {seed}");
            }
        }
    }

    #[test]
    fn likeness_is_held_by_the_nearest_of_the_others() {
        let p = Params::default();
        let alone = lesson(3, 20, &[]);
        assert!((alone.likeness.tau - p.learn.likeness_cap).abs() < 1e-12);
        assert_eq!((alone.likeness.limited_by, alone.likeness.negatives), (LimitedBy::AbsoluteCap, 0));
        // What is nothing like it changes nothing, a look-alike much: itself under a stain, here.
        let stranger = lesson(4, 20, &[]).exemplars[0].clone();
        let far = add_negatives(&alone, &[stranger], &p);
        assert!((far.likeness.tau - p.learn.likeness_cap).abs() < 1e-12 && far.likeness.negatives == 1);
        let mut stained = poster(3);
        stained = GrayImage::from_fn(300, 400, |u, v| {
            if u > 110 && v > 180 { (60 + (u / 9 + v / 11) % 2 * 90) as u8 } else { stained.at(u, v) }
        });
        let view = View::photographed(&stained, &whole(), &p).unwrap();
        let near = add_negatives(&alone, &[features(view.icon, &p.recognise)], &p);
        assert_eq!(near.likeness.limited_by, LimitedBy::NearestNegative);
        assert!(near.likeness.tau < 0.9 * p.learn.likeness_cap, "{:?}", near.likeness);
        // Itself: nothing can tell them apart, and so it is not used.
        let twin = add_negatives(&alone, &alone.exemplars.clone(), &p);
        let ModelStatus::Candidate(failures) = &twin.status else { panic!("told from itself?") };
        assert!(failures.iter().any(|f| f.gate == Gate::LikenessThreshold(ThresholdError::Overlap)));
    }

    #[test]
    fn a_model_tells_what_it_was_learnt_from() {
        let p = Params::default();
        let mut views = synthesis::views(&poster(1), &whole(), 24, &p, 1);
        views.push(View::photographed(&poster(1), &whole(), &p).unwrap());
        let model = learn(LandmarkId(7), &views, &[], &p).unwrap();
        assert_eq!((model.id, model.views, model.generated_views), (LandmarkId(7), 25, 24));
        assert!(model.views_generated() && model.v_c > 0.5 && model.photographed_v_c.abs() < 1e-12);
        assert!((1..=MAX_EXEMPLARS).contains(&model.exemplars.len()));
        assert_eq!(model.correlation.positives, 25 - model.exemplars.len());
        assert_eq!(model.params_hash, p.distance_hash());
        assert!(
            model.correlation.tau <= p.learn.correlation_cap && model.hausdorff.tau <= p.learn.hausdorff_cap
        );
    }

    #[test]
    fn folds_measure_every_view() {
        let model = lesson(2, 40, &[]);
        assert_eq!(model.correlation.positives, 40);
        assert!(model.correlation_evidence.own[0] > 0.0, "no view is compared with itself");
    }

    #[test]
    fn what_fails_a_gate_stays_a_candidate_with_its_number() {
        let p = Params::default();
        let blank = GrayImage::from_fn(300, 400, |u, _| 120 + (u / 60) as u8);
        let views = synthesis::views(&blank, &whole(), 20, &p, 1);
        let model = learn(LandmarkId(1), &views, &[], &p).unwrap();
        let ModelStatus::Candidate(failures) = &model.status else { panic!("a blank panel is no landmark") };
        let gates: Vec<Gate> = failures.iter().map(|f| f.gate).collect();
        assert!(gates.contains(&Gate::Saliency) && gates.contains(&Gate::StablePoints), "{gates:?}");
        assert!(gates.contains(&Gate::HausdorffThreshold(ThresholdError::NothingFinite)), "{gates:?}");
        assert!(model.hausdorff.tau.abs() < 1e-12, "accepts nothing");

        let one = View::photographed(&poster(1), &whole(), &p).unwrap();
        let model = learn(LandmarkId(1), &[one.clone(), one], &[], &p).unwrap();
        let ModelStatus::Candidate(failures) = &model.status else {
            panic!("two equal views are not enough")
        };
        let views = failures.iter().find(|f| f.gate == Gate::Views).unwrap();
        assert_eq!(views.to_string(), "2 views, at least 20 needed");
        assert!(failures.iter().any(|f| f.gate == Gate::VisibilityConfidence && f.value.abs() < 1e-9));
    }

    #[test]
    fn impossible_lessons_are_refused() {
        let p = Params::default();
        assert_eq!(learn(LandmarkId(1), &[], &[], &p), Err(LearnError::NoView));
        let view = View::photographed(&poster(1), &whole(), &p).unwrap();
        let many = vec![view.clone(); MAX_VIEWS + 1];
        assert_eq!(
            learn(LandmarkId(1), &many, &[], &p),
            Err(LearnError::TooManyViews { found: MAX_VIEWS + 1 })
        );
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
    fn negatives_may_come_one_after_the_other() {
        let p = Params::default();
        let others: Vec<IconFeatures> = (10..22).flat_map(|seed| lesson(seed, 6, &[]).exemplars).collect();
        let model = lesson(3, 20, &others);
        let step = add_negatives(&add_negatives(&lesson(3, 20, &[]), &others[..9], &p), &others[9..], &p);
        assert_eq!(model, step);
        assert_eq!(model.correlation.negatives, others.len());
        assert_eq!(refit_thresholds(&model, &[], &p), lesson(3, 20, &[]));
        // A copy of the landmark among the negatives makes tau no looser.
        let twin = add_negatives(&model, &lesson(3, 6, &[]).exemplars, &p);
        assert!(twin.correlation.tau <= model.correlation.tau);
    }

    #[test]
    fn counted_negatives_hold_tau_below_those_kept() {
        let mut evidence = Evidence { own: vec![0.1, 0.2, 0.9], ..Evidence::default() };
        for i in 0..200 {
            evidence.add(0.3 + f64::from(i % 100) * 1e-3);
        }
        assert_eq!((evidence.others, evidence.nearest_others.len()), (200, Evidence::MAX_NEAREST));
        assert!(evidence.nearest_others.is_sorted() && evidence.nearest_others[63] < 0.3325);
        let cheap = Params {
            learn: crate::learn::model::LearnParams {
                threshold: crate::learn::threshold::ThresholdParams {
                    false_positive_weight: 0.1,
                    nearest_share: 0.9,
                },
                ..Default::default()
            },
            ..Params::default()
        };
        // With false positives all but free, tau would go to 0.5; what was only counted keeps it below.
        let held = fitted(&evidence, 0.5, &cheap).unwrap();
        assert!(held.tau <= f64::from(evidence.nearest_others[63]), "{}", held.tau);
        assert_eq!(held.limited_by, LimitedBy::AbsoluteCap);
    }

    #[test]
    fn a_stored_model_is_the_same_bit_for_bit() {
        let p = Params::default();
        let others: Vec<IconFeatures> = (10..40).flat_map(|seed| lesson(seed, 4, &[]).exemplars).collect();
        let model = lesson(3, 20, &others);
        let bytes = model.to_bytes();
        assert!(bytes.len() < 64 * 1024, "{}", bytes.len());
        assert_eq!(LandmarkModel::from_bytes(&bytes, &p).unwrap(), model);

        let mut other = p.clone();
        other.recognise.correlation.rank += 1;
        assert!(matches!(LandmarkModel::from_bytes(&bytes, &other), Err(StoredModelError::Params { .. })));
        let mut later = bytes.clone();
        later[4] += 1;
        assert_eq!(LandmarkModel::from_bytes(&later, &p), Err(StoredModelError::Version { found: 3 }));
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
        /// Bytes that pass the digest and still are nonsense: typed error or a model, never a panic.
        #[test]
        fn forged_bytes_never_panic(
            edits in proptest::collection::vec((6usize..400, any::<u8>()), 1..6),
            cut in 0usize..300,
            seal in any::<bool>(),
        ) {
            use std::sync::OnceLock;
            static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
            let bytes = BYTES.get_or_init(|| lesson(3, 20, &lesson(4, 4, &[]).exemplars).to_bytes());
            let mut forged = bytes[..bytes.len() - 8 - cut].to_vec();
            for (at, value) in &edits {
                forged[*at] = *value;
            }
            if seal {
                let sum = crate::learn::stored::digest(&forged);
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
}
