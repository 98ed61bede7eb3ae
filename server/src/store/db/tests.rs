//! The layer on SQLite.

use super::*;
use futures::TryStreamExt as _;
use sqlx::{ConnectOptions as _, sqlite::SqliteConnectOptions};

type Read = (Option<i64>, Option<f64>, Option<Vec<u8>>);

async fn memory() -> Conn {
    let mut conn = Conn::from(SqliteConnectOptions::new().connect().await.unwrap());
    let table = "CREATE TABLE t (name TEXT UNIQUE, n INTEGER, x REAL, bytes BLOB) STRICT";
    raw_sql(table).execute(&mut conn).await.unwrap();
    conn
}

fn insert(name: &str) -> Query {
    query("INSERT INTO t (name, n, x, bytes) VALUES ($1, $2, $3, $4)").bind(name)
}

#[tokio::test]
async fn a_value_is_read_as_it_was_bound() {
    let mut conn = memory().await;
    let some = insert("a").bind(i64::MIN).bind(0.1).bind(&b"\0\xff"[..]);
    assert_eq!(some.execute(&mut conn).await.unwrap().rows_affected(), 1);
    // What is absent has a type, too.
    let none = insert("b").bind(None::<i64>).bind(None::<f64>).bind(None::<Vec<u8>>);
    none.execute(&mut conn).await.unwrap();
    insert("c").bind(true).bind(Some(-2.5)).bind(Some(vec![7])).execute(&mut conn).await.unwrap();
    let rows = query("SELECT * FROM t ORDER BY name").fetch(&mut conn);
    let read =
        |row: Row| -> Result<Read, Error> { Ok((row.try_get("n")?, row.try_get(2)?, row.try_get("bytes")?)) };
    let read: Vec<Read> = rows.and_then(|row| std::future::ready(read(row))).try_collect().await.unwrap();
    let bytes = Some(vec![0, 255]);
    assert_eq!(
        read,
        [(Some(i64::MIN), Some(0.1), bytes), (None, None, None), (Some(1), Some(-2.5), Some(vec![7]))]
    );
    let is_one = query_scalar::<bool>("SELECT n FROM t WHERE name = $1").bind("c".to_owned());
    assert!(is_one.fetch_one(&mut conn).await.unwrap());
    let pair =
        query_as::<(String, i64)>("SELECT name, n FROM t WHERE n = $2 AND name = $1").bind("c").bind(1_u16);
    assert_eq!(pair.fetch_optional(&mut conn).await.unwrap(), Some(("c".to_owned(), 1)));
    let none = query_scalar::<i64>("SELECT n FROM t WHERE name = 'd'").fetch_one(&mut conn).await;
    assert!(matches!(none, Err(Error::RowNotFound)), "{none:?}");
}

#[tokio::test]
async fn errors_are_sorted() {
    let mut conn = memory().await;
    let one = || insert("a").bind(1_i64).bind(1.0).bind(&b""[..]);
    one().execute(&mut conn).await.unwrap();
    let class_of = async |conn: &mut Conn, query: Query| class(&query.execute(conn).await.unwrap_err());
    assert_eq!(class_of(&mut conn, one()).await, ErrorClass::Taken);
    assert_eq!(class_of(&mut conn, query("INSERT INTO t (n) VALUES ('x')")).await, ErrorClass::Other);
    raw_sql("PRAGMA max_page_count = 2").execute(&mut conn).await.unwrap();
    let large = insert("b").bind(1_i64).bind(1.0).bind(vec![0; 1 << 20]);
    assert_eq!(class_of(&mut conn, large).await, ErrorClass::Full);
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("not.sqlite");
    std::fs::write(&file, [0xa5; 8192]).unwrap();
    let options = SqliteConnectOptions::new().filename(file).read_only(true);
    let mut conn = Conn::from(options.connect().await.unwrap());
    assert_eq!(class_of(&mut conn, query("SELECT * FROM t")).await, ErrorClass::Damaged);
    let mut conn = memory().await;
    raw_sql("PRAGMA query_only = 1").execute(&mut conn).await.unwrap();
    assert_eq!(class_of(&mut conn, one()).await, ErrorClass::ReadOnly);
    assert_eq!(class(&Error::WorkerCrashed), ErrorClass::Lost);
}
