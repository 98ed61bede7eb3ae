use super::*;
use crate::{
    config::RawConfig,
    jobs::Jobs,
    publication::CatalogueTasks,
    store::{
        landmarks,
        teaching::{self, Teaching},
        views::{NewView, QuadCrop},
    },
};
use engine::picture;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use std::time::Duration;
use tokio::sync::watch;
use vision::{
    frame::GrayImage,
    geometry::Corners,
    learn::{TrainingView, learn, synthesis},
    params::Params,
    recognise::DistanceKind,
};

fn config(dir: &std::path::Path) -> Config {
    let mut raw = RawConfig { data: dir.to_owned(), ..RawConfig::default() };
    raw.algorithm.recognise.verdict.points = true;
    Config::try_from(raw).unwrap()
}

/// A poster, another for another seed.
fn photograph(seed: u64) -> GrayImage {
    let texture = sim::posters::poster_of_size(seed, 260, 1.0);
    GrayImage::new(texture.width(), texture.height(), texture.data().to_vec()).unwrap()
}

fn corners() -> Corners {
    Corners::try_from([[20.0, 20.0], [240.0, 24.0], [236.0, 238.0], [24.0, 232.0]]).unwrap()
}

/// Adds a view whose stored picture is `bytes`.
async fn teach(store: &Catalogue, landmark: &str, image: &GrayImage, bytes: Vec<u8>) {
    let photographed = TrainingView::photographed(image, &corners(), &Params::default()).unwrap();
    let crop = QuadCrop { corners_px: corners(), icon: photographed.icon };
    let view = NewView {
        image_sha256: Sha256::digest(&bytes).into(),
        image: bytes,
        image_kind: "png",
        size_px: [image.width(), image.height()],
        crop,
        distractors: vec![],
        capture: None,
    };
    let (map, landmark) = ("a".to_owned(), landmark.to_owned());
    teaching::add(store, Teaching { map, landmark, view, max: 9, novelty: None, size: None, create: None })
        .await
        .unwrap();
}

fn png(image: &GrayImage) -> Vec<u8> {
    picture::png(image.width(), image.height(), image.data()).unwrap()
}

/// Map `a` with landmarks `whole` and `damaged`, each with one view and a model without points. The
/// picture of `damaged` cannot be decoded.
async fn taught(config: &Config) -> (Catalogue, CatalogueTasks) {
    let (store, task) = Catalogue::open(config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    for (seed, name) in [(1, "whole"), (2, "damaged")] {
        let none = landmarks::LandmarkGeometry::default();
        let made = store.write(move |tx| Box::pin(landmarks::create(tx, "a", name, none, 5))).await.unwrap();
        let image = photograph(seed);
        let bytes = if name == "whole" { png(&image) } else { b"no picture".to_vec() };
        teach(&store, name, &image, bytes).await;
        let views = synthesis::views(&image, &corners(), 12, &config.params, seed);
        let id = LandmarkId(made.id as u64);
        store_model(&store, &learn(id, &views, &[], &config.params).unwrap()).await;
    }
    (store, task)
}

async fn store_model(store: &Catalogue, model: &LandmarkModel) {
    let new = models::NewModel {
        landmark: model.id,
        bytes: model.to_bytes(),
        params_hash: model.params_hash,
        summary: landmarks::ModelSummary {
            active: model.is_active(),
            looks_like: None,
            reasons: "[]".into(),
            facts: r#"{"look_alikes":[{"landmark":"twin"}]}"#.into(),
            views: 1,
            generated_views: 12,
            learnt_ms: 7,
        },
    };
    let write = store.write(move |tx| {
        Box::pin(async move {
            assert!(models::put(tx, 1, &new).await?);
            maps::bump(tx, 1).await
        })
    });
    write.await.unwrap();
}

/// The job once it has ended and what it stored is published.
async fn ended(jobs: &Jobs, job: i64) -> JobRow {
    let begun = Instant::now();
    loop {
        let (row, _) = jobs.get(job).await.unwrap();
        if !matches!(row.state.as_str(), "queued" | "running") {
            return row;
        }
        assert!(begun.elapsed() < Duration::from_mins(1), "{row:?}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

fn model(store: &Catalogue, id: u64) -> Arc<LandmarkModel> {
    store.snapshots().get("a").unwrap().learnt[&LandmarkId(id)].model.clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lesson_takes_points_of_the_pictures_that_can_be_read() {
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (store, _task) = taught(&config).await;
    // A second view, whose picture is damaged.
    teach(&store, "whole", &photograph(1), b"no picture either".to_vec()).await;
    let bystander = model(&store, 2).points.clone();
    let (stop, stopping) = watch::channel(false);
    let (jobs, _) = Jobs::start(store.clone(), Arc::new(config.clone()), stopping).await.unwrap();
    let request = Request { landmarks: Some(vec!["whole".to_owned()]), ..Request::default() };
    let job = jobs.submit("a", &request).await.unwrap();
    let row = ended(&jobs, job.id).await;
    assert_eq!(row.state, "done", "{row:?}");
    let learnt = model(&store, 1);
    let expected = vision::points::taught::view_points(&photograph(1), &corners());
    let expected = vision::points::taught::landmark_points(&[expected]);
    assert!(expected.len() >= 10, "{} points", expected.len());
    assert_eq!(learnt.points, expected);
    assert_eq!(model(&store, 2).points, bystander);
    let result: Value = serde_json::from_str(row.result.as_deref().unwrap()).unwrap();
    assert_eq!(result["points"], json!(expected.len()));
    drop(stop);
}
