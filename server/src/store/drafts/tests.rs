//! A draft changes what it has changed, and nothing else; and what both have changed is named.

use super::*;
use crate::{
    publication::{Catalogue, tests::config},
    store::{
        contents::tests::{filled, model_of, rows},
        landmark_placement::tests::seen_from,
        landmarks::{self, LandmarkGeometry},
        map_locations::{self, MapLocation},
        models,
        revisions::Precondition,
        robots,
        teaching::{self, Teaching},
        underlays, views, walls,
    },
};
use vision::pose::LandmarkSize;

crate::store::tests::cluster::on_each_store! {
    a_published_draft_changes_what_it_has_changed_by_one_commit_that_can_be_gone_back_from,
    what_a_draft_has_not_changed_stays_byte_for_byte,
    what_both_have_changed_is_named_and_nothing_is_published,
    a_removed_view_and_landmark_are_removed_and_one_that_the_map_has_taught_is_in_conflict,
    what_was_compared_before_another_change_is_not_published,
    a_publication_keeps_the_bounds_of_a_map,
    a_finding_ends_with_the_geometry_that_it_is_about,
    robots_and_limits_leave_drafts_alone,
}

/// Tables of a map with all their columns but those that count changes.
const TABLES: [(&str, &str); 7] = [
    ("landmarks", "map_id = $1"),
    ("views", "landmark_id IN (SELECT id FROM landmarks WHERE map_id = $1)"),
    ("models", "landmark_id IN (SELECT id FROM landmarks WHERE map_id = $1)"),
    ("strangers", "map_id = $1"),
    ("laser_segments", "map_id = $1"),
    ("runs", "map_id = $1"),
    ("underlays", "map_id = $1"),
];

async fn state(store: &Catalogue) -> BTreeMap<&'static str, Vec<String>> {
    let counters = ["revision", "changed_ms", "version", "walls_version", "underlay_revision"];
    let mut all = BTreeMap::new();
    for (table, of) in TABLES.into_iter().chain([("maps", "id = $1")]) {
        all.insert(table, rows(store, (table, of), 1, &counters).await);
    }
    let bytes = "SELECT hex(c.bytes) FROM models m JOIN model_contents c ON c.sha256 = m.sha256 \
                 JOIN landmarks l ON l.id = m.landmark_id WHERE l.map_id = 1 ORDER BY m.landmark_id";
    all.insert("bytes", db::query_scalar(bytes).fetch_all(store.reads()).await.unwrap());
    all
}

async fn open() -> (tempfile::TempDir, Catalogue, crate::publication::CatalogueTasks) {
    let dir = tempfile::tempdir().unwrap();
    let (store, task) = Catalogue::open(&config(dir.path())).await.unwrap();
    filled(&store).await;
    (dir, store, task)
}

async fn draft(store: &Catalogue, name: &str) -> i64 {
    begin(store, "a", name, &Limits::default()).await.unwrap().id
}

async fn publish_it(store: &Catalogue, name: &str) -> Result<bool, StoreError> {
    publish(store, ("a", name), &Precondition::Any, &Limits::default()).await
}

async fn conflicts(store: &Catalogue, name: &str) -> String {
    let shown = compare(store, "a", name).await.unwrap().conflicts;
    match publish_it(store, name).await {
        Err(StoreError::Conflicts { with, .. }) => {
            assert_eq!(with, shown, "the difference says the same");
            with.join("; ")
        }
        other => panic!("{other:?}"),
    }
}

async fn teach(store: &Catalogue, map: &str, landmark: &str, number: u8) {
    let view = seen_from(1.0 + f64::from(number) * 0.4, number, 0.0);
    let (map, landmark) = (map.to_owned(), landmark.to_owned());
    let create = Some(9);
    let teaching = Teaching { map, landmark, view, max: 9, novelty: None, size: None, create };
    teaching::add(store, teaching).await.unwrap();
}

async fn learn(store: &Catalogue, map: i64, landmark: u64, seed: usize) {
    // What a lesson stores; the numbers of look-alikes are those of the model's map.
    let mut model = model_of(1, seed);
    model.bytes = vision::model::renumbered(&model.bytes, LandmarkId(landmark)).unwrap();
    model.landmark = LandmarkId(landmark);
    let write = store.write(move |tx| {
        Box::pin(async move {
            assert!(models::put(tx, map, &model).await?);
            maps::bump(tx, map).await
        })
    });
    write.await.unwrap();
}

/// Numbers of the landmarks of a map, by name.
async fn numbers(store: &Catalogue, map: &str) -> BTreeMap<String, u64> {
    let (_, contents) = contents::contents_of(store, map).await.unwrap();
    contents.landmarks.into_iter().map(|l| (l.name, l.number.0)).collect()
}

fn sized() -> LandmarkGeometry {
    let size = Some(LandmarkSize { width_m: 1.0, height_m: 2.0 });
    LandmarkGeometry { size, ..LandmarkGeometry::default() }
}

/// What people do to a draft: every kind of row is changed, some are added and removed.
async fn edit(store: &Catalogue, draft: i64) {
    let write = store.write(move |tx| {
        Box::pin(async move {
            landmarks::rename(tx, "d", "p1", "x").await?;
            landmarks::rename(tx, "d", "p2", "p1").await?;
            landmarks::rename(tx, "d", "x", "p2").await?;
            landmarks::update(tx, "d", "p1", |_| sized()).await?;
            walls::replace(tx, "d", &[[0.0, 0.0, 0.7, 0.0]]).await?;
            underlays::delete(tx, "d").await?;
            crate::store::modality_stats::add(tx, "d", "r9", 2.5, &BTreeMap::new()).await?;
            maps::set_learning(tx, "d", None, None).await?;
            map_locations::set(tx, "d", |old| MapLocation { site: None, ..old }).await.map(drop)
        })
    });
    write.await.unwrap();
    teach(store, "d", "p1", 3).await;
    teach(store, "d", "new", 4).await;
    let of = numbers(store, "d").await;
    learn(store, draft, of["new"], 3).await;
    learn(store, draft, of["p1"], 4).await;
}

async fn a_published_draft_changes_what_it_has_changed_by_one_commit_that_can_be_gone_back_from() {
    let (_dir, store, _task) = open().await;
    let before = state(&store).await;
    let made = history::newest(store.reads(), 1).await.unwrap();
    let number = draft(&store, "d").await;
    assert_eq!(state(&store).await, before, "a draft changes nothing of the map");
    edit(&store, number).await;
    assert_eq!(state(&store).await, before, "nor does what is done to it");
    let shown = compare(&store, "a", "d").await.unwrap();
    assert_eq!((shown.conflicts.len(), shown.from_commit), (0, made));
    let wanted = store.snapshots().get("d").unwrap();
    assert!(publish_it(&store, "d").await.unwrap());
    let commits = history::page(store.reads(), 1, i64::MAX, 9).await.unwrap();
    assert_eq!(commits.iter().position(|commit| commit.id == made), Some(1), "it is one commit");
    assert_eq!(commits[0].author.why.as_deref(), Some("publish draft d"));
    let mut conn = store.reads().acquire().await.unwrap();
    let done = history::between(&mut conn, 1, (made, commits[0].id)).await.unwrap();
    let summary = history::summary(&mut conn, &done, i64::MAX).await.unwrap();
    let promised = history::summary(&mut conn, &shown.difference, i64::MAX).await.unwrap();
    assert_eq!(promised, summary, "the difference has said so");
    assert_eq!((summary.landmarks_added, summary.models_changed, summary.views_added), (1, 2, 2));
    drop(conn);
    // The map is as the draft was, under its own numbers.
    let map = store.snapshots().get("a").unwrap();
    assert_eq!(map.unusable_models, BTreeMap::new());
    assert_eq!(maps::get(store.reads(), "a").await.unwrap().learning, None);
    let places = |of: &engine::snapshot::MapSnapshot| {
        let each = of.landmarks.iter().map(|(id, l)| {
            let model = of.learnt.get(id).map(|stored| stored.model.exemplars.clone());
            (l.name.clone(), l.size, model.map(|m| m[0].pixels().to_vec()))
        });
        let mut each: Vec<_> = each.collect();
        each.sort_by(|a, b| a.0.cmp(&b.0));
        each
    };
    assert_eq!(places(&map), places(&wanted));
    assert!(store.snapshots().get("d").is_none() && list(store.reads(), 1).await.unwrap().is_empty());
    store.write(move |tx| Box::pin(history::roll_back(tx, "a", made))).await.unwrap();
    let after = state(&store).await;
    for (table, rows) in &before {
        assert!(&after[table] == rows, "{table} after going back");
    }
}

async fn what_a_draft_has_not_changed_stays_byte_for_byte() {
    let (_dir, store, _task) = open().await;
    draft(&store, "d").await;
    let before = state(&store).await;
    let commit = history::newest(store.reads(), 1).await.unwrap();
    assert!(!publish_it(&store, "d").await.unwrap(), "nothing to publish");
    assert_eq!(
        (state(&store).await, history::newest(store.reads(), 1).await.unwrap()),
        (before.clone(), commit)
    );
    // Both sides go on with different rows: both changes are there in the end.
    draft(&store, "d").await;
    let write = store.write(|tx| Box::pin(walls::replace(tx, "a", &[[0.0, 0.0, 0.5, 0.0]])));
    write.await.unwrap();
    store.write(|tx| Box::pin(landmarks::update(tx, "d", "p2", |_| sized()))).await.unwrap();
    assert!(publish_it(&store, "d").await.unwrap());
    let after = state(&store).await;
    assert_eq!((after["laser_segments"].len(), &after["bytes"]), (1, &before["bytes"]));
    assert_eq!((&after["views"], &after["models"]), (&before["views"], &before["models"]));
    assert_eq!(landmarks::get(store.reads(), "a", "p2").await.unwrap().geometry, sized());
}

async fn what_both_have_changed_is_named_and_nothing_is_published() {
    let (_dir, store, _task) = open().await;
    let number = draft(&store, "d").await;
    for map in ["a", "d"] {
        let wall = if map == "a" { 0.5 } else { 0.6 };
        let write = store.write(move |tx| {
            Box::pin(async move {
                walls::replace(tx, map, &[[0.0, 0.0, wall, 0.0]]).await?;
                landmarks::create(tx, map, "same", LandmarkGeometry::default(), 9).await.map(drop)
            })
        });
        write.await.unwrap();
    }
    // The map removes what the draft teaches.
    teach(&store, "d", "p2", 5).await;
    store.write(|tx| Box::pin(landmarks::delete(tx, "a", "p2"))).await.unwrap();
    let of = numbers(&store, "d").await;
    learn(&store, number, of["p1"], 2).await;
    learn(&store, 1, numbers(&store, "a").await["same"], 3).await;
    let before = state(&store).await;
    let said = conflicts(&store, "d").await;
    for part in [
        "the walls",
        "landmark `p2`",
        "landmark `same`: both",
        "models: the map and the draft were both taught",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert_eq!(state(&store).await, before);
    let is_there = get(store.reads(), 1, "d").await.is_ok();
    assert!(is_there, "the draft is there to be mended or discarded");
    // For the revision of another time it is refused, too.
    let old = Precondition::OneOf(vec!["1.1".into()]);
    let refused = publish(&store, ("a", "d"), &old, &Limits::default()).await;
    assert!(matches!(refused, Err(StoreError::ChangedMeanwhile { .. })));
    store.write(|tx| Box::pin(discard(tx, "a", "d"))).await.unwrap();
    assert!(matches!(get(store.reads(), 1, "d").await, Err(StoreError::NotFound { what: Kind::Draft, .. })));
    assert_eq!(state(&store).await, before);
}

async fn a_removed_view_and_landmark_are_removed_and_one_that_the_map_has_taught_is_in_conflict() {
    let (_dir, store, _task) = open().await;
    draft(&store, "d").await;
    draft(&store, "e").await;
    let first = numbers(&store, "d").await["p2"] as i64;
    let page =
        views::page(store.reads(), first, views::ViewFilter::default(), (None, false), 9).await.unwrap();
    let view = page[0].id;
    store.write(move |tx| Box::pin(views::delete(tx, "d", "p2", view))).await.unwrap();
    store.write(|tx| Box::pin(landmarks::delete(tx, "d", "p1"))).await.unwrap();
    store.write(|tx| Box::pin(landmarks::delete(tx, "e", "p2"))).await.unwrap();
    assert!(publish_it(&store, "d").await.unwrap());
    let left = numbers(&store, "a").await;
    assert_eq!(left.keys().collect::<Vec<_>>(), ["p2"]);
    assert_eq!(landmarks::get(store.reads(), "a", "p2").await.unwrap().views, 0);
    teach(&store, "a", "p2", 6).await;
    assert_eq!(conflicts(&store, "e").await, "landmark `p2`");
}

async fn what_was_compared_before_another_change_is_not_published() {
    let (_dir, store, _task) = open().await;
    let id = draft(&store, "d").await;
    edit(&store, id).await;
    let before = both(&store, "a", "d").await.unwrap();
    store.write(|tx| Box::pin(walls::replace(tx, "a", &[[0.0, 0.0, 0.9, 0.0]]))).await.unwrap();
    let written = store.write(move |tx| {
        let merged = (merge::merge(&before), before);
        Box::pin(async move { publish::write(tx, merged, &Precondition::Any, &Limits::default()).await })
    });
    assert!(matches!(written.await, Err(StoreError::Changed)));
    assert!(list(store.reads(), 1).await.unwrap().iter().any(|row| row.name == "d"), "the draft is there");
}

async fn a_publication_keeps_the_bounds_of_a_map() {
    let (_dir, store, _task) = open().await;
    let id = draft(&store, "d").await;
    edit(&store, id).await;
    let had = state(&store).await;
    let few = Limits { landmarks: 1, ..Limits::default() };
    let refused = publish(&store, ("a", "d"), &Precondition::Any, &few).await;
    assert!(matches!(refused, Err(StoreError::Limit { what: "landmarks in a map", max: 1 })), "{refused:?}");
    assert_eq!(state(&store).await, had, "nothing of it is published");
}

async fn a_finding_ends_with_the_geometry_that_it_is_about() {
    let (_dir, store, _task) = open().await;
    let health = async || {
        let sql = "SELECT name || ' ' || health FROM landmarks WHERE map_id = 1 AND name IN ('p1', 'p2') ORDER BY name";
        db::query_scalar::<String>(sql).fetch_all(store.reads()).await.unwrap()
    };
    let flag = "UPDATE landmarks SET health = 'flagged', finding = '{}' WHERE map_id = 1";
    draft(&store, "d").await;
    let write = store.write(move |tx| {
        Box::pin(async move {
            db::query(flag).execute(&mut tx.conn).await.map_err(StoreError::during("flag"))?;
            landmarks::update(tx, "d", "p1", |_| sized()).await.map(drop)
        })
    });
    write.await.unwrap();
    assert_eq!(health().await, ["p1 flagged", "p2 flagged"]);
    publish_it(&store, "d").await.unwrap();
    assert_eq!(health().await, ["p1 sound", "p2 flagged"]);
}

async fn robots_and_limits_leave_drafts_alone() {
    let (_dir, store, _task) = open().await;
    let refused = |name: &'static str| store.write(move |tx| Box::pin(robots::put(tx, "r1", name, 9)));
    draft(&store, "d").await;
    assert!(matches!(refused("d").await, Err(StoreError::InUse(why)) if why.contains("draft of map `a`")));
    assert!(store.snapshots().get("d").is_some() && store.snapshots().for_robots("d").is_none());
    let of_draft = begin(&store, "d", "dd", &Limits::default()).await;
    assert!(matches!(of_draft, Err(StoreError::InUse(_))));
    let deleted = store.write(|tx| Box::pin(maps::delete(tx, "a"))).await;
    assert!(matches!(deleted, Err(StoreError::InUse(why)) if why.contains("has the draft `d`")));
    let few = Limits { maps: 2, ..Limits::default() };
    for i in 1..MAX_DRAFTS {
        begin(&store, "a", &format!("d{i}"), &few).await.unwrap();
    }
    let more = begin(&store, "a", "d9", &few).await;
    assert!(matches!(more, Err(StoreError::Limit { what: "drafts of a map", max: MAX_DRAFTS })));
    let job =
        store.write(|tx| Box::pin(crate::store::jobs::create(tx, "learn", "d", "{}", (9, 9)))).await.unwrap();
    assert!(
        matches!(publish_it(&store, "d").await, Err(StoreError::InUse(why)) if why.contains(&job.id.to_string()))
    );
}
