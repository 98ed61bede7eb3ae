//! `/robots`: which robots there are and on which map each stands.

use super::{
    AppState,
    answers::{row_major, selected},
    authorise::check_map,
    error::ApiError,
    extract::{Body, PathParams, QueryParams, name},
    robot_activity::activity_shown,
    robot_certificates::access_control,
};
use crate::{
    identity::Principal,
    store::{
        robot_certificates,
        robots::{self, RobotRow},
    },
};
use axum::{Extension, Json, extract::State, http::StatusCode};
use engine::{
    epochs::Conflict,
    live::LiveHub,
    motion::{Correction, Corrections, KnownPose, MotionTracker},
};
use map::pose2::Pose2;
use protos::{
    Name,
    api::{
        CorrectionBody, CorrectionsBody, EpochConflictBody, ListQuery, Page, PoseTrust, Problem, Robot,
        RobotAssignment, RobotPose,
    },
};
use std::{collections::BTreeMap, time::Instant};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(put, get, delete)).routes(routes!(corrections))
}

/// A registered robot with what is known of it now.
fn robot_shown(row: RobotRow, motion: &MotionTracker, live: &LiveHub) -> Robot {
    let now = Instant::now();
    let robot = Name::new(row.name.as_str()).ok();
    let status = robot.as_ref().map(|robot| motion.epochs().status(robot, now)).unwrap_or_default();
    let known = robot.as_ref().and_then(|robot| motion.known_pose(robot, now));
    let pose = known.filter(|known| known.map == row.map).map(|known| {
        let trust = robot.as_ref().and_then(|robot| live.trust(robot, &row.map)).unwrap_or_default().into();
        pose_shown(&known, trust)
    });
    let conflict = status.conflict.map(|Conflict { epoch, refused, last_ms }| EpochConflictBody {
        epoch,
        refused,
        last_ms,
    });
    let activity = robot.and_then(|robot| activity_shown(live, &robot, now));
    Robot { name: row.name, map: row.map, alive: status.alive, epoch: status.epoch, conflict, pose, activity }
}

pub(super) fn pose_shown(KnownPose { fused, age, .. }: &KnownPose, trust: PoseTrust) -> RobotPose {
    let Pose2 { x_m, y_m, theta_rad } = fused.pose.pose;
    let covariance = row_major(&fused.pose.covariance);
    RobotPose { x_m, y_m, theta_rad, covariance, age_ms: age.as_secs_f64() * 1e3, trust }
}

fn correction_shown(correction: Correction) -> CorrectionBody {
    CorrectionBody {
        epoch: correction.epoch,
        captured_ns: correction.captured_ns,
        map: correction.map,
        modality: correction.modality.to_owned(),
        landmarks: correction.landmarks,
        outcome: correction.outcome.to_owned(),
        chi2: correction.chi2,
        along_m: correction.along_m,
        across_m: correction.across_m,
        turn_rad: correction.turn_rad,
    }
}

fn corrections_shown(found: Corrections) -> CorrectionsBody {
    let counts =
        |counts: BTreeMap<&str, u64>| counts.into_iter().map(|(end, n)| (end.to_owned(), n)).collect();
    CorrectionsBody {
        modalities: found.modalities,
        totals: found.totals.into_iter().map(|(of, ends)| (of.to_owned(), counts(ends))).collect(),
        corrections: found.corrections.into_iter().map(correction_shown).collect(),
    }
}

/// Registers a robot, or moves it to another map.
#[utoipa::path(put, path = "/robots/{robot}", operation_id = "setRobot",
    tag = "robots", params(("robot" = String, Path)),
    request_body = RobotAssignment, responses((status = 200, body = Robot),
    (status = 404, body = Problem, description = "unknown_map"), (status = 409, body = Problem),
    (status = 422, body = Problem, description = "bad_name")))]
async fn put(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
    Extension(principal): Extension<Principal>,
    Body(to): Body<RobotAssignment>,
) -> Result<Json<Robot>, ApiError> {
    check_map(&principal, &to.map)?;
    let (robot, max) = (name("robot", robot)?, app.config.limits.robots);
    let write = app
        .store
        .write(move |tx| Box::pin(async move { robots::put(tx, robot.as_str(), &to.map, max).await }));
    let row = write.await?;
    access_control(&app).await;
    Ok(Json(robot_shown(row, &app.motion, &app.live)))
}

/// Lists robots by name, with what is known of each: whether its software is connected, whether a
/// second program uses its name, its pose, how old that is and how far it is trusted.
#[utoipa::path(get, path = "/robots", operation_id = "listRobots", tag = "robots", params(ListQuery),
    responses((status = 200, body = Page<Robot>),
    (status = 422, body = Problem, description = "out_of_range, invalid_value: it is sorted by name only")))]
async fn list(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<ListQuery>,
    Extension(principal): Extension<Principal>,
) -> Result<Json<Page<Robot>>, ApiError> {
    let limits = &app.config.limits;
    let rows = robots::page(app.store.reads(), "", limits.robots).await?;
    let visible = rows.into_iter().filter(|row| principal.may_see(&row.map));
    let rows = visible.map(|row| (row.name.clone(), row)).collect();
    let Page { items, next, total } = selected(rows, &query, limits.page)?;
    let items = items.into_iter().map(|(_, row)| robot_shown(row, &app.motion, &app.live)).collect();
    Ok(Json(Page { items, next, total }))
}

/// One robot.
#[utoipa::path(get, path = "/robots/{robot}", operation_id = "getRobot",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = Robot), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<Json<Robot>, ApiError> {
    Ok(Json(robot_shown(robots::get(app.store.reads(), &robot).await?, &app.motion, &app.live)))
}

/// Forgets a robot; its frames are rejected from now on.
#[utoipa::path(delete, path = "/robots/{robot}", operation_id = "deleteRobot",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn delete(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<StatusCode, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let (gone, motion, live) = (name("robot", robot)?, app.motion.clone(), app.live.clone());
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            robots::delete(tx, gone.as_str()).await?;
            robot_certificates::revoke_all(tx, gone.as_str()).await?;
            // A run of it that is being recorded would keep its place for ever.
            tx.after(move || {
                drop(motion.take_recording(&gone));
                live.forget_activity(&gone);
            });
            Ok(())
        })
    });
    write.await?;
    access_control(&app).await;
    Ok(StatusCode::NO_CONTENT)
}

/// What the robot's pose rests on, and what became of its fixes: by landmarks that were named
/// without the pose (`landmarks`), by landmarks that were named by the pose (`guided`), and by
/// laser scans laid on the map's walls (`laser`). A guided fix corrects a pose that the others
/// support; it never starts, supports or replaces one. Since the server started; the latest 200 of
/// each modality.
#[utoipa::path(get, path = "/robots/{robot}/corrections", operation_id = "listCorrections",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = CorrectionsBody), (status = 404, body = Problem)))]
async fn corrections(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
    Extension(principal): Extension<Principal>,
) -> Result<Json<CorrectionsBody>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let mut found = app.motion.corrections(&name("robot", robot)?);
    found.corrections.retain(|correction| principal.may_see(&correction.map));
    Ok(Json(corrections_shown(found)))
}
