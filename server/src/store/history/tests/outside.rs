//! What another program wrote into the file of SQLite.

use super::*;

#[tokio::test]
async fn what_another_program_wrote_is_nobodys_commit() {
    let dir = tempfile::tempdir().unwrap();
    let (store, task) = open(&config(dir.path())).await;
    task.close().await;
    drop(store);
    let file = sqlx::sqlite::SqliteConnectOptions::new().filename(dir.path().join(crate::store::open::FILE));
    let mut foreign = sqlx::ConnectOptions::connect(&file).await.unwrap();
    sqlx::raw_sql("DELETE FROM landmarks").execute(&mut foreign).await.unwrap();
    sqlx::Connection::close(foreign).await.unwrap();
    let (store, _task) = Catalogue::open(&config(dir.path())).await.unwrap();
    let rows = page(store.reads(), 1, i64::MAX, 9).await.unwrap();
    assert_eq!((rows.len(), rows[0].author.operation.as_str()), (3, "outside"));
    let before = rows[1].id;
    store.write(move |tx| Box::pin(roll_back(tx, "a", before))).await.unwrap();
    assert!(landmarks::get(store.reads(), "a", "p1").await.is_ok());
}
