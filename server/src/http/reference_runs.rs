//! `/robots/{robot}/recording` and `/maps/{map}/reference-runs`: runs whose path is known, to learn
//! which modality to trust where.

use super::{
    App, AppState,
    answers::created,
    error::ApiError,
    extract::{BodyUpTo, PathParams, name},
    modalities::stats,
};
use crate::store::{
    maps,
    modality_stats::{self, ReferenceRunRow},
    robots,
};
use axum::{Json, extract::State, http::StatusCode};
use engine::motion::{RecordingError, RecordingStatus};
use map::{
    fuse::FuseParams,
    modality_stats::{
        MAX_REFERENCE, ReferenceError, ReferenceTrajectory, StatsByModality, learn_modality_stats,
    },
    pose2::Pose2,
};
use protos::api::{Problem, RecordingStatusBody, ReferenceRunBody, ReferenceRuns, ReferenceTrajectoryBody};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Usual standard deviations of a reference: metres, radians.
const USUAL: [f64; 2] = [0.01, 0.005];

/// Most bytes of one pose in JSON: 20 digits of the time, three numbers of up to 25 characters, and
/// what is between them.
const POSE_BYTES: usize = 112;
/// Most bytes of a path: that of [`MAX_REFERENCE`] poses, and the rest of the object.
pub(super) const PATH_BYTES: usize = MAX_REFERENCE * POSE_BYTES + 1024;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(begin, get, cancel))
        .routes(routes!(list))
        .routes(routes!(forget))
        .routes(routes!(reference))
}

fn refused(error: RecordingError) -> ApiError {
    let (status, code) = match error {
        RecordingError::AlreadyRecording | RecordingError::Lent => (StatusCode::CONFLICT, "in_use"),
        RecordingError::TooMany => (StatusCode::CONFLICT, "too_many"),
        RecordingError::None => (StatusCode::NOT_FOUND, "not_recording"),
    };
    ApiError::new(status, code, error.to_string()).field("robot")
}

/// Begins to record a run of a robot on its map: odometry, and what landmarks and the laser say. It
/// lies in memory until the path is told.
#[utoipa::path(post, path = "/robots/{robot}/recording", operation_id = "startRecording",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 201, body = RecordingStatusBody), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "in_use: one is recorded already; too_many")))]
async fn begin(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<(StatusCode, Json<RecordingStatusBody>), ApiError> {
    let row = robots::get(app.store.reads(), &robot).await?;
    let begun = app.motion.start_recording(&name("robot", robot)?, &row.map).map_err(refused)?;
    Ok((StatusCode::CREATED, Json(recording_shown(begun))))
}

/// What was recorded so far.
#[utoipa::path(get, path = "/robots/{robot}/recording", operation_id = "getRecording",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = RecordingStatusBody), (status = 404, body = Problem, description = "unknown_robot, not_recording")))]
async fn get(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<Json<RecordingStatusBody>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let recorded = app.motion.recording(&name("robot", robot)?);
    recorded.map(recording_shown).map(Json).ok_or_else(|| refused(RecordingError::None))
}

/// Gives the recording up.
#[utoipa::path(delete, path = "/robots/{robot}/recording", operation_id = "cancelRecording",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 204), (status = 404, body = Problem, description = "unknown_robot, not_recording")))]
async fn cancel(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<StatusCode, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let given_up = app.motion.take_recording(&name("robot", robot)?);
    given_up.map(|_run| StatusCode::NO_CONTENT).ok_or_else(|| refused(RecordingError::None))
}

fn run_shown(row: &ReferenceRunRow) -> ReferenceRunBody {
    let mut sums = StatsByModality::default();
    for found in row.cells.values() {
        for (sum, more) in sums.iter_mut().zip(found) {
            sum.add(more);
        }
    }
    ReferenceRunBody {
        id: row.id,
        robot: row.robot.clone(),
        created_ms: row.created_ms,
        distance_m: row.way_m,
        cells: row.cells.len(),
        statistics: stats(&sums),
    }
}

fn recording_shown(recorded: RecordingStatus) -> RecordingStatusBody {
    RecordingStatusBody {
        map: recorded.map,
        robot: recorded.robot,
        active: recorded.active,
        reason: recorded.reason,
        distance_m: recorded.distance_m,
        span_ns: recorded.span_ns,
        odometry: recorded.odometry,
        landmarks: recorded.landmarks,
        laser: recorded.laser,
    }
}

fn reference_of(path: ReferenceTrajectoryBody) -> Result<ReferenceTrajectory, ApiError> {
    if path.poses.len() > MAX_REFERENCE {
        return Err(ApiError::invalid("too_many", "poses", format!("more than {MAX_REFERENCE} poses")));
    }
    let poses = path
        .poses
        .into_iter()
        .map(|(at_ns, x, y, theta)| (at_ns, Pose2 { x_m: x, y_m: y, theta_rad: theta }));
    let [sigma_m, sigma_rad] = USUAL;
    let made = ReferenceTrajectory::new(
        poses.collect(),
        path.sigma_m.unwrap_or(sigma_m),
        path.sigma_rad.unwrap_or(sigma_rad),
    );
    made.map_err(|error| {
        let (code, field) = match &error {
            ReferenceError::Pose { index, error } => {
                ("out_of_range", format!("poses[{index}].{}", error.field))
            }
            ReferenceError::Range(error) => ("out_of_range", error.field.to_owned()),
            ReferenceError::Order { index } => ("not_in_order", format!("poses[{index}]")),
        };
        ApiError::invalid(code, field, error.to_string())
    })
}

/// Ends the recording by telling the path, once what it shows is stored; until then it stays,
/// whatever becomes of the request. What each modality was off by, and claimed, is kept by square
/// metre and heading, and robots on this map are fused by it from now on.
#[utoipa::path(post, path = "/robots/{robot}/recording/reference", operation_id = "finishRecording",
    tag = "robots", params(("robot" = String, Path)),
    request_body = ReferenceTrajectoryBody, responses((status = 201, body = ReferenceRunBody),
    (status = 404, body = Problem, description = "unknown_robot, not_recording, unknown_map"),
    (status = 409, body = Problem, description = "too_many; in_use: it is being learnt from already"),
    (status = 422, body = Problem, description = "out_of_range, not_in_order, too_many, no_overlap: none of the run's times is within the path's")))]
async fn reference(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
    BodyUpTo(path): BodyUpTo<ReferenceTrajectoryBody, PATH_BYTES>,
) -> Result<(StatusCode, Json<ReferenceRunBody>), ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let (robot, known) = (name("robot", robot)?, reference_of(path)?);
    // Whatever ends this request early, the recording stays until the run is stored.
    let (motion, whose) = (app.motion.clone(), robot.to_string());
    let work = move |_: &App| {
        let mut lent = motion.lend_recording(&robot)?;
        let learnt = learn_modality_stats(&lent.recording.with_reference(&known), &FuseParams::default());
        Ok((lent, learnt))
    };
    let (lent, learnt) = app.clone().on_vision_thread(work).await?.map_err(refused)?;
    if learnt.cells.is_empty() {
        return Err(ApiError::invalid(
            "no_overlap",
            "poses",
            "none of the run's times is within those of the path",
        ));
    }
    let (on, way_m, cells) = (lent.recording.map.clone(), learnt.way_m, learnt.cells);
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            let row = modality_stats::add(tx, &on, &whose, way_m, &cells).await?;
            tx.after(move || lent.finish());
            Ok(row)
        })
    });
    created(|row: &ReferenceRunRow| (StatusCode::CREATED, run_shown(row)), write).await
}

/// The runs that the map's areas have learnt from.
#[utoipa::path(get, path = "/maps/{map}/reference-runs", operation_id = "listReferenceRuns",
    tag = "maps", params(("map" = String, Path)),
    responses((status = 200, body = ReferenceRuns), (status = 404, body = Problem)))]
async fn list(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
) -> Result<Json<ReferenceRuns>, ApiError> {
    let map = maps::get(app.store.reads(), &map).await?;
    let runs = modality_stats::runs(app.store.reads(), map.id).await?;
    Ok(Json(ReferenceRuns { runs: runs.iter().map(run_shown).collect() }))
}

/// Forgets a run and what it showed.
#[utoipa::path(delete, path = "/maps/{map}/reference-runs/{run}", operation_id = "deleteReferenceRun", tag = "maps",
    params(("map" = String, Path), ("run" = i64, Path)),
    responses((status = 204), (status = 404, body = Problem, description = "unknown_map, unknown_reference_run")))]
async fn forget(
    State(app): State<AppState>,
    PathParams((map, run)): PathParams<(String, i64)>,
) -> Result<StatusCode, ApiError> {
    app.store.write(move |tx| Box::pin(async move { modality_stats::delete(tx, &map, run).await })).await?;
    Ok(StatusCode::NO_CONTENT)
}
