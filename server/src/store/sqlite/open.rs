//! Opens the database: one writer connection and a read-only pool, with settings that survive a
//! power cut. Each setting is read back. Errors: a SQLite with the write-ahead-log corruption bug,
//! a damaged file, a second server.

use super::{checkpoint::renew_log, disk_guard, migrations, restored};
use crate::{
    private_file::{self, OpenToOthers},
    store::{
        StoreError,
        db::{self, Conn, Pool},
        derived_schema, history, schema,
    },
};
use sqlx::{
    ConnectOptions, Row,
    sqlite::{SqliteConnectOptions, SqlitePoolOptions, SqliteSynchronous},
};
use std::{
    fs::{File, TryLockError},
    path::{Path, PathBuf},
    time::Duration,
};

/// First version without the write-ahead-log corruption of 3.7.0 to 3.51.2
/// (sqlite.org/wal.html#walresetbug).
pub(crate) const SQLITE_MIN: (u32, u32, u32) = (3, 51, 3);
/// Connections that read at a time.
const READERS: u32 = 4;
/// Only a foreign program could hold the lock: the writer is alone.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);
/// File name of the database in the data directory.
pub(crate) const FILE: &str = "waymark.sqlite";
/// File name of the lock in the data directory.
const LOCK: &str = "lock";

/// Settings that each connection must have: name and value.
const PRAGMAS: [(&str, &str); 8] = [
    ("journal_mode", "wal"),
    // The writer moves the log into the file itself, to learn of errors.
    ("wal_autocheckpoint", "0"),
    // 2 = FULL: a commit is on the disk before it is acknowledged.
    ("synchronous", "2"),
    ("foreign_keys", "1"),
    // A read error must come back as an error, not as a signal.
    ("mmap_size", "0"),
    ("trusted_schema", "0"),
    ("cell_size_check", "1"),
    ("busy_timeout", "5000"),
];

/// Why the store does not open.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OpenError {
    /// The directory or the lock file.
    #[error("data directory {path}: {source}")]
    Directory {
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Another server holds it.
    #[error("data directory {0} is in use by another server")]
    Locked(PathBuf),
    /// The compiled-in SQLite is too old.
    #[error("SQLite {0} can corrupt a database; at least {a}.{b}.{c} is needed", a = SQLITE_MIN.0, b = SQLITE_MIN.1, c = SQLITE_MIN.2)]
    Version(String),
    /// A setting has another value than needed.
    #[error("the database says {pragma} = {actual}, {expected} is needed")]
    Pragma {
        /// Name of the setting.
        pragma: &'static str,
        /// Value needed.
        expected: &'static str,
        /// Value read back.
        actual: String,
    },
    /// The file is damaged.
    #[error("the database is damaged: {0}")]
    Damaged(String),
    /// A migration cannot be applied; a newer server may have written the file.
    #[error("the database cannot be brought to this server's schema")]
    Migrate(#[source] sqlx::migrate::MigrateError),
    /// Anything else at opening.
    #[error("the database does not open")]
    Open(#[from] sqlx::Error),
    /// A read-only file system on which the database cannot be read as it is.
    #[error("data directory {path} is on a read-only file system, and {reason}")]
    ReadOnly {
        path: PathBuf,
        /// What is missing.
        reason: &'static str,
    },
    /// A database of PostgreSQL.
    #[error(transparent)]
    Postgres(#[from] crate::store::postgres::open::OpenError),
    /// The first reading of the maps.
    #[error("the maps cannot be read")]
    Load(#[source] StoreError),
}

/// An open database.
pub(in crate::store) struct Opened {
    pub(in crate::store) writer: Conn,
    pub(in crate::store) reads: Pool,
    pub(in crate::store) lock: File,
}

/// Layer of SQLite that keeps the index of the write-ahead log in memory and not in a file. It
/// needs the file for itself, as the lock of the data directory gives it.
const WITHOUT_SHARED_MEMORY: &str = "unix-excl";

/// Opens the database in `data` for reading and writing. A full disk does not keep it from opening:
/// where there is no room for the file of the log's index, the index is in memory. On a read-only
/// file system it opens for reading alone.
pub(in crate::store) async fn open(data: &Path, vfs: Option<&'static str>) -> Result<Opened, OpenError> {
    if disk_guard::is_read_only(data) {
        return open_read_only(data).await;
    }
    let lock = lock(data)?;
    restored::put_in_place(data, FILE)
        .map_err(|source| OpenError::Directory { path: data.to_owned(), source })?;
    let log = data.join(format!("{FILE}-wal"));
    match renew_log(&log) {
        // Blocks that are there are written in place; some file systems need room all the same.
        Err(error) if error.kind() == std::io::ErrorKind::StorageFull => {
            tracing::warn!(%error, follows = "it stays as it is", "log_not_renewed");
        }
        renewed => renewed.map_err(|source| OpenError::Directory { path: log, source })?,
    }
    let (writer, reads) = match connect(data, vfs).await {
        Err(OpenError::Open(error)) if vfs.is_none() && db::is_without_room(&error) => {
            let follows = "the index of its log is in memory; what adds data is refused until there is room";
            tracing::warn!(%error, follows, "database_opened_without_room");
            connect(data, Some(WITHOUT_SHARED_MEMORY)).await?
        }
        opened => opened?,
    };
    Ok(Opened { writer, reads, lock })
}

/// The connections, checked, on the present schema. After an error the writer is closed before this
/// returns: what connections of a process share (the index of the log, and where that is) lives as
/// long as one of them is open.
async fn connect(data: &Path, vfs: Option<&'static str>) -> Result<(Conn, Pool), OpenError> {
    // SQLite gives the log and its index the mode of the database. An error here is one of the next
    // line, too.
    drop(private_file::open(&data.join(FILE)));
    let options = options(&data.join(FILE));
    let options = if let Some(vfs) = vfs { options.vfs(vfs) } else { options };
    let writer = options.clone().create_if_missing(true).connect().await.map_err(OpenError::Open)?;
    let mut writer = Conn::from(writer);
    match prepare(&mut writer, options).await {
        Ok(reads) => Ok((writer, reads)),
        Err(error) => {
            // A dropped connection is closed later, by its thread. This fails only where that has
            // ended.
            drop(writer.close().await);
            Err(error)
        }
    }
}

/// Sets what reads or writes the file, checks it and brings it to the present schema; opens the
/// connections that read.
async fn prepare(writer: &mut Conn, options: SqliteConnectOptions) -> Result<Pool, OpenError> {
    let durable = "PRAGMA journal_mode = wal; PRAGMA synchronous = FULL";
    db::raw_sql(durable).execute(&mut *writer).await.map_err(OpenError::Open)?;
    check_version(writer).await?;
    check_pragmas(writer).await?;
    check_integrity(writer).await?;
    migrations::migrator().run(writer.sqlite()?).await.map_err(OpenError::Migrate)?;
    derived_schema::complete(writer).await.map_err(OpenError::Open)?;
    history::close_outside(writer).await.map_err(OpenError::Open)?;
    let reads = SqlitePoolOptions::new()
        .max_connections(READERS)
        .acquire_timeout(BUSY_TIMEOUT)
        // A connection is tested when it comes back.
        .test_before_acquire(false)
        .connect_with(options.synchronous(SqliteSynchronous::Full).read_only(true))
        .await
        .map(Pool::Sqlite)
        .map_err(OpenError::Open)?;
    check_pragmas(&mut reads.acquire().await.map_err(OpenError::Open)?).await?;
    Ok(reads)
}

/// Opens the database on a read-only file system: every write is refused by SQLite. After a clean
/// stop the file alone is complete and nobody changes it. After a kill the log is read, which needs
/// the file of its index.
async fn open_read_only(data: &Path) -> Result<Opened, OpenError> {
    let unreadable = |reason| OpenError::ReadOnly { path: data.to_owned(), reason };
    let at = |source| OpenError::Directory { path: data.to_owned(), source };
    let lock = File::open(data.join(LOCK)).or_else(|_none| File::open(data)).map_err(at)?;
    let lock = held(lock, data)?;
    let beside = |suffix: &str| std::fs::metadata(data.join(format!("{FILE}{suffix}")));
    let has_log = beside("-wal").is_ok_and(|log| log.len() > 0);
    if has_log && beside("-shm").is_err() {
        let reason =
            "the log beside the database cannot be read there: mount it writable once, or copy the directory";
        return Err(unreadable(reason));
    }
    let options = read_options(&data.join(FILE)).immutable(!has_log);
    let mut writer = options.clone().connect().await.map(Conn::from).map_err(OpenError::Open)?;
    check_version(&mut writer).await?;
    check_integrity(&mut writer).await?;
    if schema::schema(&mut writer).await.map_err(OpenError::Load)? != schema::known_schema() {
        return Err(unreadable("another version of the server has written it: mount it writable"));
    }
    let reads = SqlitePoolOptions::new().max_connections(READERS).acquire_timeout(BUSY_TIMEOUT);
    let reads = reads.test_before_acquire(false).connect_with(options).await.map(Pool::Sqlite);
    let reads = reads.map_err(OpenError::Open)?;
    tracing::error!(path = %data.display(), follows = "robots are served; nothing is stored", "data_directory_read_only");
    Ok(Opened { writer, reads, lock })
}

/// What every connection has.
fn options(file: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(file)
        .foreign_keys(true)
        .busy_timeout(BUSY_TIMEOUT)
        .pragma("wal_autocheckpoint", "0")
        .pragma("mmap_size", "0")
        .pragma("trusted_schema", "OFF")
        .pragma("cell_size_check", "ON")
        .disable_statement_logging()
}

/// A connection that only reads.
pub(super) fn read_options(file: &Path) -> SqliteConnectOptions {
    options(file).read_only(true)
}

/// Takes the data directory, which is made if it is not there, and closes it to other users: nobody
/// else uses it while the file is held.
pub(crate) fn lock(data: &Path) -> Result<File, OpenError> {
    let at = |source| OpenError::Directory { path: data.to_owned(), source };
    let was_open = private_file::data_directory(data).map_err(at)?;
    tell_open(data, was_open);
    held(private_file::open(&data.join(LOCK)).map_err(at)?, data)
}

/// One line of the log for everything that others could read: of a folder alone, nothing.
fn tell_open(data: &Path, OpenToOthers { files, folders, left }: OpenToOthers) {
    let path = data.display();
    if files > 0 {
        let follows = "only the server's user can read them now; whoever could before may have copied them";
        tracing::warn!(files, folders, %path, follows, "data_directory_closed_to_others");
    }
    if left > 0 {
        let follows =
            "others may read the maps and pictures: give the directory to the server's user, mode 0700";
        tracing::warn!(left, %path, follows, "data_directory_open_to_others");
    }
}

fn held(file: File, data: &Path) -> Result<File, OpenError> {
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(OpenError::Locked(data.to_owned())),
        Err(TryLockError::Error(source)) => Err(OpenError::Directory { path: data.to_owned(), source }),
    }
}

async fn check_version(conn: &mut Conn) -> Result<(), OpenError> {
    let text: String = db::query_scalar("SELECT sqlite_version()").fetch_one(conn).await?;
    if version(&text).is_some_and(|v| v >= SQLITE_MIN) { Ok(()) } else { Err(OpenError::Version(text)) }
}

fn version(text: &str) -> Option<(u32, u32, u32)> {
    let mut parts = text.split('.').map(str::parse);
    Some((parts.next()?.ok()?, parts.next()?.ok()?, parts.next()?.ok()?))
}

async fn check_pragmas(conn: &mut Conn) -> Result<(), OpenError> {
    for (pragma, expected) in PRAGMAS {
        let sql = sqlx::AssertSqlSafe(format!("PRAGMA {pragma}"));
        let row = sqlx::query(sql).fetch_one(conn.sqlite()?).await?;
        // Some pragmas answer with a number, some with a word; SQLite converts either to text.
        let actual: String = row.try_get_unchecked(0).map_err(OpenError::Open)?;
        if actual != expected {
            return Err(OpenError::Pragma { pragma, expected, actual });
        }
    }
    Ok(())
}

/// Checks every table but the pictures and the bytes of models, which are most of a large file.
/// Each has a digest, which is compared whenever it is read: models in use at the start, pictures
/// once by `pictures::check_all` after it.
async fn check_integrity(conn: &mut Conn) -> Result<(), OpenError> {
    let tables = "SELECT name FROM sqlite_schema WHERE type = 'table' \
                  AND name NOT IN ('pictures', 'model_contents')";
    let tables: Vec<String> = db::query_scalar(tables).fetch_all(&mut *conn).await?;
    for table in std::iter::once("sqlite_schema").chain(tables.iter().map(String::as_str)) {
        let said: String = db::query_scalar("SELECT quick_check FROM pragma_quick_check($1)")
            .bind(table)
            .fetch_one(&mut *conn)
            .await?;
        if said != "ok" {
            return Err(OpenError::Damaged(format!("table {table}: {said}")));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_compare_as_numbers() {
        assert!(version("3.51.3").unwrap() >= SQLITE_MIN);
        assert!(version("3.100.0").unwrap() >= SQLITE_MIN);
        assert!(version("3.51.2").unwrap() < SQLITE_MIN);
        assert!(version("3.9.9").unwrap() < SQLITE_MIN);
        assert_eq!(version("3.51"), None);
    }

    #[tokio::test]
    async fn a_second_server_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let first = open(dir.path(), None).await.unwrap();
        assert!(matches!(open(dir.path(), None).await, Err(OpenError::Locked(_))));
        drop(first);
        assert!(open(dir.path(), None).await.is_ok());
    }

    #[tokio::test]
    async fn a_setting_that_did_not_take_is_found() {
        let dir = tempfile::tempdir().unwrap();
        let mut opened = open(dir.path(), None).await.unwrap();
        db::raw_sql("PRAGMA synchronous = NORMAL").execute(&mut opened.writer).await.unwrap();
        assert!(matches!(
            check_pragmas(&mut opened.writer).await,
            Err(OpenError::Pragma { pragma: "synchronous", .. })
        ));
    }

    #[tokio::test]
    async fn another_schema_is_refused() {
        let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) \
                     VALUES (9999, 'later', 1, x'00', 0)";
        let other = "UPDATE _sqlx_migrations SET checksum = x'00' WHERE version = 1";
        for (change, says) in [(newer, "migration 9999"), (other, "migration 1 ")] {
            let dir = tempfile::tempdir().unwrap();
            let mut opened = open(dir.path(), None).await.unwrap();
            db::raw_sql(change).execute(&mut opened.writer).await.unwrap();
            opened.reads.close().await;
            opened.writer.close().await.unwrap();
            drop(opened.lock);
            let refused = open(dir.path(), None).await.err().unwrap();
            let OpenError::Migrate(cause) = &refused else { panic!("{refused}") };
            assert!(cause.to_string().contains(says), "{cause}");
        }
    }

    #[tokio::test]
    async fn a_damaged_file_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let opened = open(dir.path(), None).await.unwrap();
        opened.reads.close().await;
        opened.writer.close().await.unwrap();
        drop(opened.lock);
        let path = dir.path().join(FILE);
        let mut bytes = std::fs::read(&path).unwrap();
        assert!(bytes.len() > 8192);
        for byte in &mut bytes[4096..8192] {
            *byte = 0xa5;
        }
        std::fs::write(&path, bytes).unwrap();
        assert!(open(dir.path(), None).await.is_err());
    }

    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn a_database_that_does_not_open_is_closed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let mut bytes = b"SQLite format 3\0".to_vec();
        bytes.resize(8192, 0xa5);
        std::fs::write(&path, bytes).unwrap();
        for _ in 0..20 {
            assert!(connect(dir.path(), None).await.is_err());
            let open = std::fs::read_dir("/proc/self/fd").unwrap().flatten();
            let mut open = open.filter_map(|file| std::fs::read_link(file.path()).ok());
            assert_eq!(open.find(|file| file.starts_with(dir.path())), None);
        }
    }

    #[tokio::test]
    async fn readers_cannot_write() {
        let dir = tempfile::tempdir().unwrap();
        let opened = open(dir.path(), None).await.unwrap();
        let write = db::query("INSERT INTO maps (name, distance, created_ms) VALUES ('a', 'both', 0)")
            .execute(&opened.reads)
            .await;
        assert!(write.is_err());
    }
}
