//! `/healthz` (the process lives), `/readyz` (it can do its work), `/version`.

use super::{
    Shared,
    error::{ApiError, Problem},
};
use axum::{Json, extract::State, http::StatusCode};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(healthz)).routes(routes!(readyz)).routes(routes!(version))
}

/// A word.
#[derive(Debug, Serialize, ToSchema)]
struct Health {
    /// `ok` or `ready`.
    status: &'static str,
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

/// The database answers and takes writes.
#[utoipa::path(get, path = "/readyz", tag = "health", responses((status = 200, body = Health),
    (status = 503, body = Problem)))]
async fn readyz(State(app): State<Shared>) -> Result<Json<Health>, ApiError> {
    if *app.store.failed().borrow() {
        return Err(ApiError::new(
            StatusCode::SERVICE_UNAVAILABLE,
            "storage_failed",
            "the store does not take writes",
        ));
    }
    crate::store::maps::page(app.store.reads(), "", 1).await?;
    Ok(Json(Health { status: "ready" }))
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
