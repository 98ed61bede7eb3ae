//! Around every request: request id, log line, rate limit, response cache, deadline, limit on large
//! bodies, safe headers, and a refusal of requests from other web pages.
//!
//! A browser reaches the server on behalf of any page it shows; so a request must name this server
//! as its host and, if it changes anything, come from its own pages or from no page at all. Who
//! asks is the matter of `authorise`.

use super::{
    App, ambiguous, authorise,
    error::ApiError,
    peer::Peer,
    request_id::{REQUEST_ID, RequestId},
    request_rates::asking,
    reused_answers, safe_headers,
    upload_places::Uploader,
};
use crate::config::Limits;
use axum::{
    body::HttpBody,
    extract::{MatchedPath, Request},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header},
    response::{IntoResponse, Response},
};
use serde_json::Value;
use std::{
    net::IpAddr,
    time::{Duration, Instant},
};
use tracing::{Instrument as _, field::Empty};

/// Asked by what restarts the server if there is no answer.
const LIVENESS: &str = "/healthz";
/// Bodies up to this size need no place, bytes.
const SMALL_BODY: u64 = 64 << 10;

/// What is around a request: `inner` answers it if the guard lets it pass and no earlier answer is
/// kept.
pub(super) async fn guard<Answering: Future<Output = Response>>(
    app: &App,
    mut request: Request,
    inner: impl FnOnce(Request) -> Answering,
) -> Response {
    let RequestId(id) = RequestId::of(request.headers());
    request.extensions_mut().insert(RequestId(id.clone()));
    let (method, uri) = (request.method().clone(), request.uri().clone());
    let started = Instant::now();
    // With TLS, plain text comes from this machine alone, and a certificate proves the name that a
    // page was asked by.
    let peer = request.extensions().get::<Peer>().copied();
    let is_loopback = app.config.tls.is_some() || app.config.http_addr.ip().to_canonical().is_loopback();
    let loopback = is_loopback && !peer.is_some_and(|peer| peer.is_encrypted);
    // Whoever asks too much must not make the server look dead.
    let is_bound = uri.path() != LIVENESS;
    let token = is_bound.then(|| authorise::token(app, request.headers(), started)).flatten();
    let asking = is_bound.then(|| asking(token, peer.as_ref())).flatten();
    let may_ask = asking.map_or(Ok(()), |who| app.rates.take(who, started));
    let checked = ambiguous::check(&request)
        .and_then(|()| check_origin(request.method(), request.headers(), loopback))
        .and(may_ask);
    let kept = token.filter(|_| checked.is_ok()).and_then(|token| reused_answers::kept(app, &request, token));
    let kept_route = kept.as_ref().map(|kept| kept.route);
    let mut response = match (checked, kept) {
        (Err(error), _) => error.into_response(),
        (Ok(()), Some(kept)) => kept.into_response(),
        (Ok(()), None) => {
            let deadline = Duration::from_secs(deadline_s(&app.config.limits, uri.path()));
            let uploader = Uploader::of(token, peer.as_ref());
            in_span(app, (request, uploader), inner, &id, deadline).await
        }
    };
    let took = started.elapsed();
    let (status, path, ms) = (response.status(), uri.path(), took.as_secs_f64() * 1e3);
    let route = response.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
    app.http_times.add(method.as_str(), kept_route.or(route), status.as_u16(), took);
    if is_change(&method, status) {
        tracing::info!(id = id.to_str().unwrap_or_default(), %method, path, status = status.as_u16(), ms, "changed");
    } else {
        tracing::debug!(id = id.to_str().unwrap_or_default(), %method, path, status = status.as_u16(), ms, "request");
    }
    safe_headers::set(response.headers_mut(), path);
    response.headers_mut().insert(REQUEST_ID, id);
    response
}

/// Handles a request until its deadline. What is logged meanwhile has its id; how it ended is for
/// traces.
async fn in_span<Answering: Future<Output = Response>>(
    app: &App,
    (request, uploader): (Request, Uploader),
    inner: impl FnOnce(Request) -> Answering,
    id: &HeaderValue,
    deadline: Duration,
) -> Response {
    let (id, method) = (id.to_str().unwrap_or_default(), request.method().clone());
    let span = tracing::info_span!("request", id, %method, route = Empty, status = Empty);
    let handled = placed(app, (request, uploader), inner).instrument(span.clone());
    let response = match tokio::time::timeout(deadline, handled).await {
        Ok(response) => response,
        Err(_elapsed) => timed_out(&method, deadline).into_response(),
    };
    span.record("route", response.extensions().get::<MatchedPath>().map(MatchedPath::as_str));
    span.record("status", response.status().as_u16());
    response
}

/// A bundle of a map is large: its way takes longer than that of other requests.
fn deadline_s(limits: &Limits, path: &str) -> u64 {
    let is_bundle = path.ends_with("/bundle") || path.ends_with("/bundles");
    if is_bundle { limits.bundle_timeout_s } else { limits.request_timeout_s }
}

/// Whether something was changed. Some questions are put by POST: they are answered with 200,
/// creations are not.
fn is_change(method: &Method, status: StatusCode) -> bool {
    status.is_success() && !method.is_safe() && (*method != Method::POST || status != StatusCode::OK)
}

/// Handles a request. One with a large body has a place from before its body is read until it is
/// answered.
async fn placed<Answering: Future<Output = Response>>(
    app: &App,
    (request, uploader): (Request, Uploader),
    inner: impl FnOnce(Request) -> Answering,
) -> Response {
    let small = request.body().size_hint().upper().is_some_and(|bytes| bytes <= SMALL_BODY);
    let _place = if small {
        None
    } else {
        match app.uploads.take(uploader).await {
            Ok(place) => Some(place),
            Err(error) => return error.into_response(),
        }
    };
    inner(request).await
}

/// 408. A change that had not begun is not made any more; one that had is made all the same, and
///      nobody is told.
fn timed_out(method: &Method, deadline: Duration) -> ApiError {
    let seconds = deadline.as_secs();
    if method.is_safe() {
        let detail = format!("not done within {seconds} s");
        return ApiError::new(StatusCode::REQUEST_TIMEOUT, "timeout", detail);
    }
    let detail = format!(
        "not done within {seconds} s; the change may have been made: look before it is asked for again"
    );
    ApiError::new(StatusCode::REQUEST_TIMEOUT, "timeout", detail).with("may_be_done", Value::Bool(true))
}

fn check_origin(method: &Method, headers: &HeaderMap, loopback: bool) -> Result<(), ApiError> {
    let text = |name: HeaderName| headers.get(name).and_then(|v| v.to_str().ok());
    let host = text(header::HOST).unwrap_or_default();
    // A name that a stranger's DNS points at 127.0.0.1 must not make this server part of the
    // stranger's site.
    if loopback && !is_loopback_host(host) {
        let detail = "without encryption this server answers only to a loopback host";
        return Err(ApiError::new(StatusCode::FORBIDDEN, "host_not_allowed", detail).field("host"));
    }
    if method.is_safe() {
        return Ok(());
    }
    let own = |origin: &str| origin.split_once("://").is_some_and(|(_, rest)| rest == host);
    if text(header::ORIGIN).is_some_and(|origin| !own(origin)) {
        let detail = "changes are not accepted from the pages of another site";
        return Err(ApiError::new(StatusCode::FORBIDDEN, "origin_not_allowed", detail).field("origin"));
    }
    Ok(())
}

fn is_loopback_host(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split_once(']').map_or("", |(address, _)| address),
        None => host.split(':').next().unwrap_or_default(),
    };
    name == "localhost" || name.parse::<IpAddr>().is_ok_and(|ip| ip.to_canonical().is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(&'static str, &'static str)]) -> HeaderMap {
        pairs.iter().map(|(k, v)| (HeaderName::from_static(k), HeaderValue::from_static(v))).collect()
    }

    #[test]
    fn only_loopback_hosts_on_loopback() {
        for (host, ok) in [
            ("127.0.0.1:8080", true),
            ("localhost", true),
            ("[::1]:8080", true),
            ("evil.example", false),
            ("127.0.0.1.evil.example", false),
            ("", false),
        ] {
            assert_eq!(check_origin(&Method::GET, &headers(&[("host", host)]), true).is_ok(), ok, "{host}");
            assert!(check_origin(&Method::GET, &headers(&[("host", host)]), false).is_ok());
        }
    }

    #[test]
    fn other_sites_cannot_change_anything() {
        let own = headers(&[("host", "localhost:8080"), ("origin", "http://localhost:8080")]);
        let foreign = headers(&[("host", "localhost:8080"), ("origin", "https://evil.example")]);
        assert!(check_origin(&Method::POST, &own, true).is_ok());
        assert_eq!(check_origin(&Method::POST, &foreign, true).unwrap_err().code, "origin_not_allowed");
        assert!(check_origin(&Method::GET, &foreign, true).is_ok());
        let none = headers(&[("host", "localhost:8080")]);
        assert!(check_origin(&Method::DELETE, &none, true).is_ok());
    }

    #[test]
    fn what_changes_something_is_told_from_a_question() {
        let is = |method: Method, status: u16| is_change(&method, StatusCode::from_u16(status).unwrap());
        for (method, status) in [
            (Method::POST, 201),
            (Method::POST, 202),
            (Method::PUT, 200),
            (Method::PATCH, 200),
            (Method::DELETE, 204),
        ] {
            assert!(is(method.clone(), status), "{method} {status}");
        }
        for (method, status) in
            [(Method::GET, 200), (Method::POST, 200), (Method::DELETE, 404), (Method::PUT, 422)]
        {
            assert!(!is(method.clone(), status), "{method} {status}");
        }
    }
}
