//! Lessons and jobs: start, watch, stop.

use super::{
    AppState,
    answers::{created, page},
    authorise::Caller,
    error::ApiError,
    extract::{Body, PathParams, QueryParams, number_cursor, page_limit},
};
use crate::{
    identity::Principal,
    jobs::{JobProgress, request},
    store::{
        StoreError,
        jobs::{JobFilter, JobRow},
        landmarks, maps,
    },
};
use axum::{
    Extension, Json,
    extract::State,
    http::StatusCode,
    response::{
        Sse,
        sse::{Event, KeepAlive},
    },
};
use futures::{Stream, StreamExt, stream};
use protos::api::{Job, JobQuery, JobState, LandmarkLesson, MapLesson, Page, Problem};
use std::convert::Infallible;
use tokio_stream::wrappers::WatchStream;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(learn_one))
        .routes(routes!(learn_map))
        .routes(routes!(list))
        .routes(routes!(get, cancel))
        .routes(routes!(events))
}

/// A job as it stands.
pub(super) fn job_shown(row: JobRow, progress: Option<&JobProgress>) -> Job {
    let state = JobState::of_word(&row.state);
    Job {
        id: row.id,
        kind: row.kind,
        map: row.map,
        state: if progress.is_some_and(|p| p.running) { JobState::Running } else { state },
        progress: progress.map_or(if state == JobState::Done { 1.0 } else { 0.0 }, |p| p.share),
        message: progress.map_or(row.message, |p| p.message.clone()),
        result: row.result.and_then(|text| serde_json::from_str(&text).ok()),
        by: row.author,
        created_ms: row.created_ms,
        started_ms: row.started_ms,
        ended_ms: row.ended_ms,
    }
}

fn check_generated(generated_views: Option<usize>) -> Result<Option<usize>, ApiError> {
    match generated_views {
        Some(n) if n > request::MAX_GENERATED => {
            let detail = format!("{n} is more than {}", request::MAX_GENERATED);
            Err(ApiError::invalid("out_of_range", "generated_views", detail))
        }
        n => Ok(n),
    }
}

/// Learns one landmark again from its views.
#[utoipa::path(post, path = "/maps/{map}/landmarks/{landmark}/learn", operation_id = "learnLandmark", tag = "lessons",
    params(("map" = String, Path), ("landmark" = String, Path)), request_body = Option<LandmarkLesson>,
    responses((status = 202, body = Job), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "no_views, too_many"), (status = 422, body = Problem)))]
async fn learn_one(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    lesson: Option<Body<LandmarkLesson>>,
) -> Result<(StatusCode, Json<Job>), ApiError> {
    let lesson = lesson.map(|Body(l)| l).unwrap_or_default();
    let request = request::Request {
        landmarks: Some(vec![landmark]),
        generated_views: check_generated(lesson.generated_views)?,
    };
    submit(&app, &map, request).await
}

/// Learns landmarks of a map in one job: what they must be told from is worked out once.
#[utoipa::path(post, path = "/maps/{map}/learn", operation_id = "learnMap",
    tag = "lessons", params(("map" = String, Path)),
    request_body = Option<MapLesson>, responses((status = 202, body = Job), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "no_views, too_many"), (status = 422, body = Problem)))]
async fn learn_map(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    lesson: Option<Body<MapLesson>>,
) -> Result<(StatusCode, Json<Job>), ApiError> {
    let lesson = lesson.map(|Body(l)| l).unwrap_or_default();
    if lesson.landmarks.as_ref().is_some_and(Vec::is_empty) {
        return Err(ApiError::invalid(
            "out_of_range",
            "landmarks",
            "an empty list; leave it out to mean all",
        ));
    }
    let request = request::Request {
        landmarks: lesson.landmarks,
        generated_views: check_generated(lesson.generated_views)?,
    };
    submit(&app, &map, request).await
}

async fn submit(
    app: &AppState,
    map: &str,
    request: request::Request,
) -> Result<(StatusCode, Json<Job>), ApiError> {
    maps::get(app.store.reads(), map).await?;
    let max = app.config.limits.landmarks;
    let names = request.landmarks.as_deref().unwrap_or_default();
    if names.len() > max {
        return Err(ApiError::invalid("too_many", "landmarks", format!("more than {max}")));
    }
    for name in names {
        if landmarks::get(app.store.reads(), map, name).await?.views == 0 {
            let detail = format!("landmark `{name}` has no views");
            return Err(ApiError::new(StatusCode::CONFLICT, "no_views", detail).field("landmarks"));
        }
    }
    let shown = |row: &JobRow| (StatusCode::ACCEPTED, job_shown(row.clone(), None));
    created(shown, app.jobs.submit(map, &request)).await
}

async fn read(app: &AppState, id: i64) -> Result<Job, StoreError> {
    let (row, progress) = app.jobs.get(id).await?;
    Ok(job_shown(row, progress.as_ref()))
}

/// Lists jobs, newest first: those that wait or run, and the last that have ended.
#[utoipa::path(get, path = "/jobs", operation_id = "listJobs", tag = "lessons", params(JobQuery),
    responses((status = 200, body = Page<Job>), (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn list(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<JobQuery>,
    Extension(principal): Extension<Principal>,
) -> Result<Json<Page<Job>>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    // Every number is less than that of the first page.
    let before = number_cursor(query.cursor.as_deref())?.unwrap_or(i64::MAX);
    let maps = principal.visible_maps(query.map).map(|names| serde_json::json!(names).to_string());
    let filter = JobFilter { state: query.state.map(JobState::as_str), maps };
    let (jobs, total) = app.jobs.page(&filter, before, limit + 1).await?;
    Ok(Json(page(jobs, limit, total, |(row, _)| row.id.to_string(), |(row, p)| job_shown(row, p.as_ref()))))
}

/// One job.
#[utoipa::path(get, path = "/jobs/{job}", operation_id = "getJob", tag = "lessons", params(("job" = i64, Path)),
    responses((status = 200, body = Job), (status = 404, body = Problem)))]
async fn get(State(app): State<AppState>, PathParams(id): PathParams<i64>) -> Result<Json<Job>, ApiError> {
    Ok(Json(read(&app, id).await?))
}

/// Asks a job to stop: one that waits is cancelled at once. One that has ended stays as it is.
#[utoipa::path(delete, path = "/jobs/{job}", operation_id = "cancelJob", tag = "lessons", params(("job" = i64, Path)),
    responses((status = 200, body = Job), (status = 404, body = Problem)))]
async fn cancel(State(app): State<AppState>, PathParams(id): PathParams<i64>) -> Result<Json<Job>, ApiError> {
    app.jobs.cancel(id).await?;
    Ok(Json(read(&app, id).await?))
}

/// Follows a job: an event `job` with each change, the last one with its end.
#[utoipa::path(get, path = "/jobs/{job}/events", operation_id = "followJob",
    tag = "lessons", params(("job" = i64, Path)),
    responses((status = 200, content_type = "text/event-stream", body = Job), (status = 404, body = Problem),
    (status = 503, body = Problem, description = "too_many_streams")))]
async fn events(
    State(app): State<AppState>,
    PathParams(id): PathParams<i64>,
    Extension(asker): Extension<Caller>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    let place = app.stream_place()?;
    let progress = app.jobs.watch(id).await?;
    let changes = match progress {
        Some(progress) => WatchStream::new(progress).map(|_| ()).left_stream(),
        None => stream::iter([()]).right_stream(),
    };
    let stopping = app.ended_for(asker);
    // The sender of the changes goes when the job has ended; one more look then shows how.
    let states = changes.chain(stream::iter([()])).then(move |()| {
        let (app, _place) = (app.clone(), &place);
        async move { read(&app, id).await.ok() }
    });
    let events = states.filter_map(async |job| Event::default().event("job").json_data(job?).ok().map(Ok));
    Ok(Sse::new(events.take_until(stopping)).keep_alive(KeepAlive::default()))
}
