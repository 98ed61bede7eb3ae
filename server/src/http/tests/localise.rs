//! Where a robot is by a scan or a picture, without its history.

use super::{teaching::blocks, *};
use serde_json::json;

/// An L-shaped room, the free side of its walls on the left.
const CORNERS: [[f64; 2]; 6] = [[0.0, 0.0], [8.0, 0.0], [8.0, 3.0], [5.0, 3.0], [5.0, 6.0], [0.0, 6.0]];

/// One turn of a laser in the room, as the part `scan`.
fn scan(x_m: f64, y_m: f64, theta_rad: f64) -> Value {
    turn(x_m, y_m, theta_rad, std::f64::consts::TAU / 360.0)
}

/// 360 rays of a laser in the room, `step` radians apart, as the part `scan`.
fn turn(x_m: f64, y_m: f64, theta_rad: f64, step: f64) -> Value {
    let range = |beam: usize| {
        let (s, c) = (theta_rad + beam as f64 * step).sin_cos();
        let walls = (0..CORNERS.len()).map(|i| (CORNERS[i], CORNERS[(i + 1) % CORNERS.len()]));
        let hit = walls.filter_map(|([ax, ay], [bx, by])| {
            let (dx, dy) = (bx - ax, by - ay);
            let cross = c * dy - s * dx;
            let (tx, ty) = (ax - x_m, ay - y_m);
            let (range, along) = ((tx * dy - ty * dx) / cross, (tx * s - ty * c) / cross);
            (cross.abs() > 1e-9 && range > 0.0 && (0.0..=1.0).contains(&along)).then_some(range)
        });
        hit.fold(f64::INFINITY, f64::min)
    };
    let ranges: Vec<Option<f64>> = (0..360).map(range).map(|r| r.is_finite().then_some(r)).collect();
    json!({ "robot_from_laser": { "x_m": 0.0, "y_m": 0.0, "theta_rad": 0.0 }, "first_bearing_rad": 0.0,
        "bearing_step_rad": step, "max_range_m": 20.0, "ranges_m": ranges })
}

impl Service {
    /// Localises in `hall` by these parts without a picture.
    async fn localise(&self, parts: &[(&str, String)]) -> (u16, Value) {
        let mut body = String::new();
        for (name, value) in parts {
            let head = format!("--b\r\ncontent-disposition: form-data; name=\"{name}\"\r\n\r\n");
            body = format!("{body}{head}{value}\r\n");
        }
        let mut asked = request("POST", "/api/v1/maps/hall/localise", format!("{body}--b--\r\n"));
        asked.headers_mut().insert(header::CONTENT_TYPE, "multipart/form-data; boundary=b".parse().unwrap());
        read(self.ask(asked).await).await
    }
}

fn is_at(found: &Value) {
    assert_eq!((&found["status"], &found["reason"]), (&json!("located"), &Value::Null), "{found}");
    let pose = &found["map_from_robot"]["pose"];
    for (field, value) in [("x_m", 6.5), ("y_m", 1.0), ("theta_rad", 0.7)] {
        assert!((pose[field].as_f64().unwrap() - value).abs() < 0.05, "{field}: {pose}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_scan_tells_where_the_robot_is_or_why_not() {
    let service = Service::start(Limits::default()).await;
    let at = scan(6.5, 1.0, 0.7);
    let (status, nowhere) = service.localise(&[("scan", at.to_string())]).await;
    assert_eq!((status, &nowhere["status"]), (200, &json!("no_match")), "{nowhere}");
    assert_eq!((&nowhere["reason"], &nowhere["hypotheses"]), (&json!("few_points"), &json!([])));
    let ends = |i: usize| json!({ "a": CORNERS[i], "b": CORNERS[(i + 1) % CORNERS.len()] });
    let walls = json!({ "segments": (0..CORNERS.len()).map(ends).collect::<Vec<_>>() }).to_string();
    assert_eq!(service.ask(request("PUT", "/api/v1/maps/hall/walls", walls)).await.status(), StatusCode::OK);
    let (_, found) = service.localise(&[("scan", at.to_string())]).await;
    is_at(&found);
    // The LDS-01 in Gazebo: the last ray is a hair more than a turn after the first.
    let lds = turn(6.5, 1.0, 0.7, 0.017_501_922_324_299_812);
    is_at(&service.localise(&[("scan", lds.to_string())]).await.1);
    let sum: f64 =
        found["hypotheses"].as_array().unwrap().iter().map(|h| h["probability"].as_f64().unwrap()).sum();
    assert!((sum - 1.0).abs() < 1e-9 && found["answer"].is_null(), "{found}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_picture_without_landmarks_matches_nothing_and_wrong_parts_are_named() {
    let service = Service::start(Limits::default()).await;
    let intrinsics = json!({ "fx_px": 600.0, "fy_px": 600.0, "cx_px": 120.0, "cy_px": 120.0 }).to_string();
    let mounting =
        json!({ "qx": -0.5, "qy": 0.5, "qz": -0.5, "qw": 0.5, "x_m": 0.1, "y_m": 0.0, "z_m": 1.2 });
    let mounting = mounting.to_string();
    let parts = [("intrinsics", intrinsics.as_str()), ("mounting", mounting.as_str())];
    let (status, found) = service.send_form("POST", "/api/v1/maps/hall/localise", blocks(1), &parts).await;
    assert_eq!((status, &found["status"]), (200, &json!("no_match")), "{found}");
    assert_eq!(found["reason"], "nothing_recognised", "{found}");
    assert_eq!(found["answer"]["map"], "hall");
    let (status, problem) =
        service.send_form("POST", "/api/v1/maps/hall/localise", blocks(1), &parts[..1]).await;
    assert_eq!((status, &problem["code"], &problem["field"]), (422, &json!("missing"), &json!("mounting")));
    let mut many = scan(1.0, 1.0, 0.0);
    many["ranges_m"] = json!(vec![1.0; map::laser::MAX_BEAMS + 1]);
    let mut turned = scan(1.0, 1.0, 0.0);
    turned["bearing_step_rad"] = json!(4.0);
    for (parts, code, field) in [
        (vec![], "missing", "image"),
        (vec![("intrinsics", intrinsics.clone())], "missing", "image"),
        (vec![("scan", "{}".to_owned())], "invalid_value", "scan"),
        (vec![("scan", many.to_string())], "out_of_range", "scan.ranges_m"),
        (vec![("scan", turned.to_string())], "out_of_range", "scan.fan_rad"),
        (vec![("colour", "red".to_owned())], "unknown_field", "colour"),
    ] {
        let (status, problem) = service.localise(&parts).await;
        assert_eq!(
            (status, &problem["code"], &problem["field"]),
            (422, &json!(code), &json!(field)),
            "{problem}"
        );
    }
    let long = vec![("scan", " ".repeat(Limits::default().json_bytes + 1))];
    assert_eq!(service.localise(&long).await.0, 413);
}
