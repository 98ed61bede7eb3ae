//! What a query returns.

use super::Error;
use sqlx::{ColumnIndex, Decode, Row as _, Sqlite, Type, sqlite::SqliteRow};

/// A row of a result.
#[derive(Debug)]
pub(crate) enum Row {
    /// Of SQLite.
    Sqlite(SqliteRow),
}

/// A type that every engine reads from a column.
pub(crate) trait Get<'r>: Decode<'r, Sqlite> + Type<Sqlite> {}
impl<'r, T: Decode<'r, Sqlite> + Type<Sqlite>> Get<'r> for T {}

/// The name of a column, or its number from 0.
pub(crate) trait Column: ColumnIndex<SqliteRow> {}
impl<T: ColumnIndex<SqliteRow>> Column for T {}

impl Row {
    /// The value of a column. Errors: there is no such column, or its value is of another type.
    pub(crate) fn try_get<'r, T: Get<'r>, C: Column>(&'r self, column: C) -> Result<T, Error> {
        let Self::Sqlite(row) = self;
        row.try_get(column)
    }
}

/// A type that is made of a whole row.
pub(crate) trait FromRow: Sized {
    /// The columns in order.
    fn from_row(row: &Row) -> Result<Self, Error>;
}

impl<A: for<'r> Get<'r>, B: for<'r> Get<'r>> FromRow for (A, B) {
    fn from_row(row: &Row) -> Result<Self, Error> {
        Ok((row.try_get(0)?, row.try_get(1)?))
    }
}
