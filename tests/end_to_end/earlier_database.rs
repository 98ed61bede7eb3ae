//! Claim: a database of an earlier build opens, and its landmarks are recognised without a new lesson; one job adds
//! points to its models from the stored views, once.

use client::{
    MapClient,
    api::{JobState, LandmarkStatus},
};
use flate2::read::GzDecoder;
use protos::v1;
use serde_json::json;
use std::{fs, path::Path};
use tempfile::TempDir;
use tests::{Child, SOON};

fn fixture(name: &str) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name);
    fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Only icons decide: no model needs points.
const BY_ICONS: [(&str, &str); 1] = [("WAYMARK_ALGORITHM__RECOGNISE__VERDICT__POINTS", "false")];

/// A data directory with the database of the build.
fn earlier() -> TempDir {
    let data = TempDir::new().expect("a temporary directory");
    let packed = fixture("2026-11-22.sqlite.gz");
    let mut database = fs::File::create(data.path().join("waymark.sqlite")).expect("a file");
    std::io::copy(&mut GzDecoder::new(&*packed), &mut database).expect("the database");
    data
}

#[tokio::test(flavor = "multi_thread")]
async fn a_database_of_2026_11_22_recognises_its_landmarks() {
    let data = earlier();
    let server = Child::start_with(data.path(), &BY_ICONS);
    let maps = server.maps();
    let all = maps.maps().await.expect("maps");
    assert_eq!(all.len(), 1, "{all:?}");
    let map = all[0].name.as_str();
    assert_eq!(active(&maps, map).await, POSTERS, "a stored model is inactive");
    let answer = recognise(&maps, map).await;
    let named: Vec<&str> =
        answer.quads.iter().map(|q| q.landmark.as_str()).filter(|name| !name.is_empty()).collect();
    assert_eq!((answer.status(), named.as_slice()), (v1::Status::Matched, &["poster-0"][..]));
    assert!(maps.job(2).await.is_err(), "a lesson although points do not decide");
}

#[tokio::test(flavor = "multi_thread")]
async fn models_of_2026_11_22_get_points_once_where_points_decide() {
    let data = earlier();
    let server = Child::start(data.path());
    let maps = server.maps();
    let all = maps.maps().await.expect("maps");
    let map = all[0].name.as_str();
    assert_eq!(active(&maps, map).await, POSTERS, "a stored model is inactive");

    // The fixture has one job, that of its lesson.
    let job = maps.job(2).await.expect("the job that adds points");
    let job = maps.wait_for_job(job, 6 * SOON, |_| {}).await.expect("points");
    assert_eq!((job.kind.as_str(), job.state), ("learn", JobState::Done), "{job:?}");
    let result = job.result.expect("a result");
    assert_eq!((&result["with_points"], &result["failed"]), (&json!(6), &json!([])), "{result}");
    assert_eq!(active(&maps, map).await, POSTERS);
    for poster in POSTERS {
        let landmark = maps.landmark(map, poster).await.expect("a landmark");
        let model = landmark.model.expect("a model");
        assert!(model.facts["points"].as_u64().is_some_and(|points| points >= 10), "{poster}: {model:?}");
    }

    let answer = recognise(&maps, map).await;
    let quad = answer.quads.iter().find(|q| q.landmark == "poster-0").expect("the poster");
    let points = quad.points.as_ref().expect("decided by points");
    assert!(points.inliers >= 8 && points.inliers <= points.matches, "{points:?}");
    assert!(points.log10_false_alarms <= -6.0, "{points:?}");
    let agreeing = points.agreement().filter(|part| *part == v1::PartAgreement::Agrees).count();
    assert!(points.agreement.len() == 25 && agreeing >= 5, "{points:?}");

    // The next start has no such job.
    server.kill();
    let server = Child::start(data.path());
    let maps = server.maps();
    assert!(maps.job(3).await.is_err(), "points are added a second time");
    assert!(recognise(&maps, map).await.quads.iter().any(|q| q.points.is_some()));
}

const POSTERS: [&str; 6] = ["poster-0", "poster-1", "poster-2", "poster-3", "poster-4", "poster-5"];

async fn active(maps: &MapClient, map: &str) -> Vec<String> {
    let landmarks = maps.landmarks(map).await.expect("landmarks");
    landmarks.into_iter().filter(|l| l.status == LandmarkStatus::Active).map(|l| l.name).collect()
}

/// The answer to the frame, in which the poster alone is recognised.
async fn recognise(maps: &MapClient, map: &str) -> v1::Answer {
    let answer = maps.recognise(map, fixture("poster-0.jpg"), None).await.expect("an answer");
    let named: Vec<&str> =
        answer.quads.iter().map(|q| q.landmark.as_str()).filter(|name| !name.is_empty()).collect();
    assert_eq!((answer.status(), named.as_slice()), (v1::Status::Matched, &["poster-0"][..]));
    answer
}
