//! Errors as `application/problem+json` (RFC 9457): a stable `code`, the `field` at fault, a
//! sentence. What a 5xx was caused by is logged, never sent.

use crate::store::{StoreError, kind::Kind};
use axum::{
    http::{HeaderValue, StatusCode, header},
    response::{IntoResponse, Response},
};
use map::{check::OutOfRange, map_links::MapLinkError};
use protos::api::Problem;
use serde_json::{Value, json};
use vision::pose::LandmarkSize;

/// The media type of errors.
pub(crate) const PROBLEM_JSON: &str = "application/problem+json";

/// What a handler returns when it cannot do as asked.
#[derive(Debug)]
pub(crate) struct ApiError {
    pub(crate) status: StatusCode,
    pub(crate) code: &'static str,
    pub(crate) field: Option<String>,
    detail: String,
    more: serde_json::Map<String, Value>,
    /// The present revision, where another one was meant.
    revision: Option<Box<str>>,
}

impl ApiError {
    pub(crate) fn new(status: StatusCode, code: &'static str, detail: impl Into<String>) -> Self {
        Self {
            status,
            code,
            field: None,
            detail: detail.into(),
            more: serde_json::Map::new(),
            revision: None,
        }
    }

    /// 422: understood, but a value cannot be.
    pub(crate) fn invalid(code: &'static str, field: impl Into<String>, detail: impl Into<String>) -> Self {
        Self::new(StatusCode::UNPROCESSABLE_ENTITY, code, detail).field(field)
    }

    /// Names the input at fault.
    pub(crate) fn field(mut self, field: impl Into<String>) -> Self {
        self.field = Some(field.into());
        self
    }

    /// What is wrong, in words.
    pub(crate) fn told(&self) -> &str {
        &self.detail
    }

    /// Says it in other words.
    pub(crate) fn detail(mut self, detail: impl Into<String>) -> Self {
        self.detail = detail.into();
        self
    }

    /// Adds a member to the body.
    pub(crate) fn with(mut self, name: &str, value: Value) -> Self {
        self.more.insert(name.to_owned(), value);
        self
    }

    /// 500, logged here with its cause.
    pub(crate) fn internal(cause: &(dyn std::error::Error + 'static)) -> Self {
        tracing::error!(error = cause, "request failed");
        Self::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            "internal",
            "the server failed on this request; see its log",
        )
    }

    fn problem(self) -> Problem {
        Problem {
            kind: format!("/problems/{}", self.code),
            title: self.status.canonical_reason().unwrap_or("Error").to_owned(),
            status: self.status.as_u16(),
            code: self.code.to_owned(),
            field: self.field,
            detail: self.detail,
            more: self.more,
        }
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let (status, revision) = (self.status, self.revision.clone());
        let body = serde_json::to_vec(&self.problem()).unwrap_or_default();
        let mut response = (status, [(header::CONTENT_TYPE, PROBLEM_JSON)], body).into_response();
        let retry_after_s = match status {
            StatusCode::SERVICE_UNAVAILABLE => Some("2"),
            // Of a rate of at least 1 request a second.
            StatusCode::TOO_MANY_REQUESTS => Some("1"),
            _ => None,
        };
        if let Some(seconds) = retry_after_s {
            response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from_static(seconds));
        }
        response.headers_mut().extend(revision.and_then(|is| etag(&is)).map(|tag| (header::ETAG, tag)));
        response
    }
}

/// Code and field of a refusal because there is none of that kind.
fn unknown(what: Kind) -> (&'static str, &'static str) {
    match what {
        Kind::Map => ("unknown_map", "map"),
        Kind::Landmark => ("unknown_landmark", "landmark"),
        Kind::View => ("unknown_view", "view"),
        Kind::Robot => ("unknown_robot", "robot"),
        Kind::Camera => ("unknown_camera", "camera"),
        Kind::Job => ("unknown_job", "job"),
        Kind::Gathering => ("unknown_gathering", "gathering"),
        Kind::Track => ("unknown_track", "track"),
        Kind::ReferenceRun => ("unknown_reference_run", "run"),
        Kind::Underlay => ("unknown_underlay", "underlay"),
        Kind::Token => ("unknown_token", "token"),
        Kind::Certificate => ("unknown_certificate", "serial"),
        Kind::Backup => ("unknown_backup", "backup"),
        Kind::Draft => ("unknown_draft", "draft"),
        Kind::Commit => ("unknown_commit", "commit"),
        Kind::Answer => ("unknown_answer", "answer"),
        Kind::Model | Kind::Picture => ("not_found", "path"),
    }
}

fn link_code(error: &MapLinkError) -> &'static str {
    match error {
        MapLinkError::Cycle => "cycle",
        MapLinkError::TooDeep => "too_deep",
        MapLinkError::NotRelated => "not_related",
    }
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        let detail = error.to_string();
        match error {
            StoreError::NotFound { what, .. } => {
                let (code, field) = unknown(what);
                Self::new(StatusCode::NOT_FOUND, code, detail).field(field)
            }
            StoreError::Exists { .. } => Self::new(StatusCode::CONFLICT, "exists", detail).field("name"),
            StoreError::Limit { .. } => Self::new(StatusCode::CONFLICT, "too_many", detail),
            StoreError::SizeDiffers { stored, given, .. } => {
                let size = |s: LandmarkSize| json!({ "width_m": s.width_m, "height_m": s.height_m });
                Self::new(StatusCode::CONFLICT, "size_differs", detail)
                    .field("width_m")
                    .with("stored", size(stored))
                    .with("given", size(given))
            }
            StoreError::InUse(_) => Self::new(StatusCode::CONFLICT, "in_use", detail),
            StoreError::ChangedSince { by, .. } => {
                Self::new(StatusCode::CONFLICT, "changed_since", detail).field("commit").with("by", json!(by))
            }
            StoreError::Conflicts { with, .. } => Self::new(StatusCode::CONFLICT, "conflict", detail)
                .field("draft")
                .with("conflicts", json!(with)),
            StoreError::Frames(error) => {
                Self::new(StatusCode::CONFLICT, link_code(&error), detail).field("parent.map")
            }
            StoreError::Full => Self::new(StatusCode::INSUFFICIENT_STORAGE, "storage_full", detail),
            StoreError::ReadOnly => Self::new(StatusCode::INSUFFICIENT_STORAGE, "storage_read_only", detail),
            StoreError::NearlyFull(space) => {
                Self::new(StatusCode::INSUFFICIENT_STORAGE, "storage_nearly_full", detail)
                    .with("used_percent", json!(space.used_percent()))
                    .with("limit_percent", json!(space.limit_percent))
                    .with("free_bytes", json!(space.free_bytes))
            }
            StoreError::Away => Self::new(StatusCode::SERVICE_UNAVAILABLE, "store_away", detail),
            StoreError::Closed => Self::new(StatusCode::SERVICE_UNAVAILABLE, "storage_failed", detail),
            StoreError::NotPublished { .. } => {
                Self::new(StatusCode::INTERNAL_SERVER_ERROR, "not_published", detail)
                    .with("may_be_done", Value::Bool(true))
            }
            StoreError::At { index, source } => {
                let error = Self::from(*source);
                let field = error.field.as_deref().unwrap_or("name").to_owned();
                let field = if field == "landmark" { "name".to_owned() } else { field };
                error.field(format!("landmarks[{index}].{field}"))
            }
            StoreError::ChangedMeanwhile { present } => {
                let status = StatusCode::PRECONDITION_FAILED;
                let error = Self::new(status, "changed_meanwhile", detail).field("if-match");
                Self { revision: Some(present.into()), ..error }
            }
            StoreError::KeyAtWork => {
                Self::new(StatusCode::CONFLICT, "in_progress", detail).field("idempotency-key")
            }
            StoreError::KeyReused => Self::invalid("idempotency_key_reused", "idempotency-key", detail),
            StoreError::Changed | StoreError::Busy => {
                Self::new(StatusCode::SERVICE_UNAVAILABLE, "busy", StoreError::Busy.to_string())
            }
            StoreError::PictureDamaged { .. } => {
                tracing::error!(%detail, "picture_not_answered");
                Self::new(StatusCode::INTERNAL_SERVER_ERROR, "picture_damaged", detail)
            }
            StoreError::Damaged { .. } | StoreError::Database { .. } | StoreError::Panicked => {
                Self::internal(&error)
            }
        }
    }
}

impl From<protos::Rejection> for ApiError {
    fn from(rejection: protos::Rejection) -> Self {
        Self::invalid(rejection.code.as_str(), rejection.field, rejection.detail)
    }
}

/// 404 for a path without a route.
pub(super) fn not_found() -> ApiError {
    ApiError::new(StatusCode::NOT_FOUND, "not_found", "there is nothing at this path").field("path")
}

/// 405.
pub(super) fn method_not_allowed() -> ApiError {
    let detail = "this path does not take this method";
    ApiError::new(StatusCode::METHOD_NOT_ALLOWED, "method_not_allowed", detail).field("method")
}

/// A strong entity tag.
pub(super) fn etag(revision: &str) -> Option<HeaderValue> {
    HeaderValue::from_str(&format!("\"{revision}\"")).ok()
}

/// 422 for a number outside its range, in this part of the input.
pub(super) fn out_of_range(error: &OutOfRange, outer: &str) -> ApiError {
    let code = if error.value.is_finite() { "out_of_range" } else { "not_finite" };
    ApiError::invalid(code, format!("{outer}.{}", error.field), error.to_string())
}
