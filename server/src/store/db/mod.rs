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

use sqlx::{Connection as _, Sqlite, SqliteConnection, SqlitePool, Transaction, pool::PoolConnection};

/// A connection.
#[derive(Debug)]
pub(crate) enum Conn {
    /// To SQLite.
    Sqlite(SqliteConn),
}

/// A connection to SQLite, by who holds it.
#[derive(Debug)]
pub(crate) enum SqliteConn {
    /// Its owner.
    Own(SqliteConnection),
    /// The pool that it goes back to.
    Pooled(PoolConnection<Sqlite>),
    /// A transaction that only reads.
    Reading(Transaction<'static, Sqlite>),
}

impl Conn {
    /// The connection to SQLite, for what SQLite alone has.
    pub(crate) fn sqlite(&mut self) -> &mut SqliteConnection {
        let Self::Sqlite(conn) = self;
        match conn {
            SqliteConn::Own(conn) => conn,
            SqliteConn::Pooled(conn) => conn,
            SqliteConn::Reading(transaction) => transaction,
        }
    }

    /// Ends it, and waits until it has ended.
    pub(crate) async fn close(self) -> Result<(), Error> {
        let Self::Sqlite(conn) = self;
        match conn {
            SqliteConn::Own(conn) => conn.close().await,
            SqliteConn::Pooled(conn) => conn.close().await,
            SqliteConn::Reading(transaction) => transaction.rollback().await,
        }
    }
}

impl From<SqliteConnection> for Conn {
    fn from(conn: SqliteConnection) -> Self {
        Self::Sqlite(SqliteConn::Own(conn))
    }
}

/// The connections that read.
#[derive(Debug, Clone)]
pub(crate) enum Pool {
    /// To SQLite.
    Sqlite(SqlitePool),
}

impl Pool {
    /// One of them, which goes back when it is dropped.
    pub(crate) async fn acquire(&self) -> Result<Conn, Error> {
        let Self::Sqlite(pool) = self;
        Ok(Conn::Sqlite(SqliteConn::Pooled(pool.acquire().await?)))
    }

    /// One of them that reads one committed state until it is dropped.
    pub(crate) async fn begin(&self) -> Result<Conn, Error> {
        let Self::Sqlite(pool) = self;
        Ok(Conn::Sqlite(SqliteConn::Reading(pool.begin().await?)))
    }

    /// Ends them all, and waits until they have ended.
    pub(crate) async fn close(&self) {
        let Self::Sqlite(pool) = self;
        pool.close().await;
    }

    /// The connections to SQLite, for what SQLite alone has.
    pub(crate) fn sqlite(&self) -> &SqlitePool {
        let Self::Sqlite(pool) = self;
        pool
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
}

impl<'c> Executor<'c> for &'c mut Conn {
    fn target(self) -> Target<'c> {
        Target::SqliteConn(self.sqlite())
    }
}

impl<'c> Executor<'c> for &'c Pool {
    fn target(self) -> Target<'c> {
        Target::SqlitePool(self.sqlite())
    }
}

#[cfg(test)]
mod tests;
