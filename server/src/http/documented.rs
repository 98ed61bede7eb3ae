//! What every operation of the OpenAPI document may answer beside its own: the refusals of the guard, of the extractors and of
//! the store. They are added here once, with the media type of all errors.

use super::error::PROBLEM_JSON;
use utoipa::openapi::{
    Content, OpenApi, Ref, RefOr, Response,
    path::{Operation, ParameterIn, PathItem},
};

/// Status and codes of any request: of the guard, and of a server that fails or stops.
const ALWAYS: [(&str, &str); 6] = [
    ("400", "repeated_header, foreign_authority"),
    ("403", "host_not_allowed, origin_not_allowed"),
    ("408", "timeout; `may_be_done: true` if it is a change that had begun"),
    ("429", "rate_limited; `Retry-After`"),
    ("500", "internal; not_published, with `may_be_done: true`"),
    ("503", "busy, storage_failed"),
];
/// Of a request with a body.
const WITH_BODY: [(&str, &str); 3] =
    [("413", "too_large"), ("422", "invalid_value"), ("503", "too_many_uploads")];
/// Of a change of what is stored.
const CHANGING: [(&str, &str); 1] = [("507", "storage_full, storage_nearly_full, storage_read_only")];

/// Adds the errors to every operation.
pub(super) fn with_errors(mut document: OpenApi) -> OpenApi {
    for item in document.paths.paths.values_mut() {
        let is_changing = [true, true, true, true, false];
        let PathItem { post, put, patch, delete, get, .. } = item;
        for (operation, is_changing) in [post, put, patch, delete, get].into_iter().zip(is_changing) {
            if let Some(operation) = operation {
                add_errors(operation, is_changing);
            }
        }
    }
    document
}

fn add_errors(operation: &mut Operation, is_changing: bool) {
    let mut errors = ALWAYS.to_vec();
    let parameters = || operation.parameters.iter().flatten();
    let is_in =
        |place: &ParameterIn| parameters().any(|p| matches!(p, RefOr::T(p) if p.parameter_in == *place));
    if is_in(&ParameterIn::Path) {
        errors.push(("404", "not_found"));
    }
    if is_in(&ParameterIn::Query) {
        errors.push(("400", "bad_query"));
    }
    if let Some(RefOr::T(body)) = &operation.request_body {
        errors.extend(WITH_BODY);
        let is_form = body.content.contains_key("multipart/form-data");
        errors.extend(if body.content.contains_key("application/zip") {
            [("400", "bad_body"), ("415", "not_zip")]
        } else if is_form {
            [("400", "bad_multipart, bad_json"), ("415", "not_multipart")]
        } else {
            [("400", "bad_json"), ("415", "not_json")]
        });
    }
    if is_changing {
        errors.extend(CHANGING);
    }
    for p in operation.parameters.clone().iter().flatten() {
        let RefOr::T(p) = p else { continue };
        match p.name.as_str() {
            "limit" => errors.push(("422", "out_of_range")),
            "cursor" | "Waymark-Why" => errors.push(("422", "invalid_value")),
            "Idempotency-Key" => {
                errors.extend([("409", "in_progress"), ("422", "idempotency_key_reused, invalid_value")]);
            }
            "If-Match" => errors.extend([
                ("412", "changed_meanwhile; `ETag` is the present revision"),
                ("422", "invalid_value"),
                ("428", "precondition_required"),
            ]),
            _ => {}
        }
    }
    let responses = &mut operation.responses.responses;
    for (status, codes) in errors {
        let none = || RefOr::T(Response::new(""));
        if let RefOr::T(response) = responses.entry(status.to_owned()).or_insert_with(none) {
            say(response, codes);
        }
    }
    for (status, response) in responses {
        if let RefOr::T(response) = response
            && status.as_str() >= "400"
        {
            let problem = Content::new(Some(RefOr::Ref(Ref::from_schema_name("Problem"))));
            response.content = [(PROBLEM_JSON.to_owned(), RefOr::T(problem))].into_iter().collect();
        }
    }
}

/// Adds codes to the description, each once.
fn say(response: &mut Response, codes: &str) {
    for code in codes.split(", ") {
        if response.description.contains(code) {
            continue;
        }
        if !response.description.is_empty() {
            response.description.push_str(", ");
        }
        response.description.push_str(code);
    }
}
