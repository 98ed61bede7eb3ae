//! Lists where objects belong: in every object of every body of the OpenAPI document, and in parts
//! of forms. Each is refused with its place, and nothing is stored.

use super::{openapi::prepared, *};
use crate::http::router::parts;
use serde_json::json;

/// The paths of all objects in an example, as refusals name them, each with the example that has
/// `[]` there.
fn places(example: &Value, at: &str, whole: &dyn Fn(Value) -> Value, found: &mut Vec<(String, Value)>) {
    match example {
        Value::Object(object) => {
            let field = if at.is_empty() { "body" } else { at };
            found.push((field.to_owned(), whole(json!([]))));
            for (name, value) in object {
                let below = if at.is_empty() { name.clone() } else { format!("{at}.{name}") };
                let inside = |part| {
                    let mut object = object.clone();
                    object.insert(name.clone(), part);
                    whole(Value::Object(object))
                };
                places(value, &below, &inside, found);
            }
        }
        Value::Array(list) => {
            for (i, value) in list.iter().enumerate().take(1) {
                let inside = |part| {
                    let mut list = list.clone();
                    list[i] = part;
                    whole(Value::Array(list))
                };
                places(value, &format!("{at}[{i}]"), &inside, found);
            }
        }
        _ => {}
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_list_is_refused_wherever_the_schema_says_object() {
    let document = serde_json::to_value(parts(&Limits::default()).1).unwrap();
    let (mut sent, mut wrong) = (0, Vec::new());
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let body = &operation["requestBody"]["content"]["application/json"];
            if !body.is_object() {
                continue;
            }
            let name = format!("{} {}", method.to_uppercase(), path.trim_start_matches("/api/v1"));
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
            let mut found = Vec::new();
            places(&body["example"], "", &|whole| whole, &mut found);
            for (field, text) in found {
                let asked = request(&method.to_uppercase(), &at, text.to_string());
                let (status, answer) = read(service.ask(asked).await).await;
                sent += 1;
                let is_refused =
                    status == 422 && answer["code"] == "invalid_value" && answer["field"] == *field;
                if !is_refused {
                    wrong.push(format!("{name}, a list for {field}: {status} {answer}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{} of {sent}:\n{}", wrong.len(), wrong.join("\n"));
    assert!(sent > 30, "{sent}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_list_is_refused_in_a_part_of_a_form() {
    let service = Service::start(Limits::default()).await;
    let object = r#"{"fx_px": 500, "fy_px": 500, "cx_px": 120, "cy_px": 80}"#;
    for (intrinsics, refused) in
        [(object, None), ("[500, 500, 120, 80, [], [], [], null, null]", Some("intrinsics"))]
    {
        let parts = [("intrinsics", intrinsics)];
        let path = "/api/v1/maps/hall/recognise";
        let (status, answer) = service.send_form("POST", path, teaching::blocks(1), &parts).await;
        let wanted = if refused.is_some() { 422 } else { 200 };
        assert_eq!((status, answer["field"].as_str()), (wanted, refused), "{answer}");
    }
}
