//! What every operation of the OpenAPI document may answer beside its own: the refusals of the
//! guard, of the extractors and of the store. They stand once in `components`; an operation refers
//! to them, and says which codes are its own.

use super::error::PROBLEM_JSON;
use axum::http::StatusCode;
use std::collections::BTreeMap;
use utoipa::openapi::{
    Content, OpenApi, Ref, RefOr, Response,
    path::{Operation, ParameterIn, PathItem},
    response::ResponseBuilder,
};

/// Refusals with one status: the name of the response, and the codes that any operation may give
/// with it.
struct Refusal {
    status: &'static str,
    name: &'static str,
    codes: &'static str,
}

const fn refusal(status: &'static str, name: &'static str, codes: &'static str) -> Refusal {
    Refusal { status, name, codes }
}

/// What any request may be answered with: by the guard, for its token, and by a server that fails,
/// stops or has no room.
const ANY: Refusal = refusal(
    "default",
    "Refused",
    "Any request: 400 bad_query, bad_json, bad_multipart, bad_body, repeated_header, foreign_authority; 401 unauthenticated; \
     403 forbidden, page_header_missing, host_not_allowed, origin_not_allowed; 408 timeout; 429 rate_limited; 500 internal, \
     not_published; 503 busy, storage_failed, store_away, too_many_uploads; 507 storage_full, storage_nearly_full, storage_read_only",
);
/// Statuses that only some operations have, each with a response of its own.
const REFUSALS: [Refusal; 7] = [
    refusal(
        "404",
        "NotFound",
        "not_found, or what there is none of: unknown_map, unknown_landmark and so on",
    ),
    refusal("409", "Conflict", "in_progress: an earlier request with this `Idempotency-Key` is at work"),
    refusal("412", "ChangedMeanwhile", "changed_meanwhile; `ETag` is the present revision"),
    refusal("413", "TooLarge", "too_large"),
    refusal("415", "WrongMediaType", "not_json, not_multipart, not_zip"),
    refusal(
        "422",
        "InvalidValue",
        "invalid_value, out_of_range, not_finite, bad_name, idempotency_key_reused",
    ),
    refusal("428", "PreconditionRequired", "precondition_required: an `If-Match` is needed"),
];
/// Of a request with a body.
const WITH_BODY: [&str; 3] = ["413", "415", "422"];

/// Adds the refusals to every operation, and a description to every answer.
pub(super) fn with_errors(mut document: OpenApi) -> OpenApi {
    for PathItem { post, put, patch, delete, get, .. } in document.paths.paths.values_mut() {
        for operation in [post, put, patch, delete, get].into_iter().flatten() {
            add_refusals(operation);
            describe(operation);
        }
    }
    let responses = REFUSALS.iter().chain([&ANY]).map(|Refusal { name, codes, .. }| {
        let problem = Content::new(Some(RefOr::Ref(Ref::from_schema_name("Problem"))));
        let response = ResponseBuilder::new().description(*codes).content(PROBLEM_JSON, problem);
        ((*name).to_owned(), RefOr::T(response.build()))
    });
    document.components.get_or_insert_default().responses.extend(responses);
    document
}

fn add_refusals(operation: &mut Operation) {
    let mut statuses = vec![ANY.status];
    if operation.request_body.is_some() {
        statuses.extend(WITH_BODY);
    }
    for p in operation.parameters.iter().flatten() {
        let RefOr::T(p) = p else { continue };
        if p.parameter_in == ParameterIn::Path {
            statuses.push("404");
        }
        match p.name.as_str() {
            "limit" | "cursor" | "Waymark-Why" => statuses.push("422"),
            "Idempotency-Key" => statuses.extend(["409", "422"]),
            "If-Match" => statuses.extend(["412", "422", "428"]),
            _ => {}
        }
    }
    let responses = &mut operation.responses.responses;
    for status in statuses {
        responses.entry(status.to_owned()).or_insert_with(|| RefOr::T(Response::new("")));
    }
    refer(responses);
}

/// Puts a reference in the place of every refusal. It keeps the codes that the shared response does
/// not name; a status that any request may be answered with, and no codes of its own, is left out.
fn refer(responses: &mut BTreeMap<String, RefOr<Response>>) {
    responses.retain(|status, response| {
        let RefOr::T(own) = &*response else { return true };
        if status.as_str() < "400" {
            return true;
        }
        let shared = REFUSALS.iter().find(|refusal| refusal.status == status.as_str());
        let Refusal { name, codes, .. } = shared.unwrap_or(&ANY);
        let mut reference = Ref::from_response_name(*name);
        if own.description.split(", ").any(|code| !codes.contains(code)) {
            reference.description.clone_from(&own.description);
        }
        let has_more = shared.is_some() || status == ANY.status || !reference.description.is_empty();
        *response = RefOr::Ref(reference);
        has_more
    });
}

/// OpenAPI asks for a description of every response: where a handler gives none, the words of its
/// status.
fn describe(operation: &mut Operation) {
    for (status, response) in &mut operation.responses.responses {
        if let RefOr::T(response) = response
            && response.description.is_empty()
        {
            let known = StatusCode::from_bytes(status.as_bytes()).ok().and_then(|s| s.canonical_reason());
            known.unwrap_or("Done").clone_into(&mut response.description);
        }
    }
}
