//! A bundle is the map: exported, imported and exported again it is the same, and no byte of it
//! changes unseen.

mod any_bytes;

use super::{BundleError, Fault, Request, archive::Writer, load, save};
use crate::store::db;
use crate::{
    config::Limits,
    publication::{Catalogue, tests::config},
    store::{
        StoreError,
        contents::{contents_of, tests::filled},
        maps, pictures,
    },
};
use std::{
    fs::File,
    io::{Read as _, Seek as _, SeekFrom, Write as _},
    path::Path,
};
use vision::recognise::DistanceKind;

/// Map `a` of [`filled`], with pictures that are some.
async fn filled_with_pictures(store: &Catalogue) {
    filled(store).await;
    let png = |side: [u32; 2]| {
        let [width, height] = side.map(|n| n as usize);
        engine::picture::png(width, height, &vec![90; width * height]).unwrap()
    };
    let (photograph, floor) = (png([640, 480]), png([2, 3]));
    let write = store.write(move |tx| {
        Box::pin(async move {
            for (table, picture) in [("views", photograph), ("underlays", floor)] {
                let sha256 = pictures::digest(&picture);
                pictures::put(tx, &sha256, &picture).await?;
                let sql = format!("UPDATE {table} SET image_sha256 = $1");
                let done = db::query(db::AssertSqlSafe(sql)).bind(&sha256[..]).execute(tx.conn()).await;
                done.map_err(StoreError::during("give a picture"))?;
            }
            Ok(())
        })
    });
    write.await.unwrap();
}

async fn saved(store: &Catalogue, map: &str, folder: &Path) -> Vec<u8> {
    let mut bytes = Vec::new();
    save(store, map, folder, |_| true).await.unwrap().read_to_end(&mut bytes).unwrap();
    bytes
}

fn file(bytes: &[u8]) -> File {
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(bytes).unwrap();
    file.rewind().unwrap();
    file
}

async fn loaded(store: &Catalogue, bytes: &[u8], name: Option<&str>) -> Result<(), BundleError> {
    let request = Request { name: name.map(str::to_owned), without_link: false };
    load(store, file(bytes), request, &Limits::default()).await.map(drop)
}

fn fault(done: Result<(), BundleError>) -> (Fault, String) {
    match done {
        Err(BundleError::Refused { fault, file, .. }) => (fault, file),
        other => panic!("{other:?} is not refused"),
    }
}

/// An empty server with the map that map `a` lies in.
async fn empty(folder: &Path) -> Catalogue {
    let (store, task) = Catalogue::open(&config(folder)).await.unwrap();
    store.write(|tx| Box::pin(maps::create(tx, "outer", DistanceKind::Both, 9))).await.unwrap();
    // The writer ends with the test.
    std::mem::forget(task);
    store
}

#[tokio::test]
async fn a_bundle_of_a_loaded_map_is_the_first_one_byte_for_byte() {
    let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (store, _task) = Catalogue::open(&config(here.path())).await.unwrap();
    filled_with_pictures(&store).await;
    let first = saved(&store, "a", here.path()).await;
    assert_eq!(saved(&store, "a", here.path()).await, first, "the same map gives the same bytes");
    let other = empty(there.path()).await;
    loaded(&other, &first, None).await.unwrap();
    assert_eq!(saved(&other, "a", there.path()).await, first);
    // The contents that have no numbers of rows in them are the same, too.
    let ((_, was), (_, now)) =
        (contents_of(&store, "a").await.unwrap(), contents_of(&other, "a").await.unwrap());
    assert_eq!((&now.settings, &now.walls, &now.underlay), (&was.settings, &was.walls, &was.underlay));
    assert_eq!((&now.distractors, &now.reference_runs), (&was.distractors, &was.reference_runs));
    for (old, new) in was.landmarks.iter().zip(&now.landmarks) {
        assert_eq!((&new.name, &new.geometry, &new.views), (&old.name, &old.geometry, &old.views));
        let (old, new) = (old.model.as_ref().unwrap(), new.model.as_ref().unwrap());
        // All but the number of the landmark, and the digest over it.
        assert_eq!(new.bytes[22..new.bytes.len() - 8], old.bytes[22..old.bytes.len() - 8]);
        assert_eq!((new.params_hash, &new.summary.reasons), (old.params_hash, &old.summary.reasons));
    }
    let commits: i64 =
        db::query_scalar("SELECT count(*) FROM commits c JOIN maps m ON m.id = c.map_id WHERE m.name = 'a'")
            .fetch_one(other.reads())
            .await
            .unwrap();
    assert_eq!(commits, 1);
}

#[tokio::test]
async fn every_changed_byte_is_refused_and_nothing_is_left() {
    let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (store, _task) = Catalogue::open(&config(here.path())).await.unwrap();
    filled_with_pictures(&store).await;
    let first = saved(&store, "a", here.path()).await;
    let other = empty(there.path()).await;
    // Places all over the file, and each byte of its end.
    let end = first.len() - 120;
    let places = (0..end).step_by(first.len() / 150 + 1).chain(end..first.len());
    for place in places {
        let mut changed = first.clone();
        changed[place] ^= 0x20;
        let (fault, _) = fault(loaded(&other, &changed, None).await);
        assert!(matches!(fault, Fault::Damaged | Fault::NotABundle), "byte {place}: {fault:?}");
    }
    for length in [0, 21, 85, first.len() / 2, first.len() - 1] {
        let (fault, _) = fault(loaded(&other, &first[..length], None).await);
        assert_eq!(fault, Fault::NotABundle, "{length} bytes");
    }
    for table in ["landmarks", "pictures", "model_contents"] {
        let sql = db::AssertSqlSafe(format!("SELECT count(*) FROM {table}"));
        let rows: i64 = db::query_scalar(sql).fetch_one(other.reads()).await.unwrap();
        assert_eq!(rows, 0, "{table}");
    }
    loaded(&other, &first, None).await.unwrap();
    let taken = loaded(&other, &first, None).await;
    assert!(matches!(taken, Err(BundleError::Store(StoreError::Exists { .. }))));
}

/// The same bundle with the files that `change` makes of its files, sealed again.
fn rebuilt(bundle: &[u8], change: impl Fn(&str, Vec<u8>) -> Option<(String, Vec<u8>)>) -> Vec<u8> {
    let mut zip = zip::ZipArchive::new(file(bundle)).unwrap();
    let mut out = Writer::new(tempfile::tempfile().unwrap());
    for index in 0..zip.len() {
        let mut entry = zip.by_index(index).unwrap();
        let (name, mut bytes) = (entry.name().unwrap().into_owned(), Vec::new());
        entry.read_to_end(&mut bytes).unwrap();
        if name != super::MANIFEST
            && let Some((name, bytes)) = change(&name, bytes)
        {
            out.add(&name, &bytes).unwrap();
        }
    }
    let (mut made, mut bytes) = (out.finish("a").unwrap(), Vec::new());
    made.seek(SeekFrom::Start(0)).unwrap();
    made.read_to_end(&mut bytes).unwrap();
    bytes
}

#[tokio::test]
async fn a_sealed_bundle_with_a_wrong_file_is_refused_by_its_name() {
    let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let (store, _task) = Catalogue::open(&config(here.path())).await.unwrap();
    filled_with_pictures(&store).await;
    let first = saved(&store, "a", here.path()).await;
    let other = empty(there.path()).await;
    let text = |file: &'static str, from: &'static str, to: &'static str| {
        rebuilt(&first, move |name, bytes| {
            let bytes = if name == file {
                let text = String::from_utf8(bytes).unwrap();
                assert!(text.contains(from), "{file} has no {from}");
                text.replacen(from, to, 1).into_bytes()
            } else {
                bytes
            };
            Some((name.to_owned(), bytes))
        })
    };
    let renamed = |from: &'static str, to: &'static str| {
        rebuilt(&first, move |name, bytes| Some((if name == from { to } else { name }.to_owned(), bytes)))
    };
    for (bundle, expected) in [
        (renamed("map.json", "../map.json"), (Fault::BadPath, "../map.json")),
        (renamed("map.json", "/map.json"), (Fault::BadPath, "/map.json")),
        (renamed("map.json", "other.json"), (Fault::Missing, "map.json")),
        (renamed("landmarks.geojson", "extra.geojson"), (Fault::BadPath, "extra.geojson")),
        (text("map.json", "\"correlation\"", "\"other\""), (Fault::InvalidValue, "map.json: distance")),
        (text("map.json", "hung by us", ""), (Fault::InvalidValue, "map.json: learning.reason")),
        (text("landmarks.json", "\"p1\"", "\"P 1\""), (Fault::InvalidValue, "landmarks.json: [0].name")),
        (
            text("landmarks.json", "\"number\": 2", "\"number\": 3"),
            (Fault::InvalidValue, "landmarks.json: [1]"),
        ),
        (
            text("landmarks.json", "1.model", "2.model"),
            (Fault::InvalidValue, "landmarks.json: [0].model.file"),
        ),
        (
            text("views.json", "\"landmark\": 2", "\"landmark\": 9"),
            (Fault::InvalidValue, "views.json: [0].landmark"),
        ),
        (text("underlay.json", "0.05", "50.0"), (Fault::InvalidValue, "underlay.json: metres_per_pixel")),
        (
            text("modalities.json", "12.5", "-1.0"),
            (Fault::InvalidValue, "modalities.json: reference_runs[0].way_m"),
        ),
    ] {
        let (is, file) = fault(loaded(&other, &bundle, None).await);
        assert_eq!((is, file.as_str()), expected);
    }
    loaded(&other, &rebuilt(&first, |name, bytes| Some((name.to_owned(), bytes))), Some("b")).await.unwrap();
}
