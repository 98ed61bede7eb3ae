//! `Idempotency-Key`: a creation that is repeated with its key is answered as the first time, and
//! made once.

use super::{
    API, AppState, error::ApiError, extract::too_large, reference_runs::PATH_BYTES, room,
    upload::FORM_OVERHEAD,
};
use crate::{
    config::Limits,
    identity::{Principal, TokenId},
    store::kept_answers::{Answer, Creation, RequestDigest},
};
use axum::{
    body::{Body, Bytes},
    extract::{MatchedPath, Request},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header, request::Parts},
    middleware::Next,
    response::{IntoResponse, Response},
};
use protos::credentials::{MAX_KEY_BYTES, idempotency_key};
use sha2::{Digest, Sha256};
use utoipa::openapi::{
    ObjectBuilder, OpenApi, RefOr, Type,
    path::{ParameterBuilder, ParameterIn},
};

/// Carries the key of a creation.
const KEY: HeaderName = HeaderName::from_static("idempotency-key");
/// Says that the answer is that of an earlier request with this key.
const REPLAYED: HeaderName = HeaderName::from_static("idempotency-replayed");
/// Makes a map of a bundle. Its handler reads the body to a file, and looks at its key itself.
const LOAD: &str = "/bundles";

/// The largest body of a request, in bytes.
type LargestBody = fn(&Limits) -> usize;

/// Every POST that creates stored rows: its path below [`API`], and its largest body. The others
/// ask, or begin what is there once at most (a mapping, a recording), so that a repeat is refused
/// by itself; a token's secret is kept nowhere.
pub(super) const CREATIONS: &[(&str, LargestBody)] = &[
    ("/maps", json),
    ("/maps/{map}/copies", json),
    ("/maps/{map}/drafts", json),
    (LOAD, |limits| limits.bundle_bytes),
    ("/maps/{map}/landmarks", json),
    ("/maps/{map}/bulk/create-landmarks", json),
    ("/maps/{map}/landmarks/{landmark}/views", |limits| limits.upload_bytes + FORM_OVERHEAD),
    ("/maps/{map}/landmarks/{landmark}/learn", json),
    ("/maps/{map}/learn", json),
    ("/maps/{map}/gatherings", json),
    ("/maps/{map}/gatherings/{gathering}/accept", json),
    ("/robots/{robot}/recording/reference", |_| PATH_BYTES),
    ("/robots/{robot}/certificates", json),
];

fn json(limits: &Limits) -> usize {
    limits.json_bytes
}

/// Answers a creation with a key once; lets everything else pass.
pub(super) async fn keyed(app: &AppState, request: Request, next: Next) -> Response {
    let path = request.extensions().get::<MatchedPath>().and_then(|path| path.as_str().strip_prefix(API));
    let creation = CREATIONS.iter().find(|(at, _)| path == Some(*at));
    match creation {
        // A bundle goes to a file before its digest is known.
        Some((LOAD, _)) => room::run(app, request, next).await,
        Some((_, max)) if request.method() == Method::POST && request.headers().contains_key(KEY) => {
            let max = max(&app.config.limits);
            once(app, request, max, next).await.unwrap_or_else(IntoResponse::into_response)
        }
        _ => room::run(app, request, next).await,
    }
}

async fn once(app: &AppState, request: Request, max: usize, next: Next) -> Result<Response, ApiError> {
    let (head, body) = request.into_parts();
    key(&head.headers)?;
    let body = axum::body::to_bytes(body, max).await.map_err(|_too_long| too_large(max))?;
    let kind = head.headers.get(header::CONTENT_TYPE).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let (path, kind, bytes) = (head.uri.path().to_owned(), kind.to_owned(), body.clone());
    // Off the runtime: a picture takes a tenth of a second.
    let digest = tokio::task::spawn_blocking(move || digest(&path, &kind, &bytes)).await;
    let digest = digest.map_err(|e| ApiError::internal(&e))?;
    let again = head.clone();
    under_key(app, &again, digest, async {
        // A repeat of what was made is answered without room, too.
        Ok(room::run(app, Request::from_parts(head, Body::from(body)), next).await)
    })
    .await
}

/// The answer to a creation, of `work` or of an earlier request. Without a key that is always
/// `work`.
pub(super) async fn under_key(
    app: &AppState,
    head: &Parts,
    digest: RequestDigest,
    work: impl Future<Output = Result<Response, ApiError>>,
) -> Result<Response, ApiError> {
    if !head.headers.contains_key(KEY) {
        return work.await;
    }
    let key = key(&head.headers)?;
    // Everybody has keys of his own.
    let key = match head.extensions.get::<Principal>().map(|principal| principal.token) {
        Some(TokenId::Stored(number)) => format!("{number} {key}"),
        _ => format!("local {key}"),
    };
    match app.store.creation(&key, digest).await? {
        Creation::First(key) => key.scope(work).await,
        Creation::Repeat(Answer { status, body }) => {
            let status = StatusCode::from_u16(status).map_err(|e| ApiError::internal(&e))?;
            let kind = (header::CONTENT_TYPE, HeaderValue::from_static("application/json"));
            Ok((status, [kind, (REPLAYED, HeaderValue::from_static("true"))], body).into_response())
        }
    }
}

/// The key, checked.
fn key(headers: &HeaderMap) -> Result<String, ApiError> {
    let mut given = headers.get_all(KEY).iter();
    let key = given.next().and_then(|value| idempotency_key(value.as_bytes()));
    match key {
        Some(key) if given.next().is_none() => Ok(key.to_owned()),
        _ => {
            let detail = format!("one key of 1 to {MAX_KEY_BYTES} visible ASCII characters");
            Err(ApiError::invalid("invalid_value", KEY.as_str(), detail))
        }
    }
}

/// The digest of a POST. A form's boundary is left out: a client makes another one each time.
fn digest(path: &str, kind: &str, body: &Bytes) -> RequestDigest {
    let boundary = kind.split_once("boundary=").map(|(_, text)| text.split(';').next().unwrap_or(text));
    let boundary = boundary.map(|text| text.trim().trim_matches('"').as_bytes()).filter(|b| !b.is_empty());
    let mut digest = Sha256::new();
    let mut part = |bytes: &[u8]| {
        digest.update((bytes.len() as u64).to_le_bytes());
        digest.update(bytes);
    };
    part(path.as_bytes());
    let mut rest = &body[..];
    while let Some(boundary) = boundary
        && let Some(at) = rest.windows(boundary.len()).position(|here| here == boundary)
    {
        part(&rest[..at]);
        rest = &rest[at + boundary.len()..];
    }
    part(rest);
    digest.finalize().into()
}

/// Says of every creation that it takes a key.
pub(super) fn with_keys(mut document: OpenApi) -> OpenApi {
    for (path, _) in CREATIONS {
        let item = document.paths.paths.get_mut(&format!("{API}{path}"));
        let Some(operation) = item.and_then(|item| item.post.as_mut()) else { continue };
        let text = ObjectBuilder::new()
            .schema_type(Type::String)
            .min_length(Some(1))
            .max_length(Some(MAX_KEY_BYTES));
        let described = "A fresh text of visible ASCII characters for each creation, the same one to repeat it: the repeat \
                         changes nothing and gets the first answer, for a day.";
        let parameter = ParameterBuilder::new()
            .name("Idempotency-Key")
            .parameter_in(ParameterIn::Header)
            .description(Some(described))
            .schema(Some(text));
        operation.parameters.get_or_insert_default().push(RefOr::T(parameter.build()));
    }
    document
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(values: &[&'static str]) -> HeaderMap {
        values.iter().map(|value| (KEY, HeaderValue::from_static(value))).collect()
    }

    #[test]
    fn keys_are_visible_ascii_of_bounded_length() {
        let longest: &'static str = Box::leak("k".repeat(MAX_KEY_BYTES).into_boxed_str());
        let longer: &'static str = Box::leak("k".repeat(MAX_KEY_BYTES + 1).into_boxed_str());
        for fine in ["a", "!~", longest] {
            assert_eq!(key(&headers(&[fine])).unwrap(), fine);
        }
        for wrong in [&["" as &'static str][..], &["a b"], &["a\tb"], &[longer], &["a", "a"]] {
            let refused = key(&headers(wrong)).unwrap_err();
            assert_eq!((refused.code, refused.field.as_deref()), ("invalid_value", Some("idempotency-key")));
        }
    }

    #[test]
    fn a_form_is_the_same_whatever_its_boundary() {
        let form = |boundary: &str, value: &str| {
            let body = format!("--{boundary}\r\nname=\"a\"\r\n\r\n{value}\r\n--{boundary}--\r\n");
            digest("/p", &format!("multipart/form-data; boundary=\"{boundary}\"; x=y"), &body.into())
        };
        assert_eq!(form("one", "1"), form("another", "1"));
        assert_ne!(form("one", "1"), form("one", "2"));
        assert_ne!(digest("/p", "", &Bytes::from("ab")), digest("/pa", "", &Bytes::from("b")));
    }
}
