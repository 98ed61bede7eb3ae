//! One commit is taken back.

use super::*;

crate::store::tests::cluster::on_each_store! {
    one_commit_is_taken_back_unless_a_later_one_changed_the_same,
}

async fn one_commit_is_taken_back_unless_a_later_one_changed_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let (store, _task) = open(&config(dir.path())).await;
    let made = newest(store.reads(), 1).await.unwrap();
    do_one(&store, write!(|tx| landmarks::create(tx, "a", "p2", at(2.0), 9))).await;
    let second = newest(store.reads(), 1).await.unwrap();
    do_one(&store, write!(|tx| landmarks::update(tx, "a", "p1", |_| at(7.0)))).await;
    let moved = newest(store.reads(), 1).await.unwrap();
    teach(&store, "p2", 2).await;
    let taught = newest(store.reads(), 1).await.unwrap();
    let undone = async |commit: i64| store.write(move |tx| Box::pin(undo(tx, "a", commit))).await;
    // Not the newest one: `p1` was not changed since.
    undone(moved).await.unwrap();
    assert_eq!(landmarks::get(store.reads(), "a", "p1").await.unwrap().geometry, at(1.0 / 3.0));
    let refused = undone(moved).await;
    assert!(
        matches!(&refused, Err(StoreError::ChangedSince { what, .. }) if what == "landmark p1"),
        "{refused:?}"
    );
    let refused = undone(second).await;
    assert!(matches!(refused, Err(StoreError::ChangedSince { by, .. }) if by == taught), "{refused:?}");
    undone(taught).await.unwrap();
    assert!(matches!(undone(second).await, Err(StoreError::ChangedSince { .. })), "its views came and went");
    assert!(matches!(undone(made).await, Err(StoreError::ChangedSince { .. })));
    assert!(matches!(undone(1).await, Err(StoreError::InUse(_))), "the map itself");
    assert!(matches!(undone(999).await, Err(StoreError::NotFound { what: Kind::Commit, .. })));
    // A deleted landmark comes back, unless its name is taken.
    do_one(&store, write!(|tx| landmarks::delete(tx, "a", "p2"))).await;
    let deleted = newest(store.reads(), 1).await.unwrap();
    do_one(&store, write!(|tx| landmarks::create(tx, "a", "p2", at(3.0), 9))).await;
    assert!(matches!(undone(deleted).await, Err(StoreError::InUse(_))));
    do_one(&store, write!(|tx| landmarks::rename(tx, "a", "p2", "p3"))).await;
    let revision = landmarks::get(store.reads(), "a", "p1").await.unwrap().revision;
    undone(deleted).await.unwrap();
    assert_eq!(landmarks::get(store.reads(), "a", "p2").await.unwrap().geometry, at(2.0));
    assert_eq!(landmarks::get(store.reads(), "a", "p1").await.unwrap().revision, revision, "others stay");
    // A lesson that is under way would bring back what is gone.
    store.write(|tx| Box::pin(jobs::create(tx, "learn", "a", "{}", (9, 9)))).await.unwrap();
    let refused = store.write(move |tx| Box::pin(roll_back(tx, "a", made))).await;
    assert!(matches!(refused, Err(StoreError::InUse(why)) if why.contains("job 1")));
}
