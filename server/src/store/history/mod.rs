//! Maps as versions. A commit is what one transaction changed of a map: who, when, what, why, and
//! the rows as they were before. The schema writes those rows by triggers
//! (`store/derived_schema.rs`); the writer closes the commit in the same transaction ([`close`]).
//! [`kept_tables`] says which rows, [`apply`] goes back, [`difference`] compares.
//!
//! The state at a commit is found backwards: a row is as the oldest commit after it has stored it,
//! or else as it is now.

mod apply;
mod close;
mod difference;
mod kept_tables;

pub(in crate::store) use apply::no_job_on;
pub(crate) use apply::{roll_back, undo};
pub(crate) use close::HistoryLimits;
pub(super) use close::{close, close_outside};
pub(crate) use difference::{Difference, LandmarkChange, between, fill_unchanged, summary};
pub(in crate::store) use difference::{SETTINGS_OF_MAP, walls_difference};
pub(in crate::store) use kept_tables::{CONTENTS, KeptColumn, KeptTable, MAPS, PARTS};

use super::{StoreError, actor::Actor, kind::Kind, statements::statements};
use crate::store::db::{self, Executor, Row};
use protos::api::ChangeSummary;

statements! {
    PAGE = "SELECT id, parent_id, created_ms, author, job, operation, why, summary FROM commits \
            WHERE map_id = $1 AND open = 0 AND id < $2 ORDER BY id DESC LIMIT $3";
    COUNT = "SELECT count(*) FROM commits WHERE map_id = $1 AND open = 0";
    GET = "SELECT id, parent_id, created_ms, author, job, operation, why, summary FROM commits \
           WHERE map_id = $1 AND open = 0 AND id = $2";
    NEWEST = "SELECT coalesce(max(id), 0) FROM commits WHERE map_id = $1 AND open = 0";
}

#[cfg(test)]
pub(super) use apply::every_step;

/// Every statement of this folder.
#[cfg(test)]
pub(super) const EVERY: [&[(&str, &str)]; 5] =
    [ALL, apply::ALL, close::ALL, difference::ALL, kept_tables::ALL];

/// Longest reason, in characters.
pub(crate) const MAX_WHY: usize = 200;

/// Who changes a map, by what, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Author {
    /// Name of the token, or `server` for what the server does by itself.
    pub(crate) name: String,
    /// Number of the job that writes, if it is one.
    pub(crate) job: Option<i64>,
    /// Method and path of the request, or kind of the job.
    pub(crate) operation: String,
    /// The client's reason.
    pub(crate) why: Option<String>,
}

impl Default for Author {
    fn default() -> Self {
        Self { name: "server".to_owned(), job: None, operation: String::new(), why: None }
    }
}

impl From<&Actor> for Author {
    fn from(actor: &Actor) -> Self {
        let (job, asked) = actor.job.clone().unzip();
        let name = asked.unwrap_or_else(|| actor.name.clone());
        Self { name, job, operation: actor.action.clone(), why: actor.why.clone() }
    }
}

/// A commit, without what it changed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct CommitRow {
    pub(crate) id: i64,
    /// The commit before it, which may be forgotten.
    pub(crate) parent: Option<i64>,
    pub(crate) created_ms: i64,
    pub(crate) author: Author,
    pub(crate) summary: ChangeSummary,
}

fn commit_row(row: &Row) -> Result<CommitRow, db::Error> {
    Ok(CommitRow {
        id: row.try_get("id")?,
        parent: row.try_get("parent_id")?,
        created_ms: row.try_get("created_ms")?,
        author: Author {
            name: row.try_get("author")?,
            job: row.try_get("job")?,
            operation: row.try_get("operation")?,
            why: row.try_get("why")?,
        },
        // That of another program is shown as none.
        summary: serde_json::from_str(row.try_get("summary")?).unwrap_or_default(),
    })
}

/// Kept commits of a map with numbers below `before`, newest first.
pub(crate) async fn page(
    db: impl Executor<'_>,
    map: i64,
    before: i64,
    limit: usize,
) -> Result<Vec<CommitRow>, StoreError> {
    let at = || StoreError::during("list commits");
    let rows = db::query(PAGE).bind(map).bind(before).bind(limit as i64).fetch_all(db).await;
    rows.map_err(at())?.iter().map(commit_row).collect::<Result<_, _>>().map_err(at())
}

/// How many commits of a map are kept.
pub(crate) async fn count(db: impl Executor<'_>, map: i64) -> Result<u64, StoreError> {
    let count = db::query_scalar::<i64>(COUNT).bind(map).fetch_one(db).await;
    count.map(|n| n as u64).map_err(StoreError::during("count commits"))
}

/// A kept commit of a map. Errors: `NotFound`.
pub(crate) async fn get(db: impl Executor<'_>, map: i64, id: i64) -> Result<CommitRow, StoreError> {
    let at = || StoreError::during("read commit");
    let row = db::query(GET).bind(map).bind(id).fetch_optional(db).await.map_err(at())?;
    let row = row.ok_or_else(|| StoreError::NotFound { what: Kind::Commit, name: id.to_string() })?;
    commit_row(&row).map_err(at())
}

/// The number of a map's newest commit.
pub(crate) async fn newest(db: impl Executor<'_>, map: i64) -> Result<i64, StoreError> {
    let newest = db::query_scalar(NEWEST).bind(map).fetch_one(db).await;
    newest.map_err(StoreError::during("read the newest commit"))
}

/// The rows before the commits of map $1 after $2, up to $3: of each row the oldest.
macro_rules! before {
    ($table:literal, $key:literal) => {
        $crate::store::history::oldest!(
            $table,
            $key,
            "commit_id IN (SELECT id FROM commits WHERE map_id = $1 AND id > $2 AND id <= $3)"
        )
    };
}
use before;

/// Of each row that of `$rows`, the oldest.
macro_rules! oldest {
    ($table:literal, $key:literal, $rows:expr) => {
        concat!(
            "(SELECT * FROM past_",
            $table,
            " WHERE (commit_id, ",
            $key,
            ") IN (SELECT min(commit_id), ",
            $key,
            " FROM past_",
            $table,
            " WHERE ",
            $rows,
            " GROUP BY ",
            $key,
            "))"
        )
    };
}
use oldest;

#[cfg(test)]
mod tests;
