//! Keys and kept answers, without HTTP.

use super::*;
use crate::{
    config::{Limits, RawConfig},
    publication::{Catalogue, CatalogueTasks, tests::raw_config},
    store::maps::{self, MapRow},
};
use vision::recognise::DistanceKind;

crate::store::tests::cluster::on_each_store! {
    an_answer_is_kept_with_its_change_and_only_with_it,
    a_key_is_at_work_until_its_write_has_ended,
    the_oldest_answers_go,
}

async fn store(dir: &std::path::Path) -> (Catalogue, CatalogueTasks) {
    let limits = Limits { kept_answers: 3, ..Limits::default() };
    let raw = RawConfig { limits, ..raw_config(dir) };
    Catalogue::open(&crate::config::Config::try_from(raw).unwrap()).await.unwrap()
}

fn answer(made: &MapRow) -> Result<Answer, StoreError> {
    Answer::json(201, &made.name)
}

/// Creates a map under a key; gives the answer to a repeat.
async fn create(store: &Catalogue, key: &str, map: &str) -> Result<Option<Answer>, StoreError> {
    let request = std::array::from_fn(|i| map.as_bytes().get(i).copied().unwrap_or_default());
    let first = match store.creation(key, request).await? {
        Creation::Repeat(answer) => return Ok(Some(answer)),
        Creation::First(key) => key,
    };
    let name = map.to_owned();
    let write =
        store.write(move |tx| Box::pin(async move { maps::create(tx, &name, DistanceKind::Both, 9).await }));
    first.scope(answered(answer, write)).await.map(|_| None)
}

async fn kept(store: &Catalogue) -> Vec<String> {
    db::query_scalar("SELECT key FROM kept_answers ORDER BY id").fetch_all(store.reads()).await.unwrap()
}

async fn an_answer_is_kept_with_its_change_and_only_with_it() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    assert_eq!(create(&store, "k1", "a").await.unwrap(), None);
    assert!(matches!(create(&store, "k2", "a").await, Err(StoreError::Exists { .. })));
    assert_eq!(kept(&store).await, ["k1"], "a failed write has kept its key");
    let repeated = create(&store, "k1", "a").await.unwrap();
    assert_eq!(repeated, Some(Answer { status: 201, body: "\"a\"".into() }));
    assert!(matches!(create(&store, "k1", "b").await, Err(StoreError::KeyReused)));
    // What was refused may be asked again under its key.
    assert_eq!(create(&store, "k2", "b").await.unwrap(), None);
    // A write without a key keeps nothing.
    store.write(|tx| Box::pin(maps::create(tx, "c", DistanceKind::Both, 9))).await.unwrap();
    assert_eq!(kept(&store).await, ["k1", "k2"]);
}

async fn a_key_is_at_work_until_its_write_has_ended() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    let Creation::First(key) = store.creation("k", [1; 32]).await.unwrap() else { panic!("a repeat") };
    let (begin, begun) = tokio::sync::oneshot::channel();
    let (release, released) = tokio::sync::oneshot::channel::<()>();
    let writes = store.clone();
    let request = tokio::spawn(key.scope(answered(answer, async move {
        let write = writes.write(move |tx| {
            Box::pin(async move {
                begin.send(()).unwrap();
                drop(released.await);
                maps::create(tx, "a", DistanceKind::Both, 9).await
            })
        });
        write.await.map(drop)
    })));
    begun.await.unwrap();
    // Its client goes; the write goes on.
    request.abort();
    assert!(request.await.is_err());
    assert!(matches!(store.creation("k", [1; 32]).await, Err(StoreError::KeyAtWork)));
    release.send(()).unwrap();
    store.write(|_| Box::pin(async { Ok(()) })).await.unwrap();
    assert!(matches!(store.creation("k", [1; 32]).await, Ok(Creation::Repeat(_))));
}

async fn the_oldest_answers_go() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = store(dir.path()).await;
    for (key, map) in [("k1", "a"), ("k2", "b"), ("k3", "c"), ("k4", "d")] {
        create(&store, key, map).await.unwrap();
    }
    assert_eq!(kept(&store).await, ["k2", "k3", "k4"]);
    // A day later an answer is none any more, and makes room.
    let late = "UPDATE kept_answers SET created_ms = created_ms - 86400000 WHERE key IN ('k2', 'k3')";
    let aged = store.write(move |tx| {
        Box::pin(async move { db::query(late).execute(tx.conn()).await.map_err(StoreError::during("age")) })
    });
    aged.await.unwrap();
    assert!(matches!(create(&store, "k2", "b").await, Err(StoreError::Exists { .. })), "taken for a repeat");
    create(&store, "k5", "e").await.unwrap();
    assert_eq!(kept(&store).await, ["k4", "k5"]);
}
