//! A version that is made from the one before equals one that is made from nothing.

use super::*;
use crate::{
    publication::build,
    store::{history, landmark_learning},
};
use engine::snapshot::{MapSnapshot, Snapshots, StoredModel};
use map::landmark_health::LandmarkHealth;
use vision::{
    model::{
        landmark_model::{Gate, GateFailure, ModelStatus},
        threshold::Threshold,
    },
    params::preset::Preset,
    pose::LandmarkSize,
};

/// Thresholds and gates of every model.
fn models(map: &MapSnapshot) -> Vec<(ModelStatus, Vec<GateFailure>, Threshold)> {
    let of = |l: &StoredModel| (l.model.status.clone(), l.model.waived.clone(), l.model.hausdorff);
    map.learnt.values().map(of).collect()
}

/// The map as it is built without a version before it.
async fn from_nothing(store: &Catalogue, config: &Config, map: &MapSnapshot) -> MapSnapshot {
    let mut conn = store.reads().acquire().await.unwrap();
    let id = maps::get(store.reads(), &map.name).await.unwrap().id;
    let (none, vitals) = (Snapshots::default(), engine::vitals::Vitals::default());
    build::snapshot(&mut conn, id, &none, &config.params, vitals.panics()).await.unwrap().unwrap()
}

#[tokio::test]
async fn a_version_made_from_the_one_before_equals_one_made_from_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (store, _task) = Catalogue::open(&config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let check = async |what: &str| {
        let published = store.snapshots().get("a").unwrap();
        let built = from_nothing(&store, &config, &published).await;
        assert_eq!(published.landmarks, built.landmarks, "{what}");
        assert!(build::digests(&published.learnt).eq(build::digests(&built.learnt)), "{what}");
        published.landmarks.clone()
    };
    let none = landmarks::LandmarkGeometry::default();
    for name in ["p1", "p2", "p3"] {
        let made = store.write(move |tx| Box::pin(landmarks::create(tx, "a", name, none, 5))).await.unwrap();
        store_model(&store, made.id, &config.params).await;
        check(name).await;
    }
    let taught = history::newest(store.reads(), 1).await.unwrap();
    let size = Some(LandmarkSize { width_m: 0.5, height_m: 0.7 });
    let sized = move |old| landmarks::LandmarkGeometry { size, ..old };
    store.write(move |tx| Box::pin(landmarks::update(tx, "a", "p2", sized))).await.unwrap();
    let with_size = check("a size").await;
    assert_eq!(with_size.values().filter(|l| l.size == size).count(), 1);
    store.write(|tx| Box::pin(landmarks::rename(tx, "a", "p1", "door"))).await.unwrap();
    check("a name").await;
    // Health has no revision: robots change it.
    let quarantined = LandmarkHealth::Quarantined;
    let write = store.write(move |tx| Box::pin(landmarks::set_health(tx, "a", "p2", quarantined, None)));
    write.await.unwrap();
    assert_eq!(check("a health").await.values().filter(|l| l.health == quarantined).count(), 1);
    store.write(|tx| Box::pin(landmarks::delete(tx, "a", "p3"))).await.unwrap();
    assert_eq!(check("a deletion").await.len(), 2);
    store.write(move |tx| Box::pin(landmarks::create(tx, "a", "p3", none, 5))).await.unwrap();
    check("the name once more").await;
    store.write(move |tx| Box::pin(history::roll_back(tx, "a", taught))).await.unwrap();
    let back = check("a roll back").await;
    assert_eq!(back.values().filter(|l| l.size.is_some()).count(), 0);
    assert_eq!(back.values().map(|l| l.name.as_str()).collect::<Vec<_>>(), ["p1", "p2", "p3"]);
}

#[tokio::test]
async fn a_maps_preset_goes_over_the_servers_settings() {
    let dir = tempfile::tempdir().unwrap();
    let mut raw = RawConfig { data: dir.path().to_owned(), ..RawConfig::default() };
    raw.algorithm.detect.edges.high *= 2.0;
    let config = Config::try_from(raw).unwrap();
    let (store, task) = Catalogue::open(&config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let none = landmarks::LandmarkGeometry::default();
    let made = store.write(move |tx| Box::pin(landmarks::create(tx, "a", "p", none, 5))).await.unwrap();
    store_model(&store, made.id, &config.params).await;
    let of = |store: &Catalogue| store.snapshots().get("a").unwrap();
    let before = of(&store);
    assert_eq!(*before.params, *config.params);
    let paper = maps::MapPipeline { preset: Some(Preset::Paper), distance: DistanceKind::Hausdorff };
    store.write(move |tx| Box::pin(maps::set_pipeline(tx, "a", move |_| paper))).await.unwrap();
    let own = of(&store);
    assert_eq!((&*own.params, own.distance), (&Preset::Paper.over(&config.params), paper.distance));
    assert_eq!((own.version, own.learnt.len()), (before.version + 1, before.learnt.len()));
    assert!(own.params.detect.edges == before.params.detect.edges && own.unusable_models.is_empty());
    assert_eq!(models(&own), models(&from_nothing(&store, &config, &own).await));
    assert_ne!(models(&own), models(&before), "the preset refuses what is seen from one side");
    // Nothing changes, so there is no new version.
    store.write(move |tx| Box::pin(maps::set_pipeline(tx, "a", move |_| paper))).await.unwrap();
    assert_eq!(of(&store).version, own.version);
    task.close().await;
    let (store, _task) = Catalogue::open(&config).await.unwrap();
    assert_eq!(of(&store).params, own.params);
}

#[tokio::test]
async fn a_maps_weights_and_gates_judge_its_models_and_a_landmarks_own_go_before() {
    let dir = tempfile::tempdir().unwrap();
    let config = config(dir.path());
    let (store, _task) = Catalogue::open(&config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    let none = landmarks::LandmarkGeometry::default();
    for name in ["own", "other"] {
        let made = store.write(move |tx| Box::pin(landmarks::create(tx, "a", name, none, 5))).await.unwrap();
        store_model(&store, made.id, &config.params).await;
    }
    let own = "{\"reason\":\"r\",\"min_views\":1}";
    store.write(move |tx| Box::pin(landmark_learning::set(tx, ("a", "own"), Some(own), None))).await.unwrap();
    // Whether the number of views, 2, fails in each.
    let few = async |learning: Option<&'static str>| {
        store.write(move |tx| Box::pin(maps::set_learning(tx, "a", learning, None))).await.unwrap();
        let map = store.snapshots().get("a").unwrap();
        assert_eq!(models(&map), models(&from_nothing(&store, &config, &map).await), "{learning:?}");
        let fails = |l: &StoredModel| match &l.model.status {
            ModelStatus::Candidate(failures) => failures.iter().any(|f| f.gate == Gate::Views),
            ModelStatus::Active => false,
        };
        map.learnt.values().map(fails).collect::<Vec<_>>()
    };
    assert_eq!(few(None).await, [false, true]);
    assert_eq!(few(Some("{\"reason\":\"r\",\"min_views\":2}")).await, [false, false]);
    assert_eq!(few(Some("{\"reason\":\"r\",\"min_views\":3}")).await, [false, true]);
    assert_eq!(few(None).await, [false, true]);
}
