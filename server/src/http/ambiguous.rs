//! Requests that two programs read differently: a header twice, or one host in the first line and
//! another in `Host`. In: a request. Out: a refusal that says what to send. A proxy in front may
//! take the other one, and check something else than what is done.

use super::error::ApiError;
use axum::{
    extract::Request,
    http::{HeaderName, HeaderValue, StatusCode, header},
};

/// Headers with one value. `If-Match` takes several tags in one line.
const ONCE: [HeaderName; 5] =
    [header::HOST, header::IF_MATCH, header::AUTHORIZATION, header::ORIGIN, header::CONTENT_TYPE];

/// Refuses a request of which it is not clear what it asks.
pub(super) fn check(request: &Request) -> Result<(), ApiError> {
    let headers = request.headers();
    for name in ONCE {
        let count = headers.get_all(&name).iter().count();
        if count > 1 {
            let detail = format!("the header `{name}` is there {count} times: send it once");
            return Err(
                ApiError::new(StatusCode::BAD_REQUEST, "repeated_header", detail).field(name.as_str())
            );
        }
    }
    let Some(asked) = request.uri().authority() else { return Ok(()) };
    let host = headers.get(header::HOST).map(HeaderValue::as_bytes);
    // A name in front of an `@` is for people who do not read on.
    let is_same = host.is_some_and(|host| host.eq_ignore_ascii_case(asked.as_str().as_bytes()));
    if is_same && !asked.as_str().contains('@') {
        return Ok(());
    }
    let detail = format!(
        "the first line asks for `{asked}`, which is not what the header `host` says: ask for the path alone, \
         `{} {}`",
        request.method(),
        request.uri().path()
    );
    Err(ApiError::new(StatusCode::BAD_REQUEST, "foreign_authority", detail).field("host"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;

    fn code(uri: &str, headers: &[(&str, &str)]) -> Option<(&'static str, Option<String>)> {
        let mut request = Request::builder().uri(uri);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        check(&request.body(Body::empty()).unwrap()).err().map(|error| (error.code, error.field))
    }

    #[test]
    fn what_may_be_read_in_two_ways_is_refused_by_name() {
        let host = ("host", "localhost:8080");
        for (uri, headers) in [
            ("/api/v1/maps", vec![host]),
            ("/api/v1/maps", vec![]),
            ("http://localhost:8080/api/v1/maps", vec![host]),
            ("http://LOCALHOST:8080/", vec![host, ("if-match", "\"1\", \"2\"")]),
            ("/", vec![host, ("cookie", "a=1"), ("cookie", "b=2"), ("accept", "a/b"), ("accept", "c/d")]),
        ] {
            assert_eq!(code(uri, &headers), None, "{uri} {headers:?}");
        }
        for name in ["host", "if-match", "authorization", "origin", "content-type"] {
            for (one, other) in [("a", "a"), ("a", "b")] {
                let refused = code("/", &[(name, one), (name, other)]);
                assert_eq!(refused, Some(("repeated_header", Some(name.to_owned()))), "{name}");
            }
        }
        for (uri, headers) in [
            ("http://evil.example/api/v1/maps", vec![host]),
            ("http://localhost/api/v1/maps", vec![host]),
            ("http://localhost:8080@evil.example/", vec![host]),
            ("http://a@localhost:8080/", vec![("host", "a@localhost:8080")]),
            ("https://evil.example/", vec![]),
        ] {
            assert_eq!(code(uri, &headers), Some(("foreign_authority", Some("host".to_owned()))), "{uri}");
        }
    }
}
