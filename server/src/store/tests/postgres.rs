//! Texts and schema mean the same to PostgreSQL, which reads a script.

use super::{
    OF_SQLITE,
    cluster::Cluster,
    every,
    scenario::{self, step},
};
use crate::store::{db, history, open};
use std::fs;

#[tokio::test]
async fn every_portable_text_prepares_on_postgresql() {
    let Some(cluster) = Cluster::new().await else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut opened = open::open(dir.path(), None).await.unwrap();
    let mut script = Vec::new();
    for (number, (name, sql)) in every().enumerate() {
        let name = name.trim_start_matches("server::store::");
        if !OF_SQLITE.contains(&name) && !name.starts_with("sqlite::") {
            script.push(format!("PREPARE s{number} AS {sql}"));
        }
    }
    for (number, sql) in history::every_step(&mut opened.writer).await.iter().enumerate() {
        script.push(format!("PREPARE h{number} AS {sql}"));
    }
    assert!(script.len() > 200, "{} texts", script.len());
    let errors = cluster.errors("template1", &script);
    assert!(errors.is_empty(), "{}", errors.join("\n"));
}

#[tokio::test]
async fn triggers_leave_the_same_rows_in_both() {
    let Some(cluster) = Cluster::new().await else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut opened = open::open(dir.path(), None).await.unwrap();
    let conn = &mut opened.writer;
    let mut script = Vec::new();
    let tables = scenario::tables(conn).await;
    let steps: Vec<String> = (0..scenario::STEPS).map(step).collect();
    for sql in &steps {
        let done = db::raw_sql(db::AssertSqlSafe(sql.clone())).execute(&mut *conn).await;
        done.unwrap_or_else(|error| panic!("{error}: {sql}"));
        script
            .extend(sql.split(';').map(|sql| sql.replace("x'", "'\\x")).filter(|sql| !sql.trim().is_empty()));
    }
    for (name, columns) in &tables {
        let rows = scenario::rows(name, columns, "encode(", ", 'hex')");
        script.push(format!("COPY ({rows}) TO '{}'", cluster.file(name).display()));
    }
    let errors = cluster.errors("template1", &script);
    assert!(errors.is_empty(), "{}", errors.join("\n"));
    let mut compared = 0;
    for (name, columns) in &tables {
        let rows = scenario::rows(name, columns, "lower(hex(", "))");
        let here: Vec<String> =
            db::query_scalar(db::AssertSqlSafe(rows)).fetch_all(&mut *conn).await.unwrap();
        let there = fs::read_to_string(cluster.file(name)).unwrap();
        let there: Vec<&str> = there.lines().collect();
        assert_eq!(here, there, "{name}");
        assert!(!here.is_empty(), "{name} has no rows");
        compared += 1;
    }
    assert_eq!(compared, scenario::TABLES.len());
}
