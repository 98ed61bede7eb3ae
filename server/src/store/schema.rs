//! The number of a database's schema, and the newest that this program knows.

use super::{
    StoreError,
    db::{self, Conn},
    sqlite::migrations,
    statements::statements,
};

statements! {
    SCHEMA = "SELECT coalesce(max(version), 0) FROM _sqlx_migrations WHERE success";
}

/// The newest schema that this program knows.
pub(crate) fn known_schema() -> i64 {
    migrations::migrator().iter().map(|step| step.version).max().unwrap_or_default()
}

/// The schema of a database.
pub(super) async fn schema(conn: &mut Conn) -> Result<i64, StoreError> {
    db::query_scalar(SCHEMA).fetch_one(conn).await.map_err(StoreError::during("read the schema"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::open;
    use std::{
        collections::{BTreeMap, BTreeSet},
        fs,
        path::Path,
    };

    /// The checksum of every applied file, then every table, index and trigger on a line.
    async fn dump(conn: &mut Conn) -> String {
        let objects = "SELECT printf('file %04d %s %s', version, description, lower(hex(checksum))) FROM _sqlx_migrations \
                       UNION ALL SELECT type || ' ' || name || ' ' || sql FROM sqlite_schema \
                       WHERE sql IS NOT NULL AND name NOT GLOB 'sqlite_*' AND name <> '_sqlx_migrations' ORDER BY 1";
        let objects: Vec<String> = db::query_scalar(objects).fetch_all(conn).await.unwrap();
        objects.iter().map(|sql| crate::store::postgres::schema::on_one_line(sql) + "\n").collect()
    }

    #[tokio::test]
    async fn the_schema_is_the_pinned_one() {
        let dir = tempfile::tempdir().unwrap();
        let made = dump(&mut open::open(dir.path(), None).await.unwrap().writer).await;
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/store/schema.txt");
        if std::env::var_os("WAYMARK_REFRESH").is_some() {
            fs::write(&path, &made).unwrap();
        }
        let pinned = fs::read_to_string(&path).unwrap_or_default();
        let by_name = |text: &str| -> BTreeMap<String, String> {
            let name = |line: &str| line.split(' ').take(2).collect::<Vec<_>>().join(" ");
            text.lines().map(|line| (name(line), line.to_owned())).collect()
        };
        let (made, pinned) = (by_name(&made), by_name(&pinned));
        let differs = |name: &&String| made.get(*name) != pinned.get(*name);
        let differing: BTreeSet<&String> = made.keys().chain(pinned.keys()).filter(differs).collect();
        assert!(
            differing.is_empty(),
            "{differing:?} differ from schema.txt. A database in use is brought from one schema to the next by a new file in \
             migrations/: take back what was changed in a file that is there, and write it as a step in a file with the next \
             number. Then `WAYMARK_REFRESH=1 cargo test -p server the_schema_is_the_pinned_one` pins it."
        );
    }

    /// What a new column of a landmark touches, as the list of typical changes in
    /// docs/ARCHITECTURE.md says.
    #[test]
    fn a_column_of_a_landmark_is_named_in_few_files() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let (mut folders, mut naming) = (vec![root.join("server/src"), root.join("migrations")], Vec::new());
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let is_test = path.components().any(|part| part.as_os_str() == "tests")
                    || path.ends_with("tests.rs")
                    || path.ends_with("store/schema.rs");
                if path.is_dir() {
                    folders.push(path);
                } else if !is_test && fs::read(&path).unwrap().windows(15).any(|w| w == b"size_from_views") {
                    naming.push(path.strip_prefix(&root).unwrap().to_string_lossy().into_owned());
                }
            }
        }
        naming.sort();
        let files = [
            "migrations/0002_landmarks.sql",
            "server/src/bundle/landmark_records.rs",
            "server/src/store/landmark_placement.rs",
            "server/src/store/landmarks.rs",
            "server/src/store/schema.txt",
        ];
        assert_eq!(naming, files, "at most six: see `geometry_columns` and `LandmarkGeometry`");
    }
}
