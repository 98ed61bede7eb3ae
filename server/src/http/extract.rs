//! From bytes to checked values: JSON bodies within their bound, names in paths, pages in queries.
//! Every failure is a problem with a code and a field.

use super::{AppState, error::ApiError, objects::Objects};
use crate::label::{LabelError, check_label};
use axum::{
    body::HttpBody,
    extract::{FromRequest, FromRequestParts, OptionalFromRequest, Path, Query, Request},
    http::{StatusCode, header, request::Parts},
};
use protos::{Name, api::PageQuery};
use serde::de::DeserializeOwned;

/// A JSON body of at most `limits.json_bytes`.
pub(super) struct Body<T>(pub(super) T);

impl<T: DeserializeOwned + Send + 'static> FromRequest<AppState> for Body<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &AppState) -> Result<Self, ApiError> {
        read(request, app.config.limits.json_bytes).await.map(Self)
    }
}

/// A JSON body of at most so many bytes, for a route that promises to take more than
/// `limits.json_bytes`.
pub(super) struct BodyUpTo<T, const BYTES: usize>(pub(super) T);

impl<T: DeserializeOwned + Send + 'static, const BYTES: usize> FromRequest<AppState> for BodyUpTo<T, BYTES> {
    type Rejection = ApiError;

    async fn from_request(request: Request, _: &AppState) -> Result<Self, ApiError> {
        read(request, BYTES).await.map(Self)
    }
}

/// Larger bodies are parsed off the runtime.
const PARSED_HERE: usize = 256 << 10;

async fn read<T: DeserializeOwned + Send + 'static>(request: Request, max: usize) -> Result<T, ApiError> {
    let kind = request.headers().get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
    if kind.split(';').next().map(str::trim) != Some("application/json") {
        let detail = "the body must be application/json";
        return Err(
            ApiError::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "not_json", detail).field("content-type")
        );
    }
    let bytes = axum::body::to_bytes(request.into_body(), max).await.map_err(|_too_long| too_large(max))?;
    if bytes.len() <= PARSED_HERE {
        return json(&bytes, "");
    }
    let parsed = tokio::task::spawn_blocking(move || json(&bytes, "")).await;
    parsed.map_err(|e| ApiError::internal(&e))?
}

/// No body at all is fine where the body is optional.
impl<T: DeserializeOwned + Send + 'static> OptionalFromRequest<AppState> for Body<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &AppState) -> Result<Option<Self>, ApiError> {
        let empty = request.body().size_hint().exact() == Some(0);
        if empty {
            Ok(None)
        } else {
            <Self as FromRequest<AppState>>::from_request(request, app).await.map(Some)
        }
    }
}

/// 413.
pub(super) fn too_large(max: usize) -> ApiError {
    let detail = format!("the body has more than {max} bytes");
    ApiError::new(StatusCode::PAYLOAD_TOO_LARGE, "too_large", detail).field("body")
}

/// Reads JSON; what is wrong is named by its path, inside `outer` if that is not empty. A list is
/// no object anywhere ([`Objects`]): every body and every part of a form comes this way.
pub(super) fn json<T: DeserializeOwned>(bytes: &[u8], outer: &str) -> Result<T, ApiError> {
    let mut reader = serde_json::Deserializer::from_slice(bytes);
    let value = serde_path_to_error::deserialize(Objects(&mut reader)).map_err(|error| {
        let path = error.path().to_string();
        // "." is the whole, "?" a place that was not reached.
        let path = if path == "." || path == "?" { String::new() } else { path };
        let field = match (outer.is_empty(), path.is_empty()) {
            (true, true) => "body".to_owned(),
            (false, true) => outer.to_owned(),
            (true, false) => path,
            (false, false) if path.starts_with('[') => format!("{outer}{path}"),
            (false, false) => format!("{outer}.{path}"),
        };
        let inner = error.inner();
        if inner.is_data() {
            ApiError::invalid("invalid_value", field, inner.to_string())
        } else {
            ApiError::new(StatusCode::BAD_REQUEST, "bad_json", inner.to_string()).field(field)
        }
    })?;
    reader.end().map_err(|e| {
        let field = if outer.is_empty() { "body" } else { outer };
        ApiError::new(StatusCode::BAD_REQUEST, "bad_json", e.to_string()).field(field)
    })?;
    Ok(value)
}

/// Checks a name and says which field it is.
pub(super) fn name(field: &'static str, text: String) -> Result<Name, ApiError> {
    Name::new(text).map_err(|e| ApiError::invalid("bad_name", field, e.to_string()))
}

/// Checks a text of one line for people and says which field it is.
pub(super) fn label(field: impl Into<String>, text: &str, max: usize) -> Result<(), ApiError> {
    check_label(text, max).map_err(|e| {
        let code = if matches!(e, LabelError::Length(_)) { "out_of_range" } else { "invalid_value" };
        ApiError::invalid(code, field, e.to_string())
    })
}

/// Path parameters. A path with wrong percent-encoding or a number that is none is a thing that
/// does not exist.
pub(super) struct PathParams<T>(pub(super) T);

impl<T: DeserializeOwned + Send> FromRequestParts<AppState> for PathParams<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, ApiError> {
        if parts.uri.path().contains(NUL) {
            let detail = "nothing has U+0000 in its name";
            return Err(ApiError::new(StatusCode::NOT_FOUND, "not_found", detail).field("path"));
        }
        let path = Path::<T>::from_request_parts(parts, app).await;
        path.map(|Path(value)| Self(value))
            .map_err(|e| ApiError::new(StatusCode::NOT_FOUND, "not_found", e.body_text()).field("path"))
    }
}

/// U+0000 in an address, which no text of the store has.
const NUL: &str = "%00";

pub(super) struct QueryParams<T>(pub(super) T);

impl<T: DeserializeOwned> FromRequestParts<AppState> for QueryParams<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &AppState) -> Result<Self, ApiError> {
        let mut given = parts.uri.query().unwrap_or_default().split('&');
        if let Some(nul) = given.find(|parameter| parameter.contains(NUL)) {
            let field = nul.split('=').next().unwrap_or_default();
            let error = ApiError::new(StatusCode::BAD_REQUEST, "bad_query", "a text has no U+0000");
            return Err(error.field(field));
        }
        let query = Query::<T>::from_request_parts(parts, app).await;
        query
            .map(|Query(value)| Self(value))
            .map_err(|e| ApiError::new(StatusCode::BAD_REQUEST, "bad_query", e.body_text()).field("query"))
    }
}

/// Items of a page that does not say how many it wants.
const PAGE_DEFAULT: usize = 100;

/// How many items a page may have, checked against the bound.
pub(super) fn page_limit(limit: Option<usize>, max: usize) -> Result<usize, ApiError> {
    match limit {
        None => Ok(PAGE_DEFAULT.min(max)),
        Some(limit) if (1..=max).contains(&limit) => Ok(limit),
        Some(limit) => {
            Err(ApiError::invalid("out_of_range", "limit", format!("{limit} is not in 1 to {max}")))
        }
    }
}

/// The cursor of a list by number; 0 comes before every number.
pub(super) fn after_number(query: &PageQuery) -> Result<i64, ApiError> {
    Ok(number_cursor(query.cursor.as_deref())?.unwrap_or(0))
}

/// The cursor of a list by number.
pub(super) fn number_cursor(cursor: Option<&str>) -> Result<Option<i64>, ApiError> {
    let bad = |_e| ApiError::invalid("invalid_value", "cursor", "not one of this list");
    cursor.map(|text| text.parse().map_err(bad)).transpose()
}
