//! `/healthz` (the process lives), `/readyz` (it can do its work), `/version`.

use super::{AppState, authorise, error::ApiError};
use crate::{
    identity::Principal,
    store::{WRITER, disk_guard::DiskSpace, pictures},
};
use axum::{
    Json,
    extract::State,
    http::{StatusCode, request::Parts},
};
use engine::{heartbeats::Heartbeat, panics::Edge, vitals::Failure};
use protos::api::{
    BackupHealth, DatabaseCheckBody, DatabaseCheckState, Health, Problem, Readiness, ReadinessCounts,
    StorageHealth, Version,
};
use serde_json::json;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(healthz)).routes(routes!(readyz)).routes(routes!(version))
}

/// Liveness check.
#[utoipa::path(get, path = "/healthz", operation_id = "getHealth",
    tag = "health", responses((status = 200, body = Health)))]
async fn healthz() -> Json<Health> {
    Json(Health { status: "ok".to_owned() })
}

/// Every part of the server runs and goes on, and the database answers. 503: a part has ended or
/// stands still, and the process is about to end with an error, too, unless the part goes on again.
///
/// Open to everybody, so that monitors need no token: without a valid one the answer has status and
/// counts. A token or a session adds the names of what its maps contain; one for all maps the
/// parts, the reason of a failed backup and the name of the newest.
#[utoipa::path(get, path = "/readyz", operation_id = "getReadiness",
    tag = "health", responses((status = 200, body = Readiness),
    (status = 503, body = Problem, description = "storage_failed, part_ended, part_stalled")))]
async fn readyz(State(app): State<AppState>, parts: Parts) -> Result<Json<Readiness>, ApiError> {
    let asker = authorise::asker(&app, &parts);
    let sees_all = asker.as_ref().is_some_and(|asker| asker.maps.is_none());
    let vitals = app.store.vitals();
    if let Some(failure) = vitals.failure() {
        return Err(not_ready(&failure, sees_all));
    }
    if let Some(heart) = vitals.stalled() {
        return Err(stalled(&heart, app.config.limits.stalled_s, sees_all));
    }
    crate::store::maps::page(app.store.reads(), "", 1).await?;
    let mut maps_not_in_use = vitals.all_unpublished();
    // Nobody's maps are none, not all.
    let visible = asker.as_ref().map_or_else(|| Some(Vec::new()), |asker| asker.visible_maps(None));
    let (damaged, damaged_pictures) = pictures::damaged(app.store.reads(), visible.as_deref()).await?;
    let counts = ReadinessCounts { maps_not_in_use: maps_not_in_use.len() as u64, damaged_pictures: damaged };
    maps_not_in_use.retain(|map, _| asker.as_ref().is_some_and(|asker: &Principal| asker.may_see(map)));
    let mut backup = app.backups.health();
    let scheduled_failed = backup.every_hours > 0 && backup.failed.is_some();
    if !sees_all {
        backup = BackupHealth { newest: None, failed: None, ..backup };
    }
    let (router, mut maps_not_served) = app.fleet.as_ref().map(|fleet| fleet.faults()).unwrap_or_default();
    let is_alone = router.is_some() || !maps_not_served.is_empty();
    maps_not_served.retain(|map, _| asker.as_ref().is_some_and(|asker: &Principal| asker.may_see(map)));
    let storage = storage(app.store.disk().space());
    let has_no_room = storage.refused.is_some();
    let database_check = database_check(&app, sees_all, backup.newest.as_deref());
    let is_damaged = database_check.state == DatabaseCheckState::Failed;
    let has_faults = is_damaged || counts != ReadinessCounts::default() || scheduled_failed;
    let status = if has_faults || has_no_room || is_alone { "degraded" } else { "ready" }.to_owned();
    let panics =
        Edge::ALL.into_iter().map(|edge| (edge.name().to_owned(), vitals.panics().at(edge))).collect();
    let hearts = vitals.hearts().all();
    let seen = hearts.iter().filter(|_| sees_all);
    let parts_still_s = seen.map(|heart| (heart.part().to_owned(), heart.still().as_secs())).collect();
    let (storage, router) = (sees_all.then_some(storage), router.filter(|_| sees_all));
    Ok(Json(Readiness {
        status,
        counts,
        maps_not_in_use,
        damaged_pictures,
        router,
        maps_not_served,
        database_check: app.store.database().is_none().then_some(database_check),
        backup,
        parts_still_s,
        storage,
        panics,
    }))
}

/// What the check of the database has found. Names of rows, paths and backups are for who sees all
/// maps.
fn database_check(app: &AppState, sees_all: bool, newest: Option<&str>) -> DatabaseCheckBody {
    let check = app.store.last_check().get();
    let state = check.state();
    let advice = (state == DatabaseCheckState::Failed).then(|| {
        let data = sees_all.then(|| app.config.data.display().to_string());
        let file = newest.and_then(|name| app.backups.file(name).ok()).filter(|_| sees_all);
        let file = file.map_or_else(|| "FILE".to_owned(), |file| file.display().to_string());
        format!(
            "stop the server, and restore a backup in the place of the damaged database: \
             waymark restore {file} --data {}",
            data.as_deref().unwrap_or("DIR")
        )
    });
    let faults = if sees_all { check.faults().to_vec() } else { Vec::new() };
    DatabaseCheckBody { state, ended_ms: check.ended_ms(), faults, advice }
}

fn storage(space: DiskSpace) -> StorageHealth {
    StorageHealth {
        total_bytes: space.total_bytes,
        free_bytes: space.free_bytes,
        reusable_bytes: space.reusable_bytes,
        used_percent: space.used_percent(),
        limit_percent: space.limit_percent,
        refused: space.refusal(),
    }
}

fn stalled(heart: &Heartbeat, limit_s: u64, sees_all: bool) -> ApiError {
    let new = |detail| ApiError::new(StatusCode::SERVICE_UNAVAILABLE, "part_stalled", detail);
    let follows = format!("after {limit_s} s the server ends with an error");
    if !sees_all {
        return new(format!("a part of the server stands still; {follows}"));
    }
    let (part, still_s) = (heart.part(), heart.still().as_secs());
    new(format!("{part} has not gone on for {still_s} s; {follows}")).with("part", json!(part))
}

/// Names of parts may hold those of robots, reasons anything: only who may see all is told.
fn not_ready(failure: &Failure, sees_all: bool) -> ApiError {
    let code = if failure.part == WRITER { "storage_failed" } else { "part_ended" };
    let new = |detail| ApiError::new(StatusCode::SERVICE_UNAVAILABLE, code, detail);
    if !sees_all {
        return new("a part of the server has ended; the server must be started again".to_owned());
    }
    new(format!("{failure}; the server must be started again")).with("part", json!(failure.part))
}

/// What runs here.
#[utoipa::path(get, path = "/version", operation_id = "getVersion",
    tag = "health", responses((status = 200, body = Version)))]
async fn version(State(app): State<AppState>) -> Json<Version> {
    Json(Version {
        name: "waymark".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        api: "v1".to_owned(),
        protocol: protos::keys::PROTOCOL.to_owned(),
        server: app.server.to_string(),
    })
}
