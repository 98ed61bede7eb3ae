//! What the authorisation table says, in the OpenAPI document: the way to send a token, and 401 and 403 of every
//! operation that needs one.

use crate::identity::authorisation::{Access, Scope, access};
use utoipa::openapi::{
    Content, OpenApi, Ref, RefOr, Response,
    path::Operation,
    response::ResponseBuilder,
    security::{HttpAuthScheme, HttpBuilder, SecurityRequirement, SecurityScheme},
};

/// Name of the scheme in the document.
const SCHEME: &str = "token";

/// Gives every operation its refusals.
pub(super) fn with_security(mut document: OpenApi, root: &str) -> OpenApi {
    let scheme = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).bearer_format("wmk_ID_SECRET").build();
    let components = document.components.get_or_insert_default();
    components.security_schemes.insert(SCHEME.to_owned(), RefOr::T(SecurityScheme::Http(scheme)));
    for (path, item) in &mut document.paths.paths {
        let below = path.strip_prefix(root).unwrap_or(path);
        let methods = [
            ("GET", &mut item.get),
            ("POST", &mut item.post),
            ("PUT", &mut item.put),
            ("PATCH", &mut item.patch),
            ("DELETE", &mut item.delete),
        ];
        for (method, operation) in methods {
            if let (Some(operation), Some(Access::Needs(role, scope))) = (operation, access(method, below)) {
                let whole = if scope == Scope::Server { ", for all maps" } else { "" };
                refuse(operation, "401", &format!("unauthenticated: the role {role} is needed"));
                refuse(
                    operation,
                    "403",
                    &format!("forbidden: less than the role {role}{whole}; page_header_missing"),
                );
                operation.security = Some(vec![SecurityRequirement::new(SCHEME, [] as [&str; 0])]);
            }
        }
    }
    document
}

/// Adds a refusal to what the document says of this status.
fn refuse(operation: &mut Operation, status: &str, description: &str) {
    let responses = &mut operation.responses.responses;
    let before = match responses.get(status) {
        Some(RefOr::T(response)) => format!("{}; ", response.description),
        _ => String::new(),
    };
    let problem = Content::new(Some(RefOr::Ref(Ref::from_schema_name("Problem"))));
    let response = ResponseBuilder::new().description(before + description);
    let response: Response = response.content(super::error::PROBLEM_JSON, problem).build();
    responses.insert(status.to_owned(), RefOr::T(response));
}
