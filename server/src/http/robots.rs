//! `/robots`: which robots there are and on which map each stands.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, Body, Page, PageQuery, Params, name},
    resources::Robot,
};
use crate::store::robots;
use axum::{Json, extract::State, http::StatusCode};
use engine::motion::Corrections;
use serde::Deserialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(put, get, delete)).routes(routes!(corrections))
}

/// Where a robot stands.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Assignment {
    /// Name of the map.
    map: String,
}

/// Registers a robot, or moves it to another map.
#[utoipa::path(put, path = "/robots/{robot}", tag = "robots", params(("robot" = String, Path)),
    request_body = Assignment, responses((status = 200, body = Robot),
    (status = 404, body = Problem, description = "unknown_map"), (status = 409, body = Problem),
    (status = 422, body = Problem, description = "bad_name")))]
async fn put(
    State(app): State<Shared>,
    At(robot): At<String>,
    Body(to): Body<Assignment>,
) -> Result<Json<Robot>, ApiError> {
    let (robot, max) = (name("robot", robot)?, app.config.limits.robots);
    let write = app
        .store
        .write(move |tx| Box::pin(async move { robots::put(tx, robot.as_str(), &to.map, max).await }));
    Ok(Json(Robot::new(write.await?, &app.motion, &app.live)))
}

/// Lists robots by name, with what is known of each: whether its software is connected, whether a second program uses its
/// name, its pose, how old that is and how far it is trusted.
#[utoipa::path(get, path = "/robots", tag = "robots", params(PageQuery),
    responses((status = 200, body = Page<Robot>)))]
async fn list(
    State(app): State<Shared>,
    Params(page): Params<PageQuery>,
) -> Result<Json<Page<Robot>>, ApiError> {
    let limit = page.limit(app.config.limits.page)?;
    let rows = robots::page(app.store.reads(), &page.after(), limit + 1).await?;
    Ok(Json(Page::new(rows, limit, |r| r.name.clone(), |r| Robot::new(r, &app.motion, &app.live))))
}

/// One robot.
#[utoipa::path(get, path = "/robots/{robot}", tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = Robot), (status = 404, body = Problem)))]
async fn get(State(app): State<Shared>, At(robot): At<String>) -> Result<Json<Robot>, ApiError> {
    Ok(Json(Robot::new(robots::get(app.store.reads(), &robot).await?, &app.motion, &app.live)))
}

/// Forgets a robot; its frames are rejected from now on.
#[utoipa::path(delete, path = "/robots/{robot}", tag = "robots", params(("robot" = String, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn delete(State(app): State<Shared>, At(robot): At<String>) -> Result<StatusCode, ApiError> {
    let (gone, motion) = (name("robot", robot)?, app.motion.clone());
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            robots::delete(tx, gone.as_str()).await?;
            // A run of it that is being recorded would keep its place for ever.
            tx.after(move || drop(motion.take_recording(&gone)));
            Ok(())
        })
    });
    write.await?;
    Ok(StatusCode::NO_CONTENT)
}

/// What the robot's pose rests on, and what became of its fixes: by landmarks that were named without the pose
/// (`landmarks`), by landmarks that were named by the pose (`guided`), and by laser scans laid on the map's walls (`laser`).
/// A guided fix corrects a pose that the others support; it never starts, supports or replaces one. Since the server
/// started; the latest 200 of each modality.
#[utoipa::path(get, path = "/robots/{robot}/corrections", tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = Corrections), (status = 404, body = Problem)))]
async fn corrections(
    State(app): State<Shared>,
    At(robot): At<String>,
) -> Result<Json<Corrections>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    Ok(Json(app.motion.corrections(&name("robot", robot)?)))
}
