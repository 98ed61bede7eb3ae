//! Changes say which revision they are meant for; what somebody else has changed meanwhile is not
//! overwritten.

use super::{
    openapi::{read_long, takes},
    teaching::blocks,
    *,
};
use crate::{http::revision::REVISED, store::landmarks};
use axum::http::HeaderMap;
use map::landmark_health::LandmarkHealth;
use serde_json::json;

/// Where an example of everything with a revision is, and how it is changed.
const CHANGES: [(&str, &str, &str); 6] = [
    ("/maps/hall", "PATCH", r#"{"site": "SITE"}"#),
    ("/maps/hall/walls", "PUT", r#"{"segments": [{"a": [0.0, 0.0], "b": [6.0, 0.0]}]}"#),
    ("/maps/hall/underlay", "PUT", ""),
    ("/maps/hall/visibility-settings", "PUT", r#"{"focal_px": FOCAL}"#),
    ("/maps/hall/modalities", "PUT", r#"{"fusion_mode": "MODE"}"#),
    ("/maps/hall/landmarks/poster", "PATCH", r#"{"size": {"width_m": FOCAL, "height_m": 1.0}}"#),
];

/// The body of a change, another one each time, and its media type.
fn body(path: &str, text: &str, turn: usize) -> (String, Vec<u8>) {
    if path.ends_with("/underlay") {
        let part = |name: &str| format!("--b\r\ncontent-disposition: form-data; name=\"{name}\"\r\n\r\n");
        let form = [
            format!("{}0.{turn}\r\n{}", part("metres_per_pixel"), part("image")).into_bytes(),
            blocks(7),
            b"\r\n--b--\r\n".to_vec(),
        ];
        return ("multipart/form-data; boundary=b".to_owned(), form.concat());
    }
    let text = text.replace("SITE", &format!("s{turn}")).replace("FOCAL", &format!("{}", 20 + turn));
    let text = text.replace("MODE", ["near_best", "all", "best"][turn % 3]);
    ("application/json".to_owned(), text.into_bytes())
}

impl Service {
    /// A change with this `If-Match`: status, headers, body.
    async fn change(
        &self,
        (method, path): (&str, &str),
        if_match: Option<&str>,
        (kind, body): (String, Vec<u8>),
    ) -> (u16, HeaderMap, Value) {
        let request = Request::builder().method(method).uri(format!("/api/v1{path}"));
        let mut request = request.header(header::HOST, "localhost").header(header::CONTENT_TYPE, kind);
        if let Some(tag) = if_match {
            request = request.header(header::IF_MATCH, tag);
        }
        let response = self.ask(request.body(Body::from(body)).unwrap()).await;
        let headers = response.headers().clone();
        let (status, body) = read(response).await;
        (status, headers, body)
    }

    /// The revision of what is there.
    async fn tag(&self, path: &str) -> String {
        let response = self.ask(request("GET", &format!("/api/v1{path}"), "")).await;
        assert_eq!(response.status(), StatusCode::OK, "{path}");
        response.headers()[header::ETAG].to_str().unwrap().to_owned()
    }
}

/// A service with a landmark that has a view, and with an underlay.
async fn edited() -> Service {
    let service = Service::start(Limits::default()).await;
    assert_eq!(
        service.upload("poster", blocks(1), &[("create", "true"), ("whole_image", "true")]).await.0,
        201
    );
    let path = "/maps/hall/underlay";
    let put = service.change(("PUT", path), Some("*"), body(path, "", 1)).await;
    assert_eq!(put.0, 200, "{}", put.2);
    service
}

#[tokio::test(flavor = "multi_thread")]
async fn of_two_editors_the_second_is_told_and_overwrites_nothing() {
    let service = edited().await;
    for (path, method, text) in CHANGES {
        let at = (method, path);
        let seen = service.tag(path).await;
        assert!(seen.starts_with('"') && seen.ends_with('"'), "{path}: {seen} is no strong tag");
        let (status, headers, first) = service.change(at, Some(&seen), body(path, text, 2)).await;
        assert_eq!(status, 200, "{path}: {first}");
        let present = service.tag(path).await;
        assert_ne!(present, seen, "{path}: changed, and the same revision");
        assert_eq!(headers[header::ETAG], present.as_str(), "{path}");
        let before = service.get(&format!("/api/v1{path}")).await;
        let (status, headers, second) = service.change(at, Some(&seen), body(path, text, 3)).await;
        assert_eq!((status, &second["code"]), (412, &json!("changed_meanwhile")), "{path}");
        assert_eq!(headers[header::ETAG], present.as_str(), "{path}: the present revision is not told");
        let (status, _, none) = service.change(at, None, body(path, text, 3)).await;
        assert_eq!((status, &none["code"]), (428, &json!("precondition_required")), "{path}");
        assert!(none["detail"].as_str().unwrap().contains("If-Match: *"), "{none}");
        assert_eq!(service.get(&format!("/api/v1{path}")).await, before, "{path}: changed all the same");
        assert_eq!(service.change(at, Some("*"), body(path, text, 3)).await.0, 200, "{path}");
    }
    for path in ["/maps/hall/landmarks/poster", "/maps/hall/underlay"] {
        let gone =
            async |tag: &str| service.change(("DELETE", path), Some(tag), (String::new(), vec![])).await;
        let stale = "\"1.1\"";
        assert_eq!(gone(stale).await.0, 412, "{path}");
        let present = service.tag(path).await;
        assert_eq!(gone(&present).await.0, 204, "{path}");
    }
    let made = service.ask(request("POST", "/api/v1/maps", r#"{"name": "attic"}"#)).await;
    let (_, map) = read(made).await;
    let tag = format!("\"{}\"", map["revision"].as_str().unwrap());
    assert_eq!(service.tag("/maps/attic").await, tag);
    let new = request("POST", "/api/v1/maps/attic/landmarks", r#"{"name": "new"}"#);
    assert_eq!(service.ask(new).await.status(), StatusCode::CREATED);
    let delete = async |tag: &str| {
        service.change(("DELETE", "/maps/attic"), Some(tag), (String::new(), vec![])).await.0
    };
    assert_eq!(delete(&tag).await, 412, "deleted with a landmark that nobody has seen");
    let tag = service.tag("/maps/attic").await;
    assert_eq!(delete(&tag).await, 204);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_revision_counts_edits_and_lessons_and_not_what_robots_do() {
    let service = edited().await;
    let (map, landmark) = ("/maps/hall", "/maps/hall/landmarks/poster");
    let tags = async || (service.tag(map).await, service.tag(landmark).await);
    let before = tags().await;
    // A finding of robots, and that the landmark is in place again.
    for (health, finding) in [
        (LandmarkHealth::Quarantined, Some(r#"{"kind": "missing", "missed_frames": 20}"#)),
        (LandmarkHealth::Sound, None),
    ] {
        let found = service.store.write(move |tx| {
            Box::pin(
                async move { landmarks::set_health(tx, "hall", "poster", health, finding).await.map(drop) },
            )
        });
        found.await.unwrap();
    }
    assert_eq!(tags().await, before, "changed by what robots have found");
    // A person's word on it.
    let flagged = ("application/json".to_owned(), br#"{"health": "flagged"}"#.to_vec());
    assert_eq!(service.change(("PATCH", landmark), Some(&before.1), flagged).await.0, 200);
    let judged = tags().await;
    assert!(judged.0 != before.0 && judged.1 != before.1, "{judged:?}");
    // A view, and a lesson.
    assert_eq!(service.upload("poster", blocks(2), &[("whole_image", "true")]).await.0, 201);
    let viewed = tags().await;
    assert!(viewed.0 != judged.0 && viewed.1 != judged.1, "{viewed:?}");
    service.learn("poster").await;
    let learnt = tags().await;
    assert!(learnt.0 != viewed.0 && learnt.1 != viewed.1, "{learnt:?}");
    // Another landmark of the same name is another thing.
    let (none, name) = (|| (String::new(), vec![]), r#"{"name": "poster"}"#);
    assert_eq!(service.change(("DELETE", landmark), Some(&learnt.1), none()).await.0, 204);
    assert_eq!(service.ask(request("POST", "/api/v1/maps/hall/landmarks", name)).await.status(), 201);
    assert_eq!(service.change(("DELETE", landmark), Some("\"1.1\", \"1.2\", \"1.3\""), none()).await.0, 412);
}

#[tokio::test]
async fn the_document_asks_for_revisions_where_the_server_does() {
    let service = Service::start(Limits::default()).await;
    let (_, document) = read_long(&service, "/api/v1/openapi.json").await;
    let mut found = 0;
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let asks = takes(operation, "header.If-Match");
            let below = path.trim_start_matches("/api/v1");
            let listed =
                REVISED.iter().any(|(at, changes)| *at == below && changes.contains(&method.as_str()));
            assert_eq!(asks, listed, "{method} {path}");
            found += usize::from(asks);
        }
    }
    assert_eq!(found, 13);
}
