//! Copies of the database. In: the data directory of a running server, or a file. Out: a file with
//! one committed state, or what a file holds and what is wrong with it.
//!
//! A copy reads one snapshot of the write-ahead log: the writer goes on, and what it commits
//! meanwhile is not in the copy.

use super::open::{FILE, read_options};
use crate::{
    private_file,
    store::{
        StoreError, audit,
        db::{self, Conn},
        pictures,
        schema::schema,
        statements::statements,
    },
};
use futures::TryStreamExt as _;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use sqlx::{Column as _, ConnectOptions as _, Row as _, TypeInfo as _, ValueRef as _, sqlite::SqliteRow};
use std::path::Path;

statements! {
    INTEGRITY = "PRAGMA integrity_check(20)";
    REFERENCES = "SELECT count(*) FROM pragma_foreign_key_check";
    MAPS = "SELECT id, name, version FROM maps ORDER BY name";
    MAP = "SELECT * FROM maps WHERE id = $1";
    LANDMARKS = "SELECT * FROM landmarks WHERE map_id = $1 ORDER BY id";
    VIEWS = "SELECT v.* FROM views v JOIN landmarks l ON l.id = v.landmark_id WHERE l.map_id = $1 ORDER BY v.id";
    MODELS = "SELECT m.* FROM models m JOIN landmarks l ON l.id = m.landmark_id WHERE l.map_id = $1 ORDER BY m.landmark_id";
    WALLS = "SELECT * FROM laser_segments WHERE map_id = $1 ORDER BY ordinal";
    MODEL_BYTES = "SELECT c.bytes AS model, m.sha256, l.name AS landmark, p.name AS map FROM models m \
                   JOIN model_contents c ON c.sha256 = m.sha256 \
                   JOIN landmarks l ON l.id = m.landmark_id JOIN maps p ON p.id = l.map_id ORDER BY m.landmark_id";
    QUARANTINED = "SELECT count(*) FROM damaged_pictures WHERE sha256 = $1";
    SHOWN_BY = "SELECT 'view ' || v.id || ' of landmark ' || l.name || ', map ' || m.name FROM views v \
                JOIN landmarks l ON l.id = v.landmark_id JOIN maps m ON m.id = l.map_id WHERE v.image_sha256 = $1 LIMIT 1";
}

/// Most faults that are listed.
const MAX_FAULTS: usize = 20;

/// Rows of one kind: their number, and the digest of all their values in order.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RowsDigest {
    pub(crate) rows: u64,
    /// SHA-256, hexadecimal, over names of columns, types and values.
    pub(crate) sha256: String,
}

/// What a copy holds of one map.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct MapDigest {
    pub(crate) name: String,
    pub(crate) version: i64,
    /// The map's own row.
    pub(crate) map: RowsDigest,
    pub(crate) landmarks: RowsDigest,
    pub(crate) views: RowsDigest,
    pub(crate) models: RowsDigest,
    pub(crate) walls: RowsDigest,
}

/// What a copy holds.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Contents {
    /// Number of the last step of its schema.
    pub(crate) schema: i64,
    /// By name.
    pub(crate) maps: Vec<MapDigest>,
    pub(crate) pictures: u64,
}

/// Writes one committed state of the database in `data` to the new file `to`. Returns once it is on
/// the disk.
pub(crate) async fn copy(data: &Path, to: &Path) -> Result<(), StoreError> {
    let at = || StoreError::during("copy the database");
    // SQLite writes into an empty file, and leaves its mode. An error here is one of the copy, too.
    drop(private_file::create(to));
    let mut conn = open_live(&data.join(FILE)).await?;
    let copied = db::query("VACUUM INTO $1").bind(to.to_string_lossy().into_owned()).execute(&mut conn).await;
    conn.close().await.map_err(at())?;
    copied.map_err(at()).map(drop)
}

/// Opens the database of a server that may run, to read it.
pub(crate) async fn open_live(file: &Path) -> Result<Conn, StoreError> {
    read_options(file).connect().await.map(Conn::from).map_err(StoreError::during("open the database"))
}

/// Opens a file that nobody writes. Errors: it is no database.
pub(crate) async fn open_file(file: &Path) -> Result<Conn, StoreError> {
    read_options(file)
        .immutable(true)
        .connect()
        .await
        .map(Conn::from)
        .map_err(StoreError::during("open the copy"))
}

/// Reads the whole of a file: what it holds, and what is wrong with it, named. An error means that
/// the reading broke off.
pub(crate) async fn examine(file: &Path) -> Result<(Contents, Vec<String>), StoreError> {
    let mut conn = open_file(file).await?;
    let mut faults = Vec::new();
    let said: Vec<String> = db::query_scalar(INTEGRITY)
        .fetch_all(&mut conn)
        .await
        .map_err(StoreError::during("check the copy"))?;
    faults.extend(said.into_iter().filter(|text| text != "ok"));
    let dangling: i64 = db::query_scalar(REFERENCES)
        .fetch_one(&mut conn)
        .await
        .map_err(StoreError::during("check references"))?;
    if dangling > 0 {
        faults.push(format!("{dangling} rows refer to others that are not there"));
    }
    check_models(&mut conn, &mut faults).await?;
    let chain = audit::check(&mut conn, None).await?;
    faults.extend(chain.fault.map(|fault| format!("the audit log: {fault}")));
    let pictures = check_pictures(&mut conn, &mut faults).await?;
    faults.truncate(MAX_FAULTS);
    Ok((Contents { pictures, ..contents(&mut conn).await? }, faults))
}

/// Digests of every map, without the pictures.
pub(crate) async fn contents(conn: &mut Conn) -> Result<Contents, StoreError> {
    let at = || StoreError::during("list maps");
    let schema = schema(&mut *conn).await?;
    let rows = db::query(MAPS).fetch_all(&mut *conn).await.map_err(at())?;
    let mut maps = Vec::with_capacity(rows.len());
    for row in rows {
        let id: i64 = row.try_get("id").map_err(at())?;
        maps.push(MapDigest {
            name: row.try_get("name").map_err(at())?,
            version: row.try_get("version").map_err(at())?,
            map: rows_digest(conn, MAP, id).await?,
            landmarks: rows_digest(conn, LANDMARKS, id).await?,
            views: rows_digest(conn, VIEWS, id).await?,
            models: rows_digest(conn, MODELS, id).await?,
            walls: rows_digest(conn, WALLS, id).await?,
        });
    }
    Ok(Contents { schema, maps, pictures: 0 })
}

/// The digest of the rows of a query over one map.
async fn rows_digest(conn: &mut Conn, sql: &'static str, map: i64) -> Result<RowsDigest, StoreError> {
    let at = || StoreError::during("read rows for their digest");
    let (mut hash, mut count) = (Sha256::new(), 0);
    let mut rows = sqlx::query(sql).bind(map).fetch(conn.sqlite().map_err(at())?);
    while let Some(row) = rows.try_next().await.map_err(at())? {
        add_row(&mut hash, &row).map_err(at())?;
        count += 1;
    }
    Ok(RowsDigest { rows: count, sha256: pictures::hex(&hash.finalize()) })
}

/// Adds every column: its name, the type of its value, and the value with its length.
fn add_row(hash: &mut Sha256, row: &SqliteRow) -> Result<(), sqlx::Error> {
    for (i, column) in row.columns().iter().enumerate() {
        let kind = {
            let value = row.try_get_raw(i)?;
            if value.is_null() { "NULL".to_owned() } else { value.type_info().name().to_owned() }
        };
        let bytes = match kind.as_str() {
            "NULL" => Vec::new(),
            "INTEGER" => row.try_get_unchecked::<i64, _>(i)?.to_le_bytes().to_vec(),
            "REAL" => row.try_get_unchecked::<f64, _>(i)?.to_bits().to_le_bytes().to_vec(),
            "TEXT" => row.try_get_unchecked::<String, _>(i)?.into_bytes(),
            _ => row.try_get_unchecked::<Vec<u8>, _>(i)?,
        };
        for part in [column.name().as_bytes(), kind.as_bytes(), &bytes] {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        }
    }
    Ok(())
}

/// Names the landmarks whose stored model does not have its digest.
async fn check_models(conn: &mut Conn, faults: &mut Vec<String>) -> Result<(), StoreError> {
    let at = || StoreError::during("read models");
    let mut rows = db::query(MODEL_BYTES).fetch(conn);
    while let Some(row) = rows.try_next().await.map_err(at())? {
        let (model, sha256): (Vec<u8>, Vec<u8>) =
            (row.try_get("model").map_err(at())?, row.try_get("sha256").map_err(at())?);
        if sha256 != Sha256::digest(&model)[..] {
            let (landmark, map): (String, String) =
                (row.try_get("landmark").map_err(at())?, row.try_get("map").map_err(at())?);
            faults.push(format!("the model of landmark {landmark}, map {map}, does not have its digest"));
        }
    }
    Ok(())
}

/// Names the views whose picture does not have its digest, unless that was known when the copy was
/// made. Returns the number of pictures.
async fn check_pictures(conn: &mut Conn, faults: &mut Vec<String>) -> Result<u64, StoreError> {
    let at = || StoreError::during("check pictures");
    let (mut after, mut count) = (Vec::new(), 0);
    while let Some(sha256) = pictures::next(&mut *conn, &after).await? {
        (after, count) = (sha256.to_vec(), count + 1);
        match pictures::checked(&mut *conn, &sha256).await {
            Ok(_) => continue,
            Err(StoreError::PictureDamaged { .. }) => {}
            Err(error) => return Err(error),
        }
        let known: i64 =
            db::query_scalar(QUARANTINED).bind(&sha256[..]).fetch_one(&mut *conn).await.map_err(at())?;
        if known == 0 {
            let shown: Option<String> =
                db::query_scalar(SHOWN_BY).bind(&sha256[..]).fetch_optional(&mut *conn).await.map_err(at())?;
            let what = shown.unwrap_or_else(|| pictures::hex(&sha256));
            faults.push(format!("the picture of {what} does not have its digest"));
        }
    }
    Ok(count)
}
