//! What became of the messages of a robot of ROS 2.

use super::{
    AppState,
    error::ApiError,
    extract::{PathParams, name},
};
use crate::store::robots;
use axum::{Json, extract::State};
use protos::api::{Problem, Ros2Status};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(ros2))
}

/// What became of the messages of a robot of ROS 2 since the start: how many came and went on each
/// topic, and what was not used for which reason.
#[utoipa::path(get, path = "/robots/{robot}/ros2", operation_id = "getRos2Status",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = Ros2Status), (status = 404, body = Problem)))]
async fn ros2(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<Json<Ros2Status>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    Ok(Json(app.ros2.status(&name("robot", robot)?)))
}
