use super::*;
use crate::{
    config::{Config, RawConfig},
    publication::{Catalogue, CatalogueTasks, tests::config},
    store::{
        landmark_placement::tests::seen_from,
        landmarks::{self, LandmarkGeometry},
        maps, migrations, open,
        teaching::{self, Teaching},
        underlays::{self, UnderlayRow},
        views::{self, NewView},
    },
};
use sqlx::{ConnectOptions, Connection, migrate::Migrator, sqlite::SqliteConnectOptions};
use std::path::Path;
use vision::recognise::DistanceKind;

/// Map `a` with landmarks `p1` and `p2`, and the history of one commit.
async fn store(dir: &Path) -> (Catalogue, CatalogueTasks) {
    let mut raw = RawConfig { data: dir.to_owned(), ..RawConfig::default() };
    raw.limits.kept_commits = 1;
    let (store, task) = Catalogue::open(&Config::try_from(raw).unwrap()).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
    for name in ["p1", "p2"] {
        let none = LandmarkGeometry::default();
        store.write(move |tx| Box::pin(landmarks::create(tx, "a", name, none, 5))).await.unwrap();
    }
    (store, task)
}

/// A view of this picture.
fn view(image: Vec<u8>) -> NewView {
    NewView { image_sha256: digest(&image), image, capture: None, ..seen_from(1.0, 1, 0.0) }
}

async fn teach(store: &Catalogue, landmark: &str, image: &[u8]) -> i64 {
    let (map, landmark, view) = ("a".to_owned(), landmark.to_owned(), view(image.to_vec()));
    let teaching = Teaching { map, landmark, view, max: 9, novelty: None, size: None, create: None };
    teaching::add(store, teaching).await.unwrap().0.id
}

async fn put_underlay(store: &Catalogue, image: &'static [u8]) {
    let row = UnderlayRow {
        image_sha256: digest(image),
        image_kind: "png".into(),
        size_px: [2, 2],
        metres_per_pixel: 0.05,
        map_from_picture: [0.0; 3],
        created_ms: 0,
    };
    store.write(move |tx| Box::pin(underlays::put(tx, "a", row, image))).await.unwrap();
}

/// Another commit, so that those before it are forgotten.
async fn forget(store: &Catalogue) {
    store.write(|tx| Box::pin(landmarks::rename(tx, "a", "p1", "other"))).await.unwrap();
    store.write(|tx| Box::pin(landmarks::rename(tx, "a", "other", "p1"))).await.unwrap();
}

async fn count(store: &Catalogue) -> i64 {
    sqlx::query_scalar("SELECT count(*) FROM pictures").fetch_one(store.reads()).await.unwrap()
}

#[tokio::test]
async fn a_picture_is_stored_once_and_goes_with_the_last_row_that_refers_to_it() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let first = teach(&store, "p1", b"one").await;
    teach(&store, "p2", b"one").await;
    put_underlay(&store, b"one").await;
    assert_eq!(count(&store).await, 1);
    store.write(move |tx| Box::pin(views::delete(tx, "a", "p1", first))).await.unwrap();
    store.write(|tx| Box::pin(landmarks::delete(tx, "a", "p2"))).await.unwrap();
    assert_eq!(read(&store, &digest(b"one")).await.unwrap(), b"one", "the underlay shows it");
    put_underlay(&store, b"two").await;
    assert_eq!(count(&store).await, 2, "kept for the way back");
    forget(&store).await;
    assert_eq!(count(&store).await, 1, "replaced");
    assert!(matches!(read(&store, &digest(b"one")).await, Err(StoreError::NotFound { .. })));
    teach(&store, "p1", b"three").await;
    store.write(|tx| Box::pin(maps::delete(tx, "a"))).await.unwrap();
    assert_eq!(count(&store).await, 0, "a cascade deletes pictures, too");
}

#[tokio::test]
async fn a_damaged_picture_is_named_and_mended_by_the_same_one() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let (first, other) = (teach(&store, "p1", b"one").await, teach(&store, "p2", b"two").await);
    let damage = "UPDATE pictures SET bytes = x'00' WHERE bytes = x'6f6e65'";
    store
        .write(move |tx| {
            Box::pin(async move {
                sqlx::raw_sql(damage).execute(tx.conn()).await.map_err(StoreError::during("damage")).map(drop)
            })
        })
        .await
        .unwrap();
    let (_stop, stopping) = watch::channel(false);
    check_all((*store).clone(), stopping).await;
    let named = |maps: Option<&'static str>| {
        let maps = maps.map(|map| vec![map.to_owned()]);
        let reads = store.reads().clone();
        async move { damaged(&reads, maps.as_deref()).await.unwrap() }
    };
    let view = format!("view {first} of landmark p1, map a");
    assert_eq!(named(None).await, (1, vec![view.clone()]));
    assert_eq!(named(Some("a")).await, (1, vec![view]));
    assert_eq!(named(Some("b")).await, (1, Vec::new()), "counted, and not named to another map");
    let refused = read(&store, &digest(b"one")).await;
    assert!(
        matches!(&refused, Err(error @ StoreError::PictureDamaged { .. }) if !error.is_fatal()),
        "{refused:?}"
    );
    assert_eq!(read(&store, &digest(b"two")).await.unwrap(), b"two", "others are read");
    // A duplicate mends it, too.
    assert_eq!(teach(&store, "p1", b"one").await, first);
    assert_eq!(read(&store, &digest(b"one")).await.unwrap(), b"one");
    assert_eq!(damaged(store.reads(), None).await.unwrap(), (0, Vec::new()));
    store.write(move |tx| Box::pin(views::delete(tx, "a", "p2", other))).await.unwrap();
    forget(&store).await;
    assert_eq!(count(&store).await, 1);
}

/// Breaks the chain of pages of every large picture in the file.
fn break_pages(file: &Path, of: u8) -> usize {
    let mut bytes = std::fs::read(file).unwrap();
    let mut broken = 0;
    for page in bytes.chunks_mut(4096) {
        // An overflow page: the number of the next one, and nothing but the picture.
        if page[4..].iter().all(|byte| *byte == of) {
            page.fill(0xff);
            broken += 1;
        }
    }
    std::fs::write(file, bytes).unwrap();
    broken
}

#[tokio::test]
async fn damaged_pages_of_pictures_stop_neither_the_start_nor_what_needs_no_picture() {
    let dir = tempfile::tempdir().unwrap();
    let large = vec![0x5a; 100_000];
    let (catalogue, tasks) = store(dir.path()).await;
    let taught = teach(&catalogue, "p1", &large).await;
    teach(&catalogue, "p1", b"small").await;
    tasks.close().await;
    assert!(break_pages(&dir.path().join(open::FILE), 0x5a) > 20);

    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    assert_eq!(
        views::page(store.reads(), 1, views::ViewFilter::default(), (None, false), 9).await.unwrap().len(),
        2
    );
    assert_eq!(views::of_map(store.reads(), 1).await.unwrap().len(), 2);
    views::icon(store.reads(), "a", "p1", taught).await.unwrap();
    let refused = read(&store, &digest(&large)).await;
    assert!(matches!(refused, Err(StoreError::PictureDamaged { .. })), "{refused:?}");
    assert_eq!(damaged(store.reads(), None).await.unwrap().0, 1);
    assert_eq!(read(&store, &digest(b"small")).await.unwrap(), b"small");
    // The view can be deleted; what is left of the picture is not touched.
    store.write(move |tx| Box::pin(views::delete(tx, "a", "p1", taught))).await.unwrap();
    assert_eq!((count(&store).await, damaged(store.reads(), None).await.unwrap().0), (2, 0));
    teach(&store, "p2", b"new").await;
}

/// A view, a gathered view of the same picture, an underlay; a view with the number 7 was deleted.
const EARLIER: &str = "
INSERT INTO maps (id, name, distance, created_ms) VALUES (1, 'a', 'both', 0);
INSERT INTO landmarks (id, map_id, name, created_ms) VALUES (1, 1, 'p1', 0);
INSERT INTO views (id, landmark_id, image_sha256, image_kind, image, width_px, height_px, corners_px, icon_side, icon, icon_scale,
    created_ms, capture) VALUES (7, 1, ?1, 'png', x'6f6e65', 4, 3, ?2, 20, zeroblob(400), 0.5, 8, NULL);
DELETE FROM views;
INSERT INTO views (id, landmark_id, image_sha256, image_kind, image, width_px, height_px, corners_px, icon_side, icon, icon_scale,
    created_ms, capture) VALUES (3, 1, ?1, 'png', x'6f6e65', 4, 3, ?2, 20, zeroblob(400), 0.5, 8, NULL);
INSERT INTO gatherings (id, map_id, robot, known, open, created_ms) VALUES (1, 1, 'r1', 0, 0, 0);
INSERT INTO tracks (gathering_id, number, sightings, known) VALUES (1, 1, 3, 0);
INSERT INTO track_views (gathering_id, track, image_sha256, image_kind, image, width_px, height_px, corners_px, icon_side, icon,
    icon_scale, created_ms) VALUES (1, 1, ?1, 'png', x'6f6e65', 4, 3, ?2, 20, zeroblob(400), 0.5, 8);
INSERT INTO underlays (map_id, image, image_kind, width_px, height_px, metres_per_pixel, x_m, y_m, theta_rad, created_ms)
    VALUES (1, x'74776f', 'png', 5, 6, 0.05, 1.0, 2.0, 0.5, 9);
";

#[tokio::test]
async fn pictures_of_the_schema_before_are_moved() {
    let dir = tempfile::tempdir().unwrap();
    let options = SqliteConnectOptions::new().filename(dir.path().join(open::FILE)).create_if_missing(true);
    let mut file = options.connect().await.unwrap();
    let before = migrations::migrator().iter().filter(|step| step.version <= 15).cloned().collect();
    Migrator::with_migrations(before).run(&mut file).await.unwrap();
    let corners = [1.0, 1.0, 9.0, 1.0, 9.0, 9.0, 1.0, 9.0_f64];
    let corners: Vec<u8> = corners.iter().flat_map(|c| c.to_le_bytes()).collect();
    let rows = EARLIER.replace("?1", &format!("x'{}'", hex(&digest(b"one"))));
    let rows = rows.replace("?2", &format!("x'{}'", hex(&corners)));
    sqlx::raw_sql(sqlx::AssertSqlSafe(rows)).execute(&mut file).await.unwrap();
    file.close().await.unwrap();

    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    assert_eq!(count(&store).await, 2);
    let (sha256, kind) = views::picture(store.reads(), "a", "p1", 3).await.unwrap();
    assert_eq!((read(&store, &sha256).await.unwrap(), kind.as_str()), (b"one".to_vec(), "png"));
    let row =
        &views::page(store.reads(), 1, views::ViewFilter::default(), (None, false), 9).await.unwrap()[0];
    assert_eq!((row.id, row.size_px, row.corners_px[2], row.created_ms), (3, [4, 3], [9.0, 9.0], 8));
    assert_eq!(views::icon(store.reads(), "a", "p1", 3).await.unwrap().pixels, [0.0; 400]);
    let underlay = underlays::get(store.reads(), (1, "a")).await.unwrap();
    assert_eq!((underlay.size_px, underlay.map_from_picture), ([5, 6], [1.0, 2.0, 0.5]));
    assert_eq!(read(&store, &underlay.image_sha256).await.unwrap(), b"two");
    assert_eq!(teach(&store, "p1", b"three").await, 8, "the number of a deleted view is not used again");
    store.write(|tx| Box::pin(maps::delete(tx, "a"))).await.unwrap();
    assert_eq!(count(&store).await, 0);
}
