//! How much history is kept.

use super::*;
use std::path::Path;

crate::store::tests::cluster::on_each_store! {
    history_is_bounded_by_commits_and_by_bytes,
}

fn bounded(dir: &Path, commits: usize, bytes: usize) -> Config {
    let mut raw = raw_config(dir);
    (raw.limits.kept_commits, raw.limits.history_bytes) = (commits, bytes);
    Config::try_from(raw).unwrap()
}

async fn history_is_bounded_by_commits_and_by_bytes() {
    let count = async |store: &Catalogue, table: &str| -> i64 {
        let sql = format!("SELECT count(*) FROM {table}");
        db::query_scalar(db::AssertSqlSafe(sql)).fetch_one(store.reads()).await.unwrap()
    };
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&bounded(dir.path(), 3, usize::MAX >> 1)).await;
    for number in 0..6_u8 {
        do_one(&store, write!(|tx| models::put(tx, 1, &model(1, &[number; 100])))).await;
    }
    assert_eq!((count(&store, "commits").await, count(&store, "past_models").await), (3, 3));
    assert_eq!(count(&store, "model_contents").await, 4, "that in use, and those before three commits");
    let kept = ids(&store).await;
    let too_old = kept[2] - 1;
    let refused = store.write(move |tx| Box::pin(roll_back(tx, "a", too_old))).await;
    assert!(matches!(refused, Err(StoreError::NotFound { what: Kind::Commit, .. })));
    let oldest = kept[2];
    store.write(move |tx| Box::pin(roll_back(tx, "a", oldest))).await.unwrap();
    assert_eq!(models::get(store.reads(), LandmarkId(1)).await.unwrap(), [3; 100]);

    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&bounded(dir.path(), 99, 250)).await;
    for number in 0..6_u8 {
        do_one(&store, write!(|tx| models::put(tx, 1, &model(1, &[number; 100])))).await;
    }
    // Each but the first holds 100 bytes that are stored for it alone.
    assert_eq!((count(&store, "commits").await, count(&store, "model_contents").await), (2, 3));
    do_one(&store, write!(|tx| models::put(tx, 1, &model(1, &[7; 1000])))).await;
    do_one(&store, write!(|tx| models::put(tx, 1, &model(1, &[8; 1000])))).await;
    assert_eq!(count(&store, "commits").await, 1, "the newest is kept, however large");
    // The history goes with its map.
    do_one(&store, write!(|tx| maps::delete(tx, "a"))).await;
    for table in ["commits", "past_models", "past_landmarks", "model_contents"] {
        assert_eq!(count(&store, table).await, 0, "{table}");
    }
}
