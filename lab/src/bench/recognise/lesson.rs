//! A lesson: one landmark from many views, against the icons of all others of a map.

use super::{
    Args, fastest,
    landmarks::{picture, views, whole},
};
use serde::Serialize;
use vision::{
    learn::learn,
    model::{LandmarkId, ModelSet},
    params::Params,
    points::taught::view_points,
    recognise::IconFeatures,
};

/// The poster that is learnt: no landmark of the maps.
const POSTER: usize = 2_000_000;

/// Time and sizes of the lesson.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) views: usize,
    pub(super) others: usize,
    /// Icons of the others, three each as in the server.
    pub(super) negatives: usize,
    /// Time with views cut and negatives at hand; extracting the points of one photograph counts,
    /// if points are used.
    pub(super) ms: f64,
    pub(super) active: bool,
}

pub(super) fn run(args: &Args, first: u64, map: &ModelSet, p: &Params) -> anyhow::Result<Report> {
    let views = views(first, POSTER, args.views as usize - 1, p)?;
    let negatives: Vec<IconFeatures> = map.iter().flat_map(|m| m.features(&p.recognise)).collect();
    let photograph = picture(first, POSTER)?;
    let corners = whole(&photograph)?;
    let (ms, model) = fastest(args.rounds as usize, || {
        learn(LandmarkId(POSTER as u64), &views, &negatives, p)
            .map(|model| model.with_points(&[view_points(&photograph, &corners)]))
    });
    let model = model?;
    Ok(Report {
        views: views.len(),
        others: map.len(),
        negatives: negatives.len(),
        ms,
        active: model.is_active(),
    })
}
