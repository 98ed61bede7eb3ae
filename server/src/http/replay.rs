//! `/maps/{map}/drafts/{draft}/replay`: a draft tried with the last frames of its map's robots.

use super::{
    AppState,
    error::ApiError,
    extract::{PathParams, QueryParams},
};
use crate::store::{StoreError, drafts, kind::Kind, maps};
use axum::{Json, extract::State};
use engine::{
    decode::ImageLimits,
    kept_frames::KeptFrame,
    replay::{AnswerChange, PoseChange, replay},
};
use protos::api::{Problem, Replay, ReplayChange, ReplayQuery, ReplayedPose, RobotReplay};
use std::{collections::BTreeMap, sync::Arc};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Frames where nobody says how many.
const USUAL_FRAMES: usize = 40;
/// Most frames of a request: all are answered twice, one after the other, before it is.
const MAX_FRAMES: usize = 100;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(tried))
}

/// Answers the last frames of the map's robots by the map and by the draft, and reports what
/// differs. Nothing is changed, and no robot is told. Each frame is taken as that of a robot
/// without an earlier pose. The server keeps the frames of stored answers in memory
/// (`limits.replay_bytes`); after a start there are none.
#[utoipa::path(post, path = "/maps/{map}/drafts/{draft}/replay", operation_id = "replayDraft", tag = "history",
    params(("map" = String, Path), ("draft" = String, Path), ReplayQuery), responses((status = 200, body = Replay),
    (status = 404, body = Problem, description = "unknown_draft"), (status = 422, body = Problem, description = "out_of_range")))]
async fn tried(
    State(app): State<AppState>,
    PathParams((map, draft)): PathParams<(String, String)>,
    QueryParams(query): QueryParams<ReplayQuery>,
) -> Result<Json<Replay>, ApiError> {
    let most = query.frames.unwrap_or(USUAL_FRAMES);
    if !(1..=MAX_FRAMES).contains(&most) {
        return Err(ApiError::invalid("out_of_range", "frames", format!("1 to {MAX_FRAMES}")));
    }
    let id = maps::get(app.store.reads(), &map).await?.id;
    drafts::get(app.store.reads(), id, &draft).await?;
    let of = |name: &String| {
        let unknown = || StoreError::NotFound { what: Kind::Map, name: name.clone() };
        app.store.snapshots().get(name).ok_or_else(unknown)
    };
    let versions = [of(&map)?, of(&draft)?];
    let limits = ImageLimits { bytes: app.config.limits.frame_bytes, pixels: app.config.limits.frame_pixels };
    let frames = app.kept_frames.newest(&map, most);
    // A place for each frame: what robots and people ask meanwhile comes between two of them.
    let mut answered = Vec::with_capacity(frames.len());
    for kept in frames {
        let (frame, versions) = (kept.clone(), versions.clone());
        let work = move |_: &_| replay(&frame, [&versions[0], &versions[1]], limits);
        // It was decoded once: it is again.
        answered.push((kept, app.clone().on_vision_thread(work).await??));
    }
    Ok(Json(report(&answered)))
}

fn report(answered: &[(Arc<KeptFrame>, AnswerChange)]) -> Replay {
    let mut robots = BTreeMap::<&str, RobotReplay>::new();
    for (kept, change) in answered {
        let name = kept.key.robot.as_str();
        let of = robots
            .entry(name)
            .or_insert_with(|| RobotReplay { robot: name.to_owned(), ..RobotReplay::default() });
        of.frames += 1;
        of.unchanged += u64::from(change.is_none());
        of.lost += u64::from(!change.lost.is_empty());
        of.gained += u64::from(!change.gained.is_empty());
        match change.pose {
            PoseChange::Same => {}
            PoseChange::Gained => of.pose_gained += 1,
            PoseChange::Lost => of.pose_lost += 1,
            PoseChange::Moved { distance_m, .. } => {
                of.pose_moved += 1;
                of.longest_move_m = of.longest_move_m.max(distance_m);
            }
        }
    }
    let changed = answered.iter().filter(|(_, change)| !change.is_none());
    let changes: Vec<ReplayChange> = changed.map(|(kept, change)| shown(kept, change)).collect();
    let frames = answered.len() as u64;
    Replay {
        frames,
        unchanged: frames - changes.len() as u64,
        robots: robots.into_values().collect(),
        changes,
    }
}

fn shown(kept: &KeptFrame, change: &AnswerChange) -> ReplayChange {
    let (pose, moved) = match change.pose {
        PoseChange::Same => (ReplayedPose::Same, None),
        PoseChange::Gained => (ReplayedPose::Gained, None),
        PoseChange::Lost => (ReplayedPose::Lost, None),
        PoseChange::Moved { distance_m, angle_rad } => (ReplayedPose::Moved, Some((distance_m, angle_rad))),
    };
    ReplayChange {
        robot: kept.key.robot.to_string(),
        camera: kept.key.camera.to_string(),
        captured_ms: kept.frame.captured_ns / 1_000_000,
        lost: change.lost.clone(),
        gained: change.gained.clone(),
        pose,
        distance_m: moved.map(|(distance_m, _)| distance_m),
        angle_rad: moved.map(|(_, angle_rad)| angle_rad),
    }
}
