//! The tables whose rows the history keeps. The schema of what keeps them
//! (`store/derived_schema.rs`) and the way back ([`super::apply`]) are made of the columns that
//! these tables have.

use super::before;
use crate::store::{
    db::{self, Conn},
    postgres::schema::COLUMNS as COLUMNS_IN_POSTGRES,
    statements::statements,
};

/// A table of rows of a map.
pub(in crate::store) struct KeptTable {
    pub(in crate::store) name: &'static str,
    /// Names a row; of two rows never the same.
    pub(in crate::store) key: &'static str,
    /// The map of a row, in SQL; `ROW` stands for `OLD` or `NEW`.
    pub(in crate::store) map: &'static str,
    /// Columns that are in no history: they count, or never change.
    left_out: &'static [&'static str],
    /// Columns that only a deleted row gets back. A change of them alone is no commit.
    unversioned: &'static [&'static str],
    /// Columns of a restored row that have another value than the past one, with that value in SQL.
    pub(super) restored_as: &'static [(&'static str, &'static str)],
    /// Its rows have a revision, which these further columns count up, too.
    pub(in crate::store) revised_by: Option<&'static [&'static str]>,
    /// The oldest rows before the commits, see [`before`].
    pub(super) before: &'static str,
}

/// A column that the history keeps.
pub(in crate::store) struct KeptColumn {
    pub(in crate::store) name: String,
    /// Type, and what it refers to.
    pub(in crate::store) declaration: String,
    /// Its default, for rows that are stored before there is such a column.
    pub(in crate::store) default: Option<String>,
    /// It names a content by digest.
    pub(in crate::store) is_content: bool,
    /// Its change is a commit.
    pub(in crate::store) is_versioned: bool,
}

macro_rules! kept {
    ($name:literal, $key:literal, $map:expr) => {
        KeptTable {
            name: $name,
            key: $key,
            map: $map,
            left_out: &[],
            unversioned: &[],
            restored_as: &[],
            revised_by: None,
            before: before!($name, $key),
        }
    };
}

/// Child rows deleted by cascade find their map in the landmark's history row.
const BY_LANDMARK: &str = "coalesce((SELECT map_id FROM landmarks WHERE id = ROW.landmark_id), (SELECT c.map_id FROM commits c \
                           JOIN past_landmarks p ON p.commit_id = c.id WHERE c.open = 1 AND p.id = ROW.landmark_id))";
const BY_MAP: &str = "ROW.map_id";
const SAME_MAP: &[(&str, &str)] = &[("map_id", "$1")];

/// The map itself. It keeps its name, and goes with its history.
pub(in crate::store) const MAPS: KeptTable = KeptTable {
    left_out: &[
        "version",
        "created_ms",
        "revision",
        "changed_ms",
        "underlay_revision",
        "walls_version",
        "draft_of",
        "draft_from",
    ],
    revised_by: Some(&["underlay_revision", "walls_version"]),
    ..kept!("maps", "id", "ROW.id")
};

pub(in crate::store) const LANDMARKS: KeptTable = KeptTable {
    left_out: &["map_id"],
    unversioned: &["health", "finding", "created_ms", "revision", "changed_ms"],
    restored_as: &[
        ("map_id", "$1"),
        // Beyond every revision that it ever had.
        ("revision", "(SELECT max(p.revision) + 1 FROM past_landmarks p WHERE p.id = f.id)"),
        ("changed_ms", "CAST(unixepoch('subsec') * 1000 AS BIGINT)"),
    ],
    revised_by: Some(&[]),
    ..kept!("landmarks", "id", BY_MAP)
};

/// What belongs to a map and to its landmarks. Landmarks come first: the others go and come with
/// them.
pub(in crate::store) const PARTS: [KeptTable; 6] = [
    LANDMARKS,
    kept!("views", "id", BY_LANDMARK),
    kept!("models", "landmark_id", BY_LANDMARK),
    KeptTable { left_out: &["map_id"], restored_as: SAME_MAP, ..kept!("strangers", "id", BY_MAP) },
    KeptTable { left_out: &["map_id"], restored_as: SAME_MAP, ..kept!("runs", "id", BY_MAP) },
    kept!("underlays", "map_id", BY_MAP),
];

/// Contents that rows refer to by digest.
pub(in crate::store) const CONTENTS: [&str; 2] = ["pictures", "model_contents"];

statements! {
    COLUMNS = "SELECT c.name, c.type, c.dflt_value, (SELECT k.\"table\" FROM pragma_foreign_key_list($1) k \
               WHERE k.\"from\" = c.name) AS refers_to FROM pragma_table_info($1) c ORDER BY c.cid";
}

impl KeptTable {
    /// The columns that are kept, without the key.
    pub(in crate::store) async fn columns(&self, conn: &mut Conn) -> Result<Vec<KeptColumn>, db::Error> {
        let read = if conn.is_postgres() { COLUMNS_IN_POSTGRES } else { COLUMNS };
        let rows = db::query(read).bind(self.name).fetch_all(conn).await?;
        let mut columns = Vec::with_capacity(rows.len());
        for row in rows {
            let name: String = row.try_get("name")?;
            if name == self.key || self.left_out.contains(&name.as_str()) {
                continue;
            }
            let content: Option<String> = row.try_get("refers_to")?;
            let content = content.filter(|table| CONTENTS.contains(&table.as_str()));
            let kind: String = row.try_get("type")?;
            columns.push(KeptColumn {
                declaration: match &content {
                    Some(table) => format!("{kind} REFERENCES {table} (sha256)"),
                    None => kind,
                },
                default: row.try_get("dflt_value")?,
                is_content: content.is_some(),
                is_versioned: !self.unversioned.contains(&name.as_str()),
                name,
            });
        }
        Ok(columns)
    }
}
