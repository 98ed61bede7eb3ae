//! A backup of a store in PostgreSQL is a file like any other, and restores into either store.

use super::*;
use crate::store::{
    contents::tests::{filled, rows},
    tests::cluster::{empty_store, on_postgres, store_of},
};

/// Tables with references, numbers that go on, and every type of column.
const TABLES: [(&str, &str); 4] = [
    ("maps", "id = $1"),
    ("landmarks", "map_id = $1"),
    ("views", "landmark_id IN (SELECT id FROM landmarks WHERE map_id = $1)"),
    ("commits", "map_id = $1"),
];

async fn open_at(dir: &Path, store: &str) -> (Catalogue, CatalogueTasks) {
    let raw = crate::config::RawConfig {
        data: dir.to_owned(),
        store: store.to_owned(),
        ..crate::config::RawConfig::default()
    };
    Catalogue::open(&Config::try_from(raw).unwrap()).await.unwrap()
}

/// Number of a landmark that is made now.
async fn next_number(store: &Catalogue) -> i64 {
    let none = LandmarkGeometry::default();
    store.write(move |tx| Box::pin(landmarks::create(tx, "a", "next", none, 2000))).await.unwrap();
    let number = "SELECT id FROM landmarks WHERE name = 'next'";
    crate::store::db::query_scalar(number).fetch_one(store.reads()).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_of_either_store_restores_into_either() {
    on_postgres(Box::pin(async {
        let dirs: [_; 4] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
        let [dir, in_file, in_database, taken] = dirs.each_ref().map(tempfile::TempDir::path);
        let (store, tasks) = open_at(dir, &store_of(dir)).await;
        filled(&store).await;
        // The last number is not used again.
        add(&store, 7).await;
        store.write(|tx| Box::pin(landmarks::delete(tx, "a", "l7"))).await.unwrap();
        let (stop, stopping) = watch::channel(false);
        let told = (Arc::default(), Arc::default(), store.disk().clone(), store.database());
        let (backups, _task) = Backups::start(&config(dir), told, stopping);
        drop(stop);
        let file = made(&backups).await;
        let backup = verify(&file).await.unwrap();
        // The picture of the view is none.
        assert!(backup.manifest.faults.iter().all(|fault| fault.contains("the picture of view")));
        let (manifest, _) = archive::read(&file).unwrap();
        assert!(manifest.contents.pictures > 0 && manifest.contents.maps.len() > 1);

        StoppedServer::of(in_file).unwrap().restore(&backup).unwrap();
        let empty = empty_store(in_database);
        let address = |text: String| crate::config::PostgresAddress::checked(text).unwrap().unwrap();
        backup.restore_into(&address(empty.clone())).await.unwrap();
        let refused = backup.restore_into(&address(store_of(taken))).await.unwrap_err().to_string();
        assert!(refused.contains("empty"), "{refused}");

        let (from_file, file_tasks) = open_at(in_file, "").await;
        let (from_database, database_tasks) = open_at(in_database, &empty).await;
        let contents = copies::Contents { pictures: 0, ..manifest.contents.clone() };
        assert_eq!(committed(&from_file).await, contents);
        let map = maps::get(store.reads(), "a").await.unwrap().id;
        for table in TABLES {
            let here = rows(&store, table, map, &[]).await;
            assert!(!here.is_empty(), "{table:?}");
            assert_eq!(rows(&from_database, table, map, &[]).await, here, "{table:?}");
        }
        let number = next_number(&store).await;
        assert_eq!(next_number(&from_database).await, number);
        assert_eq!(next_number(&from_file).await, number);
        for tasks in [tasks, file_tasks, database_tasks] {
            tasks.close().await;
        }
    }))
    .await;
}
