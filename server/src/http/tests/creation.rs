//! Creations with a key: a repeat gets the first answer and changes nothing.

use super::{
    openapi::{bundle, prepared},
    teaching::blocks,
    *,
};
use crate::http::creation::CREATIONS;
use crate::store::db;
use axum::http::HeaderMap;
use serde_json::json;
use std::collections::BTreeMap;

/// Status, headers and body of an answer.
type Answered = (u16, HeaderMap, Vec<u8>);

impl Service {
    /// A POST with a key.
    pub(super) async fn keyed(&self, path: &str, key: &str, (kind, body): (&str, Vec<u8>)) -> Answered {
        let request = Request::builder().method("POST").uri(path).header(header::HOST, "localhost");
        let request = request.header(header::CONTENT_TYPE, kind).header("idempotency-key", key);
        let response = self.ask(request.body(Body::from(body)).unwrap()).await;
        let (head, body) = response.into_parts();
        (head.status.as_u16(), head.headers, to_bytes(body, 1 << 20).await.unwrap().to_vec())
    }

    /// The number of rows of every table that requests change.
    async fn rows(&self) -> BTreeMap<&'static str, i64> {
        let mut rows = BTreeMap::new();
        for (table, count) in [
            ("maps", "SELECT count(*) FROM maps"),
            ("landmarks", "SELECT count(*) FROM landmarks"),
            ("views", "SELECT count(*) FROM views"),
            ("jobs", "SELECT count(*) FROM jobs"),
            ("gatherings", "SELECT count(*) FROM gatherings"),
            ("runs", "SELECT count(*) FROM runs"),
            ("robot_certificates", "SELECT count(*) FROM robot_certificates"),
            ("kept_answers", "SELECT count(*) FROM kept_answers"),
        ] {
            rows.insert(table, db::query_scalar(count).fetch_one(self.store.reads()).await.unwrap());
        }
        rows
    }
}

fn code(body: &[u8]) -> Value {
    serde_json::from_slice::<Value>(body).unwrap()["code"].take()
}

/// The body of a creation, with this boundary where it is a form.
fn body(path: &str, examples: &BTreeMap<String, Value>, boundary: &str) -> (String, Vec<u8>) {
    if let Some(example) = examples.get(&format!("POST {path}")).filter(|example| example["image"].is_null())
    {
        return ("application/json".to_owned(), example.to_string().into_bytes());
    }
    assert!(path.ends_with("/views"), "{path} has no example that can be sent as it is");
    let part =
        |name: &str| format!("--{boundary}\r\ncontent-disposition: form-data; name=\"{name}\"\r\n\r\n");
    let form = [
        format!("{}true\r\n{}", part("whole_image"), part("image")).into_bytes(),
        blocks(7),
        format!("\r\n--{boundary}--\r\n").into_bytes(),
    ];
    (format!("multipart/form-data; boundary={boundary}"), form.concat())
}

#[tokio::test(flavor = "multi_thread")]
async fn every_creation_is_made_once_under_its_key() {
    let examples: BTreeMap<String, Value> = serde_json::from_str(include_str!("../examples.json")).unwrap();
    for &(path, _) in CREATIONS {
        let (service, gathering) = prepared(path).await;
        let at =
            [("{map}", "hall"), ("{landmark}", "poster"), ("{robot}", "r1"), ("{gathering}", &gathering)]
                .iter()
                .fold(format!("/api/v1{path}"), |at, (name, value)| at.replace(name, value));
        let at = if path == "/bundles" { format!("{at}?name=new") } else { at };
        let packed = if path == "/bundles" { bundle(&service).await } else { Vec::new() };
        let body = |boundary| match path {
            "/bundles" => ("application/zip".to_owned(), packed.clone()),
            path => body(path, &examples, boundary),
        };
        let (kind, sent) = body("one");
        let (status, headers, first) = service.keyed(&at, "k", (&kind, sent)).await;
        let text = String::from_utf8_lossy(&first);
        assert!(
            (200..300).contains(&status) && !headers.contains_key("idempotency-replayed"),
            "{path}: {text}"
        );
        let rows = service.rows().await;
        assert_eq!(rows["kept_answers"], 1, "{path}: the answer is not kept");
        let (kind, sent) = body("other");
        let (again, headers, repeat) = service.keyed(&at, "k", (&kind, sent)).await;
        assert_eq!((again, String::from_utf8_lossy(&repeat)), (status, text), "{path}");
        assert_eq!(headers["idempotency-replayed"], "true", "{path}");
        let (status, _, other) = service.keyed(&at, "k", ("application/json", b"{\"x\": 1}".to_vec())).await;
        assert_eq!((status, code(&other)), (422, json!("idempotency_key_reused")), "{path}");
        assert_eq!(service.rows().await, rows, "{path}: a repeat has changed something");
    }
}

#[tokio::test]
async fn a_refused_creation_leaves_its_key_free() {
    let service = Service::start(Limits::default()).await;
    let map = |name: &str| ("application/json", json!({ "name": name }).to_string().into_bytes());
    let (status, _, refused) = service.keyed("/api/v1/maps", "k", map("hall")).await;
    assert_eq!((status, code(&refused)), (409, json!("exists")));
    assert_eq!(service.rows().await["kept_answers"], 0);
    assert_eq!(service.keyed("/api/v1/maps", "k", map("attic")).await.0, 201);
    let (status, _, refused) = service.keyed("/api/v1/maps", "two words", map("cellar")).await;
    assert_eq!((status, code(&refused)), (422, json!("invalid_value")));
    // Where nothing is created, a key has no meaning.
    let pose = json!({ "pose": { "x_m": 0.0, "y_m": 0.0, "theta_rad": 0.0 } }).to_string().into_bytes();
    for _ in 0..2 {
        let (status, headers, _) =
            service.keyed("/api/v1/maps/hall/visible", "v", ("application/json", pose.clone())).await;
        assert!(status == 200 && !headers.contains_key("idempotency-replayed"));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repeat_while_the_first_is_at_work_is_told_so() {
    let service = Service::start(Limits::default()).await;
    let writer = hold_writer(&service.store).await;
    let map = || ("application/json", json!({ "name": "late" }).to_string().into_bytes());
    let mut first = Box::pin(service.keyed("/api/v1/maps", "k", map()));
    while !service.store.is_at_work("local k") {
        assert!(futures::poll!(first.as_mut()).is_pending(), "answered while the writer is held");
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    let (status, _, repeat) = service.keyed("/api/v1/maps", "k", map()).await;
    assert_eq!((status, code(&repeat)), (409, json!("in_progress")));
    drop(writer);
    assert_eq!(first.await.0, 201);
    assert_eq!(service.keyed("/api/v1/maps", "k", map()).await.1["idempotency-replayed"], "true");
}
