//! `/robots/{robot}/run` and `/maps/{map}/runs`: runs whose path is known, to learn which modality to trust where.

use super::{
    App, Shared,
    areas::Shown,
    error::{ApiError, Problem},
    extract::{At, BodyUpTo, name},
};
use crate::store::{areas, maps, robots};
use axum::{Json, extract::State, http::StatusCode};
use engine::motion::{Recorded, RunError};
use map::{
    fuse::FuseParams,
    modality_stats::{
        MAX_REFERENCE, ReferenceError, ReferenceTrajectory, StatsByModality, learn_modality_stats,
    },
    pose2::Pose2,
};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

/// Usual standard deviations of a reference: metres, radians.
const USUAL: [f64; 2] = [0.01, 0.005];

/// Most bytes of one pose in JSON: 20 digits of the time, three numbers of up to 25 characters, and what is between them.
const POSE_BYTES: usize = 112;
/// Most bytes of a path: that of [`MAX_REFERENCE`] poses, and the rest of the object.
const PATH_BYTES: usize = MAX_REFERENCE * POSE_BYTES + 1024;

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(begin, get, cancel))
        .routes(routes!(list))
        .routes(routes!(forget))
        .routes(routes!(reference))
}

fn refused(error: RunError) -> ApiError {
    let (status, code) = match error {
        RunError::Going | RunError::Lent => (StatusCode::CONFLICT, "in_use"),
        RunError::TooMany => (StatusCode::CONFLICT, "too_many"),
        RunError::None => (StatusCode::NOT_FOUND, "not_recording"),
    };
    ApiError::new(status, code, error.to_string()).field("robot")
}

/// Begins to record a run of a robot on its map: odometry, and what landmarks and the laser say. It lies in memory until
/// the path is told.
#[utoipa::path(post, path = "/robots/{robot}/run", tag = "robots", params(("robot" = String, Path)),
    responses((status = 201, body = Recorded), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "in_use: one is recorded already; too_many")))]
async fn begin(
    State(app): State<Shared>,
    At(robot): At<String>,
) -> Result<(StatusCode, Json<Recorded>), ApiError> {
    let row = robots::get(app.store.reads(), &robot).await?;
    let begun = app.motion.record(&name("robot", robot)?, &row.map).map_err(refused)?;
    Ok((StatusCode::CREATED, Json(begun)))
}

/// What was recorded so far.
#[utoipa::path(get, path = "/robots/{robot}/run", tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = Recorded), (status = 404, body = Problem, description = "unknown_robot, not_recording")))]
async fn get(State(app): State<Shared>, At(robot): At<String>) -> Result<Json<Recorded>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let recorded = app.motion.recorded(&name("robot", robot)?);
    recorded.map(Json).ok_or_else(|| refused(RunError::None))
}

/// Gives the recording up.
#[utoipa::path(delete, path = "/robots/{robot}/run", tag = "robots", params(("robot" = String, Path)),
    responses((status = 204), (status = 404, body = Problem, description = "unknown_robot, not_recording")))]
async fn cancel(State(app): State<Shared>, At(robot): At<String>) -> Result<StatusCode, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let given_up = app.motion.take_recording(&name("robot", robot)?);
    given_up.map(|_run| StatusCode::NO_CONTENT).ok_or_else(|| refused(RunError::None))
}

/// Where the robot really was.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct KnownPath {
    /// Time (ns of the robot's clock, as in its messages), x and y in metres on the map, heading in radians; times rise, 2 to
    /// 200 000 (up to 112 bytes each). Nothing is learnt between two that are more than a second apart.
    poses: Vec<(i64, f64, f64, f64)>,
    /// Standard deviation of its positions, metres; 0.01 if absent.
    sigma_m: Option<f64>,
    /// Of its headings, radians; 0.005 if absent.
    sigma_rad: Option<f64>,
}

/// A run that was learnt from.
#[derive(Debug, Serialize, ToSchema)]
struct LearntRun {
    /// Its number.
    id: i64,
    /// Whose.
    robot: String,
    /// ms since the Unix epoch.
    created_ms: i64,
    /// Way of which the path was known, metres.
    way_m: f64,
    /// Square metres by heading that it tells of.
    cells: usize,
    /// What it showed, all of it together.
    modules: Vec<Shown>,
}

impl From<areas::RunRow> for LearntRun {
    fn from(row: areas::RunRow) -> Self {
        let mut sums = StatsByModality::default();
        for found in row.cells.values() {
            for (sum, more) in sums.iter_mut().zip(found) {
                sum.add(more);
            }
        }
        Self {
            id: row.id,
            robot: row.robot,
            created_ms: row.created_ms,
            way_m: row.way_m,
            cells: row.cells.len(),
            modules: Shown::all(&sums),
        }
    }
}

fn reference_of(path: KnownPath) -> Result<ReferenceTrajectory, ApiError> {
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

/// Ends the recording by telling the path, once what it shows is stored; until then it stays, whatever becomes of the request.
/// What each modality was off by, and claimed, is kept by square metre and heading,
/// and robots on this map are fused by it from now on.
#[utoipa::path(post, path = "/robots/{robot}/run/reference", tag = "robots", params(("robot" = String, Path)),
    request_body = KnownPath, responses((status = 201, body = LearntRun),
    (status = 404, body = Problem, description = "unknown_robot, not_recording, unknown_map"),
    (status = 409, body = Problem, description = "too_many; in_use: it is being learnt from already"),
    (status = 422, body = Problem, description = "out_of_range, not_in_order, too_many, no_overlap: none of the run's times is within the path's")))]
async fn reference(
    State(app): State<Shared>,
    At(robot): At<String>,
    BodyUpTo(path): BodyUpTo<KnownPath, PATH_BYTES>,
) -> Result<(StatusCode, Json<LearntRun>), ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let (robot, known) = (name("robot", robot)?, reference_of(path)?);
    // Whatever ends this request early, the recording stays until the run is stored.
    let (motion, whose) = (app.motion.clone(), robot.to_string());
    let work = move |_: &App| {
        let mut lent = motion.lend_recording(&robot)?;
        let learnt = learn_modality_stats(&lent.recording.against(&known), &FuseParams::default());
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
    let map = lent.recording.map.clone();
    let (on, way_m, cells) = (map.clone(), learnt.way_m, learnt.cells);
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            let id = areas::add(tx, &on, &whose, way_m, &cells).await?;
            tx.after(move || lent.learnt());
            Ok(id)
        })
    });
    let id = write.await?;
    let map = maps::get(app.store.reads(), &map).await?;
    let runs = areas::runs(app.store.reads(), map.id).await?;
    let row = runs.into_iter().find(|run| run.id == id);
    let row = row.ok_or_else(|| refused(RunError::None))?;
    Ok((StatusCode::CREATED, Json(row.into())))
}

/// Runs of a map that were learnt from.
#[derive(Debug, Serialize, ToSchema)]
struct Runs {
    /// Oldest first; at most 200.
    runs: Vec<LearntRun>,
}

/// The runs that the map's areas have learnt from.
#[utoipa::path(get, path = "/maps/{map}/runs", tag = "maps", params(("map" = String, Path)),
    responses((status = 200, body = Runs), (status = 404, body = Problem)))]
async fn list(State(app): State<Shared>, At(map): At<String>) -> Result<Json<Runs>, ApiError> {
    let map = maps::get(app.store.reads(), &map).await?;
    let runs = areas::runs(app.store.reads(), map.id).await?;
    Ok(Json(Runs { runs: runs.into_iter().map(LearntRun::from).collect() }))
}

/// Forgets a run and what it showed.
#[utoipa::path(delete, path = "/maps/{map}/runs/{run}", tag = "maps",
    params(("map" = String, Path), ("run" = i64, Path)),
    responses((status = 204), (status = 404, body = Problem, description = "unknown_map, unknown_run")))]
async fn forget(
    State(app): State<Shared>,
    At((map, run)): At<(String, i64)>,
) -> Result<StatusCode, ApiError> {
    app.store.write(move |tx| Box::pin(async move { areas::forget(tx, &map, run).await })).await?;
    Ok(StatusCode::NO_CONTENT)
}
