//! Sessions of the page: links that open it once, the form that takes a token, logging out. A session is a cookie that
//! scripts cannot read and other sites cannot make a browser send.

use super::{
    AppState,
    authorise::{check_page, refused, unauthenticated},
    cookie::{session_cookie, set_cookie},
    error::ApiError,
    extract::{json, too_large},
    peer::Peer,
};
use crate::{
    identity::{CODE_VALID, Principal, SESSION_VALID, TokenId},
    store::now_ms,
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
use std::time::Instant;
use utoipa_axum::{router::OpenApiRouter, routes};

/// Largest body of the form, in bytes.
const FORM_MAX: usize = 1024;
/// Where a link leads that is not valid any more.
const LINK_ENDED: HeaderValue = HeaderValue::from_static("/?link=ended");

/// The operation of the API.
pub(super) fn api() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(link))
}

/// What the browser asks for.
pub(super) fn router() -> Router<AppState> {
    Router::new().route("/open", get(open)).route("/login", post(login)).route("/logout", post(logout))
}

/// Makes a link that opens the page once, within ten minutes, with the rights of the one who asks.
#[utoipa::path(post, path = "/session/links", tag = "identity", responses((status = 201, body = PageLink)))]
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
        Some(token) => match begun(&app, &parts, token) {
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
        begun(&app, &parts, principal.map_err(unknown)?.token)
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
    if let Some(cookie) = session_cookie(&parts.headers) {
        app.sessions.close(cookie);
    }
    (StatusCode::NO_CONTENT, [(header::SET_COOKIE, cookie(&parts, "", 0))]).into_response()
}

/// A session for a token: its cookie.
fn begun(app: &AppState, parts: &Parts, token: TokenId) -> Result<HeaderValue, ApiError> {
    let value = app.sessions.open(token, Instant::now()).map_err(|e| ApiError::internal(&e))?;
    Ok(cookie(parts, &value, SESSION_VALID.as_secs()))
}

fn cookie(parts: &Parts, value: &str, max_age_s: u64) -> HeaderValue {
    let is_encrypted = parts.extensions.get::<Peer>().is_some_and(|peer| peer.is_encrypted);
    set_cookie(&parts.headers, is_encrypted, value, max_age_s)
}
