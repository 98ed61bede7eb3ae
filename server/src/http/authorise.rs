//! Around every operation of the API: who asks, and whether the authorisation table allows it. In:
//! a request that has found its route. Out: the same with its [`Principal`], or 401, 403, or 404
//! for what the principal may not see.

use super::{
    API, App, AppState,
    cookie::session_cookie,
    error::{ApiError, method_not_allowed},
    history,
    peer::Peer,
    request_id::RequestId,
};
use crate::{
    identity::{
        Denial, Principal, TokenId,
        authorisation::{self, Access, Forbidden, Scope},
    },
    store::{StoreError, actor::Actor, kind::Kind, now_ms, stored_answers},
};
use axum::{
    extract::{FromRequestParts, MatchedPath, RawPathParams, Request},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
};
use protos::{api::Role, credentials};
use serde_json::json;
use std::{path::Path, time::Instant};

/// Sent by the page with what changes something: forms and pictures of other sites cannot send it.
pub(super) const PAGE_HEADER: HeaderName = HeaderName::from_static("x-waymark-page");
/// Set by proxies: then the peer is not who asks.
const FORWARDED: [&str; 2] = ["forwarded", "x-forwarded-for"];

/// Who asks, and by which session of the page.
#[derive(Debug, Clone)]
pub(super) struct Caller {
    pub(super) principal: Principal,
    /// Value of the session's cookie; `None` for a token.
    pub(super) session: Option<String>,
}

/// The request with its principal, and who asks for a change if it may be one. Errors: the refusal
/// as an answer.
pub(super) async fn authorise(
    app: &AppState,
    request: Request,
) -> Result<(Request, Option<Actor>), Box<Response>> {
    let (mut parts, body) = request.into_parts();
    if let Err(error) = admitted(app, &mut parts).await {
        return Err(Box::new(refused(app, &parts, error)));
    }
    match actor(&parts) {
        Ok(actor) => Ok((Request::from_parts(parts, body), actor)),
        Err(error) => Err(Box::new(refused(app, &parts, error))),
    }
}

/// Who asks for a change, and why, for the audit log and the history of maps. Errors: the reason is
/// none.
fn actor(parts: &Parts) -> Result<Option<Actor>, ApiError> {
    let principal = parts.extensions.get::<Principal>().filter(|_| !parts.method.is_safe());
    let Some(principal) = principal else { return Ok(None) };
    let matched = parts.extensions.get::<MatchedPath>().map_or("", MatchedPath::as_str);
    let below = |path: &str| path.strip_prefix(API).unwrap_or(path).to_owned();
    let request = parts.extensions.get::<RequestId>().and_then(|id| id.0.to_str().ok());
    let token = match principal.token {
        TokenId::Local => None,
        TokenId::Stored(number) => Some(number),
    };
    Ok(Some(Actor {
        name: principal.name.to_string(),
        token,
        action: format!("{} {}", parts.method, below(matched)),
        target: below(parts.uri.path()),
        request: request.map(str::to_owned),
        job: None,
        why: history::why(&parts.headers)?,
    }))
}

async fn admitted(app: &AppState, parts: &mut Parts) -> Result<(), ApiError> {
    let matched = parts.extensions.get::<MatchedPath>().map_or("", MatchedPath::as_str);
    // axum answers HEAD by the route of GET.
    let method = if parts.method == Method::HEAD { "GET" } else { parts.method.as_str() };
    let access = authorisation::access(method, matched.strip_prefix(API).unwrap_or(matched));
    let (role, scope) = match access {
        Some(Access::Open) => return Ok(()),
        Some(Access::Needs(role, scope)) => (role, scope),
        // Not even for administrators: the table is to have a row for it.
        None => return principal(app, parts, Role::Viewer).and_then(|_| Err(method_not_allowed())),
    };
    let principal = principal(app, parts, role)?;
    authorisation::check(&principal, role, scope).map_err(|reason| forbidden(&principal, reason))?;
    check_scope(app, parts, &principal, scope).await?;
    let is_session = !parts.headers.contains_key(header::AUTHORIZATION);
    let session = session_cookie(&parts.headers).filter(|_| is_session).map(str::to_owned);
    parts.extensions.insert(Caller { principal: principal.clone(), session });
    parts.extensions.insert(principal);
    Ok(())
}

/// Who asks. `role` is what the operation needs, for the refusal.
fn principal(app: &AppState, parts: &Parts, role: Role) -> Result<Principal, ApiError> {
    let (tokens, now_ms) = (app.store.tokens(), now_ms());
    if let Some(value) = parts.headers.get(header::AUTHORIZATION) {
        let text = bearer(value).ok_or_else(|| unauthenticated("only `Bearer TOKEN` is understood", role))?;
        return tokens.principal_of(text, now_ms).map_err(|denial| unauthenticated(denied(denial), role));
    }
    let session =
        session_cookie(&parts.headers).and_then(|cookie| app.sessions.token(cookie, Instant::now()));
    let token = session.ok_or_else(|| unauthenticated("neither a token nor a session was sent", role))?;
    let principal = tokens.principal(token, now_ms).map_err(|d| unauthenticated(denied(d), role))?;
    check_page(&parts.method, &parts.headers)?;
    Ok(principal)
}

/// The valid token that a request comes with, in its header or by its session. A header that is not
/// valid hides the session.
pub(super) fn token(app: &App, headers: &HeaderMap, now: Instant) -> Option<TokenId> {
    let (tokens, now_ms) = (app.store.tokens(), now_ms());
    if let Some(value) = headers.get(header::AUTHORIZATION) {
        return tokens.valid(bearer(value)?, now_ms).ok();
    }
    let token = session_cookie(headers).and_then(|cookie| app.sessions.token(cookie, now))?;
    tokens.check(token, now_ms).is_ok().then_some(token)
}

/// Who asks for what everybody may ask for. `None` for a stranger, and for one whose token or
/// session is not valid.
pub(super) fn asker(app: &AppState, parts: &Parts) -> Option<Principal> {
    principal(app, parts, Role::Viewer).ok()
}

/// The token of a header.
pub(super) fn bearer(value: &HeaderValue) -> Option<&str> {
    credentials::bearer(value.to_str().ok()?)
}

/// A change by cookie must come from a script of the page: a browser sends the cookie with whatever
/// asks.
pub(super) fn check_page(method: &Method, headers: &HeaderMap) -> Result<(), ApiError> {
    if method.is_safe() || headers.contains_key(PAGE_HEADER) {
        return Ok(());
    }
    let detail =
        "a change by the page's session needs the header x-waymark-page; programs send a token instead";
    Err(ApiError::new(StatusCode::FORBIDDEN, "page_header_missing", detail).field(PAGE_HEADER.as_str()))
}

/// Whether the principal may see what the path names. What it may not see is answered as what does
/// not exist.
async fn check_scope(
    app: &AppState,
    parts: &mut Parts,
    principal: &Principal,
    scope: Scope,
) -> Result<(), ApiError> {
    if principal.maps.is_none() || matches!(scope, Scope::Own | Scope::Server) {
        return Ok(());
    }
    let params = RawPathParams::from_request_parts(parts, &()).await;
    let params =
        params.map_err(|e| ApiError::new(StatusCode::NOT_FOUND, "not_found", e.body_text()).field("path"))?;
    let value = |name: &str| params.iter().find(|(key, _)| *key == name).map_or("", |(_, value)| value);
    match scope {
        Scope::Map => check_map(principal, value("map")),
        Scope::Robot => check_robot(app, principal, value("robot")),
        Scope::Job => match value("job").parse() {
            Ok(id) => {
                let (job, _) = app.jobs.get(id).await?;
                let foreign = || StoreError::NotFound { what: Kind::Job, name: id.to_string() };
                if principal.may_see(&job.map) { Ok(()) } else { Err(foreign().into()) }
            }
            // The handler says what is wrong with it.
            Err(_) => Ok(()),
        },
        Scope::Answer => match value("answer").parse() {
            Ok(id) => {
                let map = stored_answers::map_of(app.store.reads(), id).await?;
                if principal.may_see(&map) { Ok(()) } else { Err(stored_answers::unknown(id).into()) }
            }
            Err(_) => Ok(()),
        },
        Scope::Own | Scope::Server => Ok(()),
    }
}

/// 404 for a map that the principal may not see.
pub(super) fn check_map(principal: &Principal, map: &str) -> Result<(), ApiError> {
    let foreign = || StoreError::NotFound { what: Kind::Map, name: map.to_owned() };
    if principal.may_see(map) { Ok(()) } else { Err(foreign().into()) }
}

/// 404 for a robot on a map that the principal may not see. One that does not exist is left to the
/// handler.
pub(super) fn check_robot(app: &AppState, principal: &Principal, robot: &str) -> Result<(), ApiError> {
    let foreign = || StoreError::NotFound { what: Kind::Robot, name: robot.to_owned() };
    match app.store.snapshots().robot_map(robot) {
        Some(map) if !principal.may_see(&map) => Err(foreign().into()),
        _ => Ok(()),
    }
}

fn denied(denial: Denial) -> &'static str {
    match denial {
        Denial::Unknown => "the token is not one of this server",
        Denial::Revoked => "the token was revoked",
        Denial::Expired => "the token has expired",
    }
}

/// 401.
pub(super) fn unauthenticated(reason: &str, role: Role) -> ApiError {
    let detail = format!(
        "{reason}; this needs the role {role}. An administrator makes a token: waymark token create NAME --role {role}; \
         sign in with it: waymark login"
    );
    ApiError::new(StatusCode::UNAUTHORIZED, "unauthenticated", detail).with("role", json!(role))
}

fn forbidden(principal: &Principal, reason: Forbidden) -> ApiError {
    let Principal { name, role: has, .. } = principal;
    let new = |detail| ApiError::new(StatusCode::FORBIDDEN, "forbidden", detail);
    match reason {
        Forbidden::Role(role) => new(format!(
            "the token `{name}` has the role {has}; this needs {role}. An administrator makes a token: waymark token \
             create NAME --role {role}"
        ))
        .with("role", json!(role)),
        Forbidden::AllMaps => new(format!(
            "the token `{name}` is for some maps only; this needs one for all maps. An administrator makes it: waymark \
             token create NAME --role {has}, without --for-map"
        ))
        .with("role", json!(has)),
    }
}

/// The refusal as an answer. On this machine, a 401 says where the local token is.
pub(super) fn refused(app: &AppState, parts: &Parts, error: ApiError) -> Response {
    let is_unauthenticated = error.status == StatusCode::UNAUTHORIZED;
    let mut response = error.into_response();
    if is_unauthenticated {
        let peer = parts.extensions.get::<Peer>().map(|peer| peer.addr.ip().to_canonical());
        let is_local = peer.is_some_and(|ip| ip.is_loopback())
            && FORWARDED.iter().all(|name| !parts.headers.contains_key(*name));
        let file = app.local_token_file.as_deref().filter(|_| is_local);
        response.headers_mut().insert(header::WWW_AUTHENTICATE, challenge(file));
    }
    response
}

/// `Bearer`, with the file of the local token as a quoted string (RFC 9110, 5.6.4).
fn challenge(file: Option<&Path>) -> HeaderValue {
    let plain = HeaderValue::from_static("Bearer realm=\"waymark\"");
    let Some(path) = file.and_then(Path::to_str) else { return plain };
    let quoted = path.replace('\\', "\\\\").replace('"', "\\\"");
    let text = format!("Bearer realm=\"waymark\", local_token_file=\"{quoted}\"");
    HeaderValue::from_bytes(text.as_bytes()).unwrap_or(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_challenge_quotes_the_path() {
        let of = |path: &str| challenge(Some(Path::new(path)));
        assert_eq!(
            of("/a \"b\\/local-token").as_bytes(),
            br#"Bearer realm="waymark", local_token_file="/a \"b\\/local-token""#
        );
        assert!(of("/ä/local-token").as_bytes().ends_with("\"/ä/local-token\"".as_bytes()));
        assert_eq!(of("/a\nb"), "Bearer realm=\"waymark\"");
        assert_eq!(challenge(None), "Bearer realm=\"waymark\"");
    }

    #[test]
    fn the_scheme_of_a_token_is_any_case_and_bearer() {
        let of = |text: &str| bearer(&HeaderValue::from_str(text).unwrap()).map(str::to_owned);
        for (text, token) in
            [("Bearer a", Some("a")), ("bearer  a ", Some("a")), ("Basic a", None), ("a", None)]
        {
            assert_eq!(of(text).as_deref(), token, "{text}");
        }
    }
}
