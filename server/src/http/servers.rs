//! The servers of the router that this one joins.

use super::AppState;
use crate::fleet;
use axum::{Json, extract::State};
use protos::api::Servers;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(servers))
}

/// This server and those that share its router, with their maps, and what more than one of them
/// has. A server that is its own router is alone.
#[utoipa::path(get, path = "/servers", operation_id = "listServers",
    tag = "health", responses((status = 200, body = Servers)))]
async fn servers(State(app): State<AppState>) -> Json<Servers> {
    let alone = || fleet::alone(&app.server, app.store.snapshots());
    Json(app.fleet.as_ref().map_or_else(alone, |fleet| fleet.overview()))
}
