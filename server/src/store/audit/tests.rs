use super::*;
use crate::{
    config::{Config, Limits},
    publication::{Catalogue, CatalogueTasks},
    store::maps,
};
use vision::recognise::DistanceKind;

crate::store::tests::cluster::on_each_store! {
    every_change_has_an_entry_and_what_changes_nothing_has_none,
    whatever_is_changed_in_the_file_breaks_the_chain,
    a_noted_head_finds_what_the_chain_alone_cannot,
    the_oldest_are_forgotten_and_the_chain_goes_on,
    the_database_refuses_to_change_or_remove_entries,
}

async fn catalogue(data: &std::path::Path, audit_entries: usize) -> (Catalogue, CatalogueTasks) {
    let limits = Limits { audit_entries, ..Limits::default() };
    let config = Config { data: data.to_owned(), limits, ..Config::default() };
    Catalogue::open(&config).await.unwrap()
}

fn kim(target: &str) -> Actor {
    Actor {
        name: "kim".to_owned(),
        token: Some(7),
        action: "POST /maps".to_owned(),
        target: target.to_owned(),
        request: Some("r-1".to_owned()),
        job: None,
        why: None,
    }
}

async fn make(store: &Catalogue, name: &'static str) -> Result<(), StoreError> {
    let write = store.write(move |tx| Box::pin(maps::create(tx, name, DistanceKind::Both, 9)));
    kim("/maps").scope(write).await.map(drop)
}

async fn checked(store: &Catalogue, noted: Option<ChainLink>) -> AuditCheck {
    let mut conn = store.reads().acquire().await.unwrap();
    check(&mut conn, noted).await.unwrap()
}

/// Changes what is stored as only somebody with the file in his hands can.
async fn tamper(store: &Catalogue, sql: &'static str) {
    let drop_guards =
        "DROP TRIGGER IF EXISTS audit_is_not_changed; DROP TRIGGER IF EXISTS audit_is_not_removed";
    let write = store.write(move |tx| {
        Box::pin(async move {
            db::raw_sql(drop_guards).execute(tx.conn()).await.unwrap();
            db::raw_sql(sql).execute(tx.conn()).await.unwrap();
            Ok(())
        })
    });
    write.await.unwrap();
}

async fn every_change_has_an_entry_and_what_changes_nothing_has_none() {
    let data = tempfile::tempdir().unwrap();
    let (store, _tasks) = catalogue(data.path(), 100).await;
    make(&store, "hall").await.unwrap();
    assert!(make(&store, "hall").await.is_err(), "there is one already");
    kim("/nothing").scope(store.write(|_| Box::pin(async { Ok(()) }))).await.unwrap();
    // The server by itself.
    store.write(|tx| Box::pin(maps::delete(tx, "hall"))).await.unwrap();
    let all = page(store.reads(), &AuditFilter::default(), i64::MAX, 9).await.unwrap();
    let of = |row: &AuditRow| (row.seq, row.actor.clone(), row.token, row.action.clone(), row.target.clone());
    assert_eq!(
        all.iter().map(of).collect::<Vec<_>>(),
        [
            (2, "server".into(), None, "change".into(), String::new()),
            (1, "kim".into(), Some(7), "POST /maps".into(), "/maps".into())
        ]
    );
    assert_eq!(all[1].request.as_deref(), Some("r-1"));
    let found = checked(&store, None).await;
    assert_eq!((found.entries, found.forgotten, found.fault), (2, 0, None));
    assert_eq!(found.head.sha256, hex(&all[0].sha256));
    for (filter, expected) in [
        (AuditFilter { actor: Some("kim".into()), ..AuditFilter::default() }, 1),
        (AuditFilter { target: Some("/map".into()), ..AuditFilter::default() }, 1),
        (AuditFilter { target: Some("/map_".into()), ..AuditFilter::default() }, 0),
        (AuditFilter { since_ms: Some(all[0].time_ms + 1), ..AuditFilter::default() }, 0),
        (AuditFilter { before_ms: Some(all[1].time_ms), ..AuditFilter::default() }, 0),
    ] {
        let rows = page(store.reads(), &filter, i64::MAX, 9).await.unwrap();
        assert_eq!((rows.len(), count(store.reads(), &filter).await.unwrap()), (expected, expected as u64));
    }
}

async fn whatever_is_changed_in_the_file_breaks_the_chain() {
    let changes = [
        ("UPDATE audit SET time_ms = time_ms + 1 WHERE seq = 2", "entry 2 is not as it was written"),
        ("UPDATE audit SET actor = 'sam' WHERE seq = 2", "entry 2 is not as it was written"),
        ("UPDATE audit SET token = NULL WHERE seq = 2", "entry 2 is not as it was written"),
        ("UPDATE audit SET action = 'POST /map' WHERE seq = 2", "entry 2 is not as it was written"),
        // From one column into the next.
        (
            "UPDATE audit SET action = 'POST /map', target = 's/maps' WHERE seq = 2",
            "entry 2 is not as it was written",
        ),
        ("UPDATE audit SET request = NULL WHERE seq = 3", "entry 3 is not as it was written"),
        ("UPDATE audit SET sha256 = zeroblob(32) WHERE seq = 1", "entry 1 is not as it was written"),
        ("DELETE FROM audit WHERE seq = 2", "entry 2 is missing"),
        (
            "DELETE FROM audit WHERE seq = 2; UPDATE audit SET seq = 2 WHERE seq = 3",
            "entry 2 is not as it was written",
        ),
        ("UPDATE audit_start SET sha256 = randomblob(32)", "entry 1 is not as it was written"),
    ];
    for (sql, expected) in changes {
        let data = tempfile::tempdir().unwrap();
        let (store, _tasks) = catalogue(data.path(), 100).await;
        for name in ["a", "b", "c"] {
            make(&store, name).await.unwrap();
        }
        assert_eq!(checked(&store, None).await.fault, None);
        tamper(&store, sql).await;
        assert_eq!(checked(&store, None).await.fault.as_deref(), Some(expected), "{sql}");
    }
}

async fn a_noted_head_finds_what_the_chain_alone_cannot() {
    let data = tempfile::tempdir().unwrap();
    let (store, _tasks) = catalogue(data.path(), 100).await;
    make(&store, "a").await.unwrap();
    make(&store, "b").await.unwrap();
    let noted = head(store.reads()).await.unwrap();
    assert_eq!(checked(&store, Some(noted)).await.fault, None);
    assert_eq!(checked(&store, Some(ChainLink { seq: 0, sha256: [0; 32] })).await.fault, None);
    tamper(&store, "DELETE FROM audit WHERE seq = 2").await;
    let found = checked(&store, Some(noted)).await;
    assert_eq!(found.fault.as_deref(), Some("entry 2 is missing: the log ends at 1"));
    assert_eq!(checked(&store, None).await.fault, None, "a whole chain, only shorter");
    make(&store, "c").await.unwrap();
    let found = checked(&store, Some(noted)).await;
    assert_eq!(found.fault.as_deref(), Some("entry 2 has another digest than was noted"));
}

async fn the_oldest_are_forgotten_and_the_chain_goes_on() {
    let data = tempfile::tempdir().unwrap();
    let first;
    {
        let (store, tasks) = catalogue(data.path(), 4).await;
        make(&store, "a").await.unwrap();
        first = head(store.reads()).await.unwrap();
        for name in ["b", "c", "d", "e", "f"] {
            make(&store, name).await.unwrap();
        }
        let found = checked(&store, None).await;
        assert_eq!((found.entries, found.forgotten, found.head.seq, found.fault), (4, 2, 6, None));
        let fault = checked(&store, Some(first)).await.fault;
        assert_eq!(fault.as_deref(), Some("entry 1 was forgotten: note a newer one"));
        tasks.close().await;
    }
    // A bound that was lowered.
    let (store, _tasks) = catalogue(data.path(), 2).await;
    make(&store, "g").await.unwrap();
    let found = checked(&store, None).await;
    assert_eq!((found.entries, found.forgotten, found.fault), (2, 5, None));
}

async fn the_database_refuses_to_change_or_remove_entries() {
    let data = tempfile::tempdir().unwrap();
    let (store, _tasks) = catalogue(data.path(), 100).await;
    make(&store, "a").await.unwrap();
    for sql in ["UPDATE audit SET actor = 'sam'", "DELETE FROM audit"] {
        let write = store.write(move |tx| {
            Box::pin(async move {
                let refused = db::raw_sql(sql).execute(tx.conn()).await.unwrap_err().to_string();
                assert!(refused.contains("audit log are not"), "{refused}");
                Ok(())
            })
        });
        write.await.unwrap();
    }
}

#[test]
fn digests_are_read_from_64_digits() {
    let read = |text: &str| ChainLink::try_from(&AuditHead { seq: 3, sha256: text.to_owned() });
    assert_eq!(read(&hex(&[0xab; 32])), Ok(ChainLink { seq: 3, sha256: [0xab; 32] }));
    for bad in ["", "ab", &"g".repeat(64), &"ä".repeat(32), &"a".repeat(65), &format!("+{}", "a".repeat(63))]
    {
        assert_eq!(read(bad), Err(NoDigest), "{bad}");
    }
}
