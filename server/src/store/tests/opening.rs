//! How a store in PostgreSQL is opened, by whom, and what is known of a commit without an answer.

use super::cluster::{on_postgres, store_of};
use crate::{
    publication::{Catalogue, tests::config},
    store::{
        OpenError, PostgresError, StoreError, db, maps,
        postgres::{
            open::{connect, options},
            turn::{self, Commit},
        },
        schema::known_schema,
    },
};
use sqlx::postgres::PgSslMode;
use vision::recognise::DistanceKind;

/// Why the database at `address` does not open.
async fn refused(address: &str) -> PostgresError {
    crate::store::postgres::open::open(address, &[1]).await.err().unwrap()
}

#[tokio::test]
async fn a_database_that_could_lose_a_write_or_is_of_others_is_refused_by_name() {
    on_postgres(Box::pin(async {
        let dir = tempfile::tempdir().unwrap();
        let address = store_of(dir.path());
        let unsafe_one = format!("{address}&options[synchronous_commit]=off");
        let error = refused(&unsafe_one).await;
        assert!(matches!(error, PostgresError::Setting { setting: "synchronous_commit", .. }), "{error}");
        let error = refused("postgres://kim:secret@localhost/maps?host=/nowhere").await;
        assert!(matches!(error, PostgresError::Unreachable(_)), "{error}");
        let error = refused("postgres://kim@local host").await;
        assert!(matches!(error, PostgresError::Address(_)), "{error}");
        let mut conn = connect(&address).await.unwrap();
        let other = "UPDATE _sqlx_migrations SET version = version + 1";
        db::raw_sql(other).execute(&mut conn).await.unwrap();
        let error = refused(&address).await;
        assert!(matches!(error, PostgresError::InUse), "{error}");
        conn.close().await.unwrap();
        let error = refused(&address).await;
        let known = known_schema();
        assert!(matches!(error, PostgresError::Schema { found, .. } if found == known + 1), "{error}");
    }))
    .await;
}

#[test]
fn a_connection_beyond_loopback_is_encrypted() {
    let mode = |address: &str| options(address).map(|options| options.get_ssl_mode());
    for here in ["localhost", "127.0.0.1", "[::1]"] {
        let mode = mode(&format!("postgres://kim@{here}/maps?sslmode=disable"));
        assert!(matches!(mode, Ok(PgSslMode::Disable)), "{here}: {mode:?}");
    }
    assert!(matches!(mode("postgres:///maps?host=/run&sslmode=disable"), Ok(PgSslMode::Disable)));
    assert!(matches!(mode("postgres://kim@192.0.2.1/maps"), Ok(PgSslMode::Require)));
    let verified = mode("postgres://kim@db.example.org/maps?sslmode=verify-full");
    assert!(matches!(verified, Ok(PgSslMode::VerifyFull)));
    let refused = mode("postgres://kim@192.0.2.1/maps?sslmode=disable");
    assert!(matches!(refused, Err(PostgresError::PlainText)), "{refused:?}");
}

#[tokio::test]
async fn one_server_writes_and_another_ends_it_only_by_taking_its_turn() {
    on_postgres(Box::pin(async {
        let dir = tempfile::tempdir().unwrap();
        let (store, _tasks) = Catalogue::open(&config(dir.path())).await.unwrap();
        let create = |name| store.write(move |tx| Box::pin(maps::create(tx, name, DistanceKind::Both, 9)));
        create("a").await.unwrap();
        let second = tempfile::tempdir().unwrap();
        let mut settings = config(dir.path());
        settings.data = second.path().to_owned();
        let refused = Catalogue::open(&settings).await.err().unwrap();
        assert!(matches!(refused, OpenError::Postgres(PostgresError::InUse)), "{refused}");
        create("b").await.unwrap();
        let mut conn = connect(&store_of(dir.path())).await.unwrap();
        turn::hold(&mut conn, b"another").await.unwrap();
        assert!(matches!(create("c").await, Err(StoreError::Closed)));
        while store.vitals().failure().is_none() {
            tokio::task::yield_now().await;
        }
        let names: Vec<String> =
            db::query_scalar("SELECT name FROM maps ORDER BY name").fetch_all(&mut conn).await.unwrap();
        assert_eq!(names, ["a", "b"]);
    }))
    .await;
}

#[tokio::test]
async fn a_commit_without_an_answer_is_known_by_its_name() {
    on_postgres(Box::pin(async {
        let dir = tempfile::tempdir().unwrap();
        let address = store_of(dir.path());
        let (mut conn, _reads) = crate::store::postgres::open::open(&address, b"me").await.unwrap();
        let done = turn::begin(&mut conn, b"me", [1; 16]).await.unwrap().unwrap();
        assert!(matches!(turn::commit(&mut conn, done).await, Commit::Done));
        let open = turn::begin(&mut conn, b"me", [2; 16]).await.unwrap().unwrap();
        // The server is killed, and asks again.
        drop(conn);
        let mut conn = connect(&address).await.unwrap();
        assert!(turn::is_committed(&mut conn, b"me", done).await.unwrap());
        assert!(!turn::is_committed(&mut conn, b"me", open).await.unwrap());
        // After a statement that failed nothing is committed, though PostgreSQL says it was.
        let failed = turn::begin(&mut conn, b"me", [3; 16]).await.unwrap().unwrap();
        db::raw_sql("SELECT 1 / 0").execute(&mut conn).await.unwrap_err();
        assert!(matches!(turn::commit(&mut conn, failed).await, Commit::Refused(_)));
    }))
    .await;
}
