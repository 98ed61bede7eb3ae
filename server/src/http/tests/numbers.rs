//! Numbers that are none, too large, too small or too precise, in every number of every body of the
//! OpenAPI document: each is taken or refused with its field, nothing panics, and nothing is stored
//! of what is refused.

use super::{openapi::prepared, *};
use crate::http::router::parts;
use crate::store::db;
use serde_json::json;
use std::collections::BTreeSet;

/// As they stand in the text of a body. JSON has no NaN; a writer of it has.
const ATTACKS: [&str; 12] = [
    "NaN",
    "-Infinity",
    "1e39",
    "1e309",
    "-1e300",
    "-0.0",
    "5e-324",
    "9007199254740993",
    "-1",
    "-9223372036854775809",
    "18446744073709551616",
    "0.5",
];
/// Stands for the number in a body.
const HERE: &str = "@number@";

/// A place in a body: names and indices.
type Place = Vec<String>;

/// Every number of a schema that the example reaches: properties that the example leaves out, too.
fn numbers(document: &Value, schema: &Value, example: &Value, at: &Place, found: &mut BTreeSet<Place>) {
    let schema = match schema["$ref"].as_str() {
        Some(name) => &document["components"]["schemas"][name.rsplit('/').next().unwrap_or_default()],
        None => schema,
    };
    for one in ["oneOf", "anyOf", "allOf"].iter().filter_map(|of| schema[of].as_array()).flatten() {
        numbers(document, one, example, at, found);
    }
    let is = |kind: &str| match &schema["type"] {
        Value::String(one) => one == kind,
        Value::Array(several) => several.iter().any(|one| one == kind),
        _ => false,
    };
    if is("number") || is("integer") {
        found.insert(at.clone());
    }
    let below = |part: &str| at.iter().cloned().chain([part.to_owned()]).collect::<Place>();
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        numbers(document, property, &example[name], &below(name), found);
    }
    if let Some(items) = example.as_array() {
        let schemas = |i: usize| schema["prefixItems"].get(i).unwrap_or(&schema["items"]);
        for (i, item) in items.iter().enumerate().take(4) {
            numbers(document, schemas(i), item, &below(&i.to_string()), found);
        }
    }
    // Whatever the schema says: a number of the example is one.
    if example.is_number() {
        found.insert(at.clone());
    }
}

/// The example with [`HERE`] at this place; `None` where the example has no such object.
fn marked(example: &Value, at: &[String]) -> Option<Value> {
    let mut body = example.clone();
    let (last, way) = at.split_last()?;
    let mut inside = &mut body;
    for part in way {
        inside = match inside {
            Value::Object(object) => object.get_mut(part)?,
            Value::Array(list) => list.get_mut(part.parse::<usize>().ok()?)?,
            _ => return None,
        };
    }
    match inside {
        Value::Object(object) => drop(object.insert(last.clone(), HERE.into())),
        Value::Array(list) => *list.get_mut(last.parse::<usize>().ok()?)? = HERE.into(),
        _ => return None,
    }
    Some(body)
}

/// Rows of every table.
async fn rows(service: &Service) -> Vec<(String, i64)> {
    let names: Vec<String> =
        db::query_scalar("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")
            .fetch_all(service.store.reads())
            .await
            .unwrap();
    let mut all = Vec::new();
    for name in names {
        let sql = db::AssertSqlSafe(format!("SELECT count(*) FROM \"{name}\""));
        all.push((name, db::query_scalar(sql).fetch_one(service.store.reads()).await.unwrap()));
    }
    all
}

/// Whether a refusal is about the number at this place: it names a part of its path, or the whole.
/// Of two numbers that do not fit, either may be the field; views that fit no camera are what
/// `not_determined` says.
fn names(answer: &Value, at: &[String]) -> bool {
    let said = |name: &str| answer[name].as_str().unwrap_or_default();
    let names: Vec<&String> = at.iter().filter(|part| part.parse::<usize>().is_err()).collect();
    let (field, detail) = (said("field"), said("detail"));
    let is_of_fit =
        said("code") == "not_determined" || names.last().is_some_and(|name| detail.contains(*name));
    field == "body" || is_of_fit || names.iter().any(|part| field.contains(part.as_str()))
}

struct Tally {
    sent: usize,
    refused: usize,
    wrong: Vec<String>,
}

/// Sends every attack at every number of one operation.
async fn attack(document: &Value, (method, path): (&str, &str), body: &Value, tally: &mut Tally) {
    let name = format!("{} {}", method.to_uppercase(), path.trim_start_matches("/api/v1"));
    let mut places = BTreeSet::new();
    numbers(document, &body["schema"], &body["example"], &Place::new(), &mut places);
    if places.is_empty() {
        return;
    }
    let (mut service, mut gathering) = prepared(&name).await;
    let mut before = rows(&service).await;
    for place in &places {
        let Some(text) = marked(&body["example"], place) else { continue };
        for number in ATTACKS {
            let text = text.to_string().replace(&format!("\"{HERE}\""), number);
            let mut at = path.to_owned();
            for (parameter, value) in [
                ("{map}", "hall"),
                ("{landmark}", "poster"),
                ("{robot}", "r1"),
                ("{camera}", "front"),
                ("{gathering}", gathering.as_str()),
            ] {
                at = at.replace(parameter, value);
            }
            let asked = request(&method.to_uppercase(), &at, text.clone());
            let (status, answer) = read(service.ask(asked).await).await;
            let now = rows(&service).await;
            let what = format!("{name} {} = {number}: {status} {answer}", place.join("."));
            tally.sent += 1;
            match status {
                200..300 => {}
                400..500 => {
                    tally.refused += 1;
                    if !names(&answer, place) {
                        tally.wrong.push(format!("another field: {what}"));
                    }
                    if now != before {
                        tally.wrong.push(format!("stored: {what}"));
                    }
                }
                _ => tally.wrong.push(what.clone()),
            }
            if service.store.vitals().panics().total() > 0 {
                tally.wrong.push(format!("a panic: {what}"));
            }
            // A map that is being made is in no row, and cannot be begun again.
            let has_begun = status < 300 && path.ends_with("/mapping");
            if now != before || has_begun || service.store.vitals().panics().total() > 0 {
                (service, gathering) = prepared(&name).await;
                before = rows(&service).await;
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_number_of_every_body_is_taken_or_refused_with_its_field() {
    let document = serde_json::to_value(parts(&Limits::default()).1).unwrap();
    let mut tally = Tally { sent: 0, refused: 0, wrong: Vec::new() };
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let body = &operation["requestBody"]["content"]["application/json"];
            if body.is_object() {
                attack(&document, (method, path), body, &mut tally).await;
            }
        }
    }
    let Tally { sent, refused, wrong } = tally;
    assert!(wrong.is_empty(), "{} of {sent}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(sent > 500 && refused > 300, "{sent} sent, {refused} refused");
}

/// The walk finds what it is to find.
#[test]
fn the_walk_reaches_numbers_of_lists_references_and_absent_properties() {
    let document = json!({ "components": { "schemas": { "Point": { "properties": {
        "x": { "type": "number" }, "y": { "type": ["number", "null"] }, "name": { "type": "string" } } } } } });
    let schema = json!({ "properties": {
        "points": { "type": "array", "items": { "$ref": "#/components/schemas/Point" } } } });
    let example = json!({ "points": [{ "x": 1.0, "name": "a" }] });
    let mut found = BTreeSet::new();
    numbers(&document, &schema, &example, &Place::new(), &mut found);
    let place = |last: &str| vec!["points".to_owned(), "0".to_owned(), last.to_owned()];
    assert_eq!(found, BTreeSet::from([place("x"), place("y")]));
    let text = marked(&example, &place("y")).unwrap().to_string();
    assert!(text.contains(HERE), "{text}");
}
