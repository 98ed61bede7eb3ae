//! Rows of any table as text, to the last bit, as the engine of a test writes them.

use crate::store::db::{self, Pool};

/// Names of the columns of a table in order, and their defaults as [`exact`] writes them.
pub(crate) async fn columns(reads: &Pool, table: &str) -> Vec<(String, Option<String>)> {
    let sql = match reads {
        Pool::Sqlite(_) => "SELECT name, dflt_value FROM pragma_table_info($1) ORDER BY cid",
        Pool::Postgres(_) => {
            "SELECT CAST(column_name AS TEXT), \
             '''' || trim(both '''' from regexp_replace(column_default, '::.*$', '')) || '''' \
             FROM information_schema.columns WHERE table_schema = 'public' AND table_name = $1 \
             ORDER BY ordinal_position"
        }
    };
    db::query_as(sql).bind(table).fetch_all(reads).await.unwrap()
}

/// An expression for the text of a column.
pub(crate) fn exact(reads: &Pool, column: &str) -> String {
    match reads {
        Pool::Sqlite(_) => {
            format!(
                "CASE typeof({column}) WHEN 'real' THEN printf('%!.20g', {column}) ELSE quote({column}) END"
            )
        }
        Pool::Postgres(_) => format!("quote_nullable({column})"),
    }
}
