//! Views that make their landmark, sizes given with views, and landmarks that are renamed.

use super::*;
use crate::store::{jobs, landmarks};
use engine::picture;
use serde_json::json;
use std::{
    f64::consts::{FRAC_PI_2, PI},
    fmt::Write as _,
};

/// Grey blocks, another number, other blocks: PNG.
pub(super) fn blocks(number: usize) -> Vec<u8> {
    let grey = |i: usize| {
        let (u, v) = (i % 240, i / 240);
        let block = |size: usize| (u / size * 31 + v / size * 57 + size + number * 7919) as u64;
        let hash = |x: u64| (x.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 48) % 128;
        (hash(block(24)) + hash(block(60))) as u8
    };
    picture::png(240, 240, &(0..240 * 240).map(grey).collect::<Vec<_>>()).unwrap()
}

impl Service {
    /// Uploads a view of `landmark` of the map `hall`, with these parts beside the picture.
    pub(super) async fn upload(
        &self,
        landmark: &str,
        image: Vec<u8>,
        parts: &[(&str, &str)],
    ) -> (u16, Value) {
        let path = format!("/api/v1/maps/hall/landmarks/{landmark}/views");
        self.send_form("POST", &path, image, parts).await
    }

    /// Sends a form with a picture and these parts.
    pub(super) async fn send_form(
        &self,
        method: &str,
        path: &str,
        image: Vec<u8>,
        parts: &[(&str, &str)],
    ) -> (u16, Value) {
        let mut text = String::new();
        for (name, value) in parts {
            write!(text, "--b\r\ncontent-disposition: form-data; name=\"{name}\"\r\n\r\n{value}\r\n")
                .unwrap();
        }
        text.push_str("--b\r\ncontent-disposition: form-data; name=\"image\"; filename=\"i\"\r\n\r\n");
        let body = [text.into_bytes(), image, b"\r\n--b--\r\n".to_vec()].concat();
        let request = Request::builder()
            .method(method)
            .uri(path)
            .header(header::HOST, "localhost")
            .header(header::CONTENT_TYPE, "multipart/form-data; boundary=b")
            .header(header::IF_MATCH, "*")
            .body(Body::from(body))
            .unwrap();
        read(self.ask(request).await).await
    }

    pub(super) async fn patch(&self, landmark: &str, body: Value) -> (u16, Value) {
        let path = format!("/api/v1/maps/hall/landmarks/{landmark}");
        read(self.ask(request("PATCH", &path, body.to_string())).await).await
    }

    pub(super) async fn landmark(&self, name: &str) -> (u16, Value) {
        self.get(&format!("/api/v1/maps/hall/landmarks/{name}")).await
    }
}

pub(super) const WHOLE: (&str, &str) = ("whole_image", "true");
pub(super) const CREATE: (&str, &str) = ("create", "true");
const SIZE: [(&str, &str); 2] = [("width_m", "0.6"), ("height_m", "0.84")];

#[tokio::test]
async fn a_landmark_is_made_with_its_first_view_or_not_at_all() {
    let service = Service::start(Limits { landmarks: 1, ..Limits::default() }).await;
    let refused = |answer: (u16, Value)| (answer.0, answer.1["code"].as_str().unwrap_or_default().to_owned());
    let nothing = async || assert_eq!(service.landmark("poster").await.0, 404);

    assert_eq!(
        refused(service.upload("poster", blocks(1), &[WHOLE]).await),
        (404, "unknown_landmark".into())
    );
    // Blank: there is no quad to take.
    let blank = picture::png(240, 240, &vec![128; 240 * 240]).unwrap();
    assert_eq!(refused(service.upload("poster", blank, &[CREATE]).await), (422, "quad_not_found".into()));
    nothing().await;
    let corners = ("corners", "[[500,0],[600,0],[600,100],[500,100]]");
    assert_eq!(
        refused(service.upload("poster", blocks(1), &[CREATE, corners]).await),
        (422, "outside".into())
    );
    nothing().await;
    assert_eq!(
        refused(service.upload("Poster", blocks(1), &[CREATE, WHOLE]).await),
        (422, "bad_name".into())
    );
    assert_eq!(
        refused(service.upload("poster", blocks(1), &[CREATE, WHOLE, SIZE[0]]).await),
        (422, "missing".into())
    );
    let huge = [CREATE, WHOLE, SIZE[0], ("height_m", "500")];
    assert_eq!(refused(service.upload("poster", blocks(1), &huge).await), (422, "out_of_range".into()));
    nothing().await;

    let (status, view) = service.upload("poster", blocks(1), &[CREATE, WHOLE, SIZE[0], SIZE[1]]).await;
    assert_eq!((status, &view["outcome"]), (201, &json!("new")), "{view}");
    let (_, made) = service.landmark("poster").await;
    assert_eq!((&made["size"], &made["views"]), (&json!({ "width_m": 0.6, "height_m": 0.84 }), &json!(1)));
    // A second landmark is one too many.
    assert_eq!(refused(service.upload("other", blocks(2), &[CREATE, WHOLE]).await), (409, "too_many".into()));
}

#[tokio::test]
async fn a_size_given_again_is_applied_or_refused() {
    let service = Service::start(Limits::default()).await;
    assert_eq!(service.upload("poster", blocks(1), &[CREATE, WHOLE]).await.0, 201);
    assert_eq!(service.landmark("poster").await.1["size"], Value::Null);
    // The same picture: the view is there already, and the size is set.
    let (status, view) = service.upload("poster", blocks(1), &[WHOLE, SIZE[0], SIZE[1]]).await;
    assert_eq!((status, &view["outcome"]), (200, &json!("duplicate")));
    let size = json!({ "width_m": 0.6, "height_m": 0.84 });
    assert_eq!(service.landmark("poster").await.1["size"], size);
    // The same again is fine, another one is not, and then the view is not stored.
    assert_eq!(service.upload("poster", blocks(2), &[CREATE, WHOLE, SIZE[0], SIZE[1]]).await.0, 201);
    let other = [CREATE, WHOLE, ("width_m", "60"), ("height_m", "84")];
    let (status, problem) = service.upload("poster", blocks(3), &other).await;
    assert_eq!((status, &problem["code"]), (409, &json!("size_differs")), "{problem}");
    assert_eq!(problem["stored"], size);
    assert_eq!(problem["given"], json!({ "width_m": 60.0, "height_m": 84.0 }));
    assert!(problem["detail"].as_str().unwrap().contains("0.6 x 0.84 m, not 60 x 84 m"), "{problem}");
    assert_eq!(service.landmark("poster").await.1["views"], 2);
}

#[tokio::test]
async fn a_size_that_the_photographs_contradict_is_refused_and_makes_nothing() {
    let service = Service::start(Limits::default()).await;
    // From the front, 120 x 168 px: 0.60 x 0.84 m, and not 0.84 x 0.60 m.
    let corners = ("corners", "[[60,30],[180,30],[180,198],[60,198]]");
    let swapped = [CREATE, corners, ("width_m", "0.84"), ("height_m", "0.6")];
    let (status, problem) = service.upload("poster", blocks(1), &swapped).await;
    assert_eq!(
        (status, &problem["code"], &problem["field"]),
        (409, &json!("aspect_differs"), &json!("width_m"))
    );
    assert_eq!(
        (&problem["swapped"], &problem["stated"]["width_m"]),
        (&json!(true), &json!(0.84)),
        "{problem}"
    );
    let measured = problem["measured_aspect"].as_f64().unwrap();
    let sigma = problem["aspect_sigma"].as_f64().unwrap();
    assert!((measured - 120.0 / 168.0).abs() < 1e-6 && (0.01..0.04).contains(&sigma), "{problem}");
    assert_eq!(service.landmark("poster").await.0, 404);

    let (status, view) = service.upload("poster", blocks(1), &[CREATE, corners, SIZE[0], SIZE[1]]).await;
    assert_eq!(status, 201, "{view}");
    let size = |width_m: f64, height_m: f64| json!({ "size": { "width_m": width_m, "height_m": height_m } });
    let (status, problem) = service.patch("poster", size(0.84, 0.6)).await;
    assert_eq!((status, &problem["code"]), (409, &json!("aspect_differs")), "{problem}");
    // Twice as large is another distance, and the same shape.
    assert_eq!(service.patch("poster", size(1.2, 1.68)).await.0, 200);
    // A cut-out says nothing of it.
    let whole = [CREATE, WHOLE, ("width_m", "2"), ("height_m", "0.5")];
    assert_eq!(service.upload("other", blocks(2), &whole).await.0, 201);
}

#[tokio::test]
async fn what_belongs_to_a_landmark_follows_its_new_name() {
    let service = Service::start(Limits::default()).await;
    for (name, number) in [("poster", 1), ("door", 2)] {
        assert_eq!(service.upload(name, blocks(number), &[CREATE, WHOLE]).await.0, 201);
    }
    assert_eq!(service.patch("poster", json!({ "name": "door" })).await.1["code"], "exists");
    assert_eq!(service.patch("poster", json!({ "name": "A door" })).await.1["code"], "bad_name");
    assert_eq!(service.patch("nothing", json!({ "name": "else" })).await.1["code"], "unknown_landmark");
    // A job that waits, as one does that was interrupted.
    let queue = service.store.write(|tx| {
        let request = r#"{"landmarks":["door","poster"]}"#;
        Box::pin(async move { jobs::create(tx, "learn", "hall", request, (9, 9)).await })
    });
    let job = queue.await.unwrap().id;
    let id = landmarks::get(service.store.reads(), "hall", "poster").await.unwrap().id;

    let place = json!({ "x_m": 1.0, "y_m": 2.0, "z_m": 1.5, "theta_rad": 0.0 });
    let (status, renamed) = service.patch("poster", json!({ "name": "picture", "place": place })).await;
    assert_eq!((status, &renamed["name"], &renamed["place"]), (200, &json!("picture"), &place), "{renamed}");
    assert_eq!((service.landmark("poster").await.0, service.landmark("picture").await.0), (404, 200));
    let row = landmarks::get(service.store.reads(), "hall", "picture").await.unwrap();
    assert_eq!((row.id, row.views), (id, 1));
    let snapshot = service.store.snapshots().get("hall").unwrap();
    assert!(snapshot.landmarks.values().any(|l| l.name == "picture"));
    let waiting = jobs::get(service.store.reads(), job).await.unwrap();
    assert_eq!(waiting.request, r#"{"landmarks":["door","picture"]}"#);
    // A finding of a frame that was looked at before comes to the landmark by its number.
    let name = service.store.write(move |tx| {
        let id = vision::model::LandmarkId(id as u64);
        Box::pin(async move { landmarks::name_of(tx, "hall", id).await })
    });
    assert_eq!(name.await.unwrap(), "picture");
}

impl Service {
    /// Trains a landmark.
    pub(super) async fn learn(&self, landmark: &str) {
        let path = format!("/api/v1/maps/hall/landmarks/{landmark}/learn");
        let (status, job) = read(self.ask(request("POST", &path, "{}")).await).await;
        assert_eq!(status, 202, "{job}");
        let id = job["id"].as_i64().unwrap();
        for _ in 0..6_000 {
            let (_, job) = read(self.ask(request("GET", &format!("/api/v1/jobs/{id}"), "")).await).await;
            if job["state"] == "done" {
                return;
            }
            assert_ne!(job["state"], "failed", "{job}");
            tokio::time::sleep(std::time::Duration::from_millis(10)).await;
        }
        panic!("the job does not end");
    }
}

#[tokio::test]
async fn the_second_name_of_a_picture_is_refused_with_the_first() {
    let service = Service::start(Limits::default()).await;
    let poster = sim::posters::poster_of_size(1, 260, 1.0);
    let picture = picture::png(poster.width(), poster.height(), poster.data()).unwrap();
    for name in ["first", "second"] {
        assert_eq!(service.upload(name, picture.clone(), &[CREATE, WHOLE]).await.0, 201);
        service.learn(name).await;
        assert_eq!(service.landmark("first").await.1["status"], "active", "after {name}");
    }
    assert_eq!(service.patch("first", json!({ "name": "poster" })).await.0, 200);
    let (_, second) = service.landmark("second").await;
    assert_eq!(
        (&second["status"], second["failed_gates"].as_array().unwrap().len()),
        (&json!("inactive"), 1)
    );
    let reason = &second["failed_gates"][0];
    assert_eq!(
        (&reason["gate"], &reason["look_alike"]["landmark"]),
        (&json!("looks_like"), &json!("poster"))
    );
    let likeness = reason["look_alike"]["gradient_similarity"].as_f64().unwrap();
    let sentence = format!("Not in use: it looks like `poster` ({:.0} %).", 100.0 * likeness);
    assert!(likeness > 0.9 && reason["sentence"] == sentence.as_str(), "{reason}");
    assert_eq!(second["model"]["look_alikes"][0]["landmark"], "poster");

    // When that one is gone it says so.
    let gone = service.ask(request("DELETE", "/api/v1/maps/hall/landmarks/poster", "")).await;
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    let (_, second) = service.landmark("second").await;
    assert_eq!(second["failed_gates"][0]["advice"], "Learn it again.", "{second}");
    service.learn("second").await;
    assert_eq!(service.landmark("second").await.1["status"], "active");
}

#[tokio::test]
async fn two_landmarks_that_are_one_object_become_one() {
    let service = Service::start(Limits { views: 3, ..Limits::default() }).await;
    let merge = async |into: &str, from: &str, revision: &str| {
        let path = format!("/api/v1/maps/hall/landmarks/{into}/merge");
        let mut asked = request("POST", &path, json!({ "from": from }).to_string());
        asked.headers_mut().insert(header::IF_MATCH, revision.parse().unwrap());
        read(service.ask(asked).await).await
    };
    for (name, number) in [("poster", 1), ("poster", 2), ("sign", 2), ("sign", 3), ("door", 4), ("door", 5)] {
        assert_eq!(service.upload(name, blocks(number), &[CREATE, WHOLE]).await.0, 201);
    }
    let place = json!({ "x_m": 1.0, "y_m": 2.0, "z_m": 1.5, "theta_rad": 0.0 });
    let size = json!({ "width_m": 0.6, "height_m": 0.84 });
    assert_eq!(service.patch("sign", json!({ "place": place, "size": size })).await.0, 200);
    let code = |answer: (u16, Value)| (answer.0, answer.1["code"].as_str().unwrap_or_default().to_owned());
    assert_eq!(code(merge("poster", "poster", "*").await), (422, "invalid_value".into()));
    assert_eq!(code(merge("poster", "nothing", "*").await), (404, "unknown_landmark".into()));
    assert_eq!(code(merge("nothing", "poster", "*").await), (404, "unknown_landmark".into()));
    assert_eq!(code(merge("poster", "sign", "\"1.0\"").await), (412, "changed_meanwhile".into()));
    assert_eq!(code(merge("poster", "door", "*").await), (409, "too_many".into()));
    assert_eq!(service.landmark("door").await.1["views"], 2, "nothing was done");

    // The picture that both have counts once.
    let (status, merged) = merge("poster", "sign", "*").await;
    assert_eq!((status, &merged["views"]), (200, &json!(3)), "{merged}");
    assert_eq!((&merged["place"], &merged["size"]), (&place, &size), "what it lacked");
    assert_eq!(service.landmark("sign").await.0, 404);
    for view in service.get("/api/v1/maps/hall/landmarks/poster/views").await.1["items"].as_array().unwrap() {
        let path = format!("/api/v1/maps/hall/landmarks/poster/views/{}/image", view["id"]);
        assert_eq!(service.ask(request("GET", &path, "")).await.status(), 200, "{path}");
    }
    let commits = service.get("/api/v1/maps/hall/commits").await.1;
    let path = format!("/api/v1/maps/hall/commits/{}/undo", commits["items"][0]["id"]);
    let (status, undone) = read(service.ask(request("POST", &path, "{}")).await).await;
    assert_eq!(status, 200, "{undone} {commits}");
    assert_eq!(service.landmark("poster").await.1["views"], 2);
    let (status, back) = service.landmark("sign").await;
    assert_eq!((status, &back["views"], &back["place"]), (200, &json!(2), &place), "{back}");
}

/// The picture of a camera on its side is taught upright: its mounting says which corner is the
/// top-left one.
#[tokio::test]
async fn a_view_of_a_rolled_camera_is_taught_upright() {
    let service = Service::start(Limits::default()).await;
    let grey = |i: usize| {
        let (u, v) = (i % 320, i / 320);
        if (100..220).contains(&u) && (60..190).contains(&v) { 60 } else { 200 }
    };
    let image = picture::png(320, 240, &(0..320 * 240).map(grey).collect::<Vec<_>>()).unwrap();
    let capture = |roll_rad: f64| {
        // A level camera, turned clockwise about its axis.
        let level = map::extrinsics::pan_tilt(0.0, 0.0, nalgebra::Vector3::new(0.0, 0.0, 1.0));
        let mounting = level * nalgebra::Isometry3::rotation(nalgebra::Vector3::new(0.0, 0.0, roll_rad));
        let pose =
            json!({ "pose": { "x_m": 0.0, "y_m": 0.0, "theta_rad": 0.0 }, "covariance": vec![0.0; 9] });
        let capture = json!({
            "intrinsics": { "fx_px": 300.0, "fy_px": 300.0, "cx_px": 159.5, "cy_px": 119.5 },
            "map_from_robot": pose,
            "robot_from_camera": protos::convert::geometry::pose3_wire(&mounting),
        });
        capture.to_string()
    };
    // Top-left in the image; a camera that is turned clockwise sees the top of a landmark at the
    // left.
    for (roll_rad, first) in [(0.0, [99.5, 59.5]), (FRAC_PI_2, [99.5, 189.5]), (PI, [219.5, 189.5])] {
        let name = format!("poster-{}", (10.0 * roll_rad) as u32);
        let (status, view) =
            service.upload(&name, image.clone(), &[CREATE, ("capture", &capture(roll_rad))]).await;
        assert_eq!(status, 201, "{view}");
        let corner: [f64; 2] = serde_json::from_value(view["corners"][0].clone()).unwrap();
        let off_px = (corner[0] - first[0]).abs().max((corner[1] - first[1]).abs());
        assert!(off_px < 2.0, "roll {roll_rad}: {view}");
    }
}
