//! Texts and schema mean the same to PostgreSQL. It runs alone on a new data directory, without a
//! port, and reads a script. Where it is not installed, the tests say so and pass, unless
//! `WAYMARK_REQUIRE_POSTGRES=1`.

use super::{
    OF_SQLITE, every, postgres_schema as schema,
    scenario::{self, step},
};
use crate::store::{
    db::{self, Conn},
    history, open,
    schema::tests::on_one_line,
};
use std::{
    fs,
    os::unix::fs::{MetadataExt as _, chown},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};
use tempfile::TempDir;

/// A program of PostgreSQL: on the path, or where Debian has it.
fn program(name: &str) -> Option<PathBuf> {
    let on_path = std::env::var_os("PATH").unwrap_or_default();
    let versions = fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
    let versions = versions.map(|version| version.path().join("bin"));
    std::env::split_paths(&on_path).chain(versions).map(|folder| folder.join(name)).find(|file| file.exists())
}

/// A program that runs in a folder: as the user `postgres`, whom the folder is given to, where the
/// tests run as root, which PostgreSQL refuses.
fn command(program: &Path, folder: &Path) -> Command {
    let mut command = Command::new(program);
    if is_root() {
        command = Command::new("setpriv");
        command.args(["--reuid=postgres", "--regid=postgres", "--init-groups"]).arg(program);
    }
    command.current_dir(folder);
    command
}

/// Whether this process is of root, who owns the files that it makes.
fn is_root() -> bool {
    tempfile::tempfile().unwrap().metadata().unwrap().uid() == 0
}

/// The number of the user `postgres`.
fn number_of_user() -> Option<u32> {
    let said = Command::new("id").args(["-u", "postgres"]).output().ok()?;
    String::from_utf8_lossy(&said.stdout).trim().parse().ok()
}

/// A new data directory of PostgreSQL. `None` where it is not installed.
fn cluster() -> Option<(TempDir, PathBuf)> {
    let (Some(initdb), Some(postgres)) = (program("initdb"), program("postgres")) else {
        let is_required = std::env::var("WAYMARK_REQUIRE_POSTGRES").is_ok_and(|value| value == "1");
        assert!(!is_required, "WAYMARK_REQUIRE_POSTGRES=1, and PostgreSQL is not installed");
        println!("skipped: no PostgreSQL");
        return None;
    };
    let dir = tempfile::tempdir().unwrap();
    if is_root() {
        chown(dir.path(), number_of_user(), None).unwrap();
    }
    let made = command(&initdb, dir.path())
        .args(["-E", "UTF8", "--locale=C", "-A", "trust", "-N", "-D", "data"])
        .output()
        .unwrap();
    assert!(made.status.success(), "initdb: {}", String::from_utf8_lossy(&made.stderr));
    Some((dir, postgres))
}

/// Runs statements in order and returns the first errors, each with its statement.
fn errors(cluster: &(TempDir, PathBuf), statements: &[String]) -> Vec<String> {
    let (dir, postgres) = cluster;
    let script = dir.path().join("script.sql");
    fs::write(&script, statements.join(";\n\n") + ";\n\n").unwrap();
    let ran = command(postgres, dir.path())
        .args(["--single", "-j", "-F", "-c", "log_min_error_statement=error", "-c", "log_line_prefix="])
        .args(["-D", "data", "postgres"])
        .stdin(fs::File::open(&script).unwrap())
        .stdout(Stdio::null())
        .output()
        .unwrap();
    let said = format!("\n{}", String::from_utf8_lossy(&ran.stderr));
    assert!(ran.status.success(), "{said}");
    let found =
        said.split("\nERROR: ").skip(1).map(|error| error.split("\nLOG: ").next().unwrap_or_default());
    found.take(5).map(str::to_owned).collect()
}

/// The schema of a new database, in the order in which it was made.
async fn schema_of(conn: &mut Conn) -> Vec<String> {
    let made = "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL AND name NOT GLOB 'sqlite_*' \
                AND name <> '_sqlx_migrations' ORDER BY rowid";
    let made: Vec<String> = db::query_scalar(made).fetch_all(conn).await.unwrap();
    let made = made.iter().map(|sql| schema::translated(&on_one_line(sql)));
    [schema::BEFORE.to_owned()].into_iter().chain(made).chain([schema::AFTER.to_owned()]).collect()
}

#[tokio::test]
async fn every_portable_text_prepares_on_postgresql() {
    let Some(cluster) = cluster() else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut opened = open::open(dir.path(), None).await.unwrap();
    let mut script = schema_of(&mut opened.writer).await;
    // What migrations are noted in is made by sqlx.
    script.push("CREATE TABLE _sqlx_migrations (version BIGINT, success BOOLEAN)".to_owned());
    let before = script.len();
    for (number, (name, sql)) in every().enumerate() {
        let name = name.trim_start_matches("server::store::");
        if !OF_SQLITE.contains(&name) && !name.starts_with("sqlite::") {
            script.push(format!("PREPARE s{number} AS {sql}"));
        }
    }
    for (number, sql) in history::every_step(&mut opened.writer).await.iter().enumerate() {
        script.push(format!("PREPARE h{number} AS {}", schema::with_clock(sql)));
    }
    assert!(script.len() > before + 200, "{} texts", script.len() - before);
    let errors = errors(&cluster, &script);
    assert!(errors.is_empty(), "{}", errors.join("\n"));
}

#[tokio::test]
async fn triggers_leave_the_same_rows_in_both() {
    let Some(cluster) = cluster() else { return };
    let dir = tempfile::tempdir().unwrap();
    let mut opened = open::open(dir.path(), None).await.unwrap();
    let conn = &mut opened.writer;
    let mut script = schema_of(conn).await;
    let tables = scenario::tables(conn).await;
    let steps: Vec<String> = (0..scenario::STEPS).map(step).collect();
    for sql in &steps {
        let done = db::raw_sql(db::AssertSqlSafe(sql.clone())).execute(&mut *conn).await;
        done.unwrap_or_else(|error| panic!("{error}: {sql}"));
        script
            .extend(sql.split(';').map(|sql| sql.replace("x'", "'\\x")).filter(|sql| !sql.trim().is_empty()));
    }
    for (name, columns) in &tables {
        let file = cluster.0.path().join("data").join(name);
        let rows = scenario::rows(name, columns, "encode(", ", 'hex')");
        script.push(format!("COPY ({rows}) TO '{}'", file.display()));
    }
    let errors = errors(&cluster, &script);
    assert!(errors.is_empty(), "{}", errors.join("\n"));
    let mut compared = 0;
    for (name, columns) in &tables {
        let rows = scenario::rows(name, columns, "lower(hex(", "))");
        let here: Vec<String> =
            db::query_scalar(db::AssertSqlSafe(rows)).fetch_all(&mut *conn).await.unwrap();
        let there = fs::read_to_string(cluster.0.path().join("data").join(name)).unwrap();
        let there: Vec<&str> = there.lines().collect();
        assert_eq!(here, there, "{name}");
        assert!(!here.is_empty(), "{name} has no rows");
        compared += 1;
    }
    assert_eq!(compared, scenario::TABLES.len());
}
