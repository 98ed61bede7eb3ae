//! What is happening: the last frame and answer of a camera, and the events of a map as they come.

use super::{
    AppState,
    authorise::Caller,
    error::ApiError,
    extract::{PathParams, name},
};
use crate::store::kind::Kind;
use crate::store::{StoreError, maps, robots};
use axum::{
    Extension, Json,
    extract::State,
    http::header,
    response::{
        IntoResponse, Response, Sse,
        sse::{Event, KeepAlive},
    },
};
use engine::live::{LiveEvent, LiveFrame};
use futures::{Stream, StreamExt};
use map::pose2::Pose2;
use protos::{
    Name,
    api::{LiveEventData, Problem, TrajectoriesBody},
    convert::geometry::pose2_wire,
    v1,
};
use std::{collections::VecDeque, convert::Infallible};
use tokio_stream::wrappers::BroadcastStream;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(frame))
        .routes(routes!(answer))
        .routes(routes!(trajectories))
        .routes(routes!(events))
}

/// The last frame of a camera.
async fn last(app: &AppState, robot: String, camera: String) -> Result<LiveFrame, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let robot = name("robot", robot)?;
    // What is no name is no camera.
    let frame = Name::new(camera.as_str()).ok().and_then(|camera| app.live.frame(&robot, &camera));
    Ok(frame.ok_or_else(|| StoreError::NotFound { what: Kind::Camera, name: camera })?)
}

/// The last answered frame of a camera, as a picture.
#[utoipa::path(get, path = "/robots/{robot}/cameras/{camera}/frame", operation_id = "getCameraFrame", tag = "robots",
    params(("robot" = String, Path), ("camera" = String, Path)),
    responses((status = 200, content_type = "image/jpeg"), (status = 404, body = Problem)))]
async fn frame(
    State(app): State<AppState>,
    PathParams((robot, camera)): PathParams<(String, String)>,
) -> Result<Response, ApiError> {
    let frame = last(&app, robot, camera).await?;
    let seq = frame.answer.seq;
    let (kind, bytes) = frame.for_browsers().map_err(|e| ApiError::internal(&e))?;
    let headers = [(header::CONTENT_TYPE, kind.to_owned()), (header::CACHE_CONTROL, "no-store".to_owned())];
    Ok((headers, [("x-frame-seq", seq.to_string())], bytes).into_response())
}

/// The answer to that frame.
#[utoipa::path(get, path = "/robots/{robot}/cameras/{camera}/answer", operation_id = "getCameraAnswer",
    tag = "robots",
    params(("robot" = String, Path), ("camera" = String, Path)),
    responses((status = 200, body = protos::v1::Answer),
    (status = 404, body = Problem)))]
async fn answer(
    State(app): State<AppState>,
    PathParams((robot, camera)): PathParams<(String, String)>,
) -> Result<Json<v1::Answer>, ApiError> {
    let answer = last(&app, robot, camera).await?.answer.as_ref().clone();
    Ok(Json(v1::Answer { server: app.server.to_string(), ..answer }))
}

/// Where a robot was lately, by source: fused poses, odometry alone, and the truth where a
/// simulator tells it. Oldest first, at most 2000 of each; empty for a robot that has not moved
/// since the server started.
#[utoipa::path(get, path = "/robots/{robot}/trajectories", operation_id = "getTrajectories",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = TrajectoriesBody),
    (status = 404, body = Problem)))]
async fn trajectories(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<Json<TrajectoriesBody>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let trajectories = app.live.trajectories(&name("robot", robot)?).unwrap_or_default();
    let wire = |track: VecDeque<Pose2>| track.iter().map(pose2_wire).collect();
    Ok(Json(TrajectoriesBody {
        pose: wire(trajectories.pose),
        odometry: wire(trajectories.odometry),
        truth: wire(trajectories.truth),
    }))
}

/// Follows a map: events `answer`, `pose`, `odometry`, `truth`, `presence`, `map_changed` as they
/// happen. A `pose` has the word of its `trust`: `unspecified`, `unsupported`, `supported`, `stale`
/// or `contradicted`, as in the list of robots. In an `answer`, `sighting` of a quad says whether
/// the picture alone names its landmark (`global`) or the pose known before (`guided`). A reader
/// that is too slow misses events and gets `missed` with their number.
#[utoipa::path(get, path = "/maps/{map}/live", operation_id = "followMap",
    tag = "maps", params(("map" = String, Path)),
    responses((status = 200, content_type = "text/event-stream", body = LiveEventData), (status = 404, body = Problem),
    (status = 503, body = Problem, description = "too_many_streams")))]
async fn events(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Extension(asker): Extension<Caller>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, ApiError> {
    let place = app.stream_place()?;
    let events = BroadcastStream::new(app.live.events());
    maps::get(app.store.reads(), &map).await?;
    let events = events.filter_map(move |event| {
        let _held = &place;
        let shown = match event {
            Ok(event) if event.map() == map => shown(&event),
            Ok(_) => None,
            Err(missed) => Some(Event::default().event("missed").data(missed.to_string())),
        };
        std::future::ready(shown.map(Ok))
    });
    Ok(Sse::new(events.take_until(app.ended_for(asker))).keep_alive(KeepAlive::default()))
}

fn shown(event: &LiveEvent) -> Option<Event> {
    Event::default().event(event.kind()).json_data(event).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use protos::{
        Name,
        api::{LiveEventBody, PoseTrust},
    };
    use std::sync::Arc;

    #[test]
    fn every_event_is_what_readers_are_told_to_expect() {
        let name = |text: &str| Name::new(text).unwrap();
        let (robot, camera, map) = (name("r1"), name("front"), "hall".to_owned());
        let pose = v1::Pose2 { x_m: 1.0, y_m: 2.0, theta_rad: 0.5 };
        let answer = Arc::new(v1::Answer { seq: 7, map: map.clone(), ..v1::Answer::default() });
        let events = [
            LiveEvent::Answer { robot: robot.clone(), camera, answer },
            LiveEvent::Pose {
                robot: robot.clone(),
                map: map.clone(),
                pose,
                covariance: vec![0.0; 9],
                corrections: 3,
                age_ms: 12.5,
                trust: v1::PoseTrust::Stale,
            },
            LiveEvent::Odometry { robot: robot.clone(), map: map.clone(), pose },
            LiveEvent::Truth { robot: robot.clone(), map: map.clone(), pose },
            LiveEvent::Presence { robot, map: map.clone(), alive: true },
            LiveEvent::MapChanged { map, version: Some(4) },
        ];
        for event in events {
            let data = serde_json::to_string(&event).unwrap();
            match (event.kind(), LiveEventBody::read(event.kind(), &data).unwrap().unwrap()) {
                ("answer", LiveEventBody::Answer(told)) => {
                    assert_eq!(
                        (told.robot.as_str(), told.camera.as_str(), told.answer.seq),
                        ("r1", "front", 7)
                    );
                }
                ("pose", LiveEventBody::Pose(told)) => {
                    assert_eq!((told.pose, told.corrections, told.trust), (pose, 3, PoseTrust::Stale));
                }
                ("odometry", LiveEventBody::Odometry(told)) | ("truth", LiveEventBody::Truth(told)) => {
                    assert_eq!((told.map.as_str(), told.pose), ("hall", pose));
                }
                ("presence", LiveEventBody::Presence(told)) => assert!(told.alive),
                ("map_changed", LiveEventBody::MapChanged(told)) => assert_eq!(told.version, Some(4)),
                (kind, other) => panic!("{kind} is read as {other:?}"),
            }
        }
    }
}
