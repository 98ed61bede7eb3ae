//! The stream of events: what it tells whom, how it is resumed, and when it ends.

use super::{
    authorisation::{token, with_token},
    *,
};
use crate::{events::MAX_EVENTS, store::robots};
use axum::body::BodyDataStream;
use futures::StreamExt as _;
use protos::api::{Role, ServerEventBody};
use serde_json::json;

/// An open stream.
struct Reader(BodyDataStream, String);

impl Reader {
    /// The next event; `None` at the end of the stream.
    async fn next(&mut self) -> Option<Value> {
        loop {
            if let Some((block, rest)) = self.1.split_once("\n\n") {
                let data = block.lines().find_map(|line| line.strip_prefix("data: "));
                let event = data.map(|data| serde_json::from_str::<Value>(data).unwrap());
                if let Some(event) = &event {
                    assert!(
                        block.contains(&format!("id: {}\n", event["id"].as_str().unwrap()))
                            || block.ends_with(event["id"].as_str().unwrap()),
                        "{block}"
                    );
                }
                self.1 = rest.to_owned();
                if event.is_some() {
                    return event;
                }
                continue;
            }
            let part = tokio::time::timeout(Duration::from_secs(20), self.0.next()).await.expect("in time");
            self.1.push_str(std::str::from_utf8(&part?.unwrap()).unwrap());
        }
    }

    async fn kinds(&mut self, count: usize) -> Vec<String> {
        let mut kinds = Vec::new();
        for _ in 0..count {
            kinds.push(self.next().await.unwrap()["kind"].as_str().unwrap().to_owned());
        }
        kinds
    }
}

impl Service {
    async fn read_events(&self, query: &str, token: Option<&str>, last: Option<&str>) -> Reader {
        let mut asked = request("GET", &format!("/api/v1/events{query}"), "");
        if let Some(token) = token {
            asked = with_token(asked, token);
        }
        if let Some(last) = last {
            asked.headers_mut().insert("last-event-id", last.parse().unwrap());
        }
        let response = self.ask(asked).await;
        assert_eq!(response.status(), StatusCode::OK, "{query}");
        Reader(response.into_body().into_data_stream(), String::new())
    }

    fn tell(&self, map: &str, version: u64) {
        let what = ServerEventBody::MapChanged { map: map.to_owned(), version: Some(version) };
        self.store.events().tell(what);
    }
}

#[tokio::test]
async fn a_reader_resumes_after_its_last_event_and_is_told_when_too_much_is_missing() {
    let service = Service::start(Limits::default()).await;
    let mut reader = service.read_events("", None, None).await;
    let ready = reader.next().await.unwrap();
    assert_eq!(ready["kind"], "ready");
    service.tell("hall", 2);
    service.tell("hall", 3);
    let second = reader.next().await.unwrap();
    assert_eq!((&second["kind"], &second["version"]), (&json!("map_changed"), &json!(2)));
    drop(reader);
    let mut resumed = service.read_events("", None, second["id"].as_str()).await;
    assert_eq!(resumed.next().await.unwrap()["version"], 3);
    // As a query, for a first connection of a browser.
    let query = format!("?last_event_id={}", ready["id"].as_str().unwrap());
    let mut resumed = service.read_events(&query, None, None).await;
    assert_eq!(resumed.next().await.unwrap()["version"], 2);
    for version in 0..=MAX_EVENTS as u64 {
        service.tell("hall", version);
    }
    let mut late = service.read_events("", None, second["id"].as_str()).await;
    assert_eq!(late.next().await.unwrap()["kind"], "reset");
    service.tell("hall", 7);
    assert_eq!(late.next().await.unwrap()["version"], 7);
    let mut foreign = service.read_events("", None, Some("1-1")).await;
    assert_eq!(foreign.next().await.unwrap()["kind"], "reset");
}

#[tokio::test]
async fn a_reader_hears_only_what_its_token_may_see_and_what_it_asked_for() {
    let service = Service::start(Limits::default()).await;
    service.store.write(|tx| Box::pin(maps::create(tx, "yard", DistanceKind::Both, 9))).await.unwrap();
    service.store.write(|tx| Box::pin(robots::put(tx, "r2", "yard", 9))).await.unwrap();
    let own = token(&service, Role::Admin, Some("hall"), None).await;
    let mut scoped = service.read_events("", Some(&own), None).await;
    let mut all = service.read_events("", None, None).await;
    let mut yard = service.read_events("?map=yard", None, None).await;
    let mut jobs = service.read_events("?kind=job,tokens_changed", None, None).await;
    service.tell("yard", 2);
    service.store.events().tell(ServerEventBody::TokensChanged);
    service.tell("hall", 3);
    assert_eq!(all.kinds(4).await, ["ready", "map_changed", "tokens_changed", "map_changed"]);
    assert_eq!(scoped.kinds(1).await, ["ready"]);
    let heard = scoped.next().await.unwrap();
    assert_eq!(heard["map"], "hall", "{heard}");
    assert_eq!(yard.kinds(2).await, ["ready", "map_changed"]);
    assert_eq!(jobs.kinds(2).await, ["ready", "tokens_changed"]);
    for (query, status, code) in [
        ("?kind=weather", 422, "invalid_value"),
        ("?map=nowhere", 404, "unknown_map"),
        ("?colour=red", 400, "bad_query"),
    ] {
        let (found, problem) = service.get(&format!("/api/v1/events{query}")).await;
        assert_eq!((found, &problem["code"]), (status, &json!(code)), "{query}");
    }
    let foreign = with_token(request("GET", "/api/v1/events?map=yard", ""), &own);
    assert_eq!(service.ask(foreign).await.status(), StatusCode::NOT_FOUND);
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_gatherings_backups_and_views_are_told() {
    let service = Service::start(Limits::default()).await;
    let mut reader = service.read_events("", None, None).await;
    reader.next().await.unwrap();
    let parts = [("create", "true"), ("whole_image", "true")];
    assert_eq!(service.upload("sign", teaching::blocks(1), &parts).await.0, 201);
    let view = reader.next().await.unwrap();
    assert_eq!((&view["kind"], &view["landmark"]), (&json!("landmark_changed"), &json!("sign")));
    service.learn("sign").await;
    let mut states = Vec::new();
    while states.last() != Some(&json!("done")) {
        let event = reader.next().await.unwrap();
        if event["kind"] == "job" {
            states.push(event["state"].clone());
        }
    }
    assert_eq!(states, ["queued", "running", "done"]);
    let begin = request("POST", "/api/v1/maps/hall/gatherings", r#"{"robot": "r1", "known": false}"#);
    assert_eq!(service.ask(begin).await.status(), StatusCode::CREATED);
    let begun = reader.next().await.unwrap();
    assert_eq!((&begun["kind"], &begun["change"]), (&json!("gathering"), &json!("begun")));
    assert_eq!(service.ask(request("POST", "/api/v1/backups", "")).await.status(), StatusCode::ACCEPTED);
    for state in ["running", "complete"] {
        let backup = reader.next().await.unwrap();
        assert_eq!((&backup["kind"], &backup["state"]), (&json!("backup"), &json!(state)));
    }
}

#[tokio::test]
async fn logging_out_ends_the_open_streams_of_the_session_and_of_no_other() {
    let service = Service::start(Limits::default()).await;
    let session = async || {
        let login = format!(r#"{{"token": "{}"}}"#, service.local);
        let mut login = request("POST", "/login", login);
        login.headers_mut().insert("x-waymark-page", "1".parse().unwrap());
        let answer = service.ask_as_it_is(login).await;
        assert_eq!(answer.status(), StatusCode::NO_CONTENT);
        let set = answer.headers()[header::SET_COOKIE].to_str().unwrap().to_owned();
        set.split(';').next().unwrap().to_owned()
    };
    let with = |method: &str, path: &str, cookie: &str| {
        let mut asked = request(method, path, "");
        asked.headers_mut().insert(header::COOKIE, cookie.parse().unwrap());
        asked.headers_mut().insert("x-waymark-page", "1".parse().unwrap());
        service.ask_as_it_is(asked)
    };
    let (first, second) = (session().await, session().await);
    let mut readers = Vec::new();
    for (path, cookie) in
        [("/api/v1/events", &first), ("/api/v1/maps/hall/live", &first), ("/api/v1/events", &second)]
    {
        let response = with("GET", path, cookie).await;
        assert_eq!(response.status(), StatusCode::OK, "{path}");
        readers.push(Reader(response.into_body().into_data_stream(), String::new()));
    }
    assert_eq!(readers[0].kinds(1).await, ["ready"]);
    assert_eq!(readers[2].kinds(1).await, ["ready"]);
    assert_eq!(with("POST", "/logout", &first).await.status(), StatusCode::NO_CONTENT);
    assert_eq!(readers[0].next().await, None);
    assert_eq!(readers[1].next().await, None);
    service.tell("hall", 9);
    assert_eq!(readers[2].next().await.unwrap()["version"], 9);
}
