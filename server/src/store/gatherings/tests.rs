use super::*;
use crate::{
    publication::{Catalogue, CatalogueTasks, tests::config},
    store::{landmarks::LandmarkGeometry, maps, track_acceptance},
};
use map::tracks::StoredTrack;
use vision::{geometry::Corners, icon::Icon, recognise::DistanceKind};

crate::store::tests::cluster::on_each_store! {
    every_bound_holds_and_a_refusal_changes_nothing,
    an_acceptance_is_whole_or_nothing,
}

const GATHERING_LIMITS: GatheringLimits =
    GatheringLimits { open: 2, of_map: 3, tracks: 2, views: 2, bytes: 40 };
const ACCEPTANCE_LIMITS: track_acceptance::AcceptanceLimits =
    track_acceptance::AcceptanceLimits { landmarks: 2, views: 3, jobs: (1, 5) };

async fn store(dir: &std::path::Path) -> (Catalogue, CatalogueTasks) {
    let (store, task) = Catalogue::open(&config(dir)).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    for robot in ["r1", "r2", "r3"] {
        store.write(move |tx| Box::pin(robots::put(tx, robot, "a", 5))).await.unwrap();
    }
    (store, task)
}

async fn begun(store: &Catalogue, robot: &str) -> Result<GatheringRow, StoreError> {
    let new = NewGathering { robot: robot.to_owned(), landmark: None, known: false };
    store.write(move |tx| Box::pin(async move { create(tx, "a", &new, GATHERING_LIMITS).await })).await
}

async fn kept(store: &Catalogue, id: i64, number: u32, picture: u8, bytes: usize) -> Result<(), StoreError> {
    let track = StoredTrack { number, landmark: None, sightings: u32::from(picture), known: 0, place: None };
    let corners = Corners::try_from([[1.0, 1.0], [90.0, 1.0], [90.0, 99.0], [1.0, 99.0]]).unwrap();
    let new = NewView {
        image: vec![picture; bytes],
        image_sha256: [picture; 32],
        image_kind: "jpeg",
        size_px: [640, 480],
        crop: QuadCrop {
            corners_px: corners,
            icon: Icon::new(20, vec![f32::from(picture); 400], 1.0).unwrap(),
        },
        distractors: vec![],
        capture: None,
    };
    store
        .write(move |tx| Box::pin(async move { add_view(tx, id, &track, &new, GATHERING_LIMITS).await }))
        .await
}

fn at_bound<T: std::fmt::Debug>(result: &Result<T, StoreError>, what: &str) {
    assert!(matches!(result, Err(StoreError::Limit { what: w, .. }) if w.contains(what)), "{result:?}");
}

async fn every_bound_holds_and_a_refusal_changes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let id = begun(&store, "r1").await.unwrap().id;
    assert!(matches!(begun(&store, "r1").await, Err(StoreError::InUse(_))), "it gathers already");
    begun(&store, "r2").await.unwrap();
    at_bound(&begun(&store, "r3").await, "at a time");
    kept(&store, id, 1, 1, 10).await.unwrap();
    kept(&store, id, 1, 1, 10).await.unwrap();
    kept(&store, id, 1, 2, 10).await.unwrap();
    at_bound(&kept(&store, id, 1, 3, 1).await, "views of a track");
    at_bound(&kept(&store, id, 2, 4, 21).await, "bytes");
    kept(&store, id, 2, 4, 20).await.unwrap();
    at_bound(&kept(&store, id, 3, 5, 1).await, "tracks");
    let all = tracks(store.reads(), id).await.unwrap();
    let brief: Vec<_> = all.iter().map(|t| (t.number, t.sightings, t.views)).collect();
    assert_eq!(brief, [(1, 2, 2), (2, 4, 1)], "the same view twice is one view");
    store.write(move |tx| Box::pin(discard(tx, "a", id, 2))).await.unwrap();
    assert!(matches!(kept(&store, id, 2, 6, 1).await, Err(StoreError::InUse(_))), "it was thrown away");
    assert!(store.write(move |tx| Box::pin(discard(tx, "a", id, 2))).await.is_err());
    kept(&store, id, 3, 5, 20).await.unwrap();
    store.write(move |tx| Box::pin(end(tx, "a", id, "{}"))).await.unwrap();
    assert!(matches!(kept(&store, id, 3, 6, 1).await, Err(StoreError::InUse(_))), "it has ended");
    begun(&store, "r3").await.unwrap();
    let two = page(store.reads(), 1, id, 10).await.unwrap()[0].id;
    store.write(move |tx| Box::pin(end(tx, "a", two, "{}"))).await.unwrap();
    at_bound(&begun(&store, "r1").await, "gatherings of a map");
    store.write(move |tx| Box::pin(delete(tx, "a", two))).await.unwrap();
    begun(&store, "r1").await.unwrap();
    assert!(track_views(store.reads(), id, 3).await.unwrap().len() == 1);
    store.write(move |tx| Box::pin(delete(tx, "a", id))).await.unwrap();
    assert!(track_views(store.reads(), id, 3).await.unwrap().is_empty(), "gone with its gathering");
}

async fn accepted(
    store: &Catalogue,
    id: i64,
    tracks: &[(u32, &str)],
) -> Result<track_acceptance::AcceptanceResult, StoreError> {
    let tracks: Vec<_> = tracks
        .iter()
        .map(|(n, name)| track_acceptance::TrackAcceptance { number: *n, name: Some((*name).to_owned()) })
        .collect();
    let lesson = Some(crate::jobs::request::Request::of as fn(&[String]) -> String);
    let (map, after) = ("a".to_owned(), std::sync::Arc::new(|| ()));
    let decision =
        track_acceptance::Decision { map, gathering: id, tracks, lesson, limits: ACCEPTANCE_LIMITS, after };
    track_acceptance::accept(store, decision).await
}

async fn an_acceptance_is_whole_or_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let id = begun(&store, "r1").await.unwrap().id;
    kept(&store, id, 1, 1, 10).await.unwrap();
    kept(&store, id, 1, 2, 10).await.unwrap();
    kept(&store, id, 2, 3, 10).await.unwrap();
    store
        .write(|tx| Box::pin(landmarks::create(tx, "a", "taken", LandmarkGeometry::default(), 5)))
        .await
        .unwrap();
    let landmarks = async || store.snapshots().get("a").unwrap().landmarks.len();
    // The second is not there; a new landmark is one too many; the job is one too many: nothing of
    // the first stays.
    assert!(matches!(accepted(&store, id, &[(1, "x"), (7, "y")]).await, Err(StoreError::NotFound { .. })));
    at_bound(&accepted(&store, id, &[(1, "x"), (2, "y")]).await, "landmarks");
    assert_eq!((landmarks().await, track_views(store.reads(), id, 1).await.unwrap().len()), (1, 2));
    // Two tracks of one object, and a landmark that has no views yet.
    let made = accepted(&store, id, &[(1, "taken"), (2, "taken")]).await.unwrap();
    assert_eq!(made.landmarks["taken"].0, 3);
    let job = made.job.unwrap();
    assert!(job.request.contains("taken") && job.state == "queued");
    assert_eq!(crate::store::landmarks::get(store.reads(), "a", "taken").await.unwrap().views, 3);
    kept(&store, id, 4, 9, 1).await.unwrap();
    let again = accepted(&store, id, &[(4, "taken")]).await;
    assert!(matches!(again, Err(StoreError::Exists { .. })), "it has views of its own");
    at_bound(&accepted(&store, id, &[(4, "x")]).await, "jobs");
    assert_eq!(landmarks().await, 1);
    let states: Vec<_> = tracks(store.reads(), id).await.unwrap().into_iter().map(|t| t.state).collect();
    assert_eq!(states, ["accepted", "accepted", "open"]);
}
