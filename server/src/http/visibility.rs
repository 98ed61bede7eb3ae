//! From where landmarks are seen, what is seen from a pose and along a path, and where to look.

use super::{
    AppState,
    error::{ApiError, out_of_range},
    extract::{Body, PathParams, QueryParams},
    visibility_settings::{areas, other},
};
use crate::store::{landmarks, maps};
use axum::{Json, extract::State, http::StatusCode};
use engine::{
    gaze::{GazeQuery, ranked},
    snapshot::MapSnapshot,
};
use map::{
    gaze::{GazeParams, GazeTarget},
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
    visibility::{PoseDraws, VisibilitySettings, coverage},
};
use nalgebra::{Matrix3, Point2, Vector2};
use protos::api::{
    CoverageGapBody, CoverageRequest, CoverageResponse, CoverageSampleBody, GazeQueryBody, GazeRankingBody,
    GazeTargetBody, PoseBody, Problem, VisibilityAreaBody, VisibilitySettingsBody, VisibleLandmark,
    VisibleRequest, VisibleResponse,
};
use std::sync::Arc;
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::model::LandmarkId;

/// Landmarks are taken to hang so far before their walls at most.
const STANDOFF_M: f64 = 0.5;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(area))
        .routes(routes!(visible))
        .routes(routes!(along))
        .routes(routes!(gaze))
}

/// The current version of a map with its visibility areas.
async fn snapshot(app: &AppState, map: &str) -> Result<Arc<MapSnapshot>, ApiError> {
    let gone = || ApiError::new(StatusCode::NOT_FOUND, "unknown_map", "no such map").field("map");
    app.store.snapshots().with_visibility(map).await.ok_or_else(gone)
}

pub(super) fn name_of(map: &MapSnapshot, id: LandmarkId) -> String {
    map.landmarks.get(&id).map(|l| l.name.clone()).unwrap_or_default()
}

/// The area on the floor from which a landmark is seen, as a GeoJSON feature in map metres: by the
/// map's camera (`/maps/{map}/visibility-settings`), or by another for this question.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/visibility", operation_id = "getLandmarkVisibility",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), VisibilitySettingsBody), responses(
    (status = 200, body = VisibilityAreaBody),
    (status = 400, body = Problem, description = "bad_query"), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "not_placed"),
    (status = 422, body = Problem, description = "out_of_range")))]
async fn area(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    QueryParams(fields): QueryParams<VisibilitySettingsBody>,
) -> Result<Json<VisibilityAreaBody>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let row = landmarks::get(app.store.reads(), &map, &landmark).await?;
    let map = snapshot(&app, &map).await?;
    let (id, settings) = (LandmarkId(row.id as u64), other(&fields, &map, "query")?);
    let asked = map.landmarks.get(&id).and_then(|l| l.place);
    let is_asked = move |place: &LandmarkPlace, _reach| asked.as_ref() == Some(place);
    let found = app.on_vision_thread(move |_| areas(&map, settings.as_ref(), is_asked)).await??;
    let area = found.get(&id).ok_or_else(|| {
        let detail = "without size and place it is not known from where it is seen";
        ApiError::new(StatusCode::CONFLICT, "not_placed", detail).field("landmark")
    })?;
    Ok(Json(VisibilityAreaBody::new(area, &landmark)))
}

fn checked(pose: &PoseBody) -> Result<Pose2Covariance, ApiError> {
    let covariance = pose.covariance.map_or_else(Matrix3::zeros, |c| Matrix3::from_row_slice(&c));
    let made = Pose2Covariance { pose: Pose2::new(pose.x_m, pose.y_m, pose.theta_rad), covariance };
    made.check().map_err(|e| out_of_range(&e, "pose"))?;
    Ok(made)
}

/// Which landmarks a robot may see from an uncertain pose.
#[utoipa::path(post, path = "/maps/{map}/visible", operation_id = "listVisibleLandmarks",
    tag = "maps", params(("map" = String, Path)),
    request_body = VisibleRequest, responses((status = 200, body = VisibleResponse), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn visible(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Body(from): Body<VisibleRequest>,
) -> Result<Json<VisibleResponse>, ApiError> {
    let (map, pose) = (snapshot(&app, &map).await?, checked(&from.pose)?);
    let settings = other(&from.visibility_settings, &map, "visibility_settings")?;
    app.on_vision_thread(move |_| visible_from(&map, &pose, settings.as_ref())).await?.map(Json)
}

fn visible_from(
    map: &MapSnapshot,
    pose: &Pose2Covariance,
    settings: Option<&VisibilitySettings>,
) -> Result<VisibleResponse, ApiError> {
    let draws = PoseDraws::new(pose, Vector2::zeros());
    let near = |place: &LandmarkPlace, reach: f64| {
        (draws.mean() - Point2::new(place.x_m, place.y_m)).norm() <= reach + STANDOFF_M + draws.spread_m()
    };
    let areas = areas(map, settings, near)?;
    let mut seen: Vec<VisibleLandmark> = areas
        .iter()
        .map(|(id, area)| (id, area, area.probability(&draws)))
        .filter(|(_, _, probability)| *probability > 0.0)
        .map(|(id, area, probability)| VisibleLandmark {
            landmark: name_of(map, *id),
            probability,
            margin_m: area.margin_m(&draws.mean()),
        })
        .collect();
    seen.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(a.landmark.cmp(&b.landmark)));
    Ok(VisibleResponse { map_version: map.version, landmarks: seen })
}

/// Which landmarks are seen along a path, and where none is. The robot drives forward and pans its
/// camera.
#[utoipa::path(post, path = "/maps/{map}/coverage", operation_id = "computeCoverage",
    tag = "maps", params(("map" = String, Path)),
    request_body = CoverageRequest, responses((status = 200, body = CoverageResponse), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn along(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Body(along): Body<CoverageRequest>,
) -> Result<Json<CoverageResponse>, ApiError> {
    let map = snapshot(&app, &map).await?;
    app.on_vision_thread(move |_| covered(&map, &along)).await?.map(Json)
}

fn covered(map: &MapSnapshot, along: &CoverageRequest) -> Result<CoverageResponse, ApiError> {
    let path: Vec<_> = along.path.iter().map(|p| Point2::new(p[0], p[1])).collect();
    let settings = other(&along.visibility_settings, map, "visibility_settings")?;
    let near = |place: &LandmarkPlace, reach: f64| comes_near(&path, place, reach + STANDOFF_M);
    let made = areas(map, settings.as_ref(), near)?;
    let areas: Vec<_> = made.iter().map(|(id, area)| (*id, &**area)).collect();
    let found = coverage(&path, along.step_m, &areas).map_err(|e| out_of_range(&e, "path"))?;
    let step = |s: &map::visibility::CoverageSample| CoverageSampleBody {
        along_m: s.along_m,
        x_m: s.position.x,
        y_m: s.position.y,
        landmarks: s.landmarks.iter().map(|id| name_of(map, *id)).collect(),
    };
    Ok(CoverageResponse {
        map_version: map.version,
        length_m: found.length_m,
        share: found.share(),
        gaps: found.gaps.iter().map(|g| CoverageGapBody { from_m: g.from_m, to_m: g.to_m }).collect(),
        steps: found.steps.iter().map(step).collect(),
    })
}

/// Whether a path's bounding box comes within `reach_m` of a landmark.
fn comes_near(path: &[Point2<f64>], place: &LandmarkPlace, reach_m: f64) -> bool {
    let Some(first) = path.first() else { return false };
    let (low, high) = path.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
    let at = Point2::new(place.x_m, place.y_m);
    (at - at.sup(&low).inf(&high)).norm() <= reach_m
}

fn aim(map: &MapSnapshot, c: &GazeTarget) -> GazeTargetBody {
    GazeTargetBody {
        landmark: name_of(map, c.landmark),
        pan_rad: c.pan_rad,
        tilt_rad: c.tilt_rad,
        utility: c.utility,
        probability: c.probability,
        margin_m: c.margin_m,
        gain_nats: c.gain_nats,
        range_m: c.range_m,
        incidence_rad: c.incidence_rad,
    }
}

/// Which landmarks are worth looking at from a pose, best first, with the pan and tilt that centre
/// them. Robots ask over zenoh (`rpc/gaze`) and are kept to one landmark until another is clearly
/// better; this question leaves no trace.
#[utoipa::path(post, path = "/maps/{map}/gaze", operation_id = "rankGaze",
    tag = "maps", params(("map" = String, Path)),
    request_body = GazeQueryBody, responses((status = 200, body = GazeRankingBody), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn gaze(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Body(question): Body<GazeQueryBody>,
) -> Result<Json<GazeRankingBody>, ApiError> {
    let (map, pose) = (snapshot(&app, &map).await?, checked(&question.pose)?);
    let params = GazeParams { criterion: question.criterion, ..GazeParams::default() };
    let viewer = question.viewer.unwrap_or_else(|| map.visibility_settings.viewer.clone());
    let ask = GazeQuery { pose, camera: viewer, pan_tilt: question.head, params };
    let found = ranked(&map, &ask).map_err(|e| out_of_range(&e, "question"))?;
    Ok(Json(GazeRankingBody {
        map_version: map.version,
        ranked: found.iter().map(|c| aim(&map, c)).collect(),
    }))
}
