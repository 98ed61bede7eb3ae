use super::*;
use crate::{
    config::Config,
    publication::{
        Catalogue, CatalogueTasks,
        tests::{config, raw_config},
    },
    store::{
        landmark_placement::tests::seen_from,
        landmarks::{self, LandmarkGeometry},
        maps, open,
        teaching::{self, Teaching},
        underlays::{self, UnderlayRow},
        views::{self, NewView},
    },
};
use std::path::Path;
use vision::recognise::DistanceKind;

crate::store::tests::cluster::on_each_store! {
    a_picture_is_stored_once_and_goes_with_the_last_row_that_refers_to_it,
    a_damaged_picture_is_named_and_mended_by_the_same_one,
}

/// Map `a` with landmarks `p1` and `p2`, and the history of one commit.
async fn store(dir: &Path) -> (Catalogue, CatalogueTasks) {
    let mut raw = raw_config(dir);
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
    db::query_scalar("SELECT count(*) FROM pictures").fetch_one(store.reads()).await.unwrap()
}

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

async fn a_damaged_picture_is_named_and_mended_by_the_same_one() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let (first, other) = (teach(&store, "p1", b"one").await, teach(&store, "p2", b"two").await);
    let damage =
        db::query("UPDATE pictures SET bytes = $1 WHERE bytes = $2").bind(&[0][..]).bind(&b"one"[..]);
    store
        .write(move |tx| {
            Box::pin(async move {
                damage.execute(tx.conn()).await.map_err(StoreError::during("damage")).map(drop)
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
