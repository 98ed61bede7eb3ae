//! `/maps/{map}/gatherings`: views gathered by a robot that drives past, and a person's decision on
//! them.

use super::{
    App, AppState,
    answers::{created, page},
    authorise::check_robot,
    error::ApiError,
    extract::{Body, PathParams, QueryParams, after_number, name, page_limit},
    learning::job_shown,
    pictures::{FOREVER, IfNoneMatch, grey_answer},
    views::placement_shown,
};
use crate::{
    gather::{GatheringCounts, track_summaries::track_summaries},
    identity::Principal,
    store::{
        gatherings::{self, GatheringRow, NewGathering},
        landmark_placement::PlacementReport,
        landmarks, maps,
        track_acceptance::{self, AcceptanceResult, TrackAcceptance},
    },
};
use axum::{Extension, Json, extract::State, http::StatusCode, response::Response};
use protos::api::{
    AcceptRequest, AcceptanceBody, AcceptedTrackBody, ExtendedLandmark, Gathering, GatheringCountsBody,
    NewGatheringBody, Page, PageQuery, Problem, TrackList, TrackSummary,
};
use std::collections::BTreeSet;
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::model::LandmarkId;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(begin, list))
        .routes(routes!(get, delete))
        .routes(routes!(stop))
        .routes(routes!(list_tracks))
        .routes(routes!(discard))
        .routes(routes!(show_icon))
        .routes(routes!(accept))
}

fn counts_shown(counts: GatheringCounts) -> GatheringCountsBody {
    GatheringCountsBody {
        frames: counts.frames,
        dropped: counts.dropped,
        other_map: counts.other_map,
        unusable: counts.unusable,
        not_on_wall: counts.not_on_wall,
        kept: counts.kept,
        near_duplicate: counts.near_duplicate,
        too_few_observations: counts.too_few_observations,
        full: counts.full,
        decided: counts.decided,
        known_landmark: counts.known_landmark,
        not_requested: counts.not_requested,
        appearance_mismatch: counts.appearance_mismatch,
        track_limit: counts.track_limit,
        not_stored: counts.not_stored,
    }
}

fn gathering_shown(app: &AppState, row: GatheringRow) -> Gathering {
    let counts = app.gatherer.counts(row.id);
    with_counts(row, counts)
}

/// A gathering with the counts of now, or those of its end.
fn with_counts(row: GatheringRow, counts: Option<GatheringCounts>) -> Gathering {
    let kept = || serde_json::from_str(&row.counts).unwrap_or_default();
    Gathering {
        counts: counts_shown(counts.unwrap_or_else(kept)),
        id: row.id,
        map: row.map,
        robot: row.robot,
        landmark: row.landmark,
        known: row.known,
        open: row.open,
        created_ms: row.created_ms,
        ended_ms: row.ended_ms,
    }
}

/// Begins to gather views with a robot: while it drives, flat four-sided things are followed from
/// frame to frame, and of each the views that say something new are kept, until it is stopped.
/// Nothing becomes a landmark by itself.
#[utoipa::path(post, path = "/maps/{map}/gatherings", operation_id = "startGathering",
    tag = "gathering", params(("map" = String, Path)),
    request_body = NewGatheringBody, responses((status = 201, body = Gathering),
    (status = 404, body = Problem, description = "unknown_map, unknown_robot, unknown_landmark"),
    (status = 409, body = Problem, description = "in_use: it gathers already or stands on another map; not_learnt; too_many"),
    (status = 422, body = Problem)))]
async fn begin(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Extension(principal): Extension<Principal>,
    Body(new): Body<NewGatheringBody>,
) -> Result<(StatusCode, Json<Gathering>), ApiError> {
    check_robot(&app, &principal, &new.robot)?;
    if let Some(landmark) = &new.landmark {
        maps::get(app.store.reads(), &map).await?;
        let row = landmarks::get(app.store.reads(), &map, landmark).await?;
        let learnt = app
            .store
            .snapshots()
            .get(&map)
            .is_some_and(|m| m.models.get(LandmarkId(row.id as u64)).is_some());
        if !learnt {
            let detail = format!(
                "landmark `{landmark}` cannot be recognised yet: gather without naming it, and accept what is it under its name"
            );
            return Err(ApiError::new(StatusCode::CONFLICT, "not_learnt", detail).field("landmark"));
        }
    }
    let new = NewGathering { robot: new.robot, landmark: new.landmark, known: new.known };
    let shown = |row: &GatheringRow| {
        (StatusCode::CREATED, with_counts(row.clone(), Some(GatheringCounts::default())))
    };
    created(shown, app.gatherer.begin(&map, new)).await
}

/// Lists gatherings by number, ended ones included.
#[utoipa::path(get, path = "/maps/{map}/gatherings", operation_id = "listGatherings",
    tag = "gathering", params(("map" = String, Path), PageQuery),
    responses((status = 200, body = Page<Gathering>), (status = 404, body = Problem)))]
async fn list(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(query): QueryParams<PageQuery>,
) -> Result<Json<Page<Gathering>>, ApiError> {
    let (limit, after) = (page_limit(query.limit, app.config.limits.page)?, after_number(&query)?);
    let map = maps::get(app.store.reads(), &map).await?;
    let rows = gatherings::page(app.store.reads(), map.id, after, limit + 1).await?;
    let total = gatherings::count(app.store.reads(), map.id).await?;
    Ok(Json(page(rows, limit, total, |r| r.id.to_string(), |r| gathering_shown(&app, r))))
}

/// One gathering.
#[utoipa::path(get, path = "/maps/{map}/gatherings/{gathering}", operation_id = "getGathering", tag = "gathering",
    params(("map" = String, Path), ("gathering" = i64, Path)),
    responses((status = 200, body = Gathering), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams((map, id)): PathParams<(String, i64)>,
) -> Result<Json<Gathering>, ApiError> {
    let row = gatherings::get(app.store.reads(), &map, id).await?;
    Ok(Json(gathering_shown(&app, row)))
}

/// Stops; what was gathered waits for a decision. One that has ended stays as it is.
#[utoipa::path(post, path = "/maps/{map}/gatherings/{gathering}/stop", operation_id = "stopGathering",
    tag = "gathering",
    params(("map" = String, Path), ("gathering" = i64, Path)),
    responses((status = 200, body = Gathering), (status = 404, body = Problem)))]
async fn stop(
    State(app): State<AppState>,
    PathParams((map, id)): PathParams<(String, i64)>,
) -> Result<Json<Gathering>, ApiError> {
    let row = app.gatherer.end(&map, id).await?;
    Ok(Json(gathering_shown(&app, row)))
}

/// Stops, and throws away all that nobody has accepted.
#[utoipa::path(delete, path = "/maps/{map}/gatherings/{gathering}", operation_id = "deleteGathering",
    tag = "gathering",
    params(("map" = String, Path), ("gathering" = i64, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn delete(
    State(app): State<AppState>,
    PathParams((map, id)): PathParams<(String, i64)>,
) -> Result<StatusCode, ApiError> {
    app.gatherer.delete(&map, id).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// What waits for a decision, with all that helps to decide. Also while the robot still drives.
#[utoipa::path(get, path = "/maps/{map}/gatherings/{gathering}/tracks", operation_id = "listTracks",
    tag = "gathering",
    params(("map" = String, Path), ("gathering" = i64, Path)),
    responses((status = 200, body = TrackList), (status = 404, body = Problem)))]
async fn list_tracks(
    State(app): State<AppState>,
    PathParams((map, id)): PathParams<(String, i64)>,
) -> Result<Json<TrackList>, ApiError> {
    Ok(Json(TrackList { tracks: summaries(&app, &map, id).await? }))
}

async fn summaries(app: &AppState, map: &str, id: i64) -> Result<Vec<TrackSummary>, ApiError> {
    gatherings::get(app.store.reads(), map, id).await?;
    let mut tracks = vec![];
    for track in gatherings::tracks(app.store.reads(), id).await?.into_iter().filter(|t| t.state == "open") {
        let views = gatherings::track_views(app.store.reads(), id, track.number).await?;
        tracks.push((track, views));
    }
    let walls = app.store.snapshots().get(map).map(|map| map.walls.clone()).unwrap_or_default();
    app.clone().on_vision_thread(move |app: &App| track_summaries(&tracks, &walls, &app.config.params)).await
}

/// Accepts the tracks of a gathering that pass every gate, under the first free names of the map,
/// and learns them.
pub(super) async fn accept_passing(app: &AppState, map: &str, id: i64) -> Result<(), ApiError> {
    let known = app.store.snapshots().get(map);
    let taken: BTreeSet<String> =
        known.iter().flat_map(|map| map.landmarks.values().map(|landmark| landmark.name.clone())).collect();
    let free = (1..).map(|number| format!("{map}-{number:02}")).filter(|name| !taken.contains(name));
    let passing = summaries(app, map, id).await?.into_iter().filter(|track| track.passes);
    let pick = |(track, free): (TrackSummary, String)| {
        // That of a map may be as long as a name can be.
        let name = name("map", free)?;
        Ok(TrackAcceptance { number: track.number, name: Some(name.to_string()) })
    };
    let picks: Vec<TrackAcceptance> = passing.zip(free).map(pick).collect::<Result<_, ApiError>>()?;
    if picks.is_empty() {
        return Ok(());
    }
    app.gatherer.accept((map, id), picks, true, bounds(app)).await?;
    Ok(())
}

fn bounds(app: &App) -> track_acceptance::AcceptanceLimits {
    let limits = &app.config.limits;
    track_acceptance::AcceptanceLimits {
        landmarks: limits.landmarks,
        views: limits.views,
        jobs: (limits.jobs, limits.jobs_kept),
    }
}

/// Discards a track. While the gathering goes on, no more views of it are kept.
#[utoipa::path(delete, path = "/maps/{map}/gatherings/{gathering}/tracks/{track}", operation_id = "deleteTrack",
    tag = "gathering",
    params(("map" = String, Path), ("gathering" = i64, Path), ("track" = u32, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn discard(
    State(app): State<AppState>,
    PathParams((map, id, number)): PathParams<(String, i64, u32)>,
) -> Result<StatusCode, ApiError> {
    app.gatherer.discard(&map, id, number).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The rectified picture of a view of a track, as PNG.
#[utoipa::path(get, path = "/maps/{map}/gatherings/{gathering}/tracks/{track}/views/{view}/icon",
    operation_id = "getTrackIcon",
    tag = "gathering", params(("map" = String, Path), ("gathering" = i64, Path), ("track" = u32, Path),
    ("view" = i64, Path)), responses((status = 200, content_type = "image/png"),
    (status = 304, description = "`If-None-Match` has it"), (status = 404, body = Problem)))]
async fn show_icon(
    State(app): State<AppState>,
    PathParams((map, id, number, view)): PathParams<(String, i64, u32, i64)>,
    known: IfNoneMatch,
) -> Result<Response, ApiError> {
    gatherings::get(app.store.reads(), &map, id).await?;
    let views = gatherings::track_views(app.store.reads(), id, number).await?;
    let unknown = || {
        ApiError::new(StatusCode::NOT_FOUND, "unknown_view", format!("there is no view `{view}`"))
            .field("view")
    };
    let icon = views.into_iter().find(|v| v.id == view).ok_or_else(unknown)?.crop.icon;
    let grey: Vec<u8> = icon.pixels.iter().map(|g| *g as u8).collect();
    grey_answer(&known, FOREVER, (icon.size, &grey)).await
}

/// Most tracks of one decision.
const MAX_PICKS: usize = 64;

/// Makes landmarks of tracks, or adds views to the landmarks they show; places them; and learns
/// them. All or nothing.
#[utoipa::path(post, path = "/maps/{map}/gatherings/{gathering}/accept", operation_id = "acceptTracks",
    tag = "gathering",
    params(("map" = String, Path), ("gathering" = i64, Path)), request_body = AcceptRequest,
    responses((status = 202, body = AcceptanceBody), (status = 200, body = AcceptanceBody, description = "without a lesson"),
    (status = 404, body = Problem, description = "unknown_gathering, unknown_track"),
    (status = 409, body = Problem, description = "exists: the landmark has views of its own; in_use; too_many"),
    (status = 422, body = Problem, description = "bad_name, invalid_value, out_of_range")))]
async fn accept(
    State(app): State<AppState>,
    PathParams((map, id)): PathParams<(String, i64)>,
    Body(decision): Body<AcceptRequest>,
) -> Result<(StatusCode, Json<AcceptanceBody>), ApiError> {
    if !(1..=MAX_PICKS).contains(&decision.tracks.len()) {
        let detail = format!("1 to {MAX_PICKS} tracks at a time");
        return Err(ApiError::invalid("out_of_range", "tracks", detail));
    }
    let pick = |(i, pick): (usize, AcceptedTrackBody)| {
        let name = pick.name.map(|text| name("name", text)).transpose();
        let name = name.map_err(|e| e.field(format!("tracks[{i}].name")))?;
        Ok(TrackAcceptance { number: pick.track, name: name.map(|n| n.to_string()) })
    };
    let picks = decision.tracks.into_iter().enumerate().map(pick).collect::<Result<Vec<_>, ApiError>>()?;
    created(acceptance_shown, app.gatherer.accept((&map, id), picks, decision.learn, bounds(&app))).await
}

fn acceptance_shown(done: &AcceptanceResult) -> (StatusCode, AcceptanceBody) {
    let landmark = |(name, (views, placing)): (&String, &(u64, PlacementReport))| ExtendedLandmark {
        name: name.clone(),
        views: *views,
        placing: placement_shown(placing.clone()),
    };
    let status = if done.job.is_some() { StatusCode::ACCEPTED } else { StatusCode::OK };
    let job = done.job.clone().map(|row| job_shown(row, None));
    (status, AcceptanceBody { landmarks: done.landmarks.iter().map(landmark).collect(), job })
}
