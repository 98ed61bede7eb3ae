//! Sessions of the page: links, the form, the cookie, and what other sites can do with it.

use super::{
    authorisation::{token, with_token},
    *,
};
use crate::identity::TokenId;
use protos::api::Role;
use std::time::Instant;

/// A request as the browser sends it.
pub(super) fn with_cookie(mut request: Request<Body>, cookie: &str) -> Request<Body> {
    request.headers_mut().insert(header::COOKIE, format!("other=1; {cookie}").parse().unwrap());
    request
}

fn from_page(mut request: Request<Body>) -> Request<Body> {
    request.headers_mut().insert(authorise::PAGE_HEADER, "1".parse().unwrap());
    request
}

/// `NAME=VALUE` of the cookie that an answer sets.
pub(super) fn cookie(response: &Response<Body>) -> String {
    let set = response.headers()[header::SET_COOKIE].to_str().unwrap();
    for attribute in ["; HttpOnly", "; SameSite=Strict", "; Path=/", "; Max-Age="] {
        assert!(set.contains(attribute), "{set}");
    }
    set.split(';').next().unwrap().to_owned()
}

pub(super) async fn link(service: &Service, token: &str) -> String {
    let asked = with_token(request("POST", "/api/v1/session/links", ""), token);
    let (status, link) = read(service.ask_as_it_is(asked).await).await;
    assert_eq!((status, &link["valid_s"]), (201, &600.into()));
    link["path"].as_str().unwrap().to_owned()
}

#[tokio::test]
async fn a_link_opens_the_page_once_with_the_rights_of_its_maker() {
    let service = Service::start(Limits::default()).await;
    let teacher = token(&service, Role::Teacher, Some("hall"), None).await;
    let path = link(&service, &teacher).await;
    let opened = service.ask_as_it_is(request("GET", &path, "")).await;
    assert_eq!(
        (opened.status(), &opened.headers()[header::LOCATION]),
        (StatusCode::SEE_OTHER, &"/".parse().unwrap())
    );
    let cookie = cookie(&opened);
    for again in [path.as_str(), "/open", "/open?code=", "/open?code=x"] {
        let response = service.ask_as_it_is(request("GET", again, "")).await;
        assert_eq!(response.headers()[header::LOCATION], "/?link=ended", "{again}");
        assert!(!response.headers().contains_key(header::SET_COOKIE), "{again}");
    }
    let ask = |request| service.ask_as_it_is(with_cookie(request, &cookie));
    let (_, who) = read(ask(request("GET", "/api/v1/whoami", "")).await).await;
    assert_eq!((&who["role"], &who["maps"][0]), (&"teacher".into(), &"hall".into()));
    assert_eq!(ask(request("GET", "/api/v1/maps/hall/live", "")).await.status(), StatusCode::OK);
    let forbidden = from_page(request("POST", "/api/v1/maps", r#"{"name": "x"}"#));
    assert_eq!(read(ask(forbidden).await).await.1["code"], "forbidden");
}

#[tokio::test]
async fn a_session_outlives_the_server_and_one_that_was_logged_out_does_not() {
    let service = Service::start(Limits::default()).await;
    let viewer = token(&service, Role::Viewer, None, None).await;
    let form = || from_page(request("POST", "/login", format!("{{\"token\": \"{viewer}\"}}")));
    let value = |set: &str| set.split_once('=').unwrap().1.to_owned();
    let [kept, left] =
        [cookie(&service.ask_as_it_is(form()).await), cookie(&service.ask_as_it_is(form()).await)];
    let out = from_page(with_cookie(request("POST", "/logout", ""), &left));
    assert_eq!(service.ask_as_it_is(out).await.status(), StatusCode::NO_CONTENT);
    let local = link(&service, &service.local).await;
    let local = cookie(&service.ask_as_it_is(request("GET", &local, "")).await);
    // What the next start knows.
    let next = page_session::resumed_sessions(&service.store).await;
    let of = |cookie: &str| next.token(&value(cookie), Instant::now());
    assert_eq!(of(&kept), Some(TokenId::Stored(1)));
    assert_eq!(of(&local), Some(TokenId::Local));
    assert_eq!(of(&left), None, "it was logged out");
}

#[tokio::test]
async fn a_change_by_cookie_needs_what_other_sites_cannot_send() {
    let service = Service::start(Limits::default()).await;
    let path = link(&service, &service.local).await;
    let cookie = cookie(&service.ask_as_it_is(request("GET", &path, "")).await);
    let change = || with_cookie(request("POST", "/api/v1/maps", r#"{"name": "made"}"#), &cookie);
    let code = async |request| read(service.ask_as_it_is(request).await).await.1["code"].clone();
    assert_eq!(code(change()).await, "page_header_missing");
    let mut foreign = from_page(change());
    foreign.headers_mut().insert(header::ORIGIN, "http://evil.example".parse().unwrap());
    assert_eq!(code(foreign).await, "origin_not_allowed");
    assert_eq!(service.get("/api/v1/maps/made").await.0, 404);
    let mut own = from_page(change());
    own.headers_mut().insert(header::ORIGIN, "http://localhost".parse().unwrap());
    assert_eq!(service.ask_as_it_is(own).await.status(), StatusCode::CREATED);
}

#[tokio::test]
async fn the_form_takes_a_token_and_the_session_ends_with_it_or_by_logging_out() {
    let service = Service::start(Limits::default()).await;
    let viewer = token(&service, Role::Viewer, None, None).await;
    let form = |token: &str| request("POST", "/login", format!("{{\"token\": \"{token}\"}}"));
    let login = |token: &str| service.ask_as_it_is(from_page(form(token)));
    let refused = service.ask_as_it_is(form(&viewer)).await;
    assert_eq!(read(refused).await.1["code"], "page_header_missing");
    let wrong = login("wmk_1_x").await;
    assert!(wrong.headers().contains_key(header::WWW_AUTHENTICATE));
    let (status, problem) = read(wrong).await;
    assert_eq!(
        (status, &problem["code"], &problem["field"]),
        (401, &"unauthenticated".into(), &"token".into())
    );
    assert_eq!(login(&"x".repeat(2000)).await.status(), StatusCode::PAYLOAD_TOO_LARGE);
    let [first, second] = [cookie(&login(&viewer).await), cookie(&login(&viewer).await)];
    let status = async |cookie: &str| {
        service.ask_as_it_is(with_cookie(request("GET", "/api/v1/maps", ""), cookie)).await.status()
    };
    assert_eq!((status(&first).await, status(&second).await), (StatusCode::OK, StatusCode::OK));
    let logout = || with_cookie(request("POST", "/logout", ""), &first);
    assert_eq!(service.ask_as_it_is(logout()).await.status(), StatusCode::FORBIDDEN);
    let out = service.ask_as_it_is(from_page(logout())).await;
    assert!(cookie(&out).ends_with('=') && out.status() == StatusCode::NO_CONTENT);
    assert_eq!((status(&first).await, status(&second).await), (StatusCode::UNAUTHORIZED, StatusCode::OK));
    service.ask(request("DELETE", "/api/v1/tokens/1", "")).await;
    assert_eq!(status(&second).await, StatusCode::UNAUTHORIZED);
    // A token beside a cookie is what counts.
    let both = with_token(with_cookie(request("GET", "/api/v1/maps", ""), &second), &service.local);
    assert_eq!(service.ask_as_it_is(both).await.status(), StatusCode::OK);
}
