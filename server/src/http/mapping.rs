//! `/maps/{map}/mapping`: the walls of a map made by a robot that drives.

use super::{
    App, AppState,
    authorise::check_robot,
    error::ApiError,
    extract::{Body, PathParams, QueryParams, name},
    gathering::accept_passing,
    walls::shown as shown_wall,
};
use crate::{
    identity::Principal,
    store::{
        actor::{Actor, inherited},
        maps, robots,
        walls::{self, StoredWall},
    },
};
use axum::{Extension, Json, extract::State, http::StatusCode};
use engine::{
    mapping::{FRAMES_WAITING, LeftOut, MadeMap, MadeSurvey, MappingError, MappingProgress, MappingStage},
    panics::Edge,
};
use futures::FutureExt;
use map::pose2::Pose2;
use protos::api::{
    FinishMappingQuery, LeftOutBody, MappingProgressBody, MappingStageBody, NewMapping, Problem,
};
use std::{panic::AssertUnwindSafe, sync::Arc};
use tokio::sync::oneshot;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(begin, get, cancel)).routes(routes!(finish))
}

fn refused(error: MappingError) -> ApiError {
    let (status, code) = match error {
        MappingError::AlreadyMapping | MappingError::Busy => (StatusCode::CONFLICT, "in_use"),
        MappingError::TooMany => (StatusCode::CONFLICT, "too_many"),
        MappingError::None => (StatusCode::NOT_FOUND, "not_mapping"),
        MappingError::Thread => (StatusCode::SERVICE_UNAVAILABLE, "no_thread"),
    };
    ApiError::new(status, code, error.to_string()).field("map")
}

fn frames_refused(progress: &MappingProgress) -> Option<String> {
    let refused = progress.frames_refused.as_ref().map(|(count, first)| format!("{count} times {first}"));
    let dropped = progress.frames_dropped;
    let dropped = (dropped > 0).then(|| format!("{dropped} dropped: {FRAMES_WAITING} others waited"));
    let told: Vec<String> = refused.into_iter().chain(dropped).collect();
    (!told.is_empty()).then(|| told.join("; "))
}

fn left_out(object: LeftOut) -> LeftOutBody {
    let LeftOut { centre_m: [x_m, y_m, z_m], size_m: [width_m, height_m], views, reason } = object;
    LeftOutBody { x_m, y_m, z_m, width_m, height_m, views, reason }
}

fn shown(progress: MappingProgress) -> MappingProgressBody {
    let frames_refused = frames_refused(&progress);
    MappingProgressBody {
        map: progress.map,
        robot: progress.robot,
        stage: match progress.stage {
            MappingStage::Resuming => MappingStageBody::Resuming,
            MappingStage::Mapping => MappingStageBody::Mapping,
            MappingStage::Finishing => MappingStageBody::Finishing,
            MappingStage::Found => MappingStageBody::Found,
            MappingStage::Done => MappingStageBody::Done,
            MappingStage::Failed => MappingStageBody::Failed,
        },
        scans: progress.scans,
        dropped: progress.dropped,
        frames: progress.frames,
        frames_refused,
        landmarks: progress.landmarks,
        left_out: progress.left_out.into_iter().map(left_out).collect(),
        gathering: progress.gathering,
        distance_m: progress.distance_m,
        pose: progress.pose,
        segments: progress.segments,
        loop_closures: progress.loop_closures,
        reason: progress.reason,
        journal_error: progress.journal_error,
        walls: None,
    }
}

/// Begins to make the walls of a map from the scans of a robot, and with `landmarks` to look for
/// landmarks in its frames. While it lasts, scans are mapped and localise nothing. The map stays as
/// it is until the mapping is finished. The scans are kept on disk until then: after a restart of
/// the server the mapping goes on by itself (`resuming`), with a robot whose software went on;
/// `journal_error` says if they cannot be.
#[utoipa::path(post, path = "/maps/{map}/mapping", operation_id = "startMapping",
    tag = "maps", params(("map" = String, Path)),
    request_body = NewMapping, responses((status = 201, body = MappingProgressBody),
    (status = 404, body = Problem, description = "unknown_map, unknown_robot"),
    (status = 409, body = Problem, description = "in_use: it is being made already, or the robot makes or stands on another; too_many"),
    (status = 422, body = Problem, description = "out_of_range")))]
async fn begin(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Extension(principal): Extension<Principal>,
    Body(new): Body<NewMapping>,
) -> Result<(StatusCode, Json<MappingProgressBody>), ApiError> {
    maps::get(app.store.reads(), &map).await?;
    check_robot(&app, &principal, &new.robot)?;
    let row = robots::get(app.store.reads(), &new.robot).await?;
    if row.map != map {
        let detail = format!("robot {} stands on map {}", row.name, row.map);
        return Err(ApiError::new(StatusCode::CONFLICT, "in_use", detail).field("robot"));
    }
    let origin = new.origin.map(|[x_m, y_m, theta_rad]| Pose2::new(x_m, y_m, theta_rad));
    let checked = origin.as_ref().map_or(Ok(()), Pose2::check);
    checked.map_err(|e| ApiError::invalid("out_of_range", "origin", e.to_string()))?;
    let (map, robot) = (name("map", map)?, name("robot", new.robot)?);
    // It opens a file.
    let what = (origin, new.landmarks);
    let begun = tokio::task::spawn_blocking(move || app.motion.mappings().begin(&map, &robot, what)).await;
    let begun = begun.map_err(|e| ApiError::internal(&e))?;
    Ok((StatusCode::CREATED, Json(shown(begun.map_err(refused)?))))
}

/// How far it has come: the mapping that goes on, or the last since the server started.
#[utoipa::path(get, path = "/maps/{map}/mapping", operation_id = "getMapping",
    tag = "maps", params(("map" = String, Path)),
    responses((status = 200, body = MappingProgressBody), (status = 404, body = Problem, description = "unknown_map, not_mapping")))]
async fn get(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
) -> Result<Json<MappingProgressBody>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let mappings = app.motion.mappings();
    let progress = mappings.progress(&map).map(shown).ok_or_else(|| refused(MappingError::None))?;
    let walls = mappings.held(&map).map(|walls| walls.iter().map(|held| shown_wall(held.into())).collect());
    Ok(Json(MappingProgressBody { walls, ..progress }))
}

/// Gives it up, or forgets one that failed: the map stays as it is, what was kept of the scans is
/// removed.
#[utoipa::path(delete, path = "/maps/{map}/mapping", operation_id = "cancelMapping",
    tag = "maps", params(("map" = String, Path)),
    responses((status = 204), (status = 404, body = Problem, description = "unknown_map, not_mapping")))]
async fn cancel(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
) -> Result<StatusCode, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let open = app.motion.mappings().cancel(&map);
    if open { Ok(StatusCode::NO_CONTENT) } else { Err(refused(MappingError::None)) }
}

/// Ends the drive: everything is fitted once more, and the walls replace those of the map in one
/// transaction, or are held until this is asked again. Then the landmarks that were found are
/// tracks of `gathering`, for a person to accept. Answers at once; `stage` says when all is stored
/// or held.
#[utoipa::path(post, path = "/maps/{map}/mapping/finish", operation_id = "finishMapping",
    tag = "maps", params(("map" = String, Path), FinishMappingQuery),
    responses((status = 202, body = MappingProgressBody), (status = 404, body = Problem, description = "unknown_map, not_mapping")))]
async fn finish(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(FinishMappingQuery { hold, accept }): QueryParams<FinishMappingQuery>,
) -> Result<(StatusCode, Json<MappingProgressBody>), ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let (progress, made) = app.motion.mappings().finish(&map).map_err(refused)?;
    let robot = progress.robot.clone();
    // Whoever asked may go away: it is stored all the same.
    tokio::spawn(inherited(Actor::current(), async move {
        if hold {
            let found = found(&app, made).await.map(|(made, _)| made);
            app.motion.mappings().hold(&map, found);
            return;
        }
        let storing = AssertUnwindSafe(store(&app, (&map, &robot), made, accept)).catch_unwind().await;
        let stored = storing.unwrap_or_else(|cause| {
            let panics = app.store.vitals().panics();
            panics.caught(Edge::Mapping, cause.as_ref(), "a finished mapping", "it has failed");
            Err("the server failed on it; see its log".to_owned())
        });
        if let Err(reason) = &stored {
            tracing::warn!(map, reason, "a map that was made is not stored");
        }
        app.motion.mappings().stored(&map, stored);
    }));
    Ok((StatusCode::ACCEPTED, Json(shown(progress))))
}

/// What was made when it comes, and the walls as they are stored, or why there are none.
async fn found(
    app: &App,
    made: oneshot::Receiver<Result<MadeMap, String>>,
) -> Result<(MadeMap, Vec<StoredWall>), String> {
    let made = made.await.map_err(|_gone| "the mapping was given up".to_owned())??;
    let (count, max) = (made.walls.len(), app.config.limits.laser_segments);
    if count == 0 {
        return Err("the scans show no wall".to_owned());
    }
    if count > max {
        return Err(format!("{count} walls are more than {max}"));
    }
    let stored: Vec<StoredWall> = made.walls.iter().map(StoredWall::from).collect();
    match stored.iter().find_map(|wall| wall.segment().err()) {
        Some(error) => Err(error.to_string()),
        None => Ok((made, stored)),
    }
}

/// Stores the walls when they come, then what landmarks are proposed; how many walls.
async fn store(
    app: &AppState,
    (map, robot): (&str, &str),
    made: oneshot::Receiver<Result<MadeMap, String>>,
    accept: bool,
) -> Result<usize, String> {
    let (made, walls) = found(app, made).await?;
    let (name, count) = (map.to_owned(), walls.len());
    let write = app.store.write(move |tx| Box::pin(async move { walls::replace(tx, &name, &walls).await }));
    write.await.map_err(|error| error.to_string())?;
    if let Some(survey) = made.survey {
        let proposed = propose(app, (map, robot), survey, accept).await;
        app.motion.mappings().proposed(map, proposed);
    }
    Ok(count)
}

/// Proposes the landmarks of a survey, and accepts those that pass every gate if they are to be.
async fn propose(
    app: &AppState,
    (map, robot): (&str, &str),
    survey: Arc<MadeSurvey>,
    accept: bool,
) -> Result<Option<i64>, String> {
    let gathering = app.gatherer.propose(map, robot, survey).await?;
    if let (true, Some(id)) = (accept, gathering) {
        accept_passing(app, map, id).await.map_err(|error| error.told().to_owned())?;
    }
    Ok(gathering)
}
