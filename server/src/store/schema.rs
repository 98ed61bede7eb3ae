//! The number of a database's schema, and the newest that this program knows.

use super::{StoreError, migrations, statements::statements};
use sqlx::SqliteConnection;

statements! {
    SCHEMA = "SELECT coalesce(max(version), 0) FROM _sqlx_migrations WHERE success";
}

/// The newest schema that this program knows.
pub(crate) fn known_schema() -> i64 {
    migrations::migrator().iter().map(|step| step.version).max().unwrap_or_default()
}

/// The schema of a database.
pub(super) async fn schema(conn: &mut SqliteConnection) -> Result<i64, StoreError> {
    sqlx::query_scalar(SCHEMA).fetch_one(conn).await.map_err(StoreError::during("read the schema"))
}
