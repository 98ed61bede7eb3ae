//! What every answer tells a browser that it must not do with it. In: the headers of an answer,
//! with its content type. Out: the same with a policy.

use super::API;
use axum::http::{HeaderMap, HeaderName, HeaderValue, header};

/// Headers of an answer with a body, about.
const MOST_HEADERS: usize = 12;
/// The pages load only what this server serves; nothing may frame them.
const OF_PAGES: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self'; font-src 'self'; img-src 'self' blob: data:; \
     connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);
/// The documentation page sets styles from its script.
const OF_DOCS: HeaderValue = HeaderValue::from_static(
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; \
     connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
);
/// What is no page loads nothing, wherever a browser shows it: a floor plan in SVG is somebody's
/// upload.
const OF_DATA: HeaderValue = HeaderValue::from_static("default-src 'none'; frame-ancestors 'none'");
const NOSNIFF: HeaderValue = HeaderValue::from_static("nosniff");
const NO_REFERRER: HeaderValue = HeaderValue::from_static("no-referrer");
const SAME_ORIGIN: HeaderValue = HeaderValue::from_static("same-origin");
const RESOURCE_POLICY: HeaderName = HeaderName::from_static("cross-origin-resource-policy");

/// Sets them. `path` is that of the request.
pub(super) fn set(headers: &mut HeaderMap, path: &str) {
    // "Not modified" has no type, and its headers replace those that the browser keeps with the
    // page.
    let is_html = |kind: &HeaderValue| kind.as_bytes().starts_with(b"text/html");
    let is_page = headers.get(header::CONTENT_TYPE).map_or(!path.starts_with(API), is_html);
    let policy = match (is_page, path.starts_with("/api/docs")) {
        (false, _) => OF_DATA,
        (true, false) => OF_PAGES,
        (true, true) => OF_DOCS,
    };
    headers.reserve(MOST_HEADERS);
    headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, NOSNIFF);
    headers.insert(RESOURCE_POLICY, SAME_ORIGIN);
    if is_page {
        headers.insert(header::REFERRER_POLICY, NO_REFERRER);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_load_what_the_server_serves_and_data_loads_nothing() {
        for (kind, path, allowed) in [
            ("text/html; charset=utf-8", "/maps/hall", Some("script-src 'self'")),
            ("text/html", "/api/docs/", Some("'unsafe-inline'")),
            ("", "/maps/hall", Some("script-src 'self'")),
            ("", "/api/docs/", Some("'unsafe-inline'")),
            ("", "/api/v1/maps/hall/landmarks/door", None),
            ("application/json", "/api/v1/maps", None),
            ("image/svg+xml", "/api/v1/maps/hall/underlay/picture", None),
        ] {
            let mut headers = HeaderMap::new();
            headers
                .extend((!kind.is_empty()).then_some((header::CONTENT_TYPE, HeaderValue::from_static(kind))));
            set(&mut headers, path);
            let policy = headers[header::CONTENT_SECURITY_POLICY].to_str().unwrap();
            assert!(
                policy.contains("default-src 'none'") && policy.contains("frame-ancestors 'none'"),
                "{path}"
            );
            assert!(
                allowed.map_or(!policy.contains("-src 'self'"), |part| policy.contains(part)),
                "{path}: {policy}"
            );
            assert_eq!(headers.contains_key(header::REFERRER_POLICY), allowed.is_some(), "{path}");
        }
    }
}
