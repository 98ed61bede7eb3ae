//! `/healthz` (the process lives), `/readyz` (it can do its work), `/version`.

use super::{AppState, error::ApiError};
use crate::store::WRITER;
use axum::{Json, extract::State, http::StatusCode};
use engine::{panics::Edge, vitals::Failure};
use protos::api::{Health, Problem, Readiness, Version};
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
    let (router, maps_not_served) = app.fleet.as_ref().map(|fleet| fleet.faults()).unwrap_or_default();
    let has_faults = !maps_not_in_use.is_empty() || !damaged_pictures.is_empty();
    let is_degraded = has_faults || scheduled_failed || router.is_some() || !maps_not_served.is_empty();
    let status = if is_degraded { "degraded" } else { "ready" };
    let panics =
        Edge::ALL.into_iter().map(|edge| (edge.name().to_owned(), vitals.panics().at(edge))).collect();
    let status = status.to_owned();
    Ok(Json(Readiness { status, maps_not_in_use, damaged_pictures, router, maps_not_served, backup, panics }))
}

fn not_ready(failure: &Failure) -> ApiError {
    let code = if failure.part == WRITER { "storage_failed" } else { "part_ended" };
    let detail = format!("{failure}; the server must be started again");
    ApiError::new(StatusCode::SERVICE_UNAVAILABLE, code, detail).with("part", json!(failure.part))
}

/// What runs here.
#[utoipa::path(get, path = "/version", tag = "health", responses((status = 200, body = Version)))]
async fn version(State(app): State<AppState>) -> Json<Version> {
    Json(Version {
        name: "waymark".to_owned(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        api: "v1".to_owned(),
        protocol: protos::keys::PROTOCOL.to_owned(),
        server: app.server.to_string(),
    })
}
