use super::{frame_tap::QUEUE, *};
use crate::{
    publication::tests::config,
    store::{maps, robots},
};
use engine::{
    frame_tap::GatheredFrame,
    scene::{MAP, Scene},
    slots::SlotKey,
    snapshot::MapSnapshot,
    workers::FrameObserver as _,
};
use map::pose2::{Pose2, Pose2Covariance};
use nalgebra::Matrix3;
use protos::{
    CheckedFrame, Name,
    convert::{EncodedImage, Encoding, Pixels},
    prost::bytes::Bytes,
};
use vision::{pipeline, recognise::DistanceKind, trace::NoTrace};

async fn store(dir: &std::path::Path) -> (Catalogue, crate::publication::CatalogueTasks) {
    let (store, task) = Catalogue::open(&config(dir)).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, MAP, DistanceKind::Both, 2))).await.unwrap();
    store.write(|tx| Box::pin(robots::put(tx, "r1", MAP, 5))).await.unwrap();
    (store, task)
}

fn new() -> NewGathering {
    NewGathering { robot: "r1".into(), landmark: None, known: false }
}

fn key(robot: &str) -> SlotKey {
    SlotKey { robot: Name::new(robot).unwrap(), camera: Name::new("front").unwrap() }
}

/// Raw grey frames of a robot at rest in front of a poster.
fn offered(count: u64) -> Vec<(CheckedFrame, GatheredFrame)> {
    let mut scene = Scene::new();
    let (_, readings) = scene.stops(1, 1).remove(0);
    let image = &readings.frame.image;
    let params = Params::default();
    let map = Arc::new(MapSnapshot::empty(MAP, 1));
    let landmarks = pipeline::LandmarkDatabase { models: &map.models, sizes: &map.sizes, kind: map.distance };
    let camera = pipeline::FrameCamera::level(None);
    let analysis = pipeline::Pipeline::default().analyse(image, camera, landmarks, &params, &mut NoTrace);
    let map_from_robot =
        Some(Pose2Covariance { pose: Pose2::new(1.0, 0.0, 0.0), covariance: Matrix3::zeros() });
    (1..=count)
        .map(|seq| {
            let frame = CheckedFrame {
                epoch: 1,
                seq,
                captured_ns: seq as i64 * 200_000_000,
                width_px: 640,
                height_px: 480,
                pixels: Pixels::Image(EncodedImage {
                    encoding: Encoding::Gray8,
                    bytes: Bytes::from(image.data().to_vec()),
                }),
                intrinsics: Some(scene.intrinsics()),
                mounting: None,
                odometry: None,
                prior: None,
                deadline_ms: None,
                map: None,
            };
            let (quads, map) = (analysis.quads.clone(), map.clone());
            (frame, GatheredFrame { image: image.clone(), quads, map, map_from_robot })
        })
        .collect()
}

#[tokio::test]
async fn a_full_queue_drops_and_counts_and_nobody_waits() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _writer) = store(dir.path()).await;
    let (tap, frames) = gathering_tap();
    let gatherer = Arc::new(Gatherer { store, params: Arc::default(), active: tap.active.clone() });
    let id = gatherer.begin(MAP, new()).await.unwrap().id;
    for (frame, gathered) in offered(QUEUE as u64 + 3) {
        tap.offer(&key("r1"), frame, gathered);
    }
    let (frame, gathered) = offered(1).remove(0);
    let other = GatheredFrame { map: Arc::new(MapSnapshot::empty("cellar", 1)), ..gathered };
    tap.offer(&key("r1"), frame, other);
    assert!(!tap.gathers(&key("r2")), "it does not gather");
    let counts = gatherer.counts(id).unwrap();
    assert_eq!((counts.frames, counts.dropped, counts.other_map), (QUEUE as u64 + 4, 3, 1));
    // Frames in the queue are handled; the same picture repeated is one view.
    drop(tap);
    gatherer.clone().run(frames).await;
    let counts = gatherer.counts(id).unwrap();
    assert!(
        counts.kept >= 1
            && counts.near_duplicate >= 5 * counts.kept
            && counts.too_few_observations >= 2 * counts.kept,
        "{counts:?}"
    );
    let tracks = gatherings::tracks(gatherer.store.reads(), id).await.unwrap();
    assert_eq!(tracks.iter().map(|t| t.views).sum::<u64>(), counts.kept);
    let ended = gatherer.end(MAP, id).await.unwrap();
    assert_eq!(serde_json::from_str::<GatheringCounts>(&ended.counts).unwrap(), counts);
    assert_eq!(gatherer.counts(id), None);
}

#[tokio::test]
async fn a_restart_goes_on_where_it_stopped() {
    let dir = tempfile::tempdir().unwrap();
    let (first, writer) = store(dir.path()).await;
    let (first_tap, frames) = gathering_tap();
    let (gatherer, task) = Gatherer::start(first, &config(dir.path()), &first_tap, frames).await.unwrap();
    let id = gatherer.begin(MAP, new()).await.unwrap().id;
    for (frame, gathered) in offered(QUEUE as u64) {
        first_tap.offer(&key("r1"), frame, gathered);
    }
    drop(first_tap);
    task.await.unwrap();
    let stored = gatherer.counts(id).unwrap().kept;
    drop(gatherer);
    writer.close().await;

    let (store, _writer) = Catalogue::open(&config(dir.path())).await.unwrap();
    let (tap, frames) = gathering_tap();
    let (gatherer, _task) = Gatherer::start(store, &config(dir.path()), &tap, frames).await.unwrap();
    let gathering = gatherer.active_gathering(id).unwrap();
    let views = lock(&gathering.tracker).tracks().iter().map(|t| t.views() as u64).sum::<u64>();
    assert!(stored >= 1 && views == stored);
    gatherer.decided(id, [1]);
    gatherer.delete(MAP, id).await.unwrap();
    assert!(gatherer.active_gathering(id).is_none());
}
