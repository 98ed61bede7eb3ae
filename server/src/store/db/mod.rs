//! The database as the rest of the store sees it: connections, queries, rows and classes of errors,
//! whatever engine is below. In: one text for all engines, with values. Out: rows. Which engine it
//! is, only this folder and what opens and keeps files know.

mod errors;
mod query;
mod row;
mod value;

pub(super) use errors::{ErrorClass, class, is_without_room};
#[cfg(test)]
use query::Query;
pub(crate) use query::{query, query_as, query_scalar, raw_sql};
pub(crate) use row::Row;
pub(crate) use sqlx::{AssertSqlSafe, Error};

use errors::answered;
use sqlx::{
    Connection as _, Database, PgConnection, PgPool, Postgres, Sqlite, SqliteConnection, SqlitePool,
    Transaction, pool::PoolConnection,
};

/// A connection.
pub(crate) enum Conn {
    /// To SQLite.
    Sqlite(Held<Sqlite>),
    /// To PostgreSQL, with the rows that it has changed since it was opened.
    Postgres(Held<Postgres>, u64),
}

/// A connection, by who holds it.
pub(crate) enum Held<DB: Database> {
    /// Its owner.
    Own(DB::Connection),
    /// The pool that it goes back to.
    Pooled(PoolConnection<DB>),
    /// A transaction that only reads.
    Reading(Transaction<'static, DB>),
}

impl<DB: Database> Held<DB> {
    fn conn(&mut self) -> &mut DB::Connection {
        match self {
            Self::Own(conn) => conn,
            Self::Pooled(conn) => conn,
            Self::Reading(transaction) => transaction,
        }
    }

    async fn close(self) -> Result<(), Error> {
        match self {
            Self::Own(conn) => conn.close().await,
            Self::Pooled(conn) => conn.close().await,
            Self::Reading(transaction) => transaction.rollback().await,
        }
    }
}

/// What only SQLite does was asked of another engine.
fn not_sqlite() -> Error {
    Error::Protocol("this is of SQLite alone".to_owned())
}

impl Conn {
    /// The connection to SQLite, for what SQLite alone has. Errors: it is to another engine.
    pub(crate) fn sqlite(&mut self) -> Result<&mut SqliteConnection, Error> {
        match self {
            Self::Sqlite(conn) => Ok(conn.conn()),
            Self::Postgres(..) => Err(not_sqlite()),
        }
    }

    /// Whether it is to PostgreSQL.
    pub(crate) fn is_postgres(&self) -> bool {
        matches!(self, Self::Postgres(..))
    }

    /// How many rows were changed on it since it was opened. Reads it from SQLite; of PostgreSQL it
    /// is what the statements said.
    pub(crate) async fn total_changes(&mut self) -> Result<i64, Error> {
        match self {
            Self::Sqlite(conn) => sqlx::query_scalar("SELECT total_changes()").fetch_one(conn.conn()).await,
            Self::Postgres(_, changed) => Ok(*changed as i64),
        }
    }

    /// Ends it, and waits until it has ended.
    pub(crate) async fn close(self) -> Result<(), Error> {
        match self {
            Self::Sqlite(conn) => conn.close().await,
            Self::Postgres(conn, _) => conn.close().await,
        }
    }
}

impl From<SqliteConnection> for Conn {
    fn from(conn: SqliteConnection) -> Self {
        Self::Sqlite(Held::Own(conn))
    }
}

impl From<PgConnection> for Conn {
    fn from(conn: PgConnection) -> Self {
        Self::Postgres(Held::Own(conn), 0)
    }
}

/// The connections that read.
#[derive(Debug, Clone)]
pub(crate) enum Pool {
    /// To SQLite.
    Sqlite(SqlitePool),
    /// To PostgreSQL.
    Postgres(PgPool),
}

impl Pool {
    /// One of them, which goes back when it is dropped.
    pub(crate) async fn acquire(&self) -> Result<Conn, Error> {
        match self {
            Self::Sqlite(pool) => Ok(Conn::Sqlite(Held::Pooled(pool.acquire().await?))),
            Self::Postgres(pool) => Ok(Conn::Postgres(Held::Pooled(answered(pool.acquire()).await?), 0)),
        }
    }

    /// One of them that reads one committed state until it is dropped.
    pub(crate) async fn begin(&self) -> Result<Conn, Error> {
        match self {
            Self::Sqlite(pool) => Ok(Conn::Sqlite(Held::Reading(pool.begin().await?))),
            Self::Postgres(pool) => {
                let begin = "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY";
                Ok(Conn::Postgres(Held::Reading(answered(pool.begin_with(begin)).await?), 0))
            }
        }
    }

    /// Ends them all, and waits until they have ended.
    pub(crate) async fn close(&self) {
        match self {
            Self::Sqlite(pool) => pool.close().await,
            Self::Postgres(pool) => pool.close().await,
        }
    }

    /// The connections to SQLite, for what SQLite alone has. Errors: they are to another engine.
    pub(crate) fn sqlite(&self) -> Result<&SqlitePool, Error> {
        match self {
            Self::Sqlite(pool) => Ok(pool),
            Self::Postgres(_) => Err(not_sqlite()),
        }
    }
}

/// What a query runs on: a connection, or any one of a pool.
pub(crate) trait Executor<'c>: Send {
    /// The same, by its engine.
    fn target(self) -> Target<'c>;
}

/// What a query runs on, by its engine.
pub(crate) enum Target<'c> {
    SqliteConn(&'c mut SqliteConnection),
    SqlitePool(&'c SqlitePool),
    PostgresConn(&'c mut PgConnection, &'c mut u64),
    PostgresPool(&'c PgPool),
}

impl<'c> Executor<'c> for &'c mut Conn {
    fn target(self) -> Target<'c> {
        match self {
            Conn::Sqlite(conn) => Target::SqliteConn(conn.conn()),
            Conn::Postgres(conn, changed) => Target::PostgresConn(conn.conn(), changed),
        }
    }
}

impl<'c> Executor<'c> for &'c Pool {
    fn target(self) -> Target<'c> {
        match self {
            Pool::Sqlite(pool) => Target::SqlitePool(pool),
            Pool::Postgres(pool) => Target::PostgresPool(pool),
        }
    }
}

#[cfg(test)]
mod tests;
