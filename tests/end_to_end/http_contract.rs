//! Claim: bad input over HTTP gets a status, a stable code and the field at fault; no stored data
//! changes; limits accept their bound and refuse more.

use client::{LandmarkRegion, api::NewMap};
use reqwest::{
    Client, Method, StatusCode,
    header::{CONTENT_TYPE, IF_MATCH},
    multipart::{Form, Part},
};
use serde_json::{Value, json};
use server::config::Limits;
use std::time::Duration;
use tests::{Inside, pictures};

/// Method, path, body, and the expected status, code and field.
type Row<'a> = (&'a str, &'a str, &'a str, u16, &'a str, &'a str);

const ROWS: &[Row<'_>] = &[
    // Not JSON, not the shape, not a name.
    ("POST", "/maps", "{", 400, "bad_json", "body"),
    ("POST", "/maps", "{} {}", 422, "invalid_value", "body"),
    ("POST", "/maps", r#"{"name": 3}"#, 422, "invalid_value", "name"),
    ("POST", "/maps", r#"{"name": "a", "colour": 1}"#, 422, "invalid_value", "colour"),
    ("POST", "/maps", r#"{"name": "a", "distance": "cosine"}"#, 422, "invalid_value", "distance"),
    // A list where the schema says object.
    ("POST", "/maps", r#"["other"]"#, 422, "invalid_value", "body"),
    ("PATCH", "/maps/hall", "[]", 422, "invalid_value", "body"),
    ("PATCH", "/maps/hall/landmarks/p1", r#"{"size": [0.6, 0.84]}"#, 422, "invalid_value", "size"),
    // Text that reads otherwise than it is written.
    ("PATCH", "/maps/hall", r#"{"floor": "a\u202eb"}"#, 422, "invalid_value", "floor"),
    ("PATCH", "/maps/hall", r#"{"site": "a\u200bb"}"#, 422, "invalid_value", "site"),
    (
        "PUT",
        "/maps/hall/modalities",
        r#"{"areas": [{"name": "a\u2066b", "corners_m": [[0, 0], [1, 0], [1, 1]]}]}"#,
        422,
        "invalid_value",
        "areas[0].name",
    ),
    ("POST", "/maps", r#"{"name": ""}"#, 422, "bad_name", "name"),
    ("POST", "/maps", r#"{"name": "A/B"}"#, 422, "bad_name", "name"),
    ("POST", "/maps", r#"{"name": "hall"}"#, 409, "exists", "name"),
    // Numbers.
    (
        "POST",
        "/maps/hall/landmarks",
        r#"{"name": "x", "size": {"width_m": 0, "height_m": 1}}"#,
        422,
        "out_of_range",
        "size.width_m",
    ),
    (
        "POST",
        "/maps/hall/landmarks",
        r#"{"name": "x", "size": {"width_m": 1, "height_m": 100.1}}"#,
        422,
        "out_of_range",
        "size.height_m",
    ),
    (
        "POST",
        "/maps/hall/landmarks",
        r#"{"name": "x", "size": {"width_m": 1}}"#,
        422,
        "invalid_value",
        "size",
    ),
    (
        "POST",
        "/maps/hall/landmarks",
        r#"{"name": "x", "size": {"width_m": 1, "height_m": 1e400}}"#,
        400,
        "bad_json",
        "size.height_m",
    ),
    (
        "POST",
        "/maps/hall/landmarks",
        r#"{"name": "x", "size": {"width_m": 1, "height_m": NaN}}"#,
        400,
        "bad_json",
        "size.height_m",
    ),
    (
        "POST",
        "/maps/hall/landmarks",
        r#"{"name": "x", "place": {"x_m": 1e39, "y_m": 0, "z_m": 0, "theta_rad": 0}}"#,
        422,
        "out_of_range",
        "place.x_m",
    ),
    (
        "POST",
        "/maps/hall/landmarks",
        r#"{"name": "x", "place": {"x_m": 0, "y_m": 0, "z_m": 101, "theta_rad": 0}}"#,
        422,
        "out_of_range",
        "place.z_m",
    ),
    (
        "POST",
        "/maps/hall/landmarks",
        r#"{"name": "x", "place": {"x_m": 0, "y_m": 0, "z_m": 1, "theta_rad": 7}}"#,
        422,
        "out_of_range",
        "place.theta_rad",
    ),
    (
        "PATCH",
        "/maps/hall/landmarks/p1",
        r#"{"size": {"width_m": -1, "height_m": 1}}"#,
        422,
        "out_of_range",
        "size.width_m",
    ),
    (
        "PUT",
        "/maps/hall/walls",
        r#"{"segments": [{"a": [0, 0], "b": [1, 0]}, {"a": [0, 0], "b": [0, 0]}]}"#,
        422,
        "out_of_range",
        "segments[1].length_m",
    ),
    (
        "PUT",
        "/maps/hall/walls",
        r#"{"segments": [{"a": [0, 0, 0], "b": [1, 0]}]}"#,
        400,
        "bad_json",
        "segments[0].a",
    ),
    // Unknown resources.
    ("GET", "/maps/nowhere", "", 404, "unknown_map", "map"),
    ("DELETE", "/maps/nowhere", "", 404, "unknown_map", "map"),
    ("GET", "/maps/nowhere/landmarks/p1", "", 404, "unknown_map", "map"),
    ("GET", "/maps/hall/landmarks/nothing", "", 404, "unknown_landmark", "landmark"),
    ("GET", "/maps/hall/landmarks/p1/views/7/icon", "", 404, "unknown_view", "view"),
    ("GET", "/maps/hall/landmarks/p1/views/7/image", "", 404, "unknown_view", "view"),
    ("DELETE", "/maps/hall/landmarks/p1/views/7", "", 404, "unknown_view", "view"),
    ("GET", "/robots/nobody", "", 404, "unknown_robot", "robot"),
    ("GET", "/robots/r1/cameras/front/frame", "", 404, "unknown_camera", "camera"),
    ("GET", "/jobs/99", "", 404, "unknown_job", "job"),
    ("GET", "/jobs/ninety", "", 404, "not_found", "path"),
    ("PUT", "/robots/r2", r#"{"map": "nowhere"}"#, 404, "unknown_map", "map"),
    ("PUT", "/robots/R2", r#"{"map": "hall"}"#, 422, "bad_name", "robot"),
    ("GET", "/backups/20200101-000000", "", 404, "unknown_backup", "backup"),
    ("GET", "/backups/..%2Fwaymark.sqlite/file", "", 404, "unknown_backup", "backup"),
    ("DELETE", "/backups/20200101-000000", "", 404, "unknown_backup", "backup"),
    ("GET", "/nothing/here", "", 404, "not_found", "path"),
    ("PUT", "/maps", "{}", 405, "method_not_allowed", "method"),
    // Pages.
    ("GET", "/maps?limit=0", "", 422, "out_of_range", "limit"),
    ("GET", "/maps?limit=4", "", 422, "out_of_range", "limit"),
    ("GET", "/maps?limit=many", "", 400, "bad_query", "query"),
    ("GET", "/maps?offset=3", "", 400, "bad_query", "query"),
    ("GET", "/maps/hall/landmarks/p1/views?cursor=x", "", 422, "invalid_value", "cursor"),
    // Lessons.
    ("POST", "/maps/hall/landmarks/p1/learn", "", 409, "no_views", "landmarks"),
    ("POST", "/maps/hall/learn", r#"{"landmarks": []}"#, 422, "out_of_range", "landmarks"),
    ("POST", "/maps/hall/learn", r#"{"generated_views": 101}"#, 422, "out_of_range", "generated_views"),
    ("POST", "/maps/nowhere/learn", "{}", 404, "unknown_map", "map"),
    // A map in use.
    ("DELETE", "/maps/hall", "", 409, "in_use", ""),
];

fn limits() -> Limits {
    Limits {
        maps: 3,
        landmarks: 2,
        views: 2,
        robots: 2,
        laser_segments: 3,
        page: 3,
        json_bytes: 4_000,
        upload_bytes: 200_000,
        upload_pixels: 160 * 120,
        header_timeout_s: 1,
        ..Limits::default()
    }
}

async fn prepared() -> (Inside, Client, String) {
    let inside = Inside::start(limits()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.add_landmark("hall", "p1", None, None).await.expect("landmark");
    maps.put_robot("r1", "hall").await.expect("robot");
    let base = format!("{}/api/v1", inside.url());
    let http = tests::http(&inside.url()).await;
    (inside, http, base)
}

async fn refusal(response: reqwest::Response) -> (u16, String, String) {
    let status = response.status();
    let kind = response.headers()[CONTENT_TYPE].to_str().expect("text").to_owned();
    assert_eq!(kind, "application/problem+json");
    let body: Value = response.json().await.expect("JSON");
    assert_eq!(body["status"], status.as_u16());
    assert!(!body["detail"].as_str().expect("detail").is_empty());
    let text = |name: &str| body[name].as_str().unwrap_or_default().to_owned();
    (status.as_u16(), text("code"), text("field"))
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_requests_are_refused_and_change_nothing() {
    let (inside, http, base) = prepared().await;
    let before = inside.maps().map("hall").await.expect("map");
    for (method, path, body, status, code, field) in ROWS {
        let method = Method::from_bytes(method.as_bytes()).expect("a method");
        let mut request = http.request(method.clone(), format!("{base}{path}")).header(IF_MATCH, "*");
        if !body.is_empty() {
            request = request.header(CONTENT_TYPE, "application/json").body(*body);
        }
        let found = refusal(request.send().await.expect("answer")).await;
        assert_eq!(found, (*status, (*code).to_owned(), (*field).to_owned()), "{method} {path} {body}");
    }
    assert_eq!(inside.maps().map("hall").await.expect("map"), before);
    assert_eq!(inside.maps().maps().await.expect("maps").len(), 1);
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_uploads_are_refused() {
    let (inside, http, base) = prepared().await;
    let url = format!("{base}/maps/hall/landmarks/p1/views");
    let picture = pictures::picture(1);
    let image = |bytes: &[u8]| Form::new().part("image", Part::bytes(bytes.to_vec()));
    let square = |c: &str| image(&picture).text("corners", c.to_owned());
    let beyond = pictures::png(161, 120, &pictures::blocks(1, 161, 120));
    let heavy = vec![0; 200_001];
    let rows = [
        (Form::new().text("whole_image", "true"), 422, "missing", "image"),
        (image(b"GIF89a"), 422, "wrong_encoding", "image"),
        (image(&picture[..picture.len() / 2]).text("whole_image", "true"), 422, "bad_image", "image"),
        (image(&beyond).text("whole_image", "true"), 422, "too_large", "image"),
        (image(&heavy), 413, "too_large", "body"),
        (image(&picture).text("whole_image", "perhaps"), 422, "invalid_value", "whole_image"),
        (square("[[0,0],[9,0]]").text("whole_image", "true"), 422, "invalid_value", "whole_image"),
        (square("[[0,0],[159,0],[159,119]]"), 422, "invalid_value", "corners"),
        (square("[[0,0],[159,0],[159,119],[0,\"x\"]]"), 422, "invalid_value", "corners[3][1]"),
        (square("nonsense"), 400, "bad_json", "corners"),
        // Counter-clockwise, crossed, outside, tiny.
        (square("[[0,0],[0,119],[159,119],[159,0]]"), 422, "invalid_value", "corners"),
        (square("[[0,0],[159,119],[159,0],[0,119]]"), 422, "invalid_value", "corners"),
        (square("[[100,0],[300,0],[300,119],[100,119]]"), 422, "outside", "corners"),
        (square("[[0,0],[5,0],[5,5],[0,5]]"), 422, "too_small", "corners"),
        (image(&picture).text("colour", "red"), 422, "unknown_field", "colour"),
        (image(&picture).part("image", Part::bytes(picture.clone())), 422, "repeated_field", "image"),
    ];
    for (index, (form, status, code, field)) in rows.into_iter().enumerate() {
        let found = refusal(http.post(&url).multipart(form).send().await.expect("answer")).await;
        assert_eq!(found, (status, code.to_owned(), field.to_owned()), "row {index}");
    }
    let text = http.post(&url).body("text").send().await.expect("answer");
    assert_eq!(refusal(text).await.1, "not_multipart");
    assert_eq!(inside.maps().landmark("hall", "p1").await.expect("landmark").views, 0);
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn limits_accept_their_bound_and_refuse_more() {
    let (inside, http, base) = prepared().await;
    let maps = inside.maps();
    let post = |path: &str, body: Value| http.post(format!("{base}{path}")).json(&body).send();
    let put =
        |path: &str, body: Value| http.put(format!("{base}{path}")).header(IF_MATCH, "*").json(&body).send();
    let segments = |n: usize| json!({ "segments": vec![json!({ "a": [0, 0], "b": [1, 0] }); n] });

    for name in ["m2", "m3"] {
        assert_eq!(
            post("/maps", json!({ "name": name })).await.expect("answer").status(),
            StatusCode::CREATED
        );
    }
    assert_eq!(refusal(post("/maps", json!({ "name": "m4" })).await.expect("answer")).await.1, "too_many");
    maps.add_landmark("hall", "p2", None, None).await.expect("the second landmark");
    let third = post("/maps/hall/landmarks", json!({ "name": "p3" })).await.expect("answer");
    assert_eq!(refusal(third).await.1, "too_many");
    maps.put_robot("r2", "m2").await.expect("the second robot");
    assert_eq!(
        refusal(put("/robots/r3", json!({ "map": "hall" })).await.expect("answer")).await.1,
        "too_many"
    );
    assert_eq!(put("/maps/hall/walls", segments(3)).await.expect("answer").status(), StatusCode::OK);
    let four = refusal(put("/maps/hall/walls", segments(4)).await.expect("answer")).await;
    assert_eq!(four, (422, "too_many".into(), "segments".into()));
    let wall = json!({ "a": [0.0, 0.0], "b": [1.0, 0.0], "covariance": [1e-4, 1.0, 1e-4] });
    let impossible = put("/maps/hall/walls", json!({ "segments": [wall] })).await.expect("answer");
    assert_eq!(refusal(impossible).await, (422, "out_of_range".into(), "segments[0].covariance".into()));

    for seed in [1, 2, 2] {
        // The third is a duplicate of the second: no new view.
        maps.upload_view("hall", "p1", pictures::picture(seed), LandmarkRegion::WholeImage)
            .await
            .expect("view");
    }
    let third = maps.upload_view("hall", "p1", pictures::picture(3), LandmarkRegion::WholeImage).await;
    assert!(third.expect_err("beyond the bound").to_string().contains("too_many"));

    let body = |n: usize| format!("{{\"name\": \"hall\"{}}}", " ".repeat(n - 16));
    for (bytes, code) in [(4_000, "exists"), (4_001, "too_large")] {
        let request =
            http.post(format!("{base}/maps")).header(CONTENT_TYPE, "application/json").body(body(bytes));
        assert_eq!(refusal(request.send().await.expect("answer")).await.1, code);
    }

    // Pages: three maps, two a page.
    let page = |query: String| {
        let http = http.clone();
        let url = format!("{base}/maps?{query}");
        async move { http.get(url).send().await.expect("answer").json::<Value>().await.expect("JSON") }
    };
    let first = page("limit=2".into()).await;
    assert_eq!(first["items"].as_array().expect("items").len(), 2);
    let second = page(format!("limit=2&cursor={}", first["next"].as_str().expect("cursor"))).await;
    assert_eq!((second["items"][0]["name"].as_str(), &second["next"]), (Some("m3"), &Value::Null));
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_that_never_ends_is_cut_off() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let (inside, ..) = prepared().await;
    let mut slow = tokio::net::TcpStream::connect(inside.server.http_addr).await.expect("connection");
    slow.write_all(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX-Slow: ").await.expect("sent");
    let mut rest = Vec::new();
    let closed = tokio::time::timeout(Duration::from_secs(10), slow.read_to_end(&mut rest)).await;
    assert!(closed.is_ok(), "still open after 10 s although the head must be there within 1 s");
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_pages_are_served_with_their_policy() {
    let (inside, http, _) = prepared().await;
    for (path, kind) in [
        ("/", "text/html"),
        ("/maps/hall/landmarks", "text/html"),
        ("/maps/hall/settings", "text/html"),
        ("/icon.svg", "image/svg+xml"),
        ("/api/docs/", "text/html"),
        ("/healthz", "application/json"),
        ("/readyz", "application/json"),
        ("/version", "application/json"),
    ] {
        let response = http.get(format!("{}{path}", inside.url())).send().await.expect("answer");
        assert_eq!(response.status(), StatusCode::OK, "{path}");
        assert!(response.headers()[CONTENT_TYPE].to_str().expect("text").starts_with(kind), "{path}");
        let policy = response.headers()["content-security-policy"].to_str().expect("text");
        assert!(policy.contains("default-src 'none'") && policy.contains("frame-ancestors 'none'"), "{path}");
        // What is no page may load nothing at all.
        assert_eq!(policy.contains("script-src 'self'"), kind == "text/html", "{path}");
    }
    inside.server.stop().await;
}
