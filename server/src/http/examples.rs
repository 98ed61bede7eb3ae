//! Examples of request bodies, from `examples.json` into the OpenAPI document. A test sends each of
//! them. In a form, `@` and a name stand for a file, as in curl.

use serde_json::Value;
use std::collections::BTreeMap;
use utoipa::openapi::{Content, OpenApi, RefOr, path::Operation};

/// By operation, `METHOD path` below the API's root.
const EXAMPLES: &str = include_str!("examples.json");

/// Kinds of bodies.
const KINDS: [&str; 4] =
    ["application/json", "multipart/form-data", "application/zip", "application/octet-stream"];

/// Gives every body of a request its example.
pub(super) fn with_examples(mut document: OpenApi, root: &str) -> OpenApi {
    let mut examples: BTreeMap<String, Value> = serde_json::from_str(EXAMPLES).unwrap_or_default();
    for (path, item) in &mut document.paths.paths {
        let below = path.strip_prefix(root).unwrap_or(path);
        let methods = [("POST", &mut item.post), ("PUT", &mut item.put), ("PATCH", &mut item.patch)];
        for (method, operation) in methods {
            let body = operation.as_mut().and_then(request_body);
            if let Some((body, example)) = body.zip(examples.remove(&format!("{method} {below}"))) {
                body.example = Some(example);
            }
        }
    }
    document
}

fn request_body(operation: &mut Operation) -> Option<&mut Content> {
    let RefOr::T(body) = operation.request_body.as_mut()? else { return None };
    let mut contents = body.content.iter_mut();
    let content = contents.find(|(kind, _)| KINDS.contains(&kind.as_str()));
    let RefOr::T(content) = content?.1 else { return None };
    Some(content)
}
