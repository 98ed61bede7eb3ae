//! A statement with the values of its parameters, and what it returns.

use super::{
    Error, Executor, Row, Target,
    errors::{answered, of_postgres},
    row::{FromRow, Get},
    value::{Bind, Value},
};
use futures::{StreamExt as _, TryStreamExt as _, stream::BoxStream};
use sqlx::{Postgres, SqlSafeStr, SqlStr, Sqlite, postgres::PgArguments, sqlite::SqliteArguments};

/// Whether the rows that a statement returns are rows that it has changed.
fn changes(sql: &SqlStr) -> bool {
    !["SELECT", "WITH"].iter().any(|verb| sql.as_str().trim_start().starts_with(verb))
}

/// A statement. It is prepared once for each connection.
pub(crate) struct Query {
    sql: SqlStr,
    values: Vec<Value>,
}

/// A statement that returns rows of one type.
pub(crate) struct TypedQuery<T> {
    query: Query,
    read: fn(&Row) -> Result<T, Error>,
}

/// What a statement that returns no rows has done.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Done {
    rows: u64,
}

impl Done {
    /// How many rows it has inserted, changed or deleted.
    pub(crate) fn rows_affected(self) -> u64 {
        self.rows
    }
}

/// A statement, without values so far.
pub(crate) fn query(sql: impl SqlSafeStr) -> Query {
    Query { sql: sql.into_sql_str(), values: Vec::new() }
}

/// A statement of whose rows the first column is read.
pub(crate) fn query_scalar<T: for<'r> Get<'r>>(sql: impl SqlSafeStr) -> TypedQuery<T> {
    TypedQuery { query: query(sql), read: |row| row.try_get(0) }
}

/// A statement of whose rows all columns are read.
pub(crate) fn query_as<T: FromRow>(sql: impl SqlSafeStr) -> TypedQuery<T> {
    TypedQuery { query: query(sql), read: T::from_row }
}

/// Statements without parameters, which are not kept prepared.
pub(crate) fn raw_sql(sql: impl SqlSafeStr) -> RawSql {
    RawSql(sql.into_sql_str())
}

/// See [`raw_sql`].
pub(crate) struct RawSql(SqlStr);

impl RawSql {
    pub(crate) async fn execute<'c>(self, on: impl Executor<'c>) -> Result<Done, Error> {
        let raw = sqlx::raw_sql(self.0);
        let rows = match on.target() {
            Target::SqliteConn(conn) => raw.execute(conn).await?.rows_affected(),
            Target::SqlitePool(pool) => raw.execute(pool).await?.rows_affected(),
            Target::PostgresConn(conn, changed) => {
                let rows = answered(raw.execute(conn)).await?.rows_affected();
                *changed += rows;
                rows
            }
            Target::PostgresPool(pool) => answered(raw.execute(pool)).await?.rows_affected(),
        };
        Ok(Done { rows })
    }
}

impl Query {
    /// The value of the next parameter.
    pub(crate) fn bind(mut self, value: impl Bind) -> Self {
        self.values.push(Bind::value(Some(value)));
        self
    }

    fn sqlite(self) -> sqlx::query::Query<'static, Sqlite, SqliteArguments> {
        self.values.into_iter().fold(sqlx::query(self.sql), |query, value| value.bind_sqlite(query))
    }

    fn postgres(self) -> sqlx::query::Query<'static, Postgres, PgArguments> {
        self.values.into_iter().fold(sqlx::query(self.sql), |query, value| value.bind_postgres(query))
    }

    pub(crate) async fn execute<'c>(self, on: impl Executor<'c>) -> Result<Done, Error> {
        let changes = changes(&self.sql);
        let rows = match on.target() {
            Target::SqliteConn(conn) => self.sqlite().execute(conn).await?.rows_affected(),
            Target::SqlitePool(pool) => self.sqlite().execute(pool).await?.rows_affected(),
            Target::PostgresConn(conn, changed) => {
                let rows = answered(self.postgres().execute(conn)).await?.rows_affected();
                *changed += if changes { rows } else { 0 };
                rows
            }
            Target::PostgresPool(pool) => answered(self.postgres().execute(pool)).await?.rows_affected(),
        };
        Ok(Done { rows })
    }

    /// The first row. Errors: there is none.
    pub(crate) async fn fetch_one<'c>(self, on: impl Executor<'c>) -> Result<Row, Error> {
        self.fetch_optional(on).await?.ok_or(Error::RowNotFound)
    }

    /// The first row, if there is one.
    pub(crate) async fn fetch_optional<'c>(self, on: impl Executor<'c>) -> Result<Option<Row>, Error> {
        let changes = changes(&self.sql);
        match on.target() {
            Target::SqliteConn(conn) => Ok(self.sqlite().fetch_optional(conn).await?.map(Row::Sqlite)),
            Target::SqlitePool(pool) => Ok(self.sqlite().fetch_optional(pool).await?.map(Row::Sqlite)),
            Target::PostgresConn(conn, changed) => {
                let row = answered(self.postgres().fetch_optional(conn)).await?.map(Row::Postgres);
                *changed += u64::from(changes && row.is_some());
                Ok(row)
            }
            Target::PostgresPool(pool) => {
                Ok(answered(self.postgres().fetch_optional(pool)).await?.map(Row::Postgres))
            }
        }
    }

    pub(crate) async fn fetch_all<'c>(self, on: impl Executor<'c>) -> Result<Vec<Row>, Error> {
        match on.target() {
            target @ (Target::SqliteConn(_) | Target::SqlitePool(_)) => self.rows(target).try_collect().await,
            target => answered(self.rows(target).try_collect()).await,
        }
    }

    /// The rows one by one.
    pub(crate) fn fetch<'c>(self, on: impl Executor<'c>) -> BoxStream<'c, Result<Row, Error>> {
        self.rows(on.target())
    }

    fn rows(self, target: Target<'_>) -> BoxStream<'_, Result<Row, Error>> {
        let changes = changes(&self.sql);
        match target {
            Target::SqliteConn(conn) => self.sqlite().fetch(conn).map_ok(Row::Sqlite).boxed(),
            Target::SqlitePool(pool) => self.sqlite().fetch(pool).map_ok(Row::Sqlite).boxed(),
            Target::PostgresConn(conn, changed) => {
                let counted = move |row| {
                    *changed += u64::from(changes);
                    Row::Postgres(row)
                };
                self.postgres().fetch(conn).map_ok(counted).map_err(of_postgres).boxed()
            }
            Target::PostgresPool(pool) => {
                self.postgres().fetch(pool).map_ok(Row::Postgres).map_err(of_postgres).boxed()
            }
        }
    }
}

impl<T> TypedQuery<T> {
    /// The value of the next parameter.
    pub(crate) fn bind(mut self, value: impl Bind) -> Self {
        self.query = self.query.bind(value);
        self
    }

    /// The first row. Errors: there is none.
    pub(crate) async fn fetch_one<'c>(self, on: impl Executor<'c>) -> Result<T, Error> {
        (self.read)(&self.query.fetch_one(on).await?)
    }

    /// The first row, if there is one.
    pub(crate) async fn fetch_optional<'c>(self, on: impl Executor<'c>) -> Result<Option<T>, Error> {
        self.query.fetch_optional(on).await?.map(|row| (self.read)(&row)).transpose()
    }

    pub(crate) async fn fetch_all<'c>(self, on: impl Executor<'c>) -> Result<Vec<T>, Error> {
        self.query.fetch_all(on).await?.iter().map(self.read).collect()
    }
}
