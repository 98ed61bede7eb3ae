//! A copy of a map has all that the map has, with numbers of its own.

use super::*;
use crate::store::db;
use crate::{
    config::Limits,
    publication::{Catalogue, tests::config},
    store::{
        StoreError,
        kind::Kind,
        landmark_learning,
        landmark_placement::tests::seen_from,
        landmarks::{self, ModelSummary, StoredPlace},
        map_locations, maps,
        modality_stats::{self, ModalitySettings},
        models::{self, NewModel},
        pictures::digest,
        teaching::{self, Teaching},
        tests::rows::{columns, exact},
        underlays, visibility_settings, walls,
    },
};
use map::{
    map_links::MapLink,
    modality_stats::NamedArea,
    pose2::{Pose2, Pose2Covariance},
    visibility::VisibilitySettings,
};
use nalgebra::{Matrix3, Matrix6};
use serde_json::json;
use std::collections::BTreeMap;
use vision::{
    geometry::Corners,
    icon::Icon,
    learn,
    params::{Params, preset::Preset},
    pose::LandmarkSize,
    recognise::DistanceKind,
};

crate::store::tests::cluster::on_each_store! {
    a_copy_has_every_column_of_the_map,
    models_of_a_copy_carry_its_numbers_and_are_used,
    a_copy_keeps_the_bounds_of_maps_and_the_pictures_of_a_deleted_one,
}

/// Tables of a map, with what says whose row it is.
const TABLES: [(&str, &str); 8] = [
    ("maps", "id = $1"),
    ("landmarks", "map_id = $1"),
    ("views", "landmark_id IN (SELECT id FROM landmarks WHERE map_id = $1)"),
    ("models", "landmark_id IN (SELECT id FROM landmarks WHERE map_id = $1)"),
    ("strangers", "map_id = $1"),
    ("laser_segments", "map_id = $1"),
    ("runs", "map_id = $1"),
    ("underlays", "map_id = $1"),
];

/// Columns that number rows or count changes, and the name; `sha256` of a model and what names
/// other landmarks hold numbers.
const OWN: [&str; 15] = [
    "id",
    "map_id",
    "landmark_id",
    "name",
    "version",
    "walls_version",
    "revision",
    "underlay_revision",
    "changed_ms",
    "sha256",
    "facts",
    "looks_like",
    "image",
    "draft_of",
    "draft_from",
];

/// A model of one view of grey levels, for the landmark with this number.
pub(crate) fn model_of(landmark: i64, seed: usize) -> NewModel {
    let params = Params::default();
    let side = params.icon.size;
    let pixels = (0..side * side).map(|i| ((i * i * 31 + i * (7 + seed)) % 251) as f32).collect();
    let view = learn::TrainingView {
        icon: Icon::new(side, pixels, 1.0).unwrap(),
        corners_px: Corners::try_from([[0.0, 0.0], [90.0, 0.0], [90.0, 90.0], [0.0, 90.0]]).unwrap(),
        image_size_px: [91, 91],
        exact: None,
        generated: false,
    };
    let id = LandmarkId(landmark as u64);
    let model = learn::learn(id, &[view.clone(), view], &[], &params).unwrap();
    let other = json!({ "id": 3 - landmark, "landmark": "other", "gradient_similarity": 1.0 / 3.0 });
    let summary = ModelSummary {
        active: landmark == 1,
        looks_like: (landmark == 2).then(|| other.to_string()),
        reasons: "[1]".into(),
        facts: json!({ "look_alikes": [other], "saliency": 0.1 }).to_string(),
        views: 2,
        generated_views: 1,
        learnt_ms: 7,
    };
    NewModel { landmark: id, bytes: model.to_bytes(), params_hash: model.params_hash, summary }
}

fn place() -> LandmarkGeometry {
    let covariance = Some(Matrix6::from_fn(|i, j| if i == j { 0.1 + i as f64 / 3.0 } else { 0.0 }));
    let (x_m, y_m, z_m) = (1.0 / 3.0, 0.2, 1.5);
    let place = StoredPlace { x_m, y_m, z_m, theta_rad: 1.1, roll_rad: 0.1, tilt_rad: 0.2, covariance };
    let size = LandmarkSize { width_m: 0.6, height_m: 1.0 / 1.3 };
    LandmarkGeometry { size: Some(size), place: Some(place), size_from_views: true }
}

/// Map `a` in map `outer`, with something in every column of every table; landmarks `p1` (number 1)
/// and `p2` (2).
pub(crate) async fn filled(store: &Catalogue) {
    let corners_m = vec![[0.0, 0.0], [1.0 / 3.0, 0.0], [1.0, 3.0]];
    let settings = ModalitySettings {
        mode: FusionMode::Best,
        named: vec![NamedArea { name: "hall".into(), corners_m }],
    };
    let mut sight = VisibilitySettings::default();
    sight.viewer.focal_px = 700.0 / 3.0;
    let parent_from_map =
        Pose2Covariance { pose: Pose2::new(1.5, -2.0, 0.7), covariance: Matrix3::identity() / 7.0 };
    let word = |text: &str| Some(text.to_owned());
    let link = Some(MapLink { parent: "outer".into(), parent_from_map, level_m: 3.4 });
    let location = MapLocation { site: word("Works"), building: word("B"), floor: word("1"), link };
    let underlay = UnderlayRow {
        image_sha256: digest(b"floor"),
        image_kind: "png".into(),
        size_px: [2, 3],
        metres_per_pixel: 0.05,
        map_from_picture: [0.1, 0.2, 0.3],
        created_ms: 0,
    };
    let write = store.write(move |tx| {
        Box::pin(async move {
            let distance = DistanceKind::Correlation;
            maps::create(tx, "a", maps::MapPipeline { preset: Some(Preset::Paper), distance }, 9).await?;
            maps::create(tx, "outer", DistanceKind::Both, 9).await?;
            landmarks::create(tx, "a", "p1", place(), 9).await?;
            landmarks::create(tx, "a", "p2", LandmarkGeometry::default(), 9).await?;
            landmarks::set_health(tx, "a", "p1", LandmarkHealth::Flagged, Some("{\"x\":1}")).await?;
            let learning = "{\"reason\":\"hung by us\",\"use_despite_gates\":true}";
            landmark_learning::set(tx, ("a", "p1"), Some(learning), None).await?;
            maps::set_learning(tx, "a", Some(learning), None).await?;
            for (landmark, seed) in [(1, 0), (2, 5)] {
                models::put(tx, 1, &model_of(landmark, seed)).await?;
            }
            let known = walls::StoredWall {
                ends: [0.0, 0.0, 1.0 / 3.0, 0.0],
                covariance: Some([1e-6, 1e-7 / 3.0, 1e-4]),
            };
            walls::replace(tx, "a", &[known, [1.0, 0.0, 1.0, 2.0].into()]).await?;
            underlays::put(tx, "a", underlay, b"floor").await?;
            modality_stats::set(tx, "a", |_| settings).await?;
            modality_stats::add(tx, "a", "r1", 12.5, &BTreeMap::new()).await?;
            visibility_settings::set(tx, "a", &sight).await?;
            map_locations::set(tx, "a", |_| location).await.map(drop)
        })
    });
    write.await.unwrap();
    let mut view = seen_from(1.4, 1, 0.0);
    view.distractors = vec![view.crop.clone()];
    let (map, landmark) = ("a".to_owned(), "p2".to_owned());
    let teaching = Teaching { map, landmark, view, max: 9, novelty: None, size: None, create: None };
    teaching::add(store, teaching).await.unwrap();
}

/// The rows of a table that belong to a map, as text, to the last bit; without these columns.
pub(crate) async fn rows(
    store: &Catalogue,
    (table, of): (&str, &str),
    map: i64,
    without: &[&str],
) -> Vec<String> {
    let columns: Vec<_> = columns(store.reads(), table).await.into_iter().map(|(name, _)| name).collect();
    let shown = columns.iter().filter(|c| !without.contains(&c.as_str()));
    let exact = shown.map(|c| format!("'{c}=' || {}", exact(store.reads(), c)));
    let exact = exact.collect::<Vec<_>>().join(" || ',' || ");
    let order = if table == "laser_segments" { "ordinal" } else { columns[0].as_str() };
    let sql = format!("SELECT {exact} FROM {table} WHERE {of} ORDER BY {order}");
    db::query_scalar(db::AssertSqlSafe(sql)).bind(map).fetch_all(store.reads()).await.unwrap()
}

async fn a_copy_has_every_column_of_the_map() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    filled(&store).await;
    let written = copy(&store, "a", "b", &Limits::default()).await.unwrap();
    let (a, b) = (maps::get(store.reads(), "a").await.unwrap().id, written.map.id);
    for (table, of) in TABLES {
        // A copy is a map of today.
        let without = [&OWN[..], if table == "maps" { &["created_ms"] } else { &[] }].concat();
        let source = rows(&store, (table, of), a, &without).await;
        assert!(!source.is_empty(), "{table} is filled");
        assert_eq!(rows(&store, (table, of), b, &without).await, source, "{table}");
        for (column, default) in columns(store.reads(), table).await {
            let empty = format!("{column}={}", default.unwrap_or_else(|| "NULL".into()));
            let is_empty = |row: &String| row.split(',').any(|part| part == empty);
            let is_unfilled = source.iter().all(is_empty);
            assert!(!is_unfilled, "{table}.{column}: fill it above, so that the copy of it is tested");
        }
    }
    let history: i64 = db::query_scalar("SELECT count(*) FROM commits WHERE map_id = $1")
        .bind(b)
        .fetch_one(store.reads())
        .await
        .unwrap();
    assert_eq!(history, 1, "a copy is one commit");
}

async fn models_of_a_copy_carry_its_numbers_and_are_used() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    filled(&store).await;
    let numbers = copy(&store, "a", "b", &Limits::default()).await.unwrap().landmarks;
    let (_, source) = contents_of(&store, "a").await.unwrap();
    let (_, made) = contents_of(&store, "b").await.unwrap();
    assert!(numbers.values().all(|number| number.0 > 2));
    let snapshot = store.snapshots().get("b").unwrap();
    assert_eq!(snapshot.unusable_models, BTreeMap::new());
    let first = &snapshot.learnt[&numbers[&LandmarkId(1)]].model;
    assert_eq!(first.exemplars, store.snapshots().get("a").unwrap().learnt[&LandmarkId(1)].model.exemplars);
    for (old, new) in source.landmarks.iter().zip(&made.landmarks) {
        assert_eq!(new.number, numbers[&old.number]);
        let (old, new) = (old.model.as_ref().unwrap(), new.model.as_ref().unwrap());
        assert_ne!(old.bytes, new.bytes);
        let back: BTreeMap<_, _> = numbers.iter().map(|(old, new)| (*new, *old)).collect();
        let number = LandmarkId(u64::from_le_bytes(old.bytes[14..22].try_into().unwrap()));
        assert_eq!(&in_other_map(new, number, &back), old, "and back, byte for byte");
    }
    let refused = made.landmarks[1].model.as_ref().unwrap().summary.looks_like.clone().unwrap();
    let other: serde_json::Value = serde_json::from_str(&refused).unwrap();
    assert_eq!(other["id"], numbers[&LandmarkId(1)].0);
}

async fn a_copy_keeps_the_bounds_of_maps_and_the_pictures_of_a_deleted_one() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    filled(&store).await;
    let refused = async |limits: Limits| copy(&store, "a", "b", &limits).await.unwrap_err();
    let default = Limits::default;
    assert!(matches!(refused(Limits { maps: 2, ..default() }).await, StoreError::Limit { what: "maps", .. }));
    let few = Limits { landmarks: 1, ..default() };
    assert!(matches!(refused(few).await, StoreError::Limit { what: "landmarks in a map", .. }));
    let few = Limits { laser_segments: 1, ..default() };
    assert!(matches!(refused(few).await, StoreError::Limit { max: 1, .. }));
    let taken = copy(&store, "a", "outer", &default()).await;
    assert!(matches!(taken, Err(StoreError::Exists { what: Kind::Map, .. })));
    let missing = copy(&store, "z", "b", &default()).await;
    assert!(matches!(missing, Err(StoreError::NotFound { what: Kind::Map, .. })));
    copy(&store, "a", "b", &default()).await.unwrap();
    store.write(|tx| Box::pin(maps::delete(tx, "a"))).await.unwrap();
    let pictures = "SELECT count(*) FROM pictures";
    let count: i64 = db::query_scalar(pictures).fetch_one(store.reads()).await.unwrap();
    assert_eq!(count, 2, "the photograph and the floor plan");
}
