//! Sessions of the page: links that open it once, the form that takes a token, logging out. A
//! session is a cookie that scripts cannot read and other sites cannot make a browser send.

use super::{
    AppState,
    authorise::{check_page, refused, unauthenticated},
    cookie::{session_cookie, set_cookie},
    error::ApiError,
    extract::{json, too_large},
    peer::Peer,
};
use crate::{
    identity::{CODE_VALID, Principal, SESSION_VALID, Sessions, TokenId},
    publication::Catalogue,
    store::{
        now_ms,
        page_sessions::{self, PageSessionRow},
    },
};
use axum::{
    Extension, Json, Router,
    body::to_bytes,
    extract::{Query, Request, State, rejection::QueryRejection},
    http::{HeaderValue, StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
    routing::{get, post},
};
use protos::api::{PageLink, Role};
use serde::Deserialize;
use std::time::{Duration, Instant};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Largest body of the form, in bytes.
const FORM_MAX: usize = 1024;
/// Where a link leads that is not valid any more.
const LINK_ENDED: HeaderValue = HeaderValue::from_static("/?link=ended");

/// The sessions that an earlier start has left, until their ends.
pub(crate) async fn resumed_sessions(store: &Catalogue) -> Sessions {
    let (sessions, now, now_ms) = (Sessions::default(), Instant::now(), now_ms());
    match page_sessions::open(store.reads(), now_ms).await {
        Ok(rows) => {
            for PageSessionRow { sha256, token, ends_ms } in rows {
                let left = Duration::from_millis(ends_ms.saturating_sub(now_ms).max(0) as u64);
                sessions.resume(sha256, token, now + left.min(SESSION_VALID), now);
            }
        }
        Err(error) => tracing::warn!(%error, "page_sessions_not_read"),
    }
    sessions
}

/// The operation of the API.
pub(super) fn api() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(link))
}

/// What the browser asks for.
pub(super) fn router() -> Router<AppState> {
    Router::new().route("/open", get(open)).route("/login", post(login)).route("/logout", post(logout))
}

/// Makes a link that opens the page once, within ten minutes, with the rights of the one who asks.
#[utoipa::path(post, path = "/session/links", operation_id = "createPageLink",
    tag = "identity", responses((status = 201, body = PageLink)))]
async fn link(
    State(app): State<AppState>,
    Extension(principal): Extension<Principal>,
) -> Result<(StatusCode, Json<PageLink>), ApiError> {
    let code = app.sessions.code(principal.token, Instant::now()).map_err(|e| ApiError::internal(&e))?;
    let link = PageLink { path: format!("/open?code={code}"), valid_s: CODE_VALID.as_secs() };
    Ok((StatusCode::CREATED, Json(link)))
}

#[derive(Deserialize)]
struct OpenQuery {
    code: String,
}

/// Takes the code of a link, and leads to the page.
async fn open(
    State(app): State<AppState>,
    query: Result<Query<OpenQuery>, QueryRejection>,
    parts: Parts,
) -> Response {
    let code = query.ok().map(|Query(OpenQuery { code })| code);
    let token = code.and_then(|code| app.sessions.redeem(&code, Instant::now()));
    let is_valid = |id: &TokenId| app.store.tokens().principal(*id, now_ms()).is_ok();
    let to =
        |place: HeaderValue| (StatusCode::SEE_OTHER, [(header::LOCATION, place), no_store()]).into_response();
    match token.filter(is_valid) {
        None => to(LINK_ENDED),
        Some(token) => match begun(&app, &parts, token).await {
            Ok(cookie) => ([(header::SET_COOKIE, cookie)], to(HeaderValue::from_static("/"))).into_response(),
            Err(error) => error.into_response(),
        },
    }
}

fn no_store() -> (header::HeaderName, HeaderValue) {
    (header::CACHE_CONTROL, HeaderValue::from_static("no-store"))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LoginForm {
    token: String,
}

/// Takes a token, and begins a session.
async fn login(State(app): State<AppState>, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    let begun = async {
        check_page(&parts.method, &parts.headers)?;
        let bytes = to_bytes(body, FORM_MAX).await.map_err(|_long| too_large(FORM_MAX))?;
        let LoginForm { token } = json(&bytes, "")?;
        let principal = app.store.tokens().principal_of(token.trim(), now_ms());
        let unknown = |_denial| unauthenticated("the token is not valid", Role::Viewer).field("token");
        begun(&app, &parts, principal.map_err(unknown)?.token).await
    };
    match begun.await {
        Ok(cookie) => (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie)]).into_response(),
        Err(error) => refused(&app, &parts, error),
    }
}

/// Ends the session.
async fn logout(State(app): State<AppState>, parts: Parts) -> Response {
    if let Err(error) = check_page(&parts.method, &parts.headers) {
        return error.into_response();
    }
    if let Some(digest) = session_cookie(&parts.headers).and_then(|cookie| app.sessions.close(cookie)) {
        let removed = app.store.write(move |tx| Box::pin(page_sessions::remove(tx, digest))).await;
        if let Err(error) = removed {
            tracing::warn!(%error, "page_session_not_removed");
        }
    }
    (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie(&parts, "", 0))]).into_response()
}

/// A session for a token: its cookie. One that cannot be stored, on a full disk, lasts until the
/// server stops.
async fn begun(app: &AppState, parts: &Parts, token: TokenId) -> Result<HeaderValue, ApiError> {
    let (value, sha256) = app.sessions.open(token, Instant::now()).map_err(|e| ApiError::internal(&e))?;
    let now = now_ms();
    let session = PageSessionRow { sha256, token, ends_ms: now + SESSION_VALID.as_millis() as i64 };
    let stored = app.store.write(move |tx| Box::pin(page_sessions::add(tx, session, now))).await;
    if let Err(error) = stored {
        tracing::warn!(%error, "page_session_not_stored");
    }
    Ok(cookie(parts, &value, SESSION_VALID.as_secs()))
}

fn cookie(parts: &Parts, value: &str, max_age_s: u64) -> HeaderValue {
    let is_encrypted = parts.extensions.get::<Peer>().is_some_and(|peer| peer.is_encrypted);
    set_cookie(&parts.headers, is_encrypted, value, max_age_s)
}
