//! The OpenAPI document: names of schemas are unique, every body has an example, and each example
//! is accepted.

use super::*;
use crate::store::{landmark_placement::tests::seen_from, track_acceptance::tests::gathered};
use serde_json::json;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs, io,
    path::{Path, PathBuf},
};

/// Names of the Rust types with a schema, by file.
fn schema_types() -> Vec<(String, PathBuf)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut folders: Vec<PathBuf> = ["protos", "server", "engine", "client", "map", "vision"]
        .map(|name| root.join(name).join("src"))
        .to_vec();
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests/openapi.rs") {
                let source = fs::read_to_string(&path).unwrap();
                for (at, _) in source.match_indices("utoipa::ToSchema") {
                    let name = source[at..].lines().find_map(|line| {
                        let rest =
                            line.strip_prefix("pub struct ").or_else(|| line.strip_prefix("pub enum "))?;
                        rest.split(|c: char| !c.is_alphanumeric()).next()
                    });
                    found.push((name.expect("a type after its schema").to_owned(), path.clone()));
                }
            }
        }
    }
    found
}

#[tokio::test]
async fn no_two_types_have_schemas_of_one_name() {
    let mut by_name: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for (name, path) in schema_types() {
        by_name.entry(name).or_default().push(path);
    }
    by_name.retain(|_, paths| paths.len() > 1);
    assert!(by_name.is_empty(), "utoipa keeps one of these without a word: {by_name:?}");

    // Nothing but these types is in the document.
    let service = Service::start(Limits::default()).await;
    let (_, document) = read_long(&service, "/api/v1/openapi.json").await;
    let types: BTreeSet<String> = schema_types().into_iter().map(|(name, _)| name).collect();
    let schemas = document["components"]["schemas"].as_object().unwrap();
    assert!(schemas.len() > 50, "{}", schemas.len());
    for name in schemas.keys() {
        // `Page_Landmark` is a page of landmarks.
        assert!(
            name.split('_').all(|part| types.contains(part)),
            "{name} is no type with a schema of its own"
        );
    }
}

pub(super) async fn read_long(service: &Service, path: &str) -> (u16, Value) {
    let response = service.ask(request("GET", path, "")).await;
    let status = response.status().as_u16();
    let bytes = to_bytes(response.into_body(), 8 << 20).await.unwrap();
    (status, serde_json::from_slice(&bytes).unwrap())
}

/// A bundle of map `hall`.
pub(super) async fn bundle(service: &Service) -> Vec<u8> {
    let response = service.ask(request("GET", "/api/v1/maps/hall/bundle", "")).await;
    assert_eq!(response.status().as_u16(), 200);
    to_bytes(response.into_body(), 8 << 20).await.unwrap().to_vec()
}

/// A picture of a poster: PNG.
fn poster(seed: u64) -> Vec<u8> {
    let poster = sim::posters::poster_of_size(seed, 120, 1.0);
    engine::picture::png(poster.width(), poster.height(), poster.data()).unwrap()
}

/// Map `hall` with walls, the landmark `poster` with a view, and robot `r1`, which has been
/// recorded or has gathered where the operation asks for it.
pub(super) async fn prepared(operation: &str) -> (Service, String) {
    let service = Service::start(Limits::default()).await;
    let walls = json!({ "segments": [{ "a": [0.0, 0.0], "b": [6.0, 0.0] }] }).to_string();
    assert_eq!(service.ask(request("PUT", "/api/v1/maps/hall/walls", walls)).await.status(), StatusCode::OK);
    let parts = [("create", "true"), ("whole_image", "true"), ("width_m", "0.6"), ("height_m", "0.84")];
    assert_eq!(service.upload("poster", poster(1), &parts).await.0, 201);
    let mut gathering = 0;
    if operation.ends_with("/accept") {
        gathering = gathered(&service.store, "hall", std::iter::once(seen_from(1.0, 1, 0.0))).await;
    }
    if operation.ends_with("/merge") {
        let new = request("POST", "/api/v1/maps/hall/landmarks", r#"{"name": "door"}"#);
        assert_eq!(service.ask(new).await.status(), StatusCode::CREATED);
    }
    if operation.ends_with("/reference") || operation.ends_with("/{robot}/pose") {
        driven(&service);
    }
    (service, gathering.to_string())
}

#[tokio::test(flavor = "multi_thread")]
async fn every_body_has_an_example_and_the_server_takes_it() {
    let service = Service::start(Limits::default()).await;
    let (_, document) = read_long(&service, "/api/v1/openapi.json").await;
    let mut sent = BTreeSet::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let Some((kind, body)) =
                operation["requestBody"]["content"].as_object().and_then(|c| c.iter().next())
            else {
                continue;
            };
            let name = format!("{} {}", method.to_uppercase(), path.trim_start_matches("/api/v1"));
            assert!(
                !body["example"].is_null(),
                "{name} has no example: add it to server/src/http/examples.json"
            );
            let (service, gathering) = prepared(&name).await;
            let mut at = path.clone();
            for (parameter, value) in [
                ("{map}", "hall"),
                ("{landmark}", "poster"),
                ("{robot}", "r1"),
                ("{camera}", "front"),
                ("{gathering}", gathering.as_str()),
            ] {
                at = at.replace(parameter, value);
            }
            let method = method.to_uppercase();
            let (status, answer) = if kind == "multipart/form-data" {
                let parts = body["example"].as_object().unwrap().iter();
                let parts = parts.map(|(name, value)| (name.as_str(), value.as_str().unwrap()));
                let (files, texts): (Vec<_>, Vec<_>) = parts.partition(|(_, value)| value.starts_with('@'));
                assert_eq!(files.iter().map(|(name, _)| *name).collect::<Vec<_>>(), ["image"], "{name}");
                service.send_form(&method, &at, poster(2), &texts).await
            } else if kind == "application/zip" {
                let (status, _, answer) =
                    service.keyed(&format!("{at}?name=new"), "z", (kind, bundle(&service).await)).await;
                (status, serde_json::from_slice(&answer).unwrap())
            } else if kind == "application/octet-stream" {
                read(service.ask(request(&method, &format!("{at}?kind=txt"), "0, 0, 4, 0")).await).await
            } else {
                assert_eq!(kind, "application/json", "{name}");
                read(service.ask(request(&method, &at, body["example"].to_string())).await).await
            };
            assert!((200..300).contains(&status), "{name}: {status} {answer}");
            sent.insert(name);
        }
    }
    let examples: BTreeMap<String, Value> = serde_json::from_str(include_str!("../examples.json")).unwrap();
    assert_eq!(
        sent,
        examples.into_keys().collect(),
        "examples of operations that do not exist, or have no body"
    );
}

/// Where the document is kept, for programs that make clients of it.
const KEPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/openapi.json");
/// Largest size of the document, in bytes: as it is kept and as it is served.
const MAX_BYTES: usize = 285_000;

/// JSON with one line for every operation and every part of `components`, so that a change shows
/// what it changes.
#[derive(Default)]
struct Lines {
    depth: usize,
}

impl Lines {
    /// Objects down to this depth have a line for each key.
    const DEPTH: usize = 3;

    fn end(&self, to: &mut (impl io::Write + ?Sized)) -> io::Result<()> {
        write!(to, "\n{:1$}", "", self.depth)
    }
}

impl serde_json::ser::Formatter for Lines {
    fn begin_object<W: io::Write + ?Sized>(&mut self, to: &mut W) -> io::Result<()> {
        self.depth += 1;
        to.write_all(b"{")
    }

    fn begin_object_key<W: io::Write + ?Sized>(&mut self, to: &mut W, first: bool) -> io::Result<()> {
        if !first {
            to.write_all(b",")?;
        }
        if self.depth <= Self::DEPTH { self.end(to) } else { Ok(()) }
    }

    fn end_object<W: io::Write + ?Sized>(&mut self, to: &mut W) -> io::Result<()> {
        self.depth -= 1;
        if self.depth < Self::DEPTH {
            self.end(to)?;
        }
        to.write_all(b"}")
    }
}

#[test]
fn the_document_in_docs_is_that_of_the_code() {
    let (_, document) = crate::http::router::parts(&Limits::default());
    let mut text = Vec::new();
    let mut to = serde_json::Serializer::with_formatter(&mut text, Lines::default());
    serde::Serialize::serialize(&document, &mut to).unwrap();
    let text = String::from_utf8(text).unwrap() + "\n";
    if std::env::var_os("WAYMARK_REFRESH").is_some() {
        fs::write(KEPT, &text).unwrap();
    }
    let kept = fs::read_to_string(KEPT).unwrap_or_default();
    assert!(
        kept == text,
        "docs/openapi.json is stale: WAYMARK_REFRESH=1 cargo test -p server the_document_in_docs"
    );
    let served = serde_json::to_vec(&document).unwrap();
    assert!(kept.len().max(served.len()) <= MAX_BYTES, "{} and {} bytes", kept.len(), served.len());
}

/// The document as JSON.
fn document() -> Value {
    serde_json::to_value(crate::http::router::parts(&Limits::default()).1).unwrap()
}

/// Every operation of a document: method, path, and what is said of it.
pub(super) fn operations(document: &Value) -> impl Iterator<Item = (&str, &str, &Value)> {
    let paths = document["paths"].as_object().unwrap().iter();
    paths.flat_map(|(path, item)| {
        item.as_object().unwrap().iter().map(move |(method, said)| (method.as_str(), path.as_str(), said))
    })
}

/// Whether an operation takes this parameter of `components`.
pub(super) fn takes(operation: &Value, parameter: &str) -> bool {
    let reference = format!("#/components/parameters/{parameter}");
    operation["parameters"].as_array().into_iter().flatten().any(|p| p["$ref"] == reference)
}

#[test]
fn every_operation_names_what_guard_extractors_and_store_may_answer() {
    let document = document();
    let mut count = 0;
    for (method, path, operation) in operations(&document) {
        count += 1;
        let responses = operation["responses"].as_object().unwrap();
        let mut needed = vec!["default"];
        if path.contains('{') {
            needed.push("404");
        }
        if !operation["requestBody"].is_null() {
            needed.extend(["413", "415", "422"]);
        }
        for status in needed {
            assert!(responses.contains_key(status), "{method} {path}: no {status}");
        }
        for (status, response) in responses {
            if status.as_str() < "400" {
                let said = response["description"].as_str().unwrap_or_default();
                assert!(!said.is_empty(), "{method} {path} {status}: no description");
            } else {
                let reference = response["$ref"].as_str().unwrap_or_default();
                let at = reference.strip_prefix('#').unwrap_or("/none");
                let shared =
                    document.pointer(at).unwrap_or_else(|| panic!("{method} {path} {status}: {response}"));
                let kinds: Vec<_> = shared["content"].as_object().unwrap().keys().collect();
                assert_eq!(kinds, ["application/problem+json"], "{reference}");
                assert!(shared["description"].as_str().is_some_and(|d| !d.is_empty()), "{reference}");
            }
        }
    }
    assert!(count > 60, "{count}");
}

/// Verbs that an operation's id begins with.
const VERBS: [&str; 29] = [
    "accept",
    "calibrate",
    "cancel",
    "check",
    "compute",
    "copy",
    "create",
    "delete",
    "finish",
    "follow",
    "get",
    "learn",
    "list",
    "load",
    "localise",
    "merge",
    "publish",
    "rank",
    "read",
    "recognise",
    "replay",
    "revoke",
    "rollBack",
    "save",
    "set",
    "start",
    "stop",
    "undo",
    "update",
];

#[test]
fn every_operation_has_an_id_of_its_own_named_by_action_and_thing() {
    let document = document();
    let mut seen = BTreeMap::new();
    for (method, path, operation) in operations(&document) {
        let id = operation["operationId"].as_str().unwrap_or_default();
        let thing = VERBS.iter().find_map(|verb| id.strip_prefix(verb)).unwrap_or_default();
        let is_named = thing.starts_with(|c: char| c.is_ascii_uppercase())
            && thing.chars().all(|c| c.is_ascii_alphanumeric());
        assert!(is_named, "{method} {path}: `{id}` is no verb with a thing, as listMaps");
        if let Some(other) = seen.insert(id.to_owned(), path) {
            panic!("{id} is both {other} and {path}");
        }
    }
    assert!(seen.len() > 100, "{}", seen.len());
}

/// Everything that `value` refers to, directly or not.
fn reached<'a>(document: &'a Value, value: &'a Value, found: &mut BTreeSet<&'a str>) {
    if let Some(reference) = value["$ref"].as_str().filter(|reference| !found.contains(reference)) {
        found.insert(reference);
        let target = document.pointer(reference.strip_prefix('#').unwrap_or("/none"));
        reached(document, target.unwrap_or_else(|| panic!("{reference} leads nowhere")), found);
    }
    match value {
        Value::Object(fields) => fields.values().for_each(|value| reached(document, value, found)),
        Value::Array(items) => items.iter().for_each(|value| reached(document, value, found)),
        _ => {}
    }
}

#[test]
fn every_part_of_components_is_used_and_nothing_shared_is_said_twice() {
    let document = document();
    let mut found = BTreeSet::new();
    reached(&document, &document["paths"], &mut found);
    for kind in ["schemas", "responses", "parameters", "headers"] {
        let parts = document["components"][kind].as_object().unwrap();
        for name in parts.keys() {
            let reference = format!("#/components/{kind}/{name}");
            assert!(found.contains(reference.as_str()), "{reference} is used by nothing");
        }
    }
    let mut said = BTreeMap::new();
    for (method, path, operation) in operations(&document) {
        for parameter in operation["parameters"].as_array().into_iter().flatten() {
            if parameter["$ref"].is_null()
                && let Some(other) = said.insert(parameter.to_string(), path)
            {
                panic!("{method} {path} says again what {other} does: {parameter}");
            }
        }
    }
}

#[test]
fn kinds_of_events_are_those_that_a_reader_can_choose() {
    let kinds = protos::api::ServerEventBody::KINDS;
    assert_eq!(document()["components"]["schemas"]["EventKind"]["enum"], json!(kinds));
}
