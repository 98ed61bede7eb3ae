//! Trains a landmark model: views of one landmark in, its model out (method 7 to 9).
//! `threshold_fit` sets the thresholds. The caller collects views, stores models and reports
//! look-alikes.

use crate::{
    icon::Icon,
    learn::{
        gates::{saliency, saliency_f, seen_from, stable_points, v_c},
        pca::{exemplars, modes},
        threshold_fit::{Templates, prepared, refit_thresholds},
        training_view::TrainingView,
    },
    model::{
        components::Components,
        exemplar::Exemplar,
        landmark_id::LandmarkId,
        landmark_model::{DistanceSamples, LandmarkModel, MAX_VIEWS, ModelStatus, distances},
        threshold::Threshold,
    },
    params::Params,
    recognise::{
        features::icon_features::{IconFeatures, features},
        params::RecogniseParams,
    },
};

/// Why no model could be trained.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LearnError {
    /// No view.
    #[error("views: none given")]
    NoView,
    /// Too many views.
    #[error("views: {found} given, at most {MAX_VIEWS} allowed")]
    TooManyViews {
        /// Number of views given.
        found: usize,
    },
    /// A view's icon has another size than the parameters say.
    #[error("views: icon {index} is {found} px wide, the parameters say {expected}")]
    IconSize {
        /// Index of the view.
        index: usize,
        /// Its icon's side in pixels.
        found: usize,
        /// The icon side of the parameters.
        expected: usize,
    },
    /// A view's icon contains values that are not grey levels, or the components do not converge.
    #[error("views: the icons have no principal components")]
    NoComponents,
}

/// Trains the model of a landmark. `negatives` are icons of other landmarks and of quads that are
/// not landmarks. Without any, the absolute caps of [`crate::learn::params::LearnParams`] apply.
pub fn learn(
    id: LandmarkId,
    views: &[TrainingView],
    negatives: &[IconFeatures],
    p: &Params,
) -> Result<LandmarkModel, LearnError> {
    check(views, p)?;
    let icons: Vec<IconFeatures> = views.iter().map(|v| features(whole(&v.icon), &p.recognise)).collect();
    let pixels: Vec<&[f32]> = icons.iter().map(|i| i.icon.pixels.as_slice()).collect();
    let components = modes(&pixels).ok_or(LearnError::NoComponents)?;
    let chosen: Vec<usize> = exemplars(&components).iter().map(|e| e.index).collect();
    // An exemplar cut along detected corners would pass their error on to every picture aligned
    // with it.
    let exemplar = |i: usize| {
        views[i].exact.as_ref().map_or_else(|| icons[i].clone(), |e| features(whole(e), &p.recognise))
    };
    let exemplar_features: Vec<IconFeatures> = chosen.iter().map(|i| exemplar(*i)).collect();
    let own =
        own_distances(&icons, (&chosen, &exemplar_features), exemplar, p).ok_or(LearnError::NoComponents)?;
    let exemplars: Vec<Exemplar> = exemplar_features.iter().map(|k| Exemplar::new(&k.icon)).collect();

    let photographed = corners_and_sizes(views, false);
    let saliency_f = saliency_f(&pixels);
    let points: Vec<_> = icons.iter().map(|i| &i.points).collect();
    let stable_points = chosen.first().map_or(0, |mean| stable_points(*mean, &points, &p.learn.gates));
    let model = LandmarkModel {
        id,
        params_hash: p.distance_hash(),
        views: views.len(),
        generated_views: views.iter().filter(|v| v.generated).count(),
        components: Components::new(p.icon.size, &components),
        eigenvalues: components.eigenvalues,
        total_variance: components.total_variance,
        correlation: Threshold::NEVER,
        hausdorff: Threshold::NEVER,
        correlation_evidence: DistanceSamples {
            own: rising(own.iter().map(|d| d.0)),
            ..DistanceSamples::default()
        },
        hausdorff_evidence: DistanceSamples {
            own: rising(own.iter().map(|d| d.1)),
            ..DistanceSamples::default()
        },
        likeness: Threshold::NEVER,
        likeness_evidence: DistanceSamples {
            own: rising(own_unlikeness(&icons, (&chosen, &exemplars), p).into_iter()),
            ..DistanceSamples::default()
        },
        saliency_f,
        stable_points,
        saliency: saliency(saliency_f, stable_points),
        v_c: v_c(&corners_and_sizes(views, true)),
        photographed_v_c: v_c(&photographed),
        seen_from: seen_from(photographed.iter().map(|(corners, _)| corners)),
        status: ModelStatus::Candidate(vec![]),
        waived: vec![],
        points: vec![],
        exemplars,
    };
    Ok(refit_thresholds(&model, negatives, p))
}

/// Own icons that are aligned with the exemplars, evenly chosen: only their median is used.
const MAX_OWN_ALIGNED: usize = 9;

/// 1 minus the likeness of the landmark's own icons that are not exemplars, aligned with the
/// exemplars.
fn own_unlikeness(
    icons: &[IconFeatures],
    (chosen, exemplars): (&[usize], &[Exemplar]),
    p: &Params,
) -> Vec<f64> {
    let prepared = prepared(exemplars, p);
    let templates = Templates::new(&prepared, p);
    let others: Vec<_> = icons.iter().enumerate().filter(|(i, _)| !chosen.contains(i)).collect();
    let every = others.len().div_ceil(MAX_OWN_ALIGNED).max(1);
    others.into_iter().step_by(every).map(|(_, icon)| templates.unlikeness(icon, -1.0)).collect()
}

/// Held-out distances (C^r, H^r) of the landmark's own icons, none to a model with the icon itself
/// (A19): by folds with many views, otherwise of the icons that are not exemplars. `None` if a fold
/// has no components.
fn own_distances(
    icons: &[IconFeatures],
    (chosen, kept): (&[usize], &[IconFeatures]),
    exemplar: impl Fn(usize) -> IconFeatures,
    p: &Params,
) -> Option<Vec<(f64, f64)>> {
    let to = |exemplars: &[IconFeatures], icon: &IconFeatures, p: &RecogniseParams| {
        let d = distances(exemplars, icon, p);
        (d.correlation, d.hausdorff)
    };
    if icons.len() < p.learn.min_views_for_folds.max(2) {
        let others = icons.iter().enumerate().filter(|(i, _)| !chosen.contains(i));
        return Some(others.map(|(_, icon)| to(kept, icon, &p.recognise)).collect());
    }
    let folds = p.learn.folds.clamp(2, icons.len());
    let mut own = Vec::with_capacity(icons.len());
    for fold in 0..folds {
        let taught: Vec<usize> = (0..icons.len()).filter(|i| i % folds != fold).collect();
        let pixels: Vec<&[f32]> = taught.iter().map(|i| icons[*i].icon.pixels.as_slice()).collect();
        let model: Vec<IconFeatures> =
            exemplars(&modes(&pixels)?).iter().map(|e| exemplar(taught[e.index])).collect();
        own.extend(icons.iter().skip(fold).step_by(folds).map(|icon| to(&model, icon, &p.recognise)));
    }
    Some(own)
}

/// The icon rounded to whole grey levels, so that a model in memory and the stored model are equal
/// bit for bit.
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
fn corners_and_sizes(views: &[TrainingView], generated: bool) -> Vec<([nalgebra::Point2<f64>; 4], [f64; 2])> {
    let of_interest = views.iter().filter(|v| generated || !v.generated);
    of_interest.map(|v| (*v.corners_px.points(), v.image_size_px.map(|s| s as f64))).collect()
}

fn check(views: &[TrainingView], p: &Params) -> Result<(), LearnError> {
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
mod tests;
