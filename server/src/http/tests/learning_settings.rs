//! Gates that a person overrules for one landmark, and what a model shows of itself.

use super::{
    teaching::{CREATE, WHOLE},
    *,
};
use engine::picture;
use serde_json::json;

const LANDMARK: &str = "/api/v1/maps/hall/landmarks/poster";

impl Service {
    /// With a landmark `poster`, learnt from one photograph.
    async fn with_poster() -> Self {
        let service = Self::start(Limits::default()).await;
        service.teach("poster", 1).await;
        service
    }

    async fn teach(&self, name: &str, seed: u64) {
        let poster = sim::posters::poster_of_size(seed, 260, 1.0);
        let picture = picture::png(poster.width(), poster.height(), poster.data()).unwrap();
        assert_eq!(self.upload(name, picture, &[CREATE, WHOLE]).await.0, 201);
        self.learn(name).await;
    }

    /// Status, failed gates and waived gates of the landmark, by their words.
    async fn gates(&self) -> (Value, Vec<String>, Vec<String>) {
        let (_, landmark) = self.landmark("poster").await;
        let words = |of: &str| {
            let gates = landmark[of].as_array().unwrap().iter();
            gates.map(|gate| gate["gate"].as_str().unwrap().to_owned()).collect()
        };
        (landmark["status"].clone(), words("failed_gates"), words("waived_gates"))
    }
}

#[tokio::test]
async fn a_failed_gate_is_overruled_for_a_reason_that_the_history_keeps() {
    let service = Service::with_poster().await;
    let one_side = || "visibility_confidence".to_owned();
    assert_eq!(service.gates().await, (json!("active"), vec![], vec![one_side()]));
    let (_, landmark) = service.landmark("poster").await;
    let said = &landmark["waived_gates"][0];
    assert_eq!(said["sentence"], "Seen from one side: all its photographs are from the front.");
    assert_eq!(
        said["advice"],
        "Photograph it from the left or the right, too, about 40 degrees off its front."
    );
    assert!(landmark.get("learning").is_none(), "{landmark}");

    let strict = json!({ "reason": "only rich pictures here", "min_saliency_f": 900.0 });
    assert_eq!(service.patch("poster", json!({ "learning": strict })).await.0, 200);
    let refused = (json!("inactive"), vec!["saliency".to_owned()], vec![one_side()]);
    assert_eq!(service.gates().await, refused);
    let wrong = [
        (json!({ "reason": "" }), "learning.reason", "invalid_value"),
        (
            json!({ "reason": "x", "false_positive_weight": 2000 }),
            "learning.false_positive_weight",
            "out_of_range",
        ),
    ];
    for (learning, field, code) in wrong {
        let (status, problem) = service.patch("poster", json!({ "learning": learning })).await;
        assert_eq!((status, &problem["field"], &problem["code"]), (422, &json!(field), &json!(code)));
    }

    let own = json!({ "reason": "nothing else hangs there", "min_saliency_f": 900.0, "use_despite_gates": true,
        "false_positive_weight": 3.0 });
    let (status, used) = service.patch("poster", json!({ "learning": own })).await;
    assert_eq!((status, &used["learning"]), (200, &own), "{used}");
    let active = (json!("active"), vec![], vec!["saliency".to_owned(), one_side()]);
    assert_eq!(service.gates().await, active);
    let (_, model) = service.get(&format!("{LANDMARK}/model")).await;
    assert_eq!((&model["in_use"], &model["weights"]), (&json!(true), &json!({ "lambda": 3.0, "mu": 1.0 })));
    let (_, commits) = service.get("/api/v1/maps/hall/commits").await;
    let newest = &commits["items"][0];
    assert_eq!(newest["why"], "nothing else hangs there", "{newest}");
    let (_, audit) = service.get("/api/v1/audit?limit=1").await;
    assert_eq!(audit["items"][0]["why"], "nothing else hangs there", "{audit}");
    let id = newest["id"].as_i64().unwrap();
    let (_, differs) = service.get(&format!("/api/v1/maps/hall/difference?from={}", id - 1)).await;
    assert_eq!(differs["landmarks"]["items"][0]["fields"], json!(["learning"]), "{differs}");

    let undo = request("POST", &format!("/api/v1/maps/hall/commits/{id}/undo"), "{}");
    assert_eq!(service.ask(undo).await.status(), StatusCode::OK);
    assert_eq!(service.gates().await, refused);
    // A lesson keeps them.
    service.learn("poster").await;
    assert_eq!(service.gates().await, refused);
    assert_eq!(service.patch("poster", json!({ "learning": null })).await.0, 200);
    assert_eq!(service.gates().await, (json!("active"), vec![], vec![one_side()]));
}

#[tokio::test]
async fn a_landmark_without_own_gates_has_those_of_its_map() {
    let service = Service::with_poster().await;
    let map = async |learning: Value| {
        let body = json!({ "learning": learning }).to_string();
        read(service.ask(request("PATCH", "/api/v1/maps/hall", body)).await).await
    };
    let strict = json!({ "reason": "only rich pictures here", "min_saliency_f": 900.0 });
    let (status, shown) = map(strict.clone()).await;
    assert_eq!((status, &shown["learning"]), (200, &strict), "{shown}");
    assert_eq!(service.gates().await.0, "inactive");
    let (_, landmark) = service.landmark("poster").await;
    assert!(landmark.get("learning").is_none(), "{landmark}");
    let (_, commits) = service.get("/api/v1/maps/hall/commits").await;
    let newest = &commits["items"][0];
    assert_eq!(newest["why"], "only rich pictures here", "{newest}");
    assert_eq!(newest["summary"]["settings"], json!(["learning"]), "{newest}");

    let own = json!({ "reason": "rich enough", "min_saliency_f": 0.0 });
    assert_eq!(service.patch("poster", json!({ "learning": own })).await.0, 200);
    assert_eq!(service.gates().await.0, "active");
    assert_eq!(service.patch("poster", json!({ "learning": null })).await.0, 200);
    let (status, problem) = map(json!({ "reason": "x", "min_views": 0 })).await;
    assert_eq!((status, &problem["field"]), (422, &json!("learning.min_views")), "{problem}");
    assert_eq!(service.gates().await.0, "inactive");
    let undo = format!("/api/v1/maps/hall/commits/{}/undo", newest["id"]);
    assert_eq!(service.ask(request("POST", &undo, "{}")).await.status(), StatusCode::OK);
    assert_eq!(service.gates().await.0, "active");
}

#[tokio::test]
async fn a_model_shows_its_pictures_and_harris_sets_whatever_is_learnt_after_it() {
    let service = Service::with_poster().await;
    let picture = async |which: &str| {
        let answer = service.ask(request("GET", &format!("{LANDMARK}/icon?which={which}"), "")).await;
        let status = answer.status();
        (status, axum::body::to_bytes(answer.into_body(), 1 << 20).await.unwrap())
    };
    let mut all = Vec::new();
    for which in ["exemplar1", "exemplar2", "exemplar3", "mean", "mode1", "mode2"] {
        let (status, png) = picture(which).await;
        assert!(status == StatusCode::OK && png.starts_with(b"\x89PNG"), "{which}: {status}");
        assert!(!all.contains(&png), "{which} is another one");
        all.push(png);
    }
    assert_eq!(picture("mode3").await.0, StatusCode::BAD_REQUEST);
    // Thresholds of the first are fitted again.
    service.teach("other", 2).await;
    assert_eq!(picture("mode2").await.1, all[5]);

    let (_, brief) = service.get(&format!("{LANDMARK}/model")).await;
    assert!(brief.get("harris").is_none() && brief["weights"] == json!({ "lambda": 6.0, "mu": 1.0 }));
    let (_, model) = service.get(&format!("{LANDMARK}/model?harris=true")).await;
    let sets = model["harris"].as_array().unwrap();
    assert_eq!((sets.len(), &sets[2]["exemplar"]), (3, &json!(3)));
    let (points, keypoints) = (sets[0]["points"].as_array().unwrap(), model["keypoints"].as_array().unwrap());
    assert!(points.len() > 10 && points.len() == keypoints.len(), "{}", points.len());
    assert_eq!((&points[0]["x_px"], points[0]["jet"].as_array().unwrap().len()), (&keypoints[0]["x_px"], 7));
}
