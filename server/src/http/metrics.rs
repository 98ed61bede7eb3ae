//! `GET /metrics`: for Prometheus, in its text format. Also below `/api/v1`, and on a listener of
//! its own if the settings name one.

use super::{App, AppState, error::ApiError, guard};
use crate::metrics;
use axum::{
    Router,
    extract::{Request, State},
    http::header,
    middleware::{Next, from_fn_with_state},
    response::IntoResponse,
    routing::get,
};
use std::sync::Arc;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(metrics))
}

/// The same where Prometheus looks for it.
pub(super) fn at_root() -> Router<AppState> {
    Router::new().route("/metrics", get(metrics))
}

/// A service of metrics alone, for a listener that only trusted programs reach: it asks for no
/// token.
pub(crate) fn alone(app: &Arc<App>) -> Router {
    let guarded = |State(app): State<AppState>, request: Request, next: Next| async move {
        guard::guard(&app, request, |request| next.run(request)).await
    };
    at_root().layer(from_fn_with_state(app.clone(), guarded)).with_state(app.clone())
}

/// Metrics in the text format of Prometheus 0.0.4. Also at `/metrics`.
#[utoipa::path(get, path = "/metrics", operation_id = "getMetrics", tag = "health",
    responses((status = 200, body = String, content_type = "text/plain")))]
async fn metrics(State(app): State<AppState>) -> Result<impl IntoResponse, ApiError> {
    Ok(([(header::CONTENT_TYPE, metrics::CONTENT_TYPE)], metrics::text(&app).await?))
}
