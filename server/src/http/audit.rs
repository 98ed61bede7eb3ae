//! `/audit`: who changed what, and whether that is unchanged.

use super::{
    AppState,
    answers::page,
    error::ApiError,
    extract::{QueryParams, number_cursor, page_limit},
};
use crate::store::audit::{self, AuditFilter, ChainLink};
use axum::{Json, extract::State};
use protos::api::{AuditCheck, AuditEntry, AuditHead, AuditHeadQuery, AuditQuery, Page, Problem};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(check))
}

/// Lists changes, newest first: who, when, what. An entry is written in the transaction of its
/// change.
#[utoipa::path(get, path = "/audit", operation_id = "listAuditEntries", tag = "audit", params(AuditQuery),
    responses((status = 200, body = Page<AuditEntry>),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn list(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<AuditQuery>,
) -> Result<Json<Page<AuditEntry>>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    let before = number_cursor(query.cursor.as_deref())?.unwrap_or(i64::MAX);
    let AuditQuery { actor, target, since_ms, before_ms, .. } = query;
    let filter = AuditFilter { actor, target, since_ms, before_ms };
    let rows = audit::page(app.store.reads(), &filter, before, limit + 1).await?;
    let total = audit::count(app.store.reads(), &filter).await?;
    Ok(Json(page(rows, limit, total, |row| row.seq.to_string(), AuditEntry::from)))
}

/// Computes the digest of every entry anew. `seq` and `sha256` of an earlier `head`, noted outside
/// of the server, are compared as well: whoever can write the database could write another chain,
/// but not one with that digest.
#[utoipa::path(get, path = "/audit/check", operation_id = "checkAudit", tag = "audit", params(AuditHeadQuery),
    responses((status = 200, body = AuditCheck), (status = 422, body = Problem, description = "invalid_value")))]
async fn check(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<AuditHeadQuery>,
) -> Result<Json<AuditCheck>, ApiError> {
    let noted = match (query.seq, query.sha256) {
        (None, None) => None,
        (Some(seq), Some(sha256)) => {
            let head = AuditHead { seq, sha256 };
            let fault = |_| ApiError::invalid("invalid_value", "sha256", "64 hexadecimal digits");
            Some(ChainLink::try_from(&head).map_err(fault)?)
        }
        (seq, _) => {
            let (missing, given) = if seq.is_some() { ("sha256", "seq") } else { ("seq", "sha256") };
            let detail = format!("needed with {given}");
            return Err(ApiError::invalid("invalid_value", missing, detail));
        }
    };
    let mut conn = app.store.reads().acquire().await.map_err(|e| ApiError::internal(&e))?;
    Ok(Json(audit::check(&mut conn, noted).await?))
}
