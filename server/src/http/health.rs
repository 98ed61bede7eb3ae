//! `/healthz` (the process lives), `/readyz` (it can do its work), `/version`.

use super::{
    Shared,
    error::{ApiError, Problem},
};
use crate::store::WRITER;
use axum::{Json, extract::State, http::StatusCode};
use engine::{panics::Edge, vitals::Failure};
use serde::Serialize;
use serde_json::json;
use std::collections::BTreeMap;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(healthz)).routes(routes!(readyz)).routes(routes!(version))
}

/// A word.
#[derive(Debug, Serialize, ToSchema)]
struct Health {
    /// `ok`.
    status: &'static str,
}

/// How far the server can do its work.
#[derive(Debug, Serialize, ToSchema)]
struct Ready {
    /// `ready`, or `degraded`: everything runs, but maps are named in `maps_not_in_use`.
    status: &'static str,
    /// Maps whose stored version cannot be made ready, with the reason: an earlier version is used, or none since the
    /// server started. A later change of the map tries again.
    maps_not_in_use: BTreeMap<String, String>,
    /// Panics caught since the start, by where: what they met was refused or dropped, everything else went on. Each is in
    /// the log. Anything but 0 is a fault of the program.
    panics: BTreeMap<&'static str, u64>,
}

/// What runs here.
#[derive(Debug, Serialize, ToSchema)]
#[expect(clippy::struct_field_names, reason = "they are the names in the JSON")]
struct Version {
    /// `waymark`.
    name: &'static str,
    /// Of the program.
    version: &'static str,
    /// Of the HTTP interface.
    api: &'static str,
    /// Of the protocol over zenoh.
    protocol: &'static str,
}

/// The process lives.
#[utoipa::path(get, path = "/healthz", tag = "health", responses((status = 200, body = Health)))]
async fn healthz() -> Json<Health> {
    Json(Health { status: "ok" })
}

/// Every part of the server runs and the database answers. 503 with the `part` that has ended: the process is about to end
/// with an error, too.
#[utoipa::path(get, path = "/readyz", tag = "health", responses((status = 200, body = Ready),
    (status = 503, body = Problem, description = "storage_failed, part_ended")))]
async fn readyz(State(app): State<Shared>) -> Result<Json<Ready>, ApiError> {
    let vitals = app.store.vitals();
    if let Some(failure) = vitals.failure() {
        return Err(not_ready(&failure));
    }
    crate::store::maps::page(app.store.reads(), "", 1).await?;
    let maps_not_in_use = vitals.all_unpublished();
    let status = if maps_not_in_use.is_empty() { "ready" } else { "degraded" };
    let panics = Edge::ALL.into_iter().map(|edge| (edge.name(), vitals.panics().at(edge))).collect();
    Ok(Json(Ready { status, maps_not_in_use, panics }))
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
        name: "waymark",
        version: env!("CARGO_PKG_VERSION"),
        api: "v1",
        protocol: protos::keys::PROTOCOL,
    })
}
