//! From where landmarks are seen, what is seen from a pose and along a path, and where to look.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, Body, Params},
    resources::out_of_range,
    sight::{self, Fields},
};
use crate::store::{landmarks, maps};
use axum::{Json, extract::State, http::StatusCode};
use engine::{
    gaze::{Ask, ranked},
    snapshot::MapSnapshot,
};
use map::{
    gaze::{Criterion, GazeParams, GazeTarget, PanTiltUnit},
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
    visibility::{Feature, PanTiltCamera, PoseDraws, VisibilitySettings, coverage},
};
use nalgebra::{Matrix3, Point2, Vector2};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::model::LandmarkId;

/// Landmarks are taken to hang so far before their walls at most.
const STANDOFF_M: f64 = 0.5;

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(area))
        .routes(routes!(visible))
        .routes(routes!(along))
        .routes(routes!(gaze))
}

/// The current version of a map with its visibility areas.
async fn snapshot(app: &Shared, map: &str) -> Result<Arc<MapSnapshot>, ApiError> {
    let gone = || ApiError::new(StatusCode::NOT_FOUND, "unknown_map", "no such map").field("map");
    app.store.snapshots().with_visibility(map).await.ok_or_else(gone)
}

fn name_of(map: &MapSnapshot, id: LandmarkId) -> String {
    map.landmarks.get(&id).map(|l| l.name.clone()).unwrap_or_default()
}

/// The area on the floor from which a landmark is seen, as a GeoJSON feature in map metres: by the map's camera
/// (`/maps/{map}/sight`), or by another for this question.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/visibility", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), Fields), responses(
    (status = 200, body = Object, description = "GeoJSON `Feature` of a `MultiPolygon`; properties landmark, area_m2, centroid_m, reach_m"),
    (status = 400, body = Problem, description = "bad_query"), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "not_placed"),
    (status = 422, body = Problem, description = "out_of_range")))]
async fn area(
    State(app): State<Shared>,
    At((map, landmark)): At<(String, String)>,
    Params(fields): Params<Fields>,
) -> Result<Json<Feature>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let row = landmarks::get(app.store.reads(), &map, &landmark).await?;
    let map = snapshot(&app, &map).await?;
    let (id, other) = (LandmarkId(row.id as u64), fields.other(&map, "query")?);
    let asked = map.landmarks.get(&id).and_then(|l| l.place);
    let is_asked = move |place: &LandmarkPlace, _reach| asked.as_ref() == Some(place);
    let found = app.on_vision_thread(move |_| sight::areas(&map, other.as_ref(), is_asked)).await??;
    let area = found.get(&id).ok_or_else(|| {
        let detail = "without size and place it is not known from where it is seen";
        ApiError::new(StatusCode::CONFLICT, "not_placed", detail).field("landmark")
    })?;
    Ok(Json(area.feature(&landmark)))
}

/// A pose in the map.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct At2 {
    /// Metres.
    x_m: f64,
    /// Metres.
    y_m: f64,
    /// Heading.
    theta_rad: f64,
    /// Over (x, y, theta), row-major; absent for a pose that is exactly known.
    covariance: Option<[f64; 9]>,
}

impl At2 {
    fn checked(&self) -> Result<Pose2Covariance, ApiError> {
        let covariance = self.covariance.map_or_else(Matrix3::zeros, |c| Matrix3::from_row_slice(&c));
        let pose = Pose2::new(self.x_m, self.y_m, self.theta_rad);
        let made = Pose2Covariance { pose, covariance };
        made.check().map_err(|e| out_of_range(&e, "pose"))?;
        Ok(made)
    }
}

/// Where the robot is.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct From {
    /// Its pose.
    pose: At2,
    /// Another camera than the map's.
    #[serde(default)]
    sight: Fields,
}

/// A landmark that may be seen.
#[derive(Debug, Serialize, ToSchema)]
struct Seen {
    /// Its name.
    landmark: String,
    /// Probability that it is seen when the camera is turned to it.
    probability: f64,
    /// Distance to the boundary of its area, positive inside.
    margin_m: f64,
}

/// What may be seen.
#[derive(Debug, Serialize, ToSchema)]
struct Visible {
    /// Of this version of the map.
    map_version: u64,
    /// Most probable first.
    landmarks: Vec<Seen>,
}

/// Which landmarks a robot may see from an uncertain pose.
#[utoipa::path(post, path = "/maps/{map}/visible", tag = "maps", params(("map" = String, Path)),
    request_body = From, responses((status = 200, body = Visible), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, bad_value")))]
async fn visible(
    State(app): State<Shared>,
    At(map): At<String>,
    Body(from): Body<From>,
) -> Result<Json<Visible>, ApiError> {
    let (map, pose) = (snapshot(&app, &map).await?, from.pose.checked()?);
    let other = from.sight.other(&map, "sight")?;
    app.on_vision_thread(move |_| visible_from(&map, &pose, other.as_ref())).await?.map(Json)
}

fn visible_from(
    map: &MapSnapshot,
    pose: &Pose2Covariance,
    other: Option<&VisibilitySettings>,
) -> Result<Visible, ApiError> {
    let draws = PoseDraws::new(pose, Vector2::zeros());
    let near = |place: &LandmarkPlace, reach: f64| {
        (draws.mean() - Point2::new(place.x_m, place.y_m)).norm() <= reach + STANDOFF_M + draws.spread_m()
    };
    let areas = sight::areas(map, other, near)?;
    let mut seen: Vec<Seen> = areas
        .iter()
        .map(|(id, area)| (id, area, area.probability(&draws)))
        .filter(|(_, _, probability)| *probability > 0.0)
        .map(|(id, area, probability)| Seen {
            landmark: name_of(map, *id),
            probability,
            margin_m: area.margin_m(&draws.mean()),
        })
        .collect();
    seen.sort_by(|a, b| b.probability.total_cmp(&a.probability).then(a.landmark.cmp(&b.landmark)));
    Ok(Visible { map_version: map.version, landmarks: seen })
}

/// A path to look at.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Along {
    /// Its points: x, y in metres.
    path: Vec<[f64; 2]>,
    /// How often to look: 0.01 to 10 m.
    #[serde(default = "step_m")]
    step_m: f64,
    /// Another camera than the map's.
    #[serde(default)]
    sight: Fields,
}

fn step_m() -> f64 {
    0.1
}

/// One place of the path.
#[derive(Debug, Serialize, ToSchema)]
struct Step {
    along_m: f64,
    x_m: f64,
    y_m: f64,
    landmarks: Vec<String>,
}

/// A piece of the path from which no landmark is seen.
#[derive(Debug, Serialize, ToSchema)]
struct Gap {
    from_m: f64,
    to_m: f64,
}

/// What is seen along a path.
#[derive(Debug, Serialize, ToSchema)]
struct Coverage {
    map_version: u64,
    length_m: f64,
    /// Share of the path from which some landmark is seen.
    share: f64,
    gaps: Vec<Gap>,
    steps: Vec<Step>,
}

/// Which landmarks are seen along a path, and where none is. The robot drives forward and pans its camera.
#[utoipa::path(post, path = "/maps/{map}/coverage", tag = "maps", params(("map" = String, Path)),
    request_body = Along, responses((status = 200, body = Coverage), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, bad_value")))]
async fn along(
    State(app): State<Shared>,
    At(map): At<String>,
    Body(along): Body<Along>,
) -> Result<Json<Coverage>, ApiError> {
    let map = snapshot(&app, &map).await?;
    app.on_vision_thread(move |_| covered(&map, &along)).await?.map(Json)
}

fn covered(map: &MapSnapshot, along: &Along) -> Result<Coverage, ApiError> {
    let path: Vec<_> = along.path.iter().map(|p| Point2::new(p[0], p[1])).collect();
    let other = along.sight.other(map, "sight")?;
    let near = |place: &LandmarkPlace, reach: f64| comes_near(&path, place, reach + STANDOFF_M);
    let made = sight::areas(map, other.as_ref(), near)?;
    let areas: Vec<_> = made.iter().map(|(id, area)| (*id, &**area)).collect();
    let found = coverage(&path, along.step_m, &areas).map_err(|e| out_of_range(&e, "path"))?;
    let step = |s: &map::visibility::CoverageSample| Step {
        along_m: s.along_m,
        x_m: s.position.x,
        y_m: s.position.y,
        landmarks: s.landmarks.iter().map(|id| name_of(map, *id)).collect(),
    };
    Ok(Coverage {
        map_version: map.version,
        length_m: found.length_m,
        share: found.share(),
        gaps: found.gaps.iter().map(|g| Gap { from_m: g.from_m, to_m: g.to_m }).collect(),
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

/// A question where to look.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Question {
    /// Where the robot is.
    pose: At2,
    /// `camera_m`, `pan_rad`, `tilt_rad`, `rate_radps`.
    #[serde(default)]
    #[schema(value_type = Object)]
    head: PanTiltUnit,
    /// `focal_px`, `pan_rad`, `tilt_rad` and the rest of the camera; absent for the map's (`/maps/{map}/sight`).
    #[schema(value_type = Option<Object>)]
    viewer: Option<PanTiltCamera>,
    /// `product` (the paper's) or `information`.
    #[serde(default)]
    #[schema(value_type = String)]
    criterion: Criterion,
}

/// A landmark worth looking at.
#[derive(Debug, Serialize, ToSchema)]
struct Aim {
    landmark: String,
    pan_rad: f64,
    tilt_rad: f64,
    utility: f64,
    probability: f64,
    margin_m: f64,
    gain_nats: f64,
    range_m: f64,
    incidence_rad: f64,
}

/// Where to look.
#[derive(Debug, Serialize, ToSchema)]
struct Advice {
    map_version: u64,
    /// Best first; empty when nothing is in sight.
    ranked: Vec<Aim>,
}

fn aim(map: &MapSnapshot, c: &GazeTarget) -> Aim {
    Aim {
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

/// Which landmarks are worth looking at from a pose, best first, with the pan and tilt that centre them. Robots ask over
/// zenoh (`rpc/gaze`) and are kept to one landmark until another is clearly better; this question leaves no trace.
#[utoipa::path(post, path = "/maps/{map}/gaze", tag = "maps", params(("map" = String, Path)),
    request_body = Question, responses((status = 200, body = Advice), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, bad_value")))]
async fn gaze(
    State(app): State<Shared>,
    At(map): At<String>,
    Body(question): Body<Question>,
) -> Result<Json<Advice>, ApiError> {
    let (map, pose) = (snapshot(&app, &map).await?, question.pose.checked()?);
    let params = GazeParams { criterion: question.criterion, ..GazeParams::default() };
    let viewer = question.viewer.unwrap_or_else(|| map.sight.viewer.clone());
    let ask = Ask { pose, viewer, head: question.head, params };
    let found = ranked(&map, &ask).map_err(|e| out_of_range(&e, "question"))?;
    Ok(Json(Advice { map_version: map.version, ranked: found.iter().map(|c| aim(&map, c)).collect() }))
}
