//! Every change is a commit, and every commit can be gone back to.

use super::*;
use crate::{
    config::Config,
    publication::{
        Catalogue, CatalogueTasks,
        tests::{config, raw_config},
    },
    store::{
        gatherings, jobs,
        landmark_placement::tests::seen_from,
        landmarks::{self, LandmarkGeometry, ModelSummary, StoredPlace},
        map_locations::{self, MapLocation},
        maps,
        modality_stats::{self, ModalitySettings},
        models::{self, NewModel},
        pictures::digest,
        robots,
        teaching::{self, Teaching},
        tests::rows,
        track_acceptance::{
            self,
            tests::{decision, gathered},
        },
        underlays::{self, UnderlayRow},
        views, visibility_settings, walls,
    },
};
use futures::future::BoxFuture;
use map::{landmark_health::LandmarkHealth, modality_stats::FusionMode, visibility::VisibilitySettings};
use std::collections::BTreeMap;
use vision::{model::LandmarkId, params::preset::Preset, pose::LandmarkSize, recognise::DistanceKind};

/// Columns that count and are not gone back to: of a row's life, not of what it says. A map keeps
/// its name.
const COUNTERS: [&str; 9] = [
    "revision",
    "changed_ms",
    "version",
    "walls_version",
    "underlay_revision",
    "created_ms",
    "id",
    "draft_of",
    "draft_from",
];

/// What a map consists of: tables, with what holds their earlier rows.
const TABLES: [(&str, &str); 8] = [
    ("maps", "past_maps"),
    ("landmarks", "past_landmarks"),
    ("views", "past_views"),
    ("strangers", "past_strangers"),
    ("models", "past_models"),
    ("laser_segments", "past_walls"),
    ("runs", "past_runs"),
    ("underlays", "past_underlays"),
];

async fn columns(store: &Catalogue, table: &str) -> Vec<String> {
    rows::columns(store.reads(), table).await.into_iter().map(|(name, _)| name).collect()
}

/// All rows of all maps, as text; REAL numbers to the last bit. Without what only counts, and
/// without names of maps.
async fn state(store: &Catalogue) -> BTreeMap<&'static str, Vec<String>> {
    let mut all = BTreeMap::new();
    for (table, _) in TABLES {
        let mut columns = columns(store, table).await;
        columns.retain(|c| {
            !["revision", "changed_ms", "version", "walls_version", "underlay_revision"].contains(&c.as_str())
        });
        columns.retain(|c| table != "maps" || c != "name");
        let exact = columns.iter().map(|column| rows::exact(store.reads(), column));
        let sql = format!("SELECT {} FROM {table} ORDER BY 1", exact.collect::<Vec<_>>().join(" || ',' || "));
        let rows: Vec<String> =
            db::query_scalar(db::AssertSqlSafe(sql)).fetch_all(store.reads()).await.unwrap();
        all.insert(table, rows);
    }
    let bytes = "SELECT hex(c.bytes) FROM models m JOIN model_contents c ON c.sha256 = m.sha256 ORDER BY m.landmark_id";
    all.insert("bytes", db::query_scalar(bytes).fetch_all(store.reads()).await.unwrap());
    all
}

type Write = Box<dyn for<'t> FnOnce(&'t mut Tx) -> BoxFuture<'t, Result<(), StoreError>> + Send>;
use crate::store::Tx;

crate::store::tests::cluster::on_each_store! {
    every_change_is_one_commit_and_every_commit_can_be_gone_back_to,
    what_robots_do_and_what_changes_nothing_is_no_commit,
    a_finding_stays_with_the_place_that_it_is_about, a_restored_landmark_has_a_revision_that_it_never_had,
    a_commit_says_who_and_why,
}

/// A write of one step, without its result.
macro_rules! write {
    (|$tx:ident| $body:expr) => {
        Box::new(move |$tx: &mut Tx| Box::pin(async move { $body.await.map(drop) }))
    };
}

fn at(x_m: f64) -> LandmarkGeometry {
    let place = StoredPlace {
        x_m,
        y_m: 0.1,
        z_m: 1.5,
        theta_rad: 1.1,
        roll_rad: 0.0,
        tilt_rad: 0.0,
        covariance: None,
    };
    let size = Some(LandmarkSize { width_m: 0.6, height_m: 0.8 });
    LandmarkGeometry { size, place: Some(place), size_from_views: false }
}

/// A wall with a covariance.
fn known_wall() -> walls::StoredWall {
    walls::StoredWall { ends: [0.0, 0.0, 1.0 / 3.0, 0.0], covariance: Some([1e-6, 1e-7 / 3.0, 1e-4]) }
}

fn model(landmark: u64, bytes: &[u8]) -> NewModel {
    let summary = ModelSummary {
        active: false,
        looks_like: None,
        reasons: "[]".into(),
        facts: "{}".into(),
        views: 2,
        generated_views: 0,
        learnt_ms: 7,
    };
    NewModel { landmark: LandmarkId(landmark), bytes: bytes.to_vec(), params_hash: 1, summary }
}

fn underlay(image: &[u8]) -> UnderlayRow {
    UnderlayRow {
        image_sha256: digest(image),
        image_kind: "png".into(),
        size_px: [2, 2],
        metres_per_pixel: 0.05,
        map_from_picture: [0.1, 0.2, 0.3],
        created_ms: 0,
    }
}

/// Map `a` with landmark `p1`.
async fn open(config: &Config) -> (Catalogue, CatalogueTasks) {
    let (store, task) = Catalogue::open(config).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    do_one(&store, write!(|tx| landmarks::create(tx, "a", "p1", at(1.0 / 3.0), 9))).await;
    (store, task)
}

async fn do_one(store: &Catalogue, write: Write) {
    store.write(write).await.unwrap();
}

/// What a person, a lesson and a drive change of a map, one write each.
fn steps() -> Vec<Write> {
    let settings = ModalitySettings { mode: FusionMode::Best, named: vec![] };
    let mut sight = VisibilitySettings::default();
    sight.viewer.focal_px = 700.0;
    let place = MapLocation { site: Some("Works".into()), ..MapLocation::default() };
    vec![
        write!(|tx| landmarks::create(tx, "a", "p2", LandmarkGeometry::default(), 9)),
        write!(|tx| landmarks::update(tx, "a", "p2", |_| at(0.1 + 0.2))),
        write!(|tx| models::put(tx, 1, &model(1, b"model of p1"))),
        write!(|tx| models::put(tx, 1, &model(2, b"model of p2"))),
        write!(|tx| models::put(tx, 1, &model(1, b"another model of p1"))),
        write!(|tx| models::put(tx, 1, &model(2, b"another model of p2"))),
        write!(|tx| walls::replace(tx, "a", &[known_wall(), [1.0, 0.0, 1.0, 2.0].into()])),
        write!(|tx| underlays::put(tx, "a", underlay(b"one"), b"one")),
        write!(|tx| underlays::put(tx, "a", underlay(b"two"), b"two")),
        write!(|tx| walls::replace(tx, "a", &[[0.0, 0.0, 0.7, 0.0]])),
        write!(|tx| modality_stats::set(tx, "a", |_| settings)),
        write!(|tx| visibility_settings::set(tx, "a", &sight)),
        write!(|tx| maps::set_pipeline(tx, "a", |_| maps::MapPipeline {
            preset: Some(Preset::Paper),
            distance: DistanceKind::Hausdorff,
        })),
        write!(|tx| maps::set_learning(tx, "a", Some("{\"reason\":\"doors look alike\"}"), None)),
        write!(|tx| map_locations::set(tx, "a", |_| place)),
        write!(|tx| modality_stats::add(tx, "a", "r1", 12.5, &BTreeMap::new())),
        write!(|tx| modality_stats::add(tx, "a", "r1", 2.5, &BTreeMap::new())),
        write!(|tx| modality_stats::delete(tx, "a", 1)),
        write!(|tx| underlays::delete(tx, "a")),
        // Exchanged names, in one write.
        write!(|tx| async {
            landmarks::rename(tx, "a", "p1", "x").await?;
            landmarks::rename(tx, "a", "p2", "p1").await?;
            landmarks::rename(tx, "a", "x", "p2").await
        }),
        write!(|tx| views::delete(tx, "a", "p2", 1)),
        write!(|tx| landmarks::delete(tx, "a", "p2")),
        write!(|tx| maps::rename(tx, "a", "b")),
        write!(|tx| landmarks::create(tx, "b", "p2", at(3.0), 9)),
        write!(|tx| landmarks::delete(tx, "b", "p1")),
    ]
}

async fn teach(store: &Catalogue, landmark: &str, number: u8) {
    let mut view = seen_from(1.0 + f64::from(number) * 0.4, number, 0.0);
    view.distractors = vec![view.crop.clone()];
    let (map, landmark) = ("a".to_owned(), landmark.to_owned());
    let teaching = Teaching { map, landmark, view, max: 9, novelty: None, size: None, create: None };
    teaching::add(store, teaching).await.unwrap();
}

async fn ids(store: &Catalogue) -> Vec<i64> {
    page(store.reads(), 1, i64::MAX, 99).await.unwrap().iter().map(|commit| commit.id).collect()
}

async fn every_change_is_one_commit_and_every_commit_can_be_gone_back_to() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&config(dir.path())).await;
    let mut states = vec![(newest(store.reads(), 1).await.unwrap(), state(&store).await)];
    teach(&store, "p1", 1).await;
    states.push((newest(store.reads(), 1).await.unwrap(), state(&store).await));
    let gathering = gathered(&store, "a", [3, 4].map(|n| seen_from(f64::from(n), n, 0.0)).into_iter()).await;
    assert_eq!(newest(store.reads(), 1).await.unwrap(), states[1].0, "what is gathered is no change yet");
    track_acceptance::accept(&store, decision("a", gathering, "new")).await.unwrap();
    let ended = jobs::Ended { state: "done", message: String::new(), result: None };
    store.write(|tx| Box::pin(async move { jobs::end(tx, 1, &ended).await })).await.unwrap();
    store.write(|tx| Box::pin(robots::delete(tx, "r1"))).await.unwrap();
    do_one(&store, write!(|tx| gatherings::end(tx, "a", gathering, "{}"))).await;
    states.push((newest(store.reads(), 1).await.unwrap(), state(&store).await));
    for (i, step) in steps().into_iter().enumerate() {
        let before = ids(&store).await;
        do_one(&store, step).await;
        let after = ids(&store).await;
        assert_eq!(after[1..], before, "step {i}");
        states.push((after[0], state(&store).await));
        let known = states.len();
        let row = get(store.reads(), 1, after[0]).await.unwrap();
        let is_same = states[known - 1].1 == states[known - 2].1;
        assert_eq!(is_same, row.summary.settings == ["name"], "step {i} changes more than the map's name");
    }
    assert!(states.iter().zip(&states[1..]).all(|(a, b)| a.0 < b.0), "each is one commit");
    let name = || async { maps::get(store.reads(), "b").await.unwrap().id };
    assert_eq!(name().await, 1);
    // Back, forth, and across each other.
    let order: Vec<usize> =
        (0..states.len()).rev().chain([4, 9, 2, 20, 0, 12, 1, states.len() - 1]).collect();
    for i in order {
        let to = states[i].0;
        store.write(move |tx| Box::pin(roll_back(tx, "b", to))).await.unwrap();
        let now = state(&store).await;
        for (table, rows) in &states[i].1 {
            assert!(&now[table] == rows, "{table} at commit {to}");
        }
        let mut conn = store.reads().acquire().await.unwrap();
        let newest = newest(&mut conn, 1).await.unwrap();
        let mut left = between(&mut conn, 1, (to, newest)).await.unwrap();
        left.settings.retain(|word| *word != "name");
        assert_eq!(left, Difference::default(), "nothing differs from commit {to}");
    }
    let unreferenced = "SELECT count(*) FROM model_contents c WHERE NOT EXISTS (SELECT 1 FROM models m WHERE m.sha256 = c.sha256) \
                        AND NOT EXISTS (SELECT 1 FROM past_models p WHERE p.sha256 = c.sha256)";
    let lost: i64 = db::query_scalar(unreferenced).fetch_one(store.reads()).await.unwrap();
    assert_eq!(lost, 0);
}

// Of SQLite alone: the schema of PostgreSQL is made of its schema.
#[tokio::test]
async fn every_column_of_a_map_is_in_its_history() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&config(dir.path())).await;
    for (table, past) in TABLES {
        let kept = columns(&store, past).await;
        let is_missing =
            |c: &String| !kept.contains(c) && !COUNTERS.contains(&c.as_str()) && c.as_str() != "map_id";
        let missing: Vec<String> = columns(&store, table).await.into_iter().filter(is_missing).collect();
        assert_eq!(
            missing,
            Vec::<String>::new(),
            "{table}: they are in no history, see kept_tables.rs; walls are in past_walls"
        );
    }
    let referring = "SELECT m.name FROM sqlite_schema m JOIN pragma_foreign_key_list(m.name) f WHERE m.type = 'table' \
                     AND f.\"table\" IN ('maps', 'landmarks') ORDER BY 1";
    let mut tables: Vec<String> = db::query_scalar(referring).fetch_all(store.reads()).await.unwrap();
    tables.dedup();
    // Not of what the map knows: where robots are, what they were answered, who may see it, what
    // was refused, what waits for a decision, and what is computed.
    let others = [
        "commits",
        "robots",
        "gatherings",
        "tracks",
        "stored_answers",
        "token_maps",
        "refused_views",
        "visibility_areas",
        "draft_landmarks",
        "draft_rows",
    ];
    tables.retain(|t| !others.contains(&t.as_str()));
    let mut known: Vec<&str> = TABLES.iter().map(|(table, _)| *table).collect();
    known.sort_unstable();
    assert_eq!(tables, known, "a new table of maps needs a place in their history");
}

async fn what_robots_do_and_what_changes_nothing_is_no_commit() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&config(dir.path())).await;
    let before = ids(&store).await;
    let found = LandmarkHealth::Flagged;
    do_one(&store, write!(|tx| landmarks::set_health(tx, "a", "p1", found, Some("{}")))).await;
    do_one(&store, write!(|tx| landmarks::update(tx, "a", "p1", |same| same))).await;
    store.write(|tx| Box::pin(roll_back(tx, "a", 1))).await.map(|done| assert!(done)).unwrap();
    let again = newest(store.reads(), 1).await.unwrap();
    let done = store.write(move |tx| Box::pin(roll_back(tx, "a", again))).await.unwrap();
    assert!(
        !done && ids(&store).await.len() == before.len() + 1,
        "a roll back to what is there changes nothing"
    );
    // A write that fails leaves none.
    let failing = store.write(|tx| {
        Box::pin(async move {
            landmarks::create(tx, "a", "p9", at(1.0), 9).await?;
            Err::<(), _>(StoreError::Busy)
        })
    });
    assert!(failing.await.is_err() && newest(store.reads(), 1).await.unwrap() == again);
}

async fn a_finding_stays_with_the_place_that_it_is_about() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&config(dir.path())).await;
    let health = async |store: &Catalogue| landmarks::get(store.reads(), "a", "p1").await.unwrap().health;
    let taught = newest(store.reads(), 1).await.unwrap();
    do_one(&store, write!(|tx| landmarks::set_health(tx, "a", "p1", LandmarkHealth::Quarantined, None)))
        .await;
    do_one(&store, write!(|tx| landmarks::update(tx, "a", "p1", |_| at(5.0)))).await;
    assert_eq!(health(&store).await, LandmarkHealth::Sound, "it is elsewhere");
    store.write(move |tx| Box::pin(roll_back(tx, "a", taught))).await.unwrap();
    assert_eq!(health(&store).await, LandmarkHealth::Quarantined, "it is there again");
    do_one(&store, write!(|tx| landmarks::rename(tx, "a", "p1", "p3"))).await;
    do_one(&store, write!(|tx| landmarks::set_health(tx, "a", "p3", LandmarkHealth::Flagged, None))).await;
    store.write(move |tx| Box::pin(roll_back(tx, "a", taught))).await.unwrap();
    assert_eq!(health(&store).await, LandmarkHealth::Flagged, "another name is no other place");
}

async fn a_restored_landmark_has_a_revision_that_it_never_had() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&config(dir.path())).await;
    let mut seen = std::collections::BTreeSet::new();
    let first = newest(store.reads(), 1).await.unwrap();
    for i in 0..4 {
        assert!(seen.insert(landmarks::get(store.reads(), "a", "p1").await.unwrap().revision), "round {i}");
        do_one(&store, write!(|tx| landmarks::update(tx, "a", "p1", |_| at(8.0)))).await;
        assert!(seen.insert(landmarks::get(store.reads(), "a", "p1").await.unwrap().revision), "round {i}");
        do_one(&store, write!(|tx| landmarks::delete(tx, "a", "p1"))).await;
        store.write(move |tx| Box::pin(roll_back(tx, "a", first))).await.unwrap();
    }
}

async fn a_commit_says_who_and_why() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&config(dir.path())).await;
    let author = Author {
        name: "ada".into(),
        job: None,
        operation: "PUT /maps/{map}/walls".into(),
        why: Some("the wall was moved".into()),
    };
    let walls = [[0.0, 0.0, 4.0, 0.0]];
    let actor = Actor {
        name: author.name.clone(),
        why: author.why.clone(),
        ..Actor::server(&author.operation, "/maps/a/walls")
    };
    actor.scope(do_one(&store, write!(|tx| walls::replace(tx, "a", &walls)))).await;
    do_one(&store, write!(|tx| landmarks::delete(tx, "a", "p1"))).await;
    let rows = page(store.reads(), 1, i64::MAX, 9).await.unwrap();
    assert_eq!((rows[1].author.clone(), rows[0].parent), (author, Some(rows[1].id)));
    assert_eq!(rows[0].author.name, "server");
    assert!(rows[1].summary.walls_changed && rows[1].summary.landmarks.is_empty());
    assert_eq!(
        (rows[0].summary.landmarks_removed, &rows[0].summary.landmarks[..]),
        (1, &["p1".to_owned()][..])
    );
}

mod bounds;
mod outside;
mod undoing;
