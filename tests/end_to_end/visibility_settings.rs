//! Claim: visibility follows the visibility settings: each map has its own, set over HTTP or by the
//! command line with errors that name the field, stored over a restart; a single request may state
//! others. A sign under the ceiling is visible only to a camera that can be tilted up.

use client::api::NewMap;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::{f64::consts::FRAC_PI_2, time::Duration};
use tests::{Child, command::waymark};

async fn call(server: &Child, method: Method, path: &str, body: Option<Value>) -> (StatusCode, Value) {
    let http = tests::http(&server.url).await;
    let request = http.request(method, format!("{}/api/v1/maps/hall{path}", server.url));
    let request = request.header("if-match", "*");
    let request = match body {
        Some(body) => request.json(&body),
        None => request,
    };
    let answer = request.send().await.expect("an answer");
    (answer.status(), answer.json().await.unwrap_or_default())
}

async fn get(server: &Child, path: &str) -> Value {
    let (status, found) = call(server, Method::GET, path, None).await;
    assert_eq!(status, StatusCode::OK, "{path}: {found}");
    found
}

/// A hall with a poster on a wall and a sign under the ceiling.
async fn hall(server: &Child) {
    server.maps().create_map(&NewMap::new("hall")).await.expect("created");
    server
        .maps()
        .set_walls("hall", &[[[0.0, 0.0], [10.0, 0.0]], [[10.0, 8.0], [0.0, 8.0]]].into_iter().collect())
        .await
        .expect("walls");
    for (name, place) in [
        ("poster", json!({ "x_m": 5, "y_m": 0, "z_m": 1.5, "theta_rad": FRAC_PI_2 })),
        ("sign", json!({ "x_m": 5, "y_m": 4, "z_m": 2.5, "theta_rad": 0, "tilt_rad": FRAC_PI_2 })),
    ] {
        let body = json!({ "name": name, "size": { "width_m": 0.6, "height_m": 0.6 }, "place": place });
        let (status, made) = call(server, Method::POST, "/landmarks", Some(body)).await;
        assert_eq!(status, StatusCode::CREATED, "{made}");
    }
}

async fn area(server: &Child, landmark: &str, query: &str) -> f64 {
    let found = get(server, &format!("/landmarks/{landmark}/visibility{query}")).await;
    found["properties"]["area_m2"].as_f64().expect("an area")
}

async fn visible_from(server: &Child, settings: Value) -> Vec<String> {
    let body = json!({ "pose": { "x_m": 5, "y_m": 3, "theta_rad": 0 }, "visibility_settings": settings });
    let (status, found) = call(server, Method::POST, "/visible", Some(body)).await;
    assert_eq!(status, StatusCode::OK, "{found}");
    let mut names: Vec<String> = found["landmarks"]
        .as_array()
        .expect("a list")
        .iter()
        .filter_map(|l| l["landmark"].as_str().map(str::to_owned))
        .collect();
    names.sort();
    names
}

async fn refusals(server: &Child) {
    let version = get(server, "").await["version"].clone();
    for (body, code, field) in [
        (json!({ "focal_px": 5 }), "out_of_range", "focal_px"),
        (json!({ "tilt_low_rad": 0.5, "tilt_high_rad": 0.4 }), "out_of_range", "tilt_high_rad"),
        (json!({ "tilt_low_rad": -2 }), "out_of_range", "tilt_low_rad"),
        (json!({ "max_incidence_rad": 1.5 }), "out_of_range", "max_incidence_rad"),
        (json!({ "camera_height_m": "high" }), "invalid_value", "camera_height_m"),
        (json!({ "focal": 500 }), "invalid_value", "focal"),
    ] {
        let (status, problem) = call(server, Method::PUT, "/visibility-settings", Some(body.clone())).await;
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{problem}");
        assert_eq!(
            (problem["code"].as_str(), problem["field"].as_str()),
            (Some(code), Some(field)),
            "{problem}"
        );
        if code == "out_of_range" {
            let body = json!({ "pose": { "x_m": 0, "y_m": 0, "theta_rad": 0 }, "visibility_settings": body });
            let (_, problem) = call(server, Method::POST, "/visible", Some(body)).await;
            assert_eq!(problem["field"], format!("visibility_settings.{field}"), "{problem}");
        }
    }
    assert_eq!(get(server, "").await["version"], version, "nothing was changed");
    let (status, _) = call(server, Method::GET, "/landmarks/sign/visibility?focal_px=1", None).await;
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY);
}

/// Other settings for one request, without a new version.
async fn one_question(server: &Child) {
    assert!(area(server, "sign", "").await <= 0.0, "the default camera cannot be tilted up so far");
    let usual = area(server, "poster", "").await;
    assert!(area(server, "poster", "?focal_px=900").await > 1.5 * usual);
    let up = json!({ "tilt_high_rad": 1.2 });
    assert!(area(server, "sign", "?tilt_high_rad=1.2").await > 5.0);
    assert_eq!(visible_from(server, json!({})).await, ["poster"]);
    assert_eq!(visible_from(server, up.clone()).await, ["poster", "sign"]);
    let path = json!({ "path": [[5, 2.6], [5, 3.2]], "visibility_settings": up });
    let (status, along) = call(server, Method::POST, "/coverage", Some(path)).await;
    assert_eq!(status, StatusCode::OK, "{along}");
    assert_eq!(along["steps"][0]["landmarks"], json!(["sign"]), "{along}");
}

#[tokio::test(flavor = "multi_thread")]
async fn visibility_areas_follow_the_settings() {
    let data = tempfile::tempdir().expect("a directory");
    let server = Child::start(data.path());
    hall(&server).await;
    let usual = get(&server, "/visibility-settings").await;
    assert_eq!(usual["focal_px"], 512.0, "{usual}");
    refusals(&server).await;
    one_question(&server).await;
    let version = get(&server, "").await["version"].as_u64().expect("a number");
    let command = ["map", "visibility", "hall", "--tilt-deg", "-10,70", "--server", &server.url];
    let run = waymark(command, Duration::from_secs(30));
    assert!(run.status == 0 && run.stdout.contains("tilts -10.0 to 70.0"), "{run:?}");
    assert_eq!(get(&server, "").await["version"], version + 1);
    assert_eq!(visible_from(&server, json!({})).await, ["poster", "sign"]);
    let gaze = json!({ "pose": { "x_m": 5, "y_m": 3, "theta_rad": 0 } });
    let (status, ranked) = call(&server, Method::POST, "/gaze", Some(gaze)).await;
    assert_eq!(status, StatusCode::OK, "no model, but the request is answered: {ranked}");
    let set = get(&server, "/visibility-settings").await;
    assert_eq!(set["width_px"], usual["width_px"], "absent options do not change");
    server.kill();
    let server = Child::start(data.path());
    assert_eq!(get(&server, "/visibility-settings").await, set);
    assert!(area(&server, "sign", "").await > 5.0, "areas by the stored settings after the restart");
    let run = waymark(
        ["map", "visibility", "hall", "--defaults", "--server", &server.url],
        Duration::from_secs(30),
    );
    assert_eq!(run.status, 0, "{run:?}");
    assert_eq!(get(&server, "/visibility-settings").await, usual);
    server.kill();
}
