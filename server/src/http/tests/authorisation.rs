//! Every operation of the OpenAPI document, asked for by each role in its own map, in another and
//! in none.

use super::*;
use crate::{
    identity::authorisation::{Access, Scope, TABLE, access},
    store::{
        jobs, now_ms, robots,
        tokens::{self, TokenInsert},
    },
};
use axum::{Router, middleware::from_fn_with_state};
use protos::{api::Role, v1};
use serde_json::json;
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::atomic::{AtomicUsize, Ordering},
};
use tower::ServiceExt as _;

/// `hall` with `r1`, job 1 and answer 1 are the principal's own; `yard` with `r2`, job 2 and answer
/// 2 are not.
const OWN: [&str; 3] = ["hall", "r1", "1"];
const FOREIGN: [&str; 3] = ["yard", "r2", "2"];
const MISSING: [&str; 3] = ["nowhere", "r9", "99"];

/// What an answer says of the principal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Outcome {
    Unauthenticated,
    Forbidden,
    /// Like something that does not exist.
    Hidden,
    /// The handler decided.
    Admitted,
}

async fn service() -> Service {
    let service = Service::start(Limits::default()).await;
    let store = &service.store;
    store.write(|tx| Box::pin(maps::create(tx, "yard", DistanceKind::Both, 9))).await.unwrap();
    store.write(|tx| Box::pin(robots::put(tx, "r2", "yard", 9))).await.unwrap();
    for map in ["hall", "yard"] {
        store.write(move |tx| Box::pin(jobs::create(tx, "learn", map, "{}", (9, 9)))).await.unwrap();
        service.answered(map, "r1", v1::Status::NoMatch).await;
    }
    service
}

/// The text of a new token.
pub(super) async fn token(
    service: &Service,
    role: Role,
    map: Option<&str>,
    expires_ms: Option<i64>,
) -> String {
    let secret = Secret::random().unwrap();
    let (name, maps) = (role.as_str().to_owned(), map.map(|map| vec![map.to_owned()]));
    let new = TokenInsert { name, role, maps, sha256: secret.digest(), expires_ms };
    let made = service.store.write(move |tx| Box::pin(tokens::create(tx, new))).await.unwrap();
    TokenText::stored(made.id, &secret)
}

pub(super) fn with_token(mut request: Request<Body>, token: &str) -> Request<Body> {
    request.headers_mut().insert(header::AUTHORIZATION, format!("Bearer {token}").parse().unwrap());
    request
}

/// Method, path below the root and example body of every operation.
async fn operations(service: &Service) -> Vec<(String, String, String)> {
    let response = service.ask(request("GET", "/api/v1/openapi.json", "")).await;
    let document: Value =
        serde_json::from_slice(&to_bytes(response.into_body(), 8 << 20).await.unwrap()).unwrap();
    let mut found = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let example = &operation["requestBody"]["content"]["application/json"]["example"];
            let body = if example.is_null() { String::new() } else { example.to_string() };
            let below = path.strip_prefix("/api/v1").unwrap();
            let method = method.to_uppercase();
            let needed = match access(&method, below) {
                Some(Access::Needs(role, Scope::Server)) => json!([{ "token": [role.as_str(), "all_maps"] }]),
                Some(Access::Needs(role, _)) => json!([{ "token": [role.as_str()] }]),
                _ => Value::Null,
            };
            assert_eq!(operation["security"], needed, "{method} {path}: the role in the document");
            found.push((method, below.to_owned(), body));
        }
    }
    found
}

fn at(path: &str, [map, robot, job]: [&str; 3]) -> String {
    let mut path = format!("/api/v1{path}");
    let of = [
        ("{map}", map),
        ("{robot}", robot),
        ("{job}", job),
        ("{answer}", job),
        ("{quad}", "0"),
        ("{landmark}", "poster"),
        ("{camera}", "front"),
    ];
    for (name, value) in of {
        path = path.replace(name, value);
    }
    for name in ["{view}", "{gathering}", "{track}", "{run}", "{token}"] {
        path = path.replace(name, "77");
    }
    path
}

/// What the table says.
fn expected(access: Access, role: Option<Role>, is_scoped: bool, target: [&str; 3]) -> Outcome {
    let Access::Needs(needed, scope) = access else { return Outcome::Admitted };
    let Some(role) = role else { return Outcome::Unauthenticated };
    if role < needed || (scope == Scope::Server && is_scoped) {
        return Outcome::Forbidden;
    }
    let is_hidden = match scope {
        Scope::Map | Scope::Job | Scope::Answer => target != OWN,
        Scope::Robot => target == FOREIGN,
        Scope::Own | Scope::Server => false,
    };
    if is_scoped && is_hidden { Outcome::Hidden } else { Outcome::Admitted }
}

async fn outcome(response: Response<Body>, named: &str) -> Outcome {
    let status = response.status().as_u16();
    if status < 400 {
        // An event stream does not end.
        return Outcome::Admitted;
    }
    assert!(status < 500, "{named}: {status}");
    let is_challenged = response.headers().contains_key(header::WWW_AUTHENTICATE);
    assert_eq!(is_challenged, status == 401, "{named}");
    let (_, problem) = read(response).await;
    match (status, problem["code"].as_str().unwrap_or_default()) {
        (401, "unauthenticated") => Outcome::Unauthenticated,
        (403, "forbidden") => Outcome::Forbidden,
        (401 | 403, code) => panic!("{named}: {status} {code}"),
        (404, "unknown_map" | "unknown_robot" | "unknown_job" | "unknown_answer") => Outcome::Hidden,
        _ => Outcome::Admitted,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_operation_answers_each_principal_as_the_authorisation_table_says() {
    let all = operations(&service().await).await;
    let described: BTreeSet<_> =
        all.iter().map(|(method, path, _)| (method.as_str(), path.as_str())).collect();
    let rows: BTreeSet<_> = TABLE.iter().map(|rule| (rule.method, rule.path)).collect();
    assert_eq!(described, rows, "an operation without a row, or a row without an operation");
    for (method, path, body) in &all {
        let access = access(method, path).unwrap();
        let service = service().await;
        let mut principals = vec![(None, false, String::new())];
        // Those for all maps come last: they may move a robot.
        for map in [Some("hall"), None] {
            for role in Role::ALL {
                principals.push((Some(role), map.is_some(), token(&service, role, map, None).await));
            }
        }
        for (role, is_scoped, token) in &principals {
            for target in [MISSING, FOREIGN, OWN] {
                let named = format!("{method} {path} {target:?} as {role:?}, scoped: {is_scoped}");
                let mut request = request(method, &at(path, target), body.clone());
                if role.is_some() {
                    request = with_token(request, token);
                }
                let found = outcome(service.ask_as_it_is(request).await, &named).await;
                let wanted = expected(access, *role, *is_scoped, target);
                // What does not exist, or what this operation has deleted, looks hidden to those
                // who may see all.
                let is_gone = target == MISSING || method == "DELETE";
                let may_miss = is_gone && wanted == Outcome::Admitted && found == Outcome::Hidden;
                assert!(found == wanted || may_miss, "{named}: {found:?}, not {wanted:?}");
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_tokens_open_nothing() {
    let service = service().await;
    let good = token(&service, Role::Admin, None, None).await;
    let revoked = token(&service, Role::Admin, None, None).await;
    let id: i64 = revoked.split('_').nth(1).unwrap().parse().unwrap();
    let revoke = with_token(request("DELETE", &format!("/api/v1/tokens/{id}"), ""), &good);
    assert_eq!(service.ask_as_it_is(revoke).await.status(), StatusCode::NO_CONTENT);
    let other = good.replacen("wmk_1_", "wmk_2_", 1);
    let bad = [
        (token(&service, Role::Admin, None, Some(1)).await, "expired"),
        (revoked, "revoked"),
        (other, "not one of this server"),
        (good[..good.len() - 1].to_owned(), "not one of this server"),
        (format!("{good}x"), "not one of this server"),
        ("wmk_".to_owned(), "not one of this server"),
    ];
    for (method, path, body) in operations(&service).await {
        if access(&method, &path) == Some(Access::Open) {
            continue;
        }
        for (token, reason) in &bad {
            let request = with_token(request(&method, &at(&path, OWN), body.clone()), token);
            let (status, problem) = read(service.ask_as_it_is(request).await).await;
            let detail = problem["detail"].as_str().unwrap_or_default();
            assert_eq!((status, problem["code"].as_str()), (401, Some("unauthenticated")), "{method} {path}");
            assert!(detail.contains(reason) && detail.contains("waymark token create"), "{detail}");
            assert!(!problem.to_string().contains(token.as_str()) || token == "wmk_", "{problem}");
        }
    }
    let basic = |value: &str| {
        let mut request = request("GET", "/api/v1/maps", "");
        request.headers_mut().insert(header::AUTHORIZATION, value.parse().unwrap());
        service.ask_as_it_is(request)
    };
    for value in ["Basic YTpi", "Bearer", "", good.as_str()] {
        assert_eq!(basic(value).await.status(), StatusCode::UNAUTHORIZED, "{value}");
    }
    assert_eq!(basic(&format!("bearer {good}")).await.status(), StatusCode::OK);
}

#[tokio::test]
async fn a_refusal_names_the_role_and_the_next_command() {
    let service = service().await;
    let viewer = token(&service, Role::Viewer, None, None).await;
    let (status, problem) =
        read(service.ask_as_it_is(with_token(request("POST", "/api/v1/maps", "{}"), &viewer)).await).await;
    assert_eq!((status, &problem["role"]), (403, &json!("operator")));
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("waymark token create NAME --role operator"), "{detail}");
    // Before the body is looked at.
    let (status, problem) = read(service.ask_as_it_is(request("POST", "/api/v1/maps", "{")).await).await;
    assert_eq!((status, &problem["role"]), (401, &json!("operator")));
    for path in
        ["/healthz", "/readyz", "/version", "/api/v1/healthz", "/", "/icon.svg", "/api/v1/openapi.json"]
    {
        let status = service.ask_as_it_is(request("GET", path, "")).await.status();
        assert_eq!(status, StatusCode::OK, "{path} is open");
    }
    // HEAD is answered by the route of GET, and needs as much.
    let head = || request("HEAD", "/api/v1/maps", "");
    assert_eq!(service.ask_as_it_is(head()).await.status(), StatusCode::UNAUTHORIZED);
    assert_eq!(service.ask(head()).await.status(), StatusCode::OK);
    assert_eq!(
        service.ask(request("PUT", "/api/v1/maps", "{}")).await.status(),
        StatusCode::METHOD_NOT_ALLOWED
    );
}

#[tokio::test]
async fn an_operation_without_a_row_is_refused_to_everybody() {
    let service = service().await;
    let admin = token(&service, Role::Admin, None, None).await;
    // As an operation would be that was added without its row: `/maps` has rows for GET and POST,
    // the other path none.
    let (forgotten, called) = ("/api/v1/forgotten", Arc::new(AtomicUsize::new(0)));
    let counted = called.clone();
    let handler = move || {
        counted.fetch_add(1, Ordering::Relaxed);
        async { "done" }
    };
    let routes = axum::routing::any(handler);
    let router = Router::new()
        .route(forgotten, routes.clone())
        .route("/api/v1/maps", routes)
        .route_layer(from_fn_with_state(service.app.clone(), router::operation));
    let ask = async |method: &str, path: &str, token: Option<&str>| {
        let asked = match token {
            Some(token) => with_token(request(method, path, ""), token),
            None => request(method, path, ""),
        };
        read(router.clone().oneshot(asked).await.unwrap()).await
    };
    for (method, path) in
        [("GET", forgotten), ("POST", forgotten), ("HEAD", forgotten), ("DELETE", "/api/v1/maps")]
    {
        for who in [admin.as_str(), service.local.as_str()] {
            assert_eq!(ask(method, path, Some(who)).await.0, 405, "{method} {path}");
        }
        assert_eq!(ask(method, path, None).await.0, 401, "{method} {path}");
    }
    assert_eq!(called.load(Ordering::Relaxed), 0, "the handler was called");
    assert_eq!(ask("GET", "/api/v1/maps", Some(&admin)).await.0, 200, "what has a row is admitted");
    assert_eq!(called.load(Ordering::Relaxed), 1);
}

#[tokio::test]
async fn only_a_local_client_is_told_where_the_local_token_is() {
    let service = service().await;
    let challenge = async |peer: &str, forwarded: bool| {
        let mut request = request("GET", "/api/v1/maps", "");
        request.extensions_mut().insert(peer::Peer::plain(peer.parse().unwrap()));
        if forwarded {
            request.headers_mut().insert("x-forwarded-for", "10.0.0.1".parse().unwrap());
        }
        let response = service.ask_as_it_is(request).await;
        response.headers()[header::WWW_AUTHENTICATE].to_str().unwrap().to_owned()
    };
    let told = "Bearer realm=\"waymark\", local_token_file=\"/data/local-token\"";
    let silent = "Bearer realm=\"waymark\"";
    assert_eq!(challenge("127.0.0.1:9", false).await, told);
    assert_eq!(challenge("[::ffff:127.0.0.1]:9", false).await, told);
    assert_eq!(challenge("127.0.0.1:9", true).await, silent);
    assert_eq!(challenge("10.0.0.1:9", false).await, silent);
}

#[tokio::test]
async fn what_a_principal_may_not_see_is_nowhere_in_its_answers() {
    let service = service().await;
    let link = r#"{"parent": {"map": "yard", "x_m": 0, "y_m": 0, "theta_rad": 0, "level_m": 0}}"#;
    assert_eq!(service.ask(request("PATCH", "/api/v1/maps/hall", link)).await.status(), StatusCode::OK);
    let own = token(&service, Role::Operator, Some("hall"), None).await;
    let ask = async |method: &str, path: &str, body: &str| {
        let request = with_token(request(method, &format!("/api/v1{path}"), body.to_owned()), &own);
        read(service.ask_as_it_is(request).await).await
    };
    let names = |page: &Value| {
        let items = page["items"].as_array().unwrap().iter();
        items.map(|item| item["name"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    for path in ["/maps", "/maps?limit=1", "/maps/hall", "/robots", "/robots?limit=1", "/whoami"] {
        let (status, body) = ask("GET", path, "").await;
        assert!(status == 200 && !body.to_string().contains("yard"), "{path}: {body}");
    }
    assert_eq!(names(&ask("GET", "/maps", "").await.1), ["hall"]);
    assert_eq!(names(&ask("GET", "/robots?limit=1", "").await.1), ["r1"]);
    assert_eq!(ask("GET", "/robots?limit=1", "").await.1["next"], Value::Null);
    for (method, path, body, code) in [
        ("GET", "/maps/hall/transform?to=yard", "", "unknown_map"),
        ("PUT", "/robots/r1", r#"{"map": "yard"}"#, "unknown_map"),
        ("PATCH", "/maps/hall", link, "unknown_map"),
        ("POST", "/maps/hall/mapping", r#"{"robot": "r2"}"#, "unknown_robot"),
        ("POST", "/maps/hall/gatherings", r#"{"robot": "r2", "known": false}"#, "unknown_robot"),
    ] {
        let (status, problem) = ask(method, path, body).await;
        assert_eq!((status, problem["code"].as_str()), (404, Some(code)), "{path}: {problem}");
    }
    let missing = ask("GET", "/maps/nowhere", "").await;
    let foreign = ask("GET", "/maps/yard", "").await;
    let same = foreign.1.to_string().replace("yard", "nowhere");
    assert_eq!((foreign.0, same), (missing.0, missing.1.to_string()));
}

#[tokio::test]
async fn an_expired_token_is_given_no_kept_answer() {
    let service = service().await;
    let token = token(&service, Role::Viewer, Some("hall"), Some(now_ms() + 1500)).await;
    let ask = || service.ask_as_it_is(with_token(request("GET", "/api/v1/maps/hall", ""), &token));
    let (first, kept) = (read(ask().await).await, read(ask().await).await);
    assert_eq!((first.0, &first), (200, &kept));
    tokio::time::sleep(Duration::from_millis(1600)).await;
    assert_eq!(ask().await.status(), StatusCode::UNAUTHORIZED);
}

#[tokio::test]
async fn a_revoked_token_ends_at_once_with_its_event_streams() {
    use futures::StreamExt as _;
    let service = service().await;
    let new = r#"{"name": "x", "role": "viewer", "maps": ["hall"], "valid_s": 60}"#;
    let (status, made) = read(service.ask(request("POST", "/api/v1/tokens", new)).await).await;
    assert_eq!((status, &made["token"]["maps"]), (201, &json!(["hall"])), "{made}");
    let text = made["text"].as_str().unwrap().to_owned();
    let ask = |path: &str| service.ask_as_it_is(with_token(request("GET", path, ""), &text));
    let (_, who) = read(ask("/api/v1/whoami").await).await;
    let wanted = json!({"name": "x", "role": "viewer", "maps": ["hall"], "token": 1,
        "expires_ms": made["token"]["expires_ms"]});
    assert_eq!(who, wanted);
    let mut events = ask("/api/v1/maps/hall/live").await.into_body().into_data_stream();
    let revoke = request("DELETE", "/api/v1/tokens/1", "");
    assert_eq!(service.ask(revoke).await.status(), StatusCode::NO_CONTENT);
    assert_eq!(ask("/api/v1/whoami").await.status(), StatusCode::UNAUTHORIZED);
    let end = tokio::time::timeout(Duration::from_secs(10), events.next()).await;
    assert!(matches!(end, Ok(None)), "the stream goes on: {end:?}");
    // The list has it, without its secret or digest.
    let (_, list) = service.get("/api/v1/tokens").await;
    let keys: Vec<_> = list["items"][0].as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(keys, ["created_ms", "expires_ms", "id", "maps", "name", "revoked_ms", "role"]);
    assert!(list["items"][0]["revoked_ms"].is_i64());
    let refusals: BTreeMap<&str, &str> = BTreeMap::from([
        (r#"{"name": "x", "role": "viewer", "maps": []}"#, "out_of_range"),
        (r#"{"name": "x", "role": "viewer", "valid_s": 0}"#, "out_of_range"),
        (r#"{"name": "X", "role": "viewer"}"#, "bad_name"),
        (r#"{"name": "x", "role": "king"}"#, "invalid_value"),
        (r#"{"name": "x", "role": "viewer", "maps": ["nowhere"]}"#, "unknown_map"),
    ]);
    for (body, code) in refusals {
        let (_, problem) = read(service.ask(request("POST", "/api/v1/tokens", body)).await).await;
        assert_eq!(problem["code"], code, "{body}");
    }
}
