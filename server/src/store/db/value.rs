//! What is bound to a parameter: of the four types that every engine stores, or absent.

use sqlx::{Postgres, Sqlite, postgres::PgArguments, query::Query, sqlite::SqliteArguments};

/// A value with its type, which an absent one has, too.
#[derive(Debug, Clone)]
pub(crate) enum Value {
    Int(Option<i64>),
    Real(Option<f64>),
    Text(Option<String>),
    Bytes(Option<Vec<u8>>),
}

macro_rules! bind_to {
    ($name:ident, $engine:ty, $arguments:ty) => {
        pub(super) fn $name(
            self,
            query: Query<'static, $engine, $arguments>,
        ) -> Query<'static, $engine, $arguments> {
            match self {
                Self::Int(value) => query.bind(value),
                Self::Real(value) => query.bind(value),
                Self::Text(value) => query.bind(value),
                Self::Bytes(value) => query.bind(value),
            }
        }
    };
}

impl Value {
    bind_to!(bind_sqlite, Sqlite, SqliteArguments);
    bind_to!(bind_postgres, Postgres, PgArguments);
}

/// A type that can be bound.
pub(crate) trait Bind: Sized {
    /// What is stored of it; of `None` an absent value of its type.
    fn value(this: Option<Self>) -> Value;
}

macro_rules! bind {
    ($($type:ty => $variant:ident, $stored:expr;)+) => {
        $(impl Bind for $type {
            fn value(this: Option<Self>) -> Value {
                Value::$variant(this.map($stored))
            }
        })+
    };
}

bind! {
    i64 => Int, |number| number;
    u16 => Int, i64::from;
    u32 => Int, i64::from;
    bool => Int, i64::from;
    // SQLite stores no negative zero.
    f64 => Real, |number| number + 0.0;
    &str => Text, str::to_owned;
    String => Text, |text| text;
    &[u8] => Bytes, <[u8]>::to_vec;
    Vec<u8> => Bytes, |bytes| bytes;
}

impl<T: Bind> Bind for Option<T> {
    fn value(this: Option<Self>) -> Value {
        T::value(this.flatten())
    }
}

impl<T: Bind + Clone> Bind for &T {
    fn value(this: Option<Self>) -> Value {
        T::value(this.cloned())
    }
}
