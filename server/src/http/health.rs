//! `/healthz` (the process lives), `/readyz` (it can do its work), `/version`.

use super::{AppState, error::ApiError};
use crate::store::{WRITER, disk_guard::DiskSpace};
use axum::{Json, extract::State, http::StatusCode};
use engine::{panics::Edge, vitals::Failure};
use protos::api::{Health, Problem, Readiness, StorageHealth, Version};
use serde_json::json;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(healthz)).routes(routes!(readyz)).routes(routes!(version))
}

/// Liveness check.
#[utoipa::path(get, path = "/healthz", tag = "health", responses((status = 200, body = Health)))]
async fn healthz() -> Json<Health> {
    Json(Health { status: "ok".to_owned() })
}

/// Every part of the server runs and the database answers. 503 with the `part` that has ended: the process is about to end
/// with an error, too.
#[utoipa::path(get, path = "/readyz", tag = "health", responses((status = 200, body = Readiness),
    (status = 503, body = Problem, description = "storage_failed, part_ended")))]
async fn readyz(State(app): State<AppState>) -> Result<Json<Readiness>, ApiError> {
    let vitals = app.store.vitals();
    if let Some(failure) = vitals.failure() {
        return Err(not_ready(&failure));
    }
    crate::store::maps::page(app.store.reads(), "", 1).await?;
    let maps_not_in_use = vitals.all_unpublished();
    let damaged_pictures = crate::store::pictures::damaged(app.store.reads()).await?;
    let backup = app.backups.health();
    let scheduled_failed = backup.every_hours > 0 && backup.failed.is_some();
    let storage = storage(app.store.disk().space());
    let is_degraded = !maps_not_in_use.is_empty()
        || !damaged_pictures.is_empty()
        || scheduled_failed
        || storage.refused.is_some();
    let status = if is_degraded { "degraded" } else { "ready" };
    let panics =
        Edge::ALL.into_iter().map(|edge| (edge.name().to_owned(), vitals.panics().at(edge))).collect();
    Ok(Json(Readiness {
        status: status.to_owned(),
        maps_not_in_use,
        damaged_pictures,
        backup,
        storage: Some(storage),
        panics,
    }))
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

fn not_ready(failure: &Failure) -> ApiError {
    let code = if failure.part == WRITER { "storage_failed" } else { "part_ended" };
    let detail = format!("{failure}; the server must be started again");
    ApiError::new(StatusCode::SERVICE_UNAVAILABLE, code, detail).with("part", json!(failure.part))
}

/// What runs here.
#[utoipa::path(get, path = "/version", tag = "health", responses((status = 200, body = Version)))]
async fn version() -> Json<Version> {
    Json(Version {
        name: "waymark".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        api: "v1".to_owned(),
        protocol: protos::keys::PROTOCOL.to_owned(),
    })
}
