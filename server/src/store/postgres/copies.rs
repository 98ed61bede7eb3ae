//! Copies between a database of PostgreSQL and a file of SQLite, row by row: backups are files, and
//! each restores into either. In: one committed state. Out: all rows of all tables, and the numbers
//! that the next rows get.

use super::{
    open::{OpenError, check_alone, check_settings, connect, has_tables},
    schema::{FIRST_ROWS, made},
};
use crate::{
    private_file,
    store::{
        StoreError,
        copies::open_file,
        db::{self, AssertSqlSafe, Conn, Error, Pool, Row},
        derived_schema,
        schema::{known_schema, schema},
        sqlite::migrations,
    },
};
use futures::TryStreamExt as _;
use sqlx::{
    ConnectOptions as _,
    sqlite::{SqliteConnectOptions, SqliteJournalMode},
};
use std::{collections::BTreeSet, path::Path};

/// A copy takes as long as it takes.
const WITHOUT_LIMITS: &str =
    "SET LOCAL statement_timeout = 0; SET LOCAL idle_in_transaction_session_timeout = 0";

const COLUMNS: &str = "SELECT name, type FROM pragma_table_info($1) ORDER BY cid";
const KEY: &str = "SELECT name FROM pragma_table_info($1) WHERE pk = 1";

/// A table: its name, its columns with their types, and the one that numbers its rows by itself.
struct Table {
    name: String,
    columns: Vec<(String, String)>,
    numbered: Option<String>,
}

impl Table {
    fn list(&self) -> String {
        self.columns.iter().map(|(name, _)| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
    }
}

/// The tables of a file, in the order in which they were made: what a table refers to is before it.
async fn tables(file: &mut Conn) -> Result<Vec<Table>, Error> {
    let made = "SELECT name, sql FROM sqlite_schema WHERE type = 'table' AND name NOT GLOB 'sqlite_*' \
                AND name <> '_sqlx_migrations' ORDER BY rowid";
    let mut all = Vec::new();
    for (name, sql) in db::query_as::<(String, String)>(made).fetch_all(&mut *file).await? {
        let columns = db::query_as(COLUMNS).bind(&*name).fetch_all(&mut *file).await?;
        let numbered = db::query_scalar(KEY).bind(&*name).fetch_optional(&mut *file).await?;
        all.push(Table { name, columns, numbered: numbered.filter(|_| sql.contains("AUTOINCREMENT")) });
    }
    Ok(all)
}

/// Inserts a row of one database into the same table of another.
async fn insert(row: &Row, table: &Table, to: &mut Conn) -> Result<(), Error> {
    let places: Vec<String> = (1..=table.columns.len()).map(|number| format!("${number}")).collect();
    let sql = format!("INSERT INTO {} ({}) VALUES ({})", table.name, table.list(), places.join(", "));
    let mut query = db::query(AssertSqlSafe(sql));
    for (at, (_, kind)) in table.columns.iter().enumerate() {
        query = match kind.as_str() {
            "INTEGER" => query.bind(row.try_get::<Option<i64>, _>(at)?),
            "REAL" => query.bind(row.try_get::<Option<f64>, _>(at)?),
            "BLOB" => query.bind(row.try_get::<Option<Vec<u8>>, _>(at)?),
            _ => query.bind(row.try_get::<Option<String>, _>(at)?),
        };
    }
    query.execute(to).await.map(drop)
}

/// Copies the rows of a table.
async fn copy_rows(table: &Table, from: &mut Conn, to: &mut Conn) -> Result<(), Error> {
    let sql = AssertSqlSafe(format!("SELECT {} FROM {}", table.list(), table.name));
    if table.name == "maps" {
        return copy_maps(table, db::query(sql).fetch_all(from).await?, to).await;
    }
    let mut rows = db::query(sql).fetch(from);
    while let Some(row) = rows.try_next().await? {
        insert(&row, table, to).await?;
    }
    Ok(())
}

/// Copies the maps: a map after those that it refers to.
async fn copy_maps(table: &Table, mut waiting: Vec<Row>, to: &mut Conn) -> Result<(), Error> {
    let mut done = BTreeSet::new();
    while !waiting.is_empty() {
        let (mut later, count) = (Vec::new(), waiting.len());
        for row in waiting.drain(..) {
            let (parent, of): (Option<i64>, Option<i64>) =
                (row.try_get("parent_id")?, row.try_get("draft_of")?);
            if parent.iter().chain(&of).all(|map| done.contains(map)) {
                insert(&row, table, to).await?;
                done.insert(row.try_get::<i64, _>("id")?);
            } else {
                later.push(row);
            }
        }
        if later.len() == count {
            return Err(Error::Protocol("maps refer to each other in a circle".to_owned()));
        }
        waiting = later;
    }
    Ok(())
}

/// Size of the database.
pub(crate) async fn bytes(reads: &Pool) -> Result<u64, StoreError> {
    let bytes = db::query_scalar::<i64>("SELECT pg_database_size(current_database())").fetch_one(reads).await;
    bytes.map(i64::unsigned_abs).map_err(StoreError::during("read the size of the database"))
}

/// Writes one committed state of a database of PostgreSQL to the new file `to`. Returns once it is
/// on the disk.
pub(crate) async fn copy(reads: &Pool, to: &Path) -> Result<(), StoreError> {
    // An error here is one of the next line, too.
    drop(private_file::create(to));
    let copied = async {
        let options = SqliteConnectOptions::new().filename(to).foreign_keys(false);
        // Nothing is left beside a copy that fails.
        let mut file = Conn::from(options.journal_mode(SqliteJournalMode::Memory).connect().await?);
        let written = into_file(reads, &mut file).await;
        file.close().await?;
        written
    };
    copied.await.map_err(StoreError::during("copy the database"))
}

async fn into_file(reads: &Pool, file: &mut Conn) -> Result<(), Error> {
    migrations::migrator().run(file.sqlite()?).await?;
    derived_schema::complete(file).await?;
    let mut from = reads.begin().await?;
    db::raw_sql(WITHOUT_LIMITS).execute(&mut from).await?;
    let triggers = "SELECT name, sql FROM sqlite_schema WHERE type = 'trigger'";
    let triggers: Vec<(String, String)> = db::query_as(triggers).fetch_all(&mut *file).await?;
    let tables = tables(file).await?;
    db::raw_sql("BEGIN").execute(&mut *file).await?;
    for (name, _) in &triggers {
        db::raw_sql(AssertSqlSafe(format!("DROP TRIGGER {name}"))).execute(&mut *file).await?;
    }
    for table in &tables {
        db::raw_sql(AssertSqlSafe(format!("DELETE FROM {}", table.name))).execute(&mut *file).await?;
        copy_rows(table, &mut from, file).await?;
        let Some(key) = &table.numbered else { continue };
        let last = "SELECT pg_sequence_last_value(CAST(pg_get_serial_sequence($1, $2) AS regclass))";
        let last = db::query_scalar::<Option<i64>>(last).bind(&*table.name).bind(&**key);
        if let Some(last) = last.fetch_one(&mut from).await? {
            let forget = db::query("DELETE FROM sqlite_sequence WHERE name = $1").bind(&*table.name);
            forget.execute(&mut *file).await?;
            let note = db::query("INSERT INTO sqlite_sequence (name, seq) VALUES ($1, $2)");
            note.bind(&*table.name).bind(last).execute(&mut *file).await?;
        }
    }
    for (_, sql) in triggers {
        db::raw_sql(AssertSqlSafe(sql)).execute(&mut *file).await?;
    }
    db::raw_sql("COMMIT").execute(file).await?;
    from.close().await
}

/// Puts what a file holds into the empty database at `address`, all or nothing.
pub(crate) async fn restore(file: &Path, address: &str) -> Result<(), OpenError> {
    let mut to = connect(address).await?;
    check_settings(&mut to).await?;
    check_alone(&mut to).await?;
    if has_tables(&mut to).await? {
        return Err(OpenError::NotEmpty);
    }
    let mut file = open_file(file).await.map_err(OpenError::Read)?;
    let (found, known) = (schema(&mut file).await.map_err(OpenError::Read)?, known_schema());
    if found != known {
        return Err(OpenError::Schema { found, known });
    }
    into_database(&mut file, &mut to).await.map_err(OpenError::Open)
}

async fn into_database(file: &mut Conn, to: &mut Conn) -> Result<(), Error> {
    let made = made().await?.into_iter().filter(|sql| sql != FIRST_ROWS);
    let (triggers, made): (Vec<_>, Vec<_>) = made.partition(|sql| sql.contains("CREATE TRIGGER"));
    db::raw_sql("BEGIN").execute(&mut *to).await?;
    db::raw_sql(WITHOUT_LIMITS).execute(&mut *to).await?;
    for sql in made {
        db::raw_sql(AssertSqlSafe(sql)).execute(&mut *to).await?;
    }
    for table in tables(file).await? {
        copy_rows(&table, file, to).await?;
        let Some(key) = &table.numbered else { continue };
        let last =
            db::query_scalar::<i64>("SELECT seq FROM sqlite_sequence WHERE name = $1").bind(&*table.name);
        if let Some(last) = last.fetch_optional(&mut *file).await?.filter(|last| *last > 0) {
            let note = "SELECT setval(CAST(pg_get_serial_sequence($1, $2) AS regclass), $3)";
            let note = db::query(note).bind(&*table.name).bind(&**key).bind(last);
            note.fetch_one(&mut *to).await?;
        }
    }
    for sql in triggers {
        db::raw_sql(AssertSqlSafe(sql)).execute(&mut *to).await?;
    }
    db::raw_sql("COMMIT").execute(to).await.map(drop)
}
