//! Opens a database of PostgreSQL: one connection that writes and a pool that reads. Settings that
//! could lose an acknowledged write are refused by name. The schema is made of that of SQLite.

use super::{schema::made, turn};
use crate::store::{
    StoreError,
    db::{self, Conn, Pool},
    schema::{known_schema, schema},
};
use sqlx::{
    ConnectOptions as _,
    postgres::{PgConnectOptions, PgPoolOptions, PgSslMode},
};
use std::{net::IpAddr, str::FromStr as _, time::Duration};
use tokio::time::{sleep, timeout};

/// First version that is taken: 14.
const VERSION_MIN: i64 = 140_000;
/// Connections that read at a time.
const READERS: u32 = 4;
/// How long a connection may take to be made, and a statement that reads may wait for one.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// How long a start waits until the connections of another server have ended: PostgreSQL takes a
/// moment to notice that one was killed.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(5);
/// Name of our connections in the database.
const PROGRAM: &str = "waymark";
/// Texts that a connection keeps prepared: all of the store.
const PREPARED: usize = 512;

/// Settings of each connection.
const OPTIONS: [(&str, &str); 4] = [
    ("statement_timeout", "10s"),
    ("lock_timeout", "10s"),
    // A server that stands still while it writes must not keep the turn.
    ("idle_in_transaction_session_timeout", "10s"),
    ("default_transaction_isolation", "read committed"),
];

/// Settings that a database must have: name and value.
const SETTINGS: [(&str, &str); 4] = [
    ("server_encoding", "UTF8"),
    // A commit is on the disk before it is acknowledged.
    ("fsync", "on"),
    ("full_page_writes", "on"),
    ("synchronous_commit", "on"),
];

/// Why a database is not taken.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OpenError {
    /// The address is none.
    #[error("setting `store` is not the address of a database: {0}")]
    Address(db::Error),
    /// What is stored would be in plain text on a network.
    #[error("setting `store` has sslmode=disable, which is for a database on this machine alone")]
    PlainText,
    /// It cannot be reached, or refuses.
    #[error("the store cannot be reached: {0}")]
    Unreachable(db::Error),
    /// It is too old.
    #[error("PostgreSQL {0} is too old: 14 or newer is needed")]
    Version(String),
    /// A setting has another value than needed.
    #[error("the store says {setting} = {actual}, {expected} is needed")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Value needed.
        expected: &'static str,
        /// Value read.
        actual: String,
    },
    /// Another version of the server has made its tables.
    #[error("the store has schema {found}; this server has schema {known}")]
    Schema {
        /// That of the store.
        found: i64,
        /// That of the program.
        known: i64,
    },
    /// A server is connected to it.
    #[error("the store is in use by another server: one server uses a store at a time")]
    InUse,
    /// A backup would be mixed with what is there.
    #[error("the database has a store already: restore into an empty one")]
    NotEmpty,
    /// Its schema cannot be read.
    #[error("the store does not open")]
    Read(#[source] StoreError),
    /// Anything else at opening.
    #[error("the store does not open: {0}")]
    Open(db::Error),
}

/// Whether the way to it leaves this machine.
fn is_beyond_loopback(options: &PgConnectOptions) -> bool {
    let host = options.get_host().trim_matches(['[', ']']);
    // A folder has a socket.
    let is_here = host.starts_with('/')
        || host == "localhost"
        || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    !is_here && options.get_socket().is_none()
}

/// How its connections are made: encrypted beyond loopback.
pub(in crate::store) fn options(address: &str) -> Result<PgConnectOptions, OpenError> {
    let mut options = PgConnectOptions::from_str(address).map_err(OpenError::Address)?;
    if is_beyond_loopback(&options) {
        match options.get_ssl_mode() {
            PgSslMode::Disable => return Err(OpenError::PlainText),
            PgSslMode::Allow | PgSslMode::Prefer => options = options.ssl_mode(PgSslMode::Require),
            PgSslMode::Require | PgSslMode::VerifyCa | PgSslMode::VerifyFull => {}
        }
    }
    let options = options.statement_cache_capacity(PREPARED).application_name(PROGRAM).options(OPTIONS);
    Ok(options.disable_statement_logging())
}

/// A connection that writes.
pub(in crate::store) async fn connect(address: &str) -> Result<Conn, OpenError> {
    let made = timeout(CONNECT_TIMEOUT, options(address)?.connect()).await;
    let made = made.unwrap_or_else(|late| Err(db::Error::Io(late.into())));
    made.map(Conn::from).map_err(OpenError::Unreachable)
}

/// Opens the database at `address` for the server `holder`, and makes its tables if it has none.
pub(in crate::store) async fn open(address: &str, holder: &[u8]) -> Result<(Conn, Pool), OpenError> {
    let mut writer = connect(address).await?;
    check_settings(&mut writer).await?;
    check_alone(&mut writer).await?;
    make_schema(&mut writer).await?;
    turn::hold(&mut writer, holder).await.map_err(OpenError::Open)?;
    let reads = options(address)?.options([("default_transaction_read_only", "on")]);
    let pool = PgPoolOptions::new().max_connections(READERS).acquire_timeout(CONNECT_TIMEOUT);
    let pool = pool.connect_with(reads).await.map_err(OpenError::Unreachable)?;
    Ok((writer, Pool::Postgres(pool)))
}

/// Errors: another server is connected, which would not see what this one writes.
pub(super) async fn check_alone(conn: &mut Conn) -> Result<(), OpenError> {
    let others = "SELECT count(*) FROM pg_catalog.pg_stat_activity WHERE datname = current_database() \
                  AND application_name = $1 AND pid <> pg_backend_pid()";
    let all_left = async {
        while db::query_scalar::<i64>(others).bind(PROGRAM).fetch_one(&mut *conn).await? > 0 {
            sleep(LEAVE_TIMEOUT / 50).await;
        }
        Ok(())
    };
    timeout(LEAVE_TIMEOUT, all_left).await.map_or(Err(OpenError::InUse), |left| left.map_err(OpenError::Open))
}

pub(super) async fn check_settings(conn: &mut Conn) -> Result<(), OpenError> {
    let setting = async |conn: &mut Conn, name: &'static str| -> Result<String, OpenError> {
        let value = db::query_scalar("SELECT current_setting($1)").bind(name).fetch_one(conn).await;
        value.map_err(OpenError::Open)
    };
    let version = setting(conn, "server_version_num").await?;
    if version.parse::<i64>().ok().is_none_or(|version| version < VERSION_MIN) {
        return Err(OpenError::Version(version));
    }
    for (name, expected) in SETTINGS {
        let actual = setting(conn, name).await?;
        // Further values of this one wait for standbys, too.
        let is_more = name == "synchronous_commit" && actual == "remote_apply";
        if actual != expected && !is_more {
            return Err(OpenError::Setting { setting: name, expected, actual });
        }
    }
    Ok(())
}

/// Whether a store was made in it.
pub(super) async fn has_tables(conn: &mut Conn) -> Result<bool, OpenError> {
    let there = "SELECT count(*) > 0 FROM pg_catalog.pg_tables WHERE schemaname = current_schema() AND tablename = 'turn'";
    db::query_scalar(there).fetch_one(conn).await.map_err(OpenError::Open)
}

/// Makes the tables in one transaction, unless they are there. Errors: they are of another schema.
async fn make_schema(conn: &mut Conn) -> Result<(), OpenError> {
    if !has_tables(conn).await? {
        let made = made().await.map_err(OpenError::Open)?;
        for sql in ["BEGIN".to_owned()].into_iter().chain(made).chain(["COMMIT".to_owned()]) {
            db::raw_sql(db::AssertSqlSafe(sql)).execute(&mut *conn).await.map_err(OpenError::Open)?;
        }
    }
    let (found, known) = (schema(conn).await.map_err(OpenError::Read)?, known_schema());
    if found == known { Ok(()) } else { Err(OpenError::Schema { found, known }) }
}
