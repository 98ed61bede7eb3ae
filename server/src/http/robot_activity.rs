//! What robots do, and `/unknown-robots`: those that send messages without being registered.

use super::{AppState, error::ApiError};
use crate::bus::connection_advice;
use axum::{Json, extract::State};
use engine::{
    live::LiveHub,
    robot_activity::{Input, InputActivity, Reason, RobotActivity},
    unknown_robots::UnknownRobot,
};
use protos::{Code, Name, api};
use std::time::{Duration, Instant};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(unknown))
}

fn ms(ago: Duration) -> u64 {
    u64::try_from(ago.as_millis()).unwrap_or(u64::MAX)
}

/// What a robot has done.
pub(super) fn activity_shown(live: &LiveHub, robot: &Name, now: Instant) -> Option<api::RobotActivity> {
    let activity = live.activity(robot, now)?;
    let RobotActivity { answered, inputs, last_message, last_recognised, frames_per_s, .. } = activity;
    Some(api::RobotActivity {
        answered,
        inputs: inputs.into_iter().map(input_shown).collect(),
        last_message_ms: last_message.map(ms),
        last_recognised_ms: last_recognised.map(ms),
        frames_per_s,
    })
}

fn input_shown(activity: InputActivity) -> api::RobotInput {
    let InputActivity { input, used, refused, refused_in_a_row, reasons } = activity;
    let reason = |Reason { code, field, detail, count, ago }| {
        let advice = match (input, Code::of(&code)) {
            (Input::Connection, _) => connection_advice(&code),
            (_, Some(code)) => code.advice(),
            (_, None) => ros2::robot::advice(&code),
        };
        api::RefusalReason { advice: advice.to_owned(), code, field, detail, count, ago_ms: ms(ago) }
    };
    let reasons = reasons.into_iter().map(reason).collect();
    api::RobotInput { input: input.word().to_owned(), used, refused, refused_in_a_row, reasons }
}

fn unknown_shown(robot: UnknownRobot) -> api::UnknownRobot {
    api::UnknownRobot {
        name: robot.name.to_string(),
        camera: robot.camera.map(|camera| camera.to_string()),
        messages: robot.messages,
        first_ms: ms(robot.first),
        last_ms: ms(robot.last),
    }
}

/// Robots that send messages and are refused because they are not registered, by name: at most 64,
/// those that were heard last. One that is registered is not among them any more.
#[utoipa::path(get, path = "/unknown-robots", operation_id = "listUnknownRobots",
    tag = "robots", responses((status = 200, body = api::UnknownRobots)))]
async fn unknown(State(app): State<AppState>) -> Result<Json<api::UnknownRobots>, ApiError> {
    let snapshots = app.store.snapshots();
    let is_registered = |robot: &Name| snapshots.robot_map(robot.as_str()).is_some();
    let robots =
        app.live.unknown_robots(Instant::now(), is_registered).into_iter().map(unknown_shown).collect();
    Ok(Json(api::UnknownRobots { robots }))
}
