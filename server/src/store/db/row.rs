//! What a query returns.

use super::Error;
use sqlx::{
    ColumnIndex, Decode, Row as _, Sqlite, Type, TypeInfo as _, ValueRef as _,
    postgres::{PgRow, PgValueRef, Postgres},
    sqlite::SqliteRow,
};

/// A row of a result.
pub(crate) enum Row {
    /// Of SQLite.
    Sqlite(SqliteRow),
    /// Of PostgreSQL.
    Postgres(PgRow),
}

/// A type that every engine reads from a column.
pub(crate) trait Get<'r>: Decode<'r, Sqlite> + Type<Sqlite> {
    /// Of a value of PostgreSQL. Errors: it is absent or of another type.
    fn of_postgres(value: PgValueRef<'r>) -> Result<Self, sqlx::error::BoxDynError>;
}

fn checked<'r, T: Decode<'r, Postgres> + Type<Postgres>>(
    value: PgValueRef<'r>,
) -> Result<T, sqlx::error::BoxDynError> {
    if !T::compatible(&value.type_info()) && !value.is_null() {
        return Err(format!("its type is {}", value.type_info().name()).into());
    }
    T::decode(value)
}

macro_rules! get {
    ($($type:ty)*) => {
        $(impl<'r> Get<'r> for $type {
            fn of_postgres(value: PgValueRef<'r>) -> Result<Self, sqlx::error::BoxDynError> {
                checked(value)
            }
        })*
    };
}

get! { f64 String &'r str Vec<u8> &'r [u8] }

impl<'r> Get<'r> for i64 {
    fn of_postgres(value: PgValueRef<'r>) -> Result<Self, sqlx::error::BoxDynError> {
        // A constant in a text is of the smaller type.
        if value.type_info().name() == "INT4" { checked::<i32>(value).map(i64::from) } else { checked(value) }
    }
}

impl<'r> Get<'r> for u32 {
    fn of_postgres(value: PgValueRef<'r>) -> Result<Self, sqlx::error::BoxDynError> {
        Ok(i64::of_postgres(value)?.try_into()?)
    }
}

impl<'r> Get<'r> for bool {
    /// A comparison, or a number that stands for one.
    fn of_postgres(value: PgValueRef<'r>) -> Result<Self, sqlx::error::BoxDynError> {
        if value.type_info().name() == "BOOL" { checked(value) } else { Ok(i64::of_postgres(value)? != 0) }
    }
}

impl<'r, T: Get<'r>> Get<'r> for Option<T>
where
    Self: Decode<'r, Sqlite> + Type<Sqlite>,
{
    fn of_postgres(value: PgValueRef<'r>) -> Result<Self, sqlx::error::BoxDynError> {
        if value.is_null() { Ok(None) } else { T::of_postgres(value).map(Some) }
    }
}

/// The name of a column, or its number from 0.
pub(crate) trait Column: ColumnIndex<SqliteRow> + ColumnIndex<PgRow> + std::fmt::Debug {}
impl<T: ColumnIndex<SqliteRow> + ColumnIndex<PgRow> + std::fmt::Debug> Column for T {}

impl Row {
    /// The value of a column. Errors: there is no such column, or its value is of another type.
    pub(crate) fn try_get<'r, T: Get<'r>, C: Column>(&'r self, column: C) -> Result<T, Error> {
        match self {
            Self::Sqlite(row) => row.try_get(column),
            Self::Postgres(row) => {
                let index = format!("{column:?}");
                T::of_postgres(row.try_get_raw(column)?)
                    .map_err(|source| Error::ColumnDecode { index, source })
            }
        }
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
