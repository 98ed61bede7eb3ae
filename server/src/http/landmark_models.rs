//! What was learnt of a landmark: its model, its icon, its distances, and which landmarks of a map
//! look alike.

use super::{
    AppState,
    answers::page,
    error::ApiError,
    extract::{PathParams, QueryParams, page_limit},
    landmarks::shown,
    pictures::{ASK_AGAIN, IfNoneMatch, PictureHead},
};
use crate::store::{StoreError, kind::Kind, landmarks, maps, models, pictures::hex, stored_answers};
use axum::{Json, extract::State, http::StatusCode, response::Response};
use engine::{picture, snapshot::StoredModel};
use protos::api::{
    DistanceHistogram, DuplicatePair, DuplicateQuery, HarrisPoint, HarrisSet, IconKeypoint, Landmark,
    LandmarkDistances, LandmarkEvidence, LandmarkModelDetail, LandmarkModelQuery, LandmarkPoint,
    LandmarkStatus, LookAlikeBody, MemoryPart, ModelPicture, ModelPictureQuery, Page, Problem, ThresholdBody,
    ThresholdLimit, ThresholdWeights,
};
use protos::v1;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::{
    model::{DistanceSamples, LandmarkId, LandmarkModel, LimitedBy, Threshold, components},
    params::Params,
    points::{descriptor::VALUES, taught::TaughtPoint},
    recognise::{IconFeatures, LOG10_EPSILON},
};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(model))
        .routes(routes!(distances))
        .routes(routes!(evidence))
        .routes(routes!(icon))
        .routes(routes!(duplicates))
}

/// A model that can be read, with what it was learnt under.
struct Learnt {
    stored: StoredModel,
    params: Arc<Params>,
    in_use: bool,
}

async fn learnt(app: &AppState, map: &str, landmark: &str) -> Result<Learnt, ApiError> {
    maps::get(app.store.reads(), map).await?;
    let row = landmarks::get(app.store.reads(), map, landmark).await?;
    let id = LandmarkId(row.id as u64);
    let snapshot = app.store.snapshots().get(map);
    let snapshot = snapshot.ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: map.to_owned() })?;
    let stored = snapshot.learnt.get(&id).cloned().ok_or_else(|| {
        let reason = snapshot.unusable_models.get(&id).map_or("is not learnt", String::as_str);
        let detail = format!("the model of landmark `{landmark}`: {reason}");
        ApiError::new(StatusCode::NOT_FOUND, "not_learnt", detail).field("landmark")
    })?;
    let in_use = snapshot.models.iter().any(|model| model.id == id);
    Ok(Learnt { stored, params: snapshot.params.clone(), in_use })
}

fn threshold(of: &Threshold) -> ThresholdBody {
    ThresholdBody {
        threshold: of.tau,
        false_positive_rate: of.false_positive_rate,
        false_negative_rate: of.false_negative_rate,
        positives: of.positives,
        negatives: of.negatives,
        limited_by: match of.limited_by {
            LimitedBy::Cost => ThresholdLimit::Cost,
            LimitedBy::NearestNegative => ThresholdLimit::NearestNegative,
            LimitedBy::AbsoluteCap => ThresholdLimit::AbsoluteCap,
        },
    }
}

/// The Harris points of an icon with their descriptors: computed, since they follow from the icon.
fn harris_set((index, icon): (usize, &IconFeatures)) -> HarrisSet {
    let points = &icon.points;
    let each = points.xy_px().iter().zip(points.responses()).zip(points.descriptors());
    let points = each.map(|((&[x_px, y_px], &response), &jet)| HarrisPoint { x_px, y_px, response, jet });
    HarrisSet { exemplar: index + 1, points: points.collect() }
}

fn model_shown(landmark: String, learnt: &Learnt, with_harris: bool) -> LandmarkModelDetail {
    let (model, params): (&LandmarkModel, _) = (&learnt.stored.model, &learnt.params);
    let icons = if with_harris { &model.exemplars[..] } else { model.exemplars.get(..1).unwrap_or_default() };
    let icons: Vec<IconFeatures> = icons.iter().map(|icon| icon.features(&params.recognise)).collect();
    let keypoints = icons.first().into_iter().flat_map(|mean| mean.points.xy_px());
    let rules = learnt.stored.rules.over(params);
    let total = model.total_variance;
    let mut memory = BTreeMap::<&str, usize>::new();
    for (purpose, bytes) in model.memory_parts() {
        *memory.entry(purpose).or_default() += bytes;
    }
    LandmarkModelDetail {
        landmark,
        sha256: hex(&learnt.stored.digest),
        in_use: learnt.in_use,
        named_by_points: model.is_named_by_points(params),
        views: model.views,
        generated_views: model.generated_views,
        exemplars: model.exemplars.len(),
        icon_px: model.exemplars.first().map_or(0, vision::model::Exemplar::size),
        keypoints: keypoints.map(|&[x_px, y_px]| IconKeypoint { x_px, y_px }).collect(),
        points: model
            .points
            .iter()
            .map(TaughtPoint::point)
            .map(|point| LandmarkPoint { x: point.at[0], y: point.at[1], sigma: point.sigma })
            .collect(),
        bits_per_point: 2 * VALUES as u32,
        mode_shares: model.eigenvalues.iter().filter(|_| total > 0.0).map(|e| e / total).collect(),
        harris: icons.iter().enumerate().filter(|_| with_harris).map(harris_set).collect(),
        weights: ThresholdWeights { lambda: rules.learn.threshold.false_positive_weight, mu: 1.0 },
        correlation: threshold(&model.correlation),
        hausdorff: threshold(&model.hausdorff),
        gradient_dissimilarity: threshold(&model.likeness),
        saliency: model.saliency,
        stable_points: model.stable_points,
        visibility_confidence: model.v_c,
        photographed_visibility_confidence: model.photographed_v_c,
        memory: memory
            .into_iter()
            .map(|(purpose, bytes)| MemoryPart { purpose: purpose.to_owned(), bytes })
            .collect(),
    }
}

/// What was learnt of a landmark: thresholds with their error rates and weights, keypoints, points,
/// saliency, sizes; on request the Harris points of each exemplar with their descriptors.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/model", operation_id = "getLandmarkModel",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), LandmarkModelQuery),
    responses((status = 200, body = LandmarkModelDetail),
    (status = 404, body = Problem, description = "unknown_map, unknown_landmark, not_learnt")))]
async fn model(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    QueryParams(query): QueryParams<LandmarkModelQuery>,
) -> Result<Json<LandmarkModelDetail>, ApiError> {
    let learnt = learnt(&app, &map, &landmark).await?;
    // Harris points are computed.
    let harris = query.harris.unwrap_or_default();
    let shown = app.on_vision_thread(move |_| model_shown(landmark, &learnt, harris)).await?;
    Ok(Json(shown))
}

/// Bins of a histogram.
const BINS: usize = 40;

/// Distances by bin, from 0 to a little beyond the greatest stored one and the threshold.
fn histogram(threshold: &Threshold, samples: &DistanceSamples) -> DistanceHistogram {
    let finite = samples.own.iter().chain(&samples.nearest_others).copied().filter(|d| d.is_finite());
    let greatest = finite.map(f64::from).fold(threshold.tau, f64::max);
    // 0 where everything is 0: one bin is as good as any.
    let bin_width = if greatest > 0.0 { greatest * 1.05 / BINS as f64 } else { 1.0 / BINS as f64 };
    let counts = |distances: &[f32]| {
        let mut bins = vec![0_u32; BINS];
        for distance in distances.iter().copied().filter(|d| d.is_finite()) {
            let bin = (f64::from(distance) / bin_width) as usize;
            bins[bin.min(BINS - 1)] += 1;
        }
        bins
    };
    let (own, others) = (counts(&samples.own), counts(&samples.nearest_others));
    let sum = |bins: &[u32]| bins.iter().sum::<u32>();
    DistanceHistogram {
        threshold: threshold.tau,
        bin_width,
        own_beyond: samples.own.len() as u32 - sum(&own),
        others_beyond: (samples.others as u64).saturating_sub(u64::from(sum(&others))),
        own,
        others,
    }
}

/// Histograms of the distances that the thresholds were fitted to: of the landmark's own views, and
/// of everything else.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/distances", operation_id = "getLandmarkDistances",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    responses((status = 200, body = LandmarkDistances),
    (status = 404, body = Problem, description = "unknown_map, unknown_landmark, not_learnt")))]
async fn distances(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
) -> Result<Json<LandmarkDistances>, ApiError> {
    let learnt = learnt(&app, &map, &landmark).await?;
    let model = &learnt.stored.model;
    Ok(Json(LandmarkDistances {
        landmark,
        correlation: histogram(&model.correlation, &model.correlation_evidence),
        hausdorff: histogram(&model.hausdorff, &model.hausdorff_evidence),
        gradient_dissimilarity: histogram(&model.likeness, &model.likeness_evidence),
    }))
}

/// Stored answers that evidence is counted in: the newest.
const EVIDENCE_ANSWERS: usize = 500;
/// Width of a bin of the evidence, powers of ten.
const EVIDENCE_BIN: f64 = 10.0;
/// Bins of the evidence. The last has what is beyond, too.
const EVIDENCE_BINS: usize = 20;

/// What points said for a landmark in these answers.
fn evidence_in(answers: &[v1::Answer], landmark: String) -> LandmarkEvidence {
    let mut shown = LandmarkEvidence {
        landmark,
        answers: answers.len() as u64,
        threshold: -LOG10_EPSILON,
        bin_width: EVIDENCE_BIN,
        named: vec![0; EVIDENCE_BINS],
        doubtful: vec![0; EVIDENCE_BINS],
        named_without_points: 0,
    };
    for quad in answers.iter().flat_map(|answer| &answer.quads) {
        let is_named = [&quad.landmark, &quad.guided_landmark].contains(&&shown.landmark);
        let is_doubtful = quad.doubtful_landmark == shown.landmark;
        let bin = quad.points.as_ref().map(|points| (-points.log10_chance / EVIDENCE_BIN) as usize);
        match bin.map(|bin| bin.min(EVIDENCE_BINS - 1)) {
            Some(bin) if is_named => shown.named[bin] += 1,
            Some(bin) if is_doubtful => shown.doubtful[bin] += 1,
            None if is_named => shown.named_without_points += 1,
            _ => {}
        }
    }
    shown
}

/// How strongly points spoke for a landmark in the newest stored answers: a histogram beside the
/// threshold.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/evidence", operation_id = "getLandmarkEvidence",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    responses((status = 200, body = LandmarkEvidence),
    (status = 404, body = Problem, description = "unknown_map, unknown_landmark")))]
async fn evidence(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
) -> Result<Json<LandmarkEvidence>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let name = landmarks::get(app.store.reads(), &map, &landmark).await?.name;
    let answers = stored_answers::about(app.store.reads(), &map, &name, EVIDENCE_ANSWERS).await?;
    Ok(Json(evidence_in(&answers, name)))
}

/// A picture of what was learnt of a landmark, as PNG: one of up to three real icons, the mean of
/// its views, or one of up to two modes. `ETag` is the digest of its model.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/icon", operation_id = "getLandmarkIcon",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), ModelPictureQuery),
    responses((status = 200, content_type = "image/png"), (status = 304, description = "`If-None-Match` has it"),
    (status = 404, body = Problem, description = "unknown_map, unknown_landmark, not_learnt; no_picture: \
     so few views have no such mode or exemplar")))]
async fn icon(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    QueryParams(query): QueryParams<ModelPictureQuery>,
    known: IfNoneMatch,
) -> Result<Response, ApiError> {
    let Learnt { stored: StoredModel { digest, model, .. }, .. } = learnt(&app, &map, &landmark).await?;
    let png = async {
        let picture = picture_of(&app, &model, query.which.unwrap_or_default()).await?;
        let (side, grey) = picture.ok_or_else(|| {
            let detail = format!("the model of landmark `{landmark}` has no such picture");
            ApiError::new(StatusCode::NOT_FOUND, "no_picture", detail).field("which")
        })?;
        picture::png(side, side, &grey).map_err(|e| ApiError::internal(&e))
    };
    PictureHead::new("png", &digest, ASK_AGAIN).answer(&known, png).await
}

/// Side and grey levels of a picture of a model. Mean and modes are in the database only.
async fn picture_of(
    app: &AppState,
    model: &LandmarkModel,
    which: ModelPicture,
) -> Result<Option<(usize, Vec<u8>)>, ApiError> {
    let exemplar = |index: usize| model.exemplars.get(index).map(|e| (e.size(), e.pixels().to_vec()));
    Ok(match which {
        ModelPicture::Exemplar1 => exemplar(0),
        ModelPicture::Exemplar2 => exemplar(1),
        ModelPicture::Exemplar3 => exemplar(2),
        ModelPicture::Mean => component(app, model.id, 0).await?,
        ModelPicture::Mode1 => component(app, model.id, 1).await?,
        ModelPicture::Mode2 => component(app, model.id, 2).await?,
    })
}

/// The mean of the views (0) or a mode.
async fn component(
    app: &AppState,
    id: LandmarkId,
    index: usize,
) -> Result<Option<(usize, Vec<u8>)>, ApiError> {
    let bytes = models::get(app.store.reads(), id).await?;
    let of = components(&bytes).map_err(|e| ApiError::internal(&e))?;
    Ok(of.pictures().get(index).map(|grey| (of.size(), grey.clone())))
}

/// The pairs of look-alikes that the landmarks of a map name, each once, by the two names.
fn pairs(landmarks: &[Landmark]) -> BTreeMap<(String, String), f64> {
    let mut pairs = BTreeMap::new();
    for landmark in landmarks {
        let facts = landmark.model.as_ref().and_then(|model| model.facts.get("look_alikes"));
        let named = facts.and_then(|facts| serde_json::from_value::<Vec<LookAlikeBody>>(facts.clone()).ok());
        let refused = landmark.failed_gates.iter().filter_map(|gate| gate.look_alike.clone());
        for other in named.unwrap_or_default().into_iter().chain(refused) {
            let mut pair = [landmark.name.clone(), other.landmark];
            pair.sort();
            let similarity = pairs.entry(pair.into()).or_insert(other.gradient_similarity);
            *similarity = f64::max(*similarity, other.gradient_similarity);
        }
    }
    pairs
}

/// Lists the landmarks of a map that look alike, in pairs by their names, as they were told apart
/// in their last lessons.
#[utoipa::path(get, path = "/maps/{map}/duplicates", operation_id = "listDuplicates",
    tag = "landmarks", params(("map" = String, Path), DuplicateQuery),
    responses((status = 200, body = Page<DuplicatePair>), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range")))]
async fn duplicates(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(query): QueryParams<DuplicateQuery>,
) -> Result<Json<Page<DuplicatePair>>, ApiError> {
    let limits = &app.config.limits;
    let limit = page_limit(query.limit, limits.page)?;
    let map = maps::get(app.store.reads(), &map).await?;
    let learning = app.jobs.learning(&map.name).await?;
    let rows = landmarks::page(app.store.reads(), map.id, "", limits.landmarks).await?;
    let landmarks: Vec<_> = rows.into_iter().map(|row| shown(&app, &learning, &map.name, row)).collect();
    let is_active = |l: &&Landmark| l.status == LandmarkStatus::Active;
    let active: BTreeSet<&str> = landmarks.iter().filter(is_active).map(|l| l.name.as_str()).collect();
    let pair = |((first, second), gradient_similarity): ((String, String), f64)| DuplicatePair {
        gradient_similarity,
        distance: 1.0 - gradient_similarity,
        first_in_use: active.contains(first.as_str()),
        second_in_use: active.contains(second.as_str()),
        first,
        second,
    };
    let mut found: Vec<_> = pairs(&landmarks).into_iter().map(pair).collect();
    found.retain(|pair| {
        query.landmark.as_ref().is_none_or(|name| [&pair.first, &pair.second].contains(&name))
            && query.in_use.is_none_or(|wanted| (pair.first_in_use && pair.second_in_use) == wanted)
    });
    let total = found.len() as u64;
    // No name has a slash.
    let key = |pair: &DuplicatePair| format!("{}/{}", pair.first, pair.second);
    if let Some((first, second)) = query.cursor.as_deref().and_then(|cursor| cursor.split_once('/')) {
        found.retain(|pair| (pair.first.as_str(), pair.second.as_str()) > (first, second));
    }
    found.truncate(limit + 1);
    Ok(Json(page(found, limit, total, key, |pair| pair)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_distance_is_in_a_bin_or_beyond() {
        let samples = DistanceSamples {
            own: vec![0.0, 0.1, 0.2, f32::INFINITY],
            nearest_others: vec![0.5, 1.0, f32::INFINITY],
            others: 70,
        };
        let threshold = Threshold { tau: 0.4, ..Threshold::NEVER };
        let shown = histogram(&threshold, &samples);
        assert_eq!((shown.own.iter().sum::<u32>(), shown.own_beyond), (3, 1));
        assert_eq!((shown.others.iter().sum::<u32>(), shown.others_beyond), (2, 68));
        let bin = |distance: f64| (distance / shown.bin_width) as usize;
        assert_eq!((shown.own[0], shown.own[bin(0.1)], shown.others[bin(1.0)]), (1, 1, 1));
        assert!(bin(0.4) < BINS && bin(1.0) < BINS);
        let nothing = histogram(&Threshold::NEVER, &DistanceSamples::default());
        assert!(nothing.bin_width > 0.0 && nothing.own.len() == BINS);
    }
}
