//! Claim: maps have locations and links: a pose on one floor can be transformed to another map,
//! links have no cycles; and the command line imports a building plan in GeoJSON as the walls of a
//! map on a running server.

use client::{
    LandmarkRegion, MapClient,
    api::{NewMap, TransformQuery, UploadOutcomeBody, WallBody},
};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use server::config::Limits;
use std::{fs, time::Duration};
use tests::{Child, Inside, command::waymark, pictures};

async fn call(url: &str, method: Method, path: &str, body: Option<Value>) -> (StatusCode, Value) {
    let request = tests::http(url).await.request(method, format!("{url}/api/v1{path}"));
    let request = request.header("if-match", "*");
    let request = match body {
        Some(body) => request.json(&body),
        None => request,
    };
    let answer = request.send().await.expect("an answer");
    (answer.status(), answer.json().await.unwrap_or_default())
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// A house in a site, two floors in the house; the upper one turned by a quarter and 3 m up.
async fn house(url: &str) {
    for (name, body) in [
        ("site", json!({ "site": "Works" })),
        (
            "house",
            json!({ "building": "B 2", "parent": { "map": "site", "x_m": 100, "y_m": 50, "theta_rad": 0.3 } }),
        ),
        ("ground", json!({ "floor": "0", "parent": { "map": "house", "x_m": 0, "y_m": 0, "theta_rad": 0 } })),
        (
            "upper",
            json!({ "floor": "1", "parent": { "map": "house", "x_m": 10, "y_m": 0, "level_m": 3,
            "theta_rad": std::f64::consts::FRAC_PI_2, "covariance": [0.01, 0, 0, 0, 0.01, 0, 0, 0, 0.0001] } }),
        ),
        ("elsewhere", json!({})),
    ] {
        let mut body = body;
        body["name"] = json!(name);
        let (status, map) = call(url, Method::POST, "/maps", Some(body)).await;
        assert_eq!(status, StatusCode::CREATED, "{map}");
    }
}

/// Each has its code and field and changes nothing.
async fn refusals(url: &str) {
    for (method, path, body, status, code, field) in [
        (Method::GET, "/maps/upper/transform?to=elsewhere", None, 409, "not_related", "to"),
        (Method::GET, "/maps/upper/transform?to=nowhere", None, 404, "unknown_map", "to"),
        (Method::GET, "/maps/upper/transform", None, 400, "bad_query", "query"),
        (Method::GET, "/maps/upper/transform?to=ground&x_m=1", None, 422, "missing", "query"),
        (
            Method::GET,
            "/maps/upper/transform?to=ground&x_m=1e9&y_m=0&theta_rad=0",
            None,
            422,
            "out_of_range",
            "query.x_m",
        ),
        (
            Method::PATCH,
            "/maps/site",
            Some(json!({ "parent": { "map": "upper", "x_m": 0, "y_m": 0, "theta_rad": 0 } })),
            409,
            "cycle",
            "parent.map",
        ),
        (
            Method::PATCH,
            "/maps/site",
            Some(json!({ "parent": { "map": "none", "x_m": 0, "y_m": 0, "theta_rad": 0 } })),
            404,
            "unknown_map",
            "parent.map",
        ),
        (
            Method::PATCH,
            "/maps/upper",
            Some(json!({ "parent": { "map": "site", "x_m": 0, "y_m": 0, "theta_rad": 0,
            "level_m": 1000.5 } })),
            422,
            "out_of_range",
            "parent.level_m",
        ),
        (
            Method::PATCH,
            "/maps/upper",
            Some(json!({ "parent": { "map": "site", "x_m": 0, "y_m": 0, "theta_rad": 0,
            "covariance": [1, 0, 0, 0, -1, 0, 0, 0, 1] } })),
            422,
            "out_of_range",
            "parent.covariance",
        ),
        (Method::PATCH, "/maps/upper", Some(json!({ "floor": "" })), 422, "out_of_range", "floor"),
        (Method::PATCH, "/maps/upper", Some(json!({ "site": "x".repeat(65) })), 422, "out_of_range", "site"),
        (Method::PATCH, "/maps/upper", Some(json!({ "building": "a\nb" })), 422, "invalid_value", "building"),
        (Method::DELETE, "/maps/house", None, 409, "in_use", ""),
    ] {
        let (got, problem) = call(url, method, path, body).await;
        assert_eq!((got.as_u16(), problem["code"].as_str()), (status, Some(code)), "{path}: {problem}");
        assert_eq!(problem["field"].as_str().unwrap_or_default(), field, "{path}: {problem}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn poses_are_transformed_between_linked_maps() {
    let inside = Inside::start(Limits::default()).await;
    let url = inside.url();
    house(&url).await;
    let maps: MapClient = inside.maps();
    let upper = maps.map("upper").await.expect("the map");
    assert_eq!((upper.floor.as_deref(), upper.parent.as_ref().map(|p| p.level_m)), (Some("1"), Some(3.0)));
    // One metre ahead on the upper floor is one metre to the left of (10, 0) below it.
    let asked = "/maps/upper/transform?to=ground&x_m=1&y_m=0&theta_rad=0";
    let (status, found) = call(&url, Method::GET, asked, None).await;
    assert_eq!(status, StatusCode::OK, "{found}");
    assert!(
        (number(&found["pose"]["x_m"]) - 10.0).abs() < 1e-9
            && (number(&found["pose"]["y_m"]) - 1.0).abs() < 1e-9
    );
    assert!((number(&found["level_m"]) - 3.0).abs() < 1e-9);
    assert_eq!(found["via"], json!(["upper", "house", "ground"]));
    // Both floors' links add uncertainty (the ground's by the default for a tape), and over a metre
    // the turn does, too.
    let variance = number(&found["pose"]["covariance"][0]);
    assert!((variance - (0.01 + 0.0025 + 0.0001 + 0.0087 * 0.0087)).abs() < 1e-6, "{found}");
    let back = maps
        .transform("ground", &TransformQuery { to: "upper".into(), ..TransformQuery::default() })
        .await
        .expect("the way back");
    assert!((back.to_from_map.theta_rad + std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    refusals(&url).await;
    // Absent fields do not change, null deletes; then the house may be deleted.
    let (_, upper) =
        call(&url, Method::PATCH, "/maps/upper", Some(json!({ "site": "x".repeat(64), "parent": null })))
            .await;
    assert_eq!((&upper["floor"], &upper["parent"]), (&json!("1"), &Value::Null));
    call(&url, Method::PATCH, "/maps/ground", Some(json!({ "parent": null }))).await;
    assert_eq!(call(&url, Method::DELETE, "/maps/house", None).await.0, 204);
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_near_duplicate_view_is_answered_and_not_stored() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.add_landmark("hall", "p1", None, None).await.expect("landmark");
    let picture = |noise: u8| {
        let grey: Vec<u8> = (0..200 * 160)
            .map(|i| {
                let (x, y) = (i % 200, i / 200);
                ((x / 20 * 37 + y / 16 * 53) % 160) as u8 + if (x + y) % 7 == 0 { noise } else { 0 }
            })
            .collect();
        pictures::png(200, 160, &grey)
    };
    let corners =
        |right: f64| LandmarkRegion::Corners([[20.0, 20.0], [right, 20.0], [right, 140.0], [20.0, 140.0]]);
    let first = maps.upload_view("hall", "p1", picture(0), corners(180.0)).await.expect("view");
    let same = maps.upload_view("hall", "p1", picture(0), corners(180.0)).await.expect("view");
    let near_duplicate = maps.upload_view("hall", "p1", picture(2), corners(180.5)).await.expect("view");
    let other = maps.upload_view("hall", "p1", picture(0), corners(150.0)).await.expect("view");
    let outcomes: Vec<_> = [&first, &same, &near_duplicate, &other].iter().map(|v| v.outcome).collect();
    let expected = [
        UploadOutcomeBody::New,
        UploadOutcomeBody::Duplicate,
        UploadOutcomeBody::NearDuplicate,
        UploadOutcomeBody::New,
    ];
    assert_eq!(outcomes, expected.map(Some));
    assert!(near_duplicate.id == first.id && same.id == first.id && other.id != first.id);
    assert_eq!(maps.landmark("hall", "p1").await.expect("landmark").views, 2);
    inside.server.stop().await;
}

const PLAN: &str = r#"{"type":"FeatureCollection","features":[
    {"type":"Feature","properties":{"name":"hall"},"geometry":{"type":"Polygon",
     "coordinates":[[[0,0],[12,0],[12,5],[0,5],[0,0]],[[5,2],[6,2],[6,3],[5,3],[5,2]]]}},
    {"type":"Feature","geometry":{"type":"LineString","coordinates":[[0,8],[4,8]]}}]}"#;

#[tokio::test(flavor = "multi_thread")]
async fn a_plan_becomes_the_walls_of_a_map_on_a_server() {
    let data = tempfile::tempdir().expect("a directory");
    let server = Child::start(data.path());
    let plan = data.path().join("plan.geojson");
    fs::write(&plan, PLAN).expect("written");
    let plan = plan.to_str().expect("text");
    let run = |args: &[&str]| {
        let run = waymark(args.iter().copied(), Duration::from_secs(30));
        assert_eq!(run.status, 0, "{args:?}: {run:?}");
        run.stdout
    };
    run(&["map", "create", "house", "--site", "Works", "--server", &server.url]);
    run(&["map", "create", "hall", "--server", &server.url]);
    let at = ["--in", "house", "--at", "-2,3,90", "--level-m", "3.4", "--floor", "1st"];
    run(&[&["map", "locate", "hall", "--server", &server.url][..], &at].concat());
    let listed = run(&["map", "list", "--server", &server.url]);
    assert!(listed.contains("1st, in house at -2.00, 3.00 m") && listed.contains("Works"), "{listed}");
    run(&["map", "import", "hall", plan, "--server", &server.url]);
    let walls = server.maps().walls("hall").await.expect("walls");
    assert_eq!(walls.segments.len(), 9, "{walls:?}");
    assert_eq!(walls.segments[0], WallBody::between([0.0, 0.0], [12.0, 0.0]), "{walls:?}");
    // A landmark on a wall of the plan is visible from inside the hall, not through the column.
    let (_, made) = call(
        &server.url,
        Method::POST,
        "/maps/hall/landmarks",
        Some(json!({ "name": "poster",
        "size": { "width_m": 0.6, "height_m": 0.8 },
        "place": { "x_m": 5.5, "y_m": 5, "z_m": 1.5, "theta_rad": -std::f64::consts::FRAC_PI_2 } })),
    )
    .await;
    assert_eq!(made["name"], "poster", "{made}");
    for (x, y, is_visible) in [(5.5, 3.6, true), (5.5, 1.5, false), (5.5, 6.5, false)] {
        let pose = json!({ "pose": { "x_m": x, "y_m": y, "theta_rad": 0 } });
        let (_, visible) = call(&server.url, Method::POST, "/maps/hall/visible", Some(pose)).await;
        assert_eq!(
            visible["landmarks"].as_array().is_some_and(|l| !l.is_empty()),
            is_visible,
            "{x} {y}: {visible}"
        );
    }
    // An invalid plan is refused and changes nothing.
    let bad = data.path().join("bad.geojson");
    fs::write(&bad, r#"{"type":"Polygon","coordinates":[[[0,0],[1,0],[1,1]]]}"#).expect("written");
    let refused = waymark(
        ["map", "import", "hall", bad.to_str().expect("text"), "--server", &server.url],
        Duration::from_secs(30),
    );
    assert!(refused.status == 1 && refused.stderr.contains("ring"), "{refused:?}");
    assert_eq!(server.maps().walls("hall").await.expect("walls"), walls);
    server.kill();
}
