//! The part of the schema that follows from the tables of `migrations/`: tables of past rows, and
//! the triggers that fill them, count edits of maps and landmarks, and delete contents that nothing
//! refers to. It is made at the start from the columns that there are: what a step of the schema
//! adds to a table is in the history.
//!
//! The first change of a row in a transaction stores it as it was; what changes nothing is no
//! commit. The conflict clause of a statement also rules in triggers, so they ask whether a row is
//! there.

use super::{
    db::{self, AssertSqlSafe, Conn},
    history::{CONTENTS, KeptColumn, KeptTable, MAPS, PARTS},
    statements::statements,
};

statements! {
    TRIGGER = "SELECT sql FROM sqlite_schema WHERE type = 'trigger' AND name = $1";
    NAMES = "SELECT name FROM pragma_table_info($1) ORDER BY cid";
    REFERENCES = "SELECT m.name, k.\"from\" FROM sqlite_schema m JOIN pragma_foreign_key_list(m.name) k \
                  WHERE m.type = 'table' AND k.\"table\" = $1 ORDER BY m.name";
}

/// A trigger: its name, and what follows the name in its definition.
type Trigger = (String, String);

/// Makes what is missing and replaces what is otherwise, in one transaction. Where nothing is, it
/// writes nothing. After an error the transaction is open: the connection is of no further use.
pub(super) async fn complete(conn: &mut Conn) -> Result<(), db::Error> {
    db::raw_sql("BEGIN").execute(&mut *conn).await?;
    let mut triggers = Vec::new();
    for table in std::iter::once(&MAPS).chain(&PARTS) {
        let columns = table.columns(conn).await?;
        past_rows(conn, table, &columns).await?;
        triggers.extend(history_triggers(table, &columns));
        triggers.extend(table.revised_by.map(|further| revision_trigger(table, &columns, further)));
    }
    triggers.extend(wall_triggers(&names(conn, "laser_segments").await?));
    for content in CONTENTS {
        let references = db::query_as(REFERENCES).bind(content).fetch_all(&mut *conn).await?;
        triggers.extend(content_triggers(content, &references));
    }
    for (name, rest) in triggers {
        let sql = format!("CREATE TRIGGER {name} {rest}");
        let there: Option<String> = db::query_scalar(TRIGGER).bind(&name).fetch_optional(&mut *conn).await?;
        if there.as_ref() != Some(&sql) {
            execute(conn, format!("DROP TRIGGER IF EXISTS {name}; {sql}")).await?;
        }
    }
    db::raw_sql("COMMIT").execute(conn).await.map(drop)
}

async fn execute(conn: &mut Conn, sql: String) -> Result<(), db::Error> {
    db::raw_sql(AssertSqlSafe(sql)).execute(conn).await.map(drop)
}

async fn names(conn: &mut Conn, table: &str) -> Result<Vec<String>, db::Error> {
    db::query_scalar(NAMES).bind(table).fetch_all(conn).await
}

/// The table of past rows. `present` = 0: there was none, and the other columns say nothing.
async fn past_rows(
    conn: &mut Conn,
    KeptTable { name, key, .. }: &KeptTable,
    columns: &[KeptColumn],
) -> Result<(), db::Error> {
    let there = names(conn, &format!("past_{name}")).await?;
    if there.is_empty() {
        let columns: Vec<_> = columns.iter().map(|c| format!("{} {}, ", c.name, c.declaration)).collect();
        let columns = columns.concat();
        let sql = format!(
            "CREATE TABLE past_{name} (commit_id INTEGER NOT NULL REFERENCES commits (id) ON DELETE CASCADE, \
             {key} INTEGER NOT NULL, present INTEGER NOT NULL CHECK (present IN (0, 1)), {columns}\
             UNIQUE (commit_id, {key})) STRICT; \
             CREATE INDEX past_{name}_by_row ON past_{name} ({key}, commit_id)"
        );
        execute(conn, sql).await?;
    } else {
        for column in columns.iter().filter(|column| !there.contains(&column.name)) {
            let KeptColumn { name: new, declaration, default, .. } = column;
            // Past rows had what the step has given to those that are there.
            let default = default.as_ref().map(|value| format!(" DEFAULT {value}")).unwrap_or_default();
            execute(conn, format!("ALTER TABLE past_{name} ADD COLUMN {new} {declaration}{default}")).await?;
        }
    }
    for KeptColumn { name: content, .. } in columns.iter().filter(|column| column.is_content) {
        let sql = format!("CREATE INDEX IF NOT EXISTS past_{name}_by_content ON past_{name} ({content})");
        execute(conn, sql).await?;
    }
    Ok(())
}

/// `f(a), f(b)` with what separates them.
fn list<'a>(of: impl IntoIterator<Item = &'a str>, separator: &str, f: impl Fn(&str) -> String) -> String {
    of.into_iter().map(f).collect::<Vec<_>>().join(separator)
}

fn versioned(columns: &[KeptColumn]) -> Vec<&str> {
    columns.iter().filter(|column| column.is_versioned).map(|column| column.name.as_str()).collect()
}

/// Opens the commit of a map unless it is open.
fn open_commit(map: &str) -> String {
    format!(
        "INSERT INTO commits (map_id) SELECT id FROM maps WHERE id = {map} \
         AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = maps.id);"
    )
}

/// What stores a row before its first change.
fn history_triggers(table: &KeptTable, columns: &[KeptColumn]) -> Vec<Trigger> {
    let KeptTable { name, key, map, .. } = table;
    let store = |row: &str, present: u8, kept: &[&str]| {
        let map = map.replace("ROW", row);
        let columns = list(kept.iter().copied(), "", |c| format!(", {c}"));
        let values = list(kept.iter().copied(), "", |c| format!(", {row}.{c}"));
        format!(
            "BEGIN {} INSERT INTO past_{name} (commit_id, {key}, present{columns}) \
             SELECT c.id, {row}.{key}, {present}{values} FROM commits c WHERE c.open = 1 AND c.map_id = {map} \
             AND NOT EXISTS (SELECT 1 FROM past_{name} p WHERE p.commit_id = c.id AND p.{key} = {row}.{key}); END",
            open_commit(&map)
        )
    };
    let all: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let edited = versioned(columns);
    let differs = list(edited.iter().copied(), " OR ", |c| format!("OLD.{c} IS DISTINCT FROM NEW.{c}"));
    let before_change = store("OLD", 1, &all);
    let change = format!("BEFORE UPDATE OF {} ON {name} WHEN {differs} {before_change}", edited.join(", "));
    let mut triggers = vec![(format!("{name}_before_change"), change)];
    if *name != MAPS.name {
        // Of a view that was not there, whose it is.
        let owner: Vec<&str> = all.iter().copied().filter(|column| *column == "landmark_id").collect();
        let none = format!("AFTER INSERT ON {name} {}", store("NEW", 0, &owner));
        triggers.push((format!("{name}_before_insertion"), none));
        triggers.push((format!("{name}_before_removal"), format!("BEFORE DELETE ON {name} {before_change}")));
    }
    triggers
}

/// What counts edits of a row.
fn revision_trigger(KeptTable { name, .. }: &KeptTable, columns: &[KeptColumn], further: &[&str]) -> Trigger {
    let edited = list(versioned(columns).into_iter().chain(further.iter().copied()), ", ", str::to_owned);
    let rest = format!(
        "AFTER UPDATE OF {edited} ON {name} BEGIN UPDATE {name} SET revision = revision + 1, \
         changed_ms = CAST(unixepoch('subsec') * 1000 AS INTEGER) WHERE id = NEW.id; END"
    );
    (format!("{name}_edited"), rest)
}

/// What stores all walls of a map before the first change of any.
fn wall_triggers(columns: &[String]) -> [Trigger; 3] {
    let kept = || columns.iter().map(String::as_str).filter(|column| *column != "map_id");
    let (names, values) = (list(kept(), ", ", str::to_owned), list(kept(), ", ", |c| format!("s.{c}")));
    [("INSERT", "NEW"), ("UPDATE", "OLD"), ("DELETE", "OLD")].map(|(event, row)| {
        let map = format!("{row}.map_id");
        let rest = format!(
            "BEFORE {event} ON laser_segments WHEN EXISTS (SELECT 1 FROM maps WHERE id = {map}) \
             AND NOT EXISTS (SELECT 1 FROM commits WHERE open = 1 AND map_id = {map} AND walls = 1) BEGIN {} \
             INSERT INTO past_walls (commit_id, {names}) SELECT c.id, {values} FROM commits c \
             JOIN laser_segments s ON s.map_id = c.map_id WHERE c.open = 1 AND c.map_id = {map}; \
             UPDATE commits SET walls = 1 WHERE open = 1 AND map_id = {map}; END",
            open_commit(&map)
        );
        (format!("walls_before_{}", event.to_lowercase()), rest)
    })
}

/// What deletes a content with the last row that refers to it, live or past, also where a cascade
/// deletes that row.
fn content_triggers(content: &str, references: &[(String, String)]) -> Vec<Trigger> {
    let trigger = |(name, column): &(String, String)| {
        let unused: Vec<String> = references
            .iter()
            .map(|(table, by)| format!(" AND NOT EXISTS (SELECT 1 FROM {table} WHERE {by} = OLD.{column})"))
            .collect();
        let damaged = if content == "pictures" {
            // What is left of it is kept.
            format!(" AND NOT EXISTS (SELECT 1 FROM damaged_pictures WHERE sha256 = OLD.{column})")
        } else {
            String::new()
        };
        let unused = unused.concat();
        let delete = format!("BEGIN DELETE FROM {content} WHERE sha256 = OLD.{column}{unused}{damaged}; END");
        let replaced = format!(
            "AFTER UPDATE OF {column} ON {name} WHEN OLD.{column} IS DISTINCT FROM NEW.{column} {delete}"
        );
        [
            (format!("content_after_{name}"), format!("AFTER DELETE ON {name} {delete}")),
            (format!("content_after_replaced_{name}"), replaced),
        ]
    };
    references.iter().flat_map(trigger).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        publication::{Catalogue, tests::config},
        store::{history, landmarks, maps},
    };
    use sqlx::{ConnectOptions as _, sqlite::SqliteConnectOptions};
    use vision::recognise::DistanceKind;

    #[tokio::test]
    async fn a_column_that_a_step_adds_is_in_the_history_and_counts_as_an_edit() {
        let dir = tempfile::tempdir().unwrap();
        let (store, tasks) = Catalogue::open(&config(dir.path())).await.unwrap();
        let none = landmarks::LandmarkGeometry::default();
        store.write(|tx| Box::pin(maps::create(tx, "a", DistanceKind::Both, 2))).await.unwrap();
        store.write(move |tx| Box::pin(landmarks::create(tx, "a", "p1", none, 5))).await.unwrap();
        store.write(|tx| Box::pin(landmarks::rename(tx, "a", "p1", "p2"))).await.unwrap();
        tasks.close().await;
        drop(store);
        let file = SqliteConnectOptions::new().filename(dir.path().join(crate::store::open::FILE));
        let step = "ALTER TABLE landmarks ADD COLUMN colour TEXT NOT NULL DEFAULT 'red'";
        let mut conn = Conn::from(file.connect().await.unwrap());
        db::raw_sql(step).execute(&mut conn).await.unwrap();
        conn.close().await.unwrap();

        let (store, _tasks) = Catalogue::open(&config(dir.path())).await.unwrap();
        let named = history::page(store.reads(), 1, i64::MAX, 9).await.unwrap()[1].id;
        let revision = landmarks::get(store.reads(), "a", "p2").await.unwrap().revision;
        let paint = |colour: &'static str| {
            store.write(move |tx| {
                Box::pin(async move {
                    let sql = "UPDATE landmarks SET colour = $1";
                    let done = db::query(sql).bind(colour).execute(tx.conn()).await;
                    done.map(drop).map_err(crate::store::StoreError::during("paint"))
                })
            })
        };
        paint("green").await.unwrap();
        assert_ne!(landmarks::get(store.reads(), "a", "p2").await.unwrap().revision, revision);
        let green = history::newest(store.reads(), 1).await.unwrap();
        paint("blue").await.unwrap();
        for (commit, name, colour) in [(green, "p2", "green"), (named, "p1", "red"), (green, "p2", "green")] {
            store.write(move |tx| Box::pin(history::roll_back(tx, "a", commit))).await.unwrap();
            let row: (String, String) =
                db::query_as("SELECT name, colour FROM landmarks").fetch_one(store.reads()).await.unwrap();
            assert_eq!((row.0.as_str(), row.1.as_str()), (name, colour), "at commit {commit}");
        }
    }
}
