//! The statements against the schema.

use super::*;
use sqlx::{Executor as _, SqlSafeStr as _};
use std::path::{Path, PathBuf};

pub(crate) mod cluster;
mod opening;
mod postgres;
pub(crate) mod rows;
mod scenario;

type Statements = &'static [(&'static str, &'static str)];

/// Every statement of the store: its path and its text.
fn every() -> impl Iterator<Item = &'static (&'static str, &'static str)> {
    let all: [Statements; 31] = [
        maps::ALL,
        robot_certificates::ALL,
        map_locations::ALL,
        visibility_settings::ALL,
        visibility_areas::ALL,
        landmarks::ALL,
        schema::ALL,
        derived_schema::ALL,
        pictures::ALL,
        views::ALL,
        aspect_views::ALL,
        models::ALL,
        walls::ALL,
        underlays::ALL,
        landmark_learning::ALL,
        landmark_merge::ALL,
        landmark_placement::ALL,
        teaching::ALL,
        gatherings::ALL,
        track_acceptance::ALL,
        modality_stats::ALL,
        robots::ALL,
        tokens::ALL,
        jobs::ALL,
        kept_answers::ALL,
        audit::ALL,
        stored_answers::ALL,
        page_sessions::ALL,
        refused_views::ALL,
        revisions::ALL,
        map_rows::ALL,
    ];
    all.into_iter()
        .chain(sqlite::EVERY)
        .chain(history::EVERY)
        .chain(contents::EVERY)
        .chain(drafts::EVERY)
        .flatten()
}

#[tokio::test]
async fn every_statement_prepares_on_the_migrated_schema() {
    let dir = tempfile::tempdir().unwrap();
    let mut opened = open::open(dir.path(), None).await.unwrap();
    for (name, sql) in every() {
        if let Err(error) = opened.writer.sqlite().unwrap().prepare(sql.into_sql_str()).await {
            panic!("{name}: {error}");
        }
    }
}

/// What SQLite alone takes, outside of its folder: its own tables.
const OF_SQLITE: [&str; 4] = [
    "derived_schema::NAMES",
    "derived_schema::REFERENCES",
    "derived_schema::TRIGGER",
    "history::kept_tables::COLUMNS",
];

/// What a text has that PostgreSQL does not take, or takes for something else. Words are lower
/// case, one blank apart. Functions that our schema gives it are `json_each`, `hex`, `unixepoch`.
fn not_portable(sql: &str) -> Option<&'static str> {
    const WORDS: [&str; 17] = [
        "?",
        "==",
        "autoincrement",
        "glob ",
        "group_concat",
        "ifnull(",
        "iif(",
        "insert or",
        "instr(",
        "json_group",
        "limit -1",
        "pragma",
        "printf(",
        "rowid",
        "sqlite_",
        "strftime(",
        "total_changes",
    ];
    let sql = sql.to_lowercase();
    let sql = sql.split_whitespace().collect::<Vec<_>>().join(" ");
    let compares = |is: &str| {
        let null = ["null", "distinct from ", "not null", "not distinct from "];
        sql.match_indices(is).any(|(at, _)| !null.iter().any(|word| sql[at + is.len()..].starts_with(word)))
    };
    WORDS.into_iter().find(|word| sql.contains(word)).or(compares(" is ").then_some("IS"))
}

#[test]
fn texts_are_portable() {
    let mut others: Vec<&str> = Vec::new();
    for (name, sql) in every() {
        let name = name.trim_start_matches("server::store::");
        if name.starts_with("sqlite::") {
            continue;
        }
        match not_portable(sql) {
            Some(_) if OF_SQLITE.contains(&name) => others.push(name),
            Some(word) => panic!("{name} has {word}: {sql}"),
            None => {}
        }
    }
    others.sort_unstable();
    assert_eq!(others, OF_SQLITE);
}

/// The driver of the database is named by the layer over it and by what is of SQLite alone; tests
/// may open the file beside a server.
#[test]
fn sqlx_is_named_in_three_folders() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut folders, mut others) = (vec![root.clone()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let within = path.strip_prefix(&root).unwrap();
            if ["db", "sqlite", "postgres"].iter().any(|part| within == Path::new("store").join(part)) {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            let product = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
            let is_test =
                ["tests", "tests.rs", "io_errors.rs"].iter().any(|part| within.iter().any(|p| p == *part));
            if !is_test && product.contains("sqlx::") {
                others.push(within.to_owned());
            }
        }
    }
    assert_eq!(others, [] as [PathBuf; 0]);
}
