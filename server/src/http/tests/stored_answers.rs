//! Stored answers, opened again; what was learnt of landmarks; pictures that a client has already.

use super::{teaching::blocks, *};
use crate::store::stored_answers;
use engine::{
    answer_records::{AnswerBasis, AnswerRecord, MAX_MATCHES, QuadIcon, QuadMatches},
    prior_check::{PriorCheck, PriorSource},
    slots::SlotKey,
};
use map::pose2::{Pose2, Pose2Covariance};
use nalgebra::Matrix3;
use protos::{Name, v1};
use serde_json::json;
use vision::points::shown_matches::ShownMatch;

/// A pose 2 m from the prior, which refuses it, and as many matches as are stored.
fn basis() -> AnswerBasis {
    let pose = |x_m| Pose2Covariance::new(Pose2::new(x_m, 1.0, 0.5), Matrix3::identity() * 0.1).unwrap();
    let prior_check = PriorCheck {
        source: PriorSource::Robot,
        prior: pose(0.0),
        seen: Some(pose(2.0)),
        distance2: pose(2.0).distance2(&pose(0.0)),
        limit: 11.3,
        is_refused: true,
    };
    let one = ShownMatch { seen: [0.25, -0.1], taught: [0.3333, 1.05], agrees: true };
    let matches = vec![one; MAX_MATCHES];
    let matched = Some(QuadMatches { landmark: "sign".into(), matches });
    let icon = QuadIcon { quad: 0, size: 2, pixels: vec![0, 80, 160, 240], matched };
    AnswerBasis { icons: vec![icon], prior_check: Some(prior_check) }
}

impl Service {
    /// Stores an answer with a quad that was compared with `sign`.
    pub(super) async fn answered(&self, map: &str, robot: &str, status: v1::Status) {
        let candidate = v1::Candidate {
            landmark: "sign".into(),
            distance: Some(0.6),
            threshold: Some(0.4),
            ratio: Some(1.5),
            refusal: "correlation".into(),
            ..v1::Candidate::default()
        };
        let quad = v1::QuadAnswer { candidates: vec![candidate], ..v1::QuadAnswer::default() };
        let answer = v1::Answer {
            map: map.into(),
            status: status.into(),
            quads: vec![quad.clone(), quad],
            ..v1::Answer::default()
        };
        let key = SlotKey { robot: Name::new(robot).unwrap(), camera: Name::new("front").unwrap() };
        let record = AnswerRecord { key, answer: Arc::new(answer), basis: basis() };
        let stored = self.store.write(|tx| {
            Box::pin(async move { stored_answers::add(tx, std::slice::from_ref(&record), 3).await })
        });
        stored.await.unwrap();
    }

    async fn numbers(&self, query: &str) -> Vec<i64> {
        let (status, page) = self.get(&format!("/api/v1/answers{query}")).await;
        assert_eq!(status, 200, "{query}: {page}");
        page["items"].as_array().unwrap().iter().map(|item| item["id"].as_i64().unwrap()).collect()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stored_answer_is_opened_again_with_its_pictures() {
    let service = Service::start(Limits::default()).await;
    assert_eq!(
        service.upload("sign", blocks(1), &[("create", "true"), ("whole_image", "true")]).await.0,
        201
    );
    service.learn("sign").await;
    service.answered("hall", "r1", v1::Status::NoMatch).await;
    let (status, found) = service.get("/api/v1/answers/1").await;
    assert_eq!(status, 200, "{found}");
    let summary = &found["summary"];
    assert_eq!((&summary["status"], &summary["refusal"]), (&json!("no_match"), &json!("correlation")));
    assert_eq!((&summary["candidates"], &summary["landmarks"]), (&json!(["sign"]), &json!([])));
    assert_eq!(found["answer"]["quads"][0]["candidates"][0]["threshold"], 0.4);
    assert_eq!(found["quads"][1]["icon"], Value::Null);
    assert_eq!(found["quads"][1]["matched"], Value::Null);
    let matched = &found["quads"][0]["matched"];
    assert_eq!(
        (&matched["landmark"], matched["matches"].as_array().unwrap().len()),
        (&json!("sign"), MAX_MATCHES)
    );
    let first = json!({ "seen": [0.25, -0.1], "taught": [0.3333, 1.05], "agrees": true });
    assert_eq!(matched["matches"][0], first);
    let check = &found["prior_check"];
    assert_eq!((&check["source"], &check["refused"]), (&json!("robot"), &json!(true)));
    assert_eq!((&check["prior"]["pose"]["x_m"], &check["seen"]["pose"]["x_m"]), (&json!(0.0), &json!(2.0)));
    assert!((check["distance2"].as_f64().unwrap() - 20.0).abs() < 1e-9 && check["limit"] == 11.3, "{check}");
    let paths = [
        found["quads"][0]["icon"].as_str().unwrap(),
        found["quads"][0]["landmarks"][0]["icon"].as_str().unwrap(),
        "/api/v1/maps/hall/landmarks/sign/views/1/icon",
        "/api/v1/maps/hall/landmarks/sign/views/1/image",
    ];
    for path in paths {
        let first = service.ask(request("GET", path, "")).await;
        assert_eq!(first.status(), StatusCode::OK, "{path}");
        let tag = first.headers()[header::ETAG].clone();
        assert!(first.headers()[header::CONTENT_TYPE].to_str().unwrap().starts_with("image/"), "{path}");
        let mut again = request("GET", path, "");
        again.headers_mut().insert(header::IF_NONE_MATCH, tag.clone());
        let again = service.ask(again).await;
        assert_eq!(
            (again.status(), &again.headers()[header::ETAG]),
            (StatusCode::NOT_MODIFIED, &tag),
            "{path}"
        );
        assert!(to_bytes(again.into_body(), 9).await.unwrap().is_empty(), "{path}");
        let mut other = request("GET", path, "");
        other.headers_mut().insert(header::IF_NONE_MATCH, "\"0\"".parse().unwrap());
        assert_eq!(service.ask(other).await.status(), StatusCode::OK, "{path}");
    }
    for path in ["/api/v1/answers/2", "/api/v1/answers/1/quads/1/icon"] {
        assert_eq!(service.get(path).await.1["code"], "unknown_answer", "{path}");
    }
}

#[tokio::test]
async fn stored_answers_are_listed_newest_first_and_the_oldest_go() {
    let service = Service::start(Limits::default()).await;
    for (robot, status) in [
        ("r1", v1::Status::NoMatch),
        ("r1", v1::Status::Ambiguous),
        ("r2", v1::Status::NoMatch),
        ("r1", v1::Status::NoMatch),
    ] {
        service.answered("hall", robot, status).await;
    }
    service.answered("gone", "r1", v1::Status::NoMatch).await;
    assert_eq!(service.numbers("").await, [4, 3, 2], "three stay");
    for (query, wanted) in [
        ("?robot=r1", &[4, 2][..]),
        ("?robot=r1&status=no_match", &[4]),
        ("?status=ambiguous", &[2]),
        ("?camera=front&landmark=sign&refusal=correlation", &[4, 3, 2]),
        ("?landmark=door", &[]),
        ("?map=yard", &[]),
        ("?until_ms=1000", &[]),
        ("?since_ms=1000&limit=1", &[4]),
        ("?cursor=4&limit=1", &[3]),
    ] {
        assert_eq!(service.numbers(query).await, wanted, "{query}");
    }
    let (_, page) = service.get("/api/v1/answers?limit=1").await;
    assert_eq!((&page["next"], &page["total"]), (&json!("4"), &json!(3)));
    for (query, code) in
        [("limit=501", "out_of_range"), ("status=good", "bad_query"), ("cursor=x", "invalid_value")]
    {
        assert_eq!(service.get(&format!("/api/v1/answers?{query}")).await.1["code"], code, "{query}");
    }
    // What belongs to a map goes with it.
    assert_eq!(service.ask(request("DELETE", "/api/v1/robots/r1", "")).await.status(), 204);
    assert_eq!(service.ask(request("DELETE", "/api/v1/maps/hall", "")).await.status(), 204);
    assert_eq!(service.numbers("").await, [0; 0]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_landmark_shows_what_was_learnt_of_it() {
    let service = Service::start(Limits::default()).await;
    let at = |what: &str| format!("/api/v1/maps/hall/landmarks/sign/{what}");
    let parts = [("create", "true"), ("whole_image", "true")];
    assert_eq!(service.upload("sign", blocks(1), &parts).await.0, 201);
    for what in ["model", "distances", "icon"] {
        let (status, problem) = service.get(&at(what)).await;
        assert_eq!((status, &problem["code"]), (404, &json!("not_learnt")), "{what}");
    }
    service.learn("sign").await;
    let (status, model) = service.get(&at("model")).await;
    assert_eq!(status, 200, "{model}");
    assert_eq!((&model["landmark"], &model["icon_px"]), (&json!("sign"), &json!(75)));
    assert!(model["views"].as_u64() > model["generated_views"].as_u64(), "{model}");
    assert!(model["correlation"]["threshold"].is_f64() && model["sha256"].as_str().unwrap().len() == 64);
    let (_, landmark) = service.get("/api/v1/maps/hall/landmarks/sign").await;
    assert_eq!(model["in_use"], landmark["status"] == "active");
    let (status, distances) = service.get(&at("distances")).await;
    assert_eq!(status, 200, "{distances}");
    let sum = |bins: &Value| bins.as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum::<u64>();
    for kind in ["correlation", "hausdorff", "gradient_dissimilarity"] {
        let shown = &distances[kind];
        assert_eq!(shown["threshold"], model[kind]["threshold"], "{kind}");
        let own = sum(&shown["own"]) + shown["own_beyond"].as_u64().unwrap();
        assert_eq!(own, model[kind]["positives"].as_u64().unwrap(), "{kind}: {shown}");
    }
    assert_eq!(service.get("/api/v1/maps/hall/duplicates").await.1["total"], 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn views_are_found_by_time_and_capture_in_both_orders() {
    let service = Service::start(Limits::default()).await;
    for seed in 1..4 {
        let parts = [("create", "true"), ("whole_image", "true"), ("keep_near_duplicate", "true")];
        assert_eq!(service.upload("sign", blocks(seed), &parts).await.0, 201);
    }
    for (query, wanted) in [
        ("", &[1, 2, 3][..]),
        ("?sort=-number", &[3, 2, 1]),
        ("?sort=-number&limit=1&cursor=3", &[2]),
        ("?limit=1&cursor=2", &[3]),
        ("?has_capture=true", &[]),
        ("?has_capture=false&since_ms=1000", &[1, 2, 3]),
        ("?until_ms=1000", &[]),
    ] {
        let (status, page) = service.get(&format!("/api/v1/maps/hall/landmarks/sign/views{query}")).await;
        assert_eq!(status, 200, "{query}: {page}");
        let items = page["items"].as_array().unwrap().iter();
        assert_eq!(items.map(|view| view["id"].as_i64().unwrap()).collect::<Vec<_>>(), wanted, "{query}");
        assert_eq!(page["total"], if wanted.is_empty() { 0 } else { 3 }, "{query}");
    }
}

#[tokio::test]
async fn what_points_said_for_a_landmark_is_counted_by_strength() {
    let service = Service::start(Limits::default()).await;
    let (status, _) = service.upload("sign", blocks(1), &[("create", "true"), ("whole_image", "true")]).await;
    assert_eq!(status, 201);
    let quad = |log10_chance: Option<f64>, landmark: &str, doubtful_landmark: &str| v1::QuadAnswer {
        points: log10_chance
            .map(|log10_chance| v1::PointEvidence { log10_chance, ..v1::PointEvidence::default() }),
        landmark: landmark.into(),
        doubtful_landmark: doubtful_landmark.into(),
        ..v1::QuadAnswer::default()
    };
    let quads = vec![
        quad(Some(-31.0), "sign", ""),
        quad(Some(-900.0), "sign", ""),
        quad(Some(-12.0), "", "sign"),
        quad(None, "sign", ""),
        quad(Some(-31.0), "door", ""),
    ];
    let answer = v1::Answer { map: "hall".into(), quads, ..v1::Answer::default() };
    let key = SlotKey { robot: Name::new("r1").unwrap(), camera: Name::new("front").unwrap() };
    let record = AnswerRecord { key, answer: Arc::new(answer), basis: AnswerBasis::default() };
    let stored = service
        .store
        .write(|tx| Box::pin(async move { stored_answers::add(tx, std::slice::from_ref(&record), 3).await }));
    stored.await.unwrap();
    let (status, found) = service.get("/api/v1/maps/hall/landmarks/sign/evidence").await;
    assert_eq!((status, &found["answers"], &found["threshold"]), (200, &json!(1), &json!(5.0)), "{found}");
    let bins = |heap: &str| -> Vec<(usize, u64)> {
        let heap = found[heap].as_array().unwrap().iter().map(|n| n.as_u64().unwrap());
        heap.enumerate().filter(|(_, n)| *n > 0).collect()
    };
    assert_eq!((bins("named"), bins("doubtful")), (vec![(3, 1), (19, 1)], vec![(1, 1)]));
    assert_eq!(found["named_without_points"], 1);
    let missing = service.get("/api/v1/maps/hall/landmarks/door/evidence").await;
    assert_eq!((missing.0, &missing.1["code"]), (404, &json!("unknown_landmark")));
}
