//! `ETag` and `If-Match`: a change is meant for what its editor has seen, and is refused if
//! somebody was faster.

use super::{
    API, AppState,
    error::{ApiError, etag},
};
use crate::store::revisions::Precondition;
use axum::{
    Json,
    extract::FromRequestParts,
    http::{HeaderMap, StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
};
use serde::Serialize;
use utoipa::openapi::{
    HeaderBuilder, ObjectBuilder, OpenApi, RefOr, Required, Type,
    path::{Operation, ParameterBuilder, ParameterIn, PathItem},
};

/// Most revisions of one condition.
const MAX_REVISIONS: usize = 8;

/// What has a revision: its path below [`API`], and the methods that change it. A way back is a
/// change of the map.
pub(super) const REVISED: &[(&str, &[&str])] = &[
    ("/maps/{map}", &["patch", "delete"]),
    ("/maps/{map}/walls", &["put"]),
    ("/maps/{map}/underlay", &["put", "delete"]),
    ("/maps/{map}/visibility-settings", &["put"]),
    ("/maps/{map}/modalities", &["put"]),
    ("/maps/{map}/landmarks/{landmark}", &["patch", "delete"]),
    ("/maps/{map}/landmarks/{landmark}/merge", &["post"]),
    ("/maps/{map}/rollback", &["post"]),
    ("/maps/{map}/commits/{commit}/undo", &["post"]),
    ("/maps/{map}/drafts/{draft}/publish", &["post"]),
];

/// The revisions that a change is meant for. Errors: `precondition_required`, `invalid_value`.
pub(super) struct IfMatch(pub(super) Precondition);

impl FromRequestParts<AppState> for IfMatch {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &AppState) -> Result<Self, ApiError> {
        precondition(&parts.headers).map(Self)
    }
}

fn precondition(headers: &HeaderMap) -> Result<Precondition, ApiError> {
    let mut lines = headers.get_all(header::IF_MATCH).iter().peekable();
    if lines.peek().is_none() {
        let detail = "say which revision the change is meant for: If-Match with the ETag of what was read, or \
                      `If-Match: *` for whatever is there";
        let status = StatusCode::PRECONDITION_REQUIRED;
        return Err(ApiError::new(status, "precondition_required", detail).field("if-match"));
    }
    let wrong = || {
        let detail = format!("`*`, or 1 to {MAX_REVISIONS} entity tags in quotes, with commas between");
        ApiError::invalid("invalid_value", "if-match", detail)
    };
    let mut known = Vec::new();
    for line in lines {
        let text = line.to_str().map_err(|_not_ascii| wrong())?.trim();
        if text == "*" && known.is_empty() {
            return Ok(Precondition::Any);
        }
        for tag in text.split(',').map(str::trim) {
            // A weak tag matches nothing: two answers of one weak tag may differ.
            let strong = tag.strip_prefix('"').and_then(|tag| tag.strip_suffix('"'));
            match strong {
                Some(tag) if known.len() < MAX_REVISIONS && !tag.contains('"') => known.push(tag.to_owned()),
                None if tag.starts_with("W/\"") && tag.len() > 3 && tag.ends_with('"') => {}
                _ => return Err(wrong()),
            }
        }
    }
    Ok(Precondition::OneOf(known))
}

/// A body with its revision as `ETag`.
pub(super) struct Revised<T>(pub(super) String, pub(super) T);

impl<T: Serialize> IntoResponse for Revised<T> {
    fn into_response(self) -> Response {
        let Self(revision, body) = self;
        let mut response = Json(body).into_response();
        response.headers_mut().extend(etag(&revision).map(|tag| (header::ETAG, tag)));
        response
    }
}

fn operation<'a>(item: &'a mut PathItem, method: &str) -> Option<&'a mut Operation> {
    match method {
        "get" => item.get.as_mut(),
        "post" => item.post.as_mut(),
        "put" => item.put.as_mut(),
        "patch" => item.patch.as_mut(),
        "delete" => item.delete.as_mut(),
        _ => None,
    }
}

/// Says of what has a revision where it is read, and of its changes that they ask for one.
pub(super) fn with_revisions(mut document: OpenApi) -> OpenApi {
    let text = || ObjectBuilder::new().schema_type(Type::String).build();
    for (path, changes) in REVISED {
        let Some(item) = document.paths.paths.get_mut(&format!("{API}{path}")) else { continue };
        for method in std::iter::once(&"get").chain(*changes) {
            let Some(operation) = operation(item, method) else { continue };
            let tag = HeaderBuilder::new().schema(Some(text())).description(Some(
                "The revision: another one after every edit or lesson, the same after what robots do by themselves.",
            ));
            if let Some(RefOr::T(done)) = operation.responses.responses.get_mut("200") {
                done.headers.insert("ETag".to_owned(), RefOr::T(tag.build()));
            }
            if *method == "get" {
                continue;
            }
            let parameter = ParameterBuilder::new()
                .name("If-Match")
                .parameter_in(ParameterIn::Header)
                .required(Required::True)
                .description(Some("The ETag of what was read, or `*` for whatever is there."))
                .schema(Some(text()))
                .example(Some("*".into()));
            operation.parameters.get_or_insert_default().push(RefOr::T(parameter.build()));
        }
    }
    document
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn conditions_are_a_star_or_tags_in_quotes() {
        let read = |lines: &[&'static str]| {
            let headers = lines.iter().map(|line| (header::IF_MATCH, HeaderValue::from_static(line)));
            precondition(&headers.collect()).map_err(|error| error.code)
        };
        let one_of = |tags: &[&str]| Ok(Precondition::OneOf(tags.iter().map(ToString::to_string).collect()));
        assert_eq!(read(&[]), Err("precondition_required"));
        assert_eq!(read(&["*"]), Ok(Precondition::Any));
        assert_eq!(read(&["\"1.2\""]), one_of(&["1.2"]));
        assert_eq!(read(&["\"1.2\" , \"1.3\"", "\"1.4\""]), one_of(&["1.2", "1.3", "1.4"]));
        assert_eq!(read(&["W/\"1.2\""]), one_of(&[]), "weak tags never match");
        for wrong in ["", "1.2", "\"1.2", "\"a\"b\"", "\"1\", *", "W/", "\"1\",", "*, *"] {
            assert_eq!(read(&[wrong]), Err("invalid_value"), "{wrong}");
        }
        assert_eq!(read(&["\"1\",\"2\",\"3\",\"4\",\"5\",\"6\",\"7\",\"8\",\"9\""]), Err("invalid_value"));
    }
}
