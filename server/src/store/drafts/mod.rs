//! Drafts: maps that are made of another one, edited beside it, and published to it as one commit.
//!
//! A draft is a map of its own, so every operation on maps works on it; no robot can be put on it.
//! What both were when it began is kept as digests of rows ([`rows`]). From these, the present map
//! and the present draft [`merge`] finds what a publication would change and what is in its way;
//! [`publish`] does it.

mod difference;
mod merge;
mod publish;
mod rows;

pub(crate) use difference::compare;
pub(crate) use publish::publish;

use super::{
    CommittedChange, Store, StoreError, Tx,
    contents::{self, MapContents},
    history,
    kind::Kind,
    maps::{self, MapRow},
    statements::statements,
    teaching::ATTEMPTS,
    within,
};
use crate::config::Limits;
use crate::store::db::{self, Conn, Executor, Row};
use rows::{Base, Owner, RowDigest};
use std::collections::BTreeMap;
use vision::model::LandmarkId;

statements! {
    MARK = "UPDATE maps SET draft_of = $2, draft_from = $3 WHERE id = $1";
    COUNT = "SELECT count(*) FROM maps WHERE draft_of = $1";
    PUT_LANDMARK = "INSERT INTO draft_landmarks (draft_id, landmark_id, of_landmark) VALUES ($1, $2, $3)";
    PUT_ROW = "INSERT INTO draft_rows (draft_id, row, in_map, in_draft) VALUES ($1, $2, $3, $4)";
    LIST = "SELECT id, name, draft_from, created_ms, id || '.' || revision AS revision, \
            (SELECT count(*) FROM landmarks WHERE map_id = maps.id) AS landmarks FROM maps WHERE draft_of = $1 ORDER BY name";
    OF = "SELECT landmark_id, of_landmark FROM draft_landmarks WHERE draft_id = $1";
    ROWS = "SELECT row, in_map, in_draft FROM draft_rows WHERE draft_id = $1";
}

/// Every statement of this folder.
#[cfg(test)]
pub(super) const EVERY: [&[(&str, &str)]; 2] = [ALL, publish::ALL];

/// Drafts of one map.
pub(crate) const MAX_DRAFTS: usize = 4;

#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct DraftRow {
    pub(crate) id: i64,
    pub(crate) name: String,
    /// The commit of the map that it began with.
    pub(crate) from_commit: i64,
    pub(crate) created_ms: i64,
    pub(crate) revision: String,
    pub(crate) landmarks: u64,
}

fn draft_row(row: &Row) -> Result<DraftRow, db::Error> {
    Ok(DraftRow {
        id: row.try_get("id")?,
        name: row.try_get("name")?,
        from_commit: row.try_get("draft_from")?,
        created_ms: row.try_get("created_ms")?,
        revision: row.try_get("revision")?,
        landmarks: row.try_get::<i64, _>("landmarks")? as u64,
    })
}

/// The drafts of a map, by name.
pub(crate) async fn list(db: impl Executor<'_>, map: i64) -> Result<Vec<DraftRow>, StoreError> {
    let at = || StoreError::during("list drafts");
    let rows = db::query(LIST).bind(map).fetch_all(db).await.map_err(at())?;
    rows.iter().map(draft_row).collect::<Result<_, _>>().map_err(at())
}

/// One draft of a map. Errors: `NotFound`.
pub(crate) async fn get(db: impl Executor<'_>, map: i64, draft: &str) -> Result<DraftRow, StoreError> {
    let found = list(db, map).await?.into_iter().find(|row| row.name == draft);
    found.ok_or_else(|| StoreError::NotFound { what: Kind::Draft, name: draft.to_owned() })
}

/// A map, a draft of it, and what both were when it began: in one state of the database.
struct Both {
    map: (MapRow, MapContents),
    draft: (MapRow, MapContents),
    from_commit: i64,
    base: Base,
    /// Of each landmark of the draft that the map had.
    of: BTreeMap<LandmarkId, LandmarkId>,
}

impl Both {
    /// Whose a landmark of the draft is.
    fn owner(&self, landmark: LandmarkId) -> Owner {
        self.of.get(&landmark).map_or(Owner::New(landmark), |of| Owner::Of(*of))
    }
}

async fn both(store: &Store, map: &str, draft: &str) -> Result<Both, StoreError> {
    let mut reading = store.reads().begin().await.map_err(StoreError::during("read a draft"))?;
    let map = contents::read(&mut reading, map).await?;
    let row = get(&mut reading, map.0.id, draft).await?;
    let draft = contents::read(&mut reading, draft).await?;
    let (base, of) = (base(&mut reading, row.id).await?, of(&mut reading, row.id).await?);
    Ok(Both { map, draft, from_commit: row.from_commit, base, of })
}

async fn of(conn: &mut Conn, draft: i64) -> Result<BTreeMap<LandmarkId, LandmarkId>, StoreError> {
    let pairs = db::query_as::<(i64, i64)>(OF).bind(draft).fetch_all(conn).await;
    let pairs = pairs.map_err(StoreError::during("read the landmarks of a draft"))?;
    Ok(pairs.into_iter().map(|(own, of)| (LandmarkId(own as u64), LandmarkId(of as u64))).collect())
}

async fn base(conn: &mut Conn, draft: i64) -> Result<Base, StoreError> {
    let at = || StoreError::during("read what a draft began with");
    let rows = db::query(ROWS).bind(draft).fetch_all(conn).await.map_err(at())?;
    let one = |row: &Row| {
        // The schema says 32 bytes.
        let digest = |column: &str| -> Result<RowDigest, db::Error> {
            Ok(row.try_get::<&[u8], _>(column)?.try_into().unwrap_or_default())
        };
        Ok((row.try_get("row")?, (digest("in_map")?, digest("in_draft")?)))
    };
    rows.iter().map(one).collect::<Result<_, db::Error>>().map_err(at())
}

/// Begins a draft. Errors: `NotFound`, `Exists`, `Limit`; `InUse` of a draft; `Busy` while others
/// keep changing the map.
pub(crate) async fn begin(
    store: &Store,
    map: &str,
    name: &str,
    limits: &Limits,
) -> Result<DraftRow, StoreError> {
    let _turn = store.preparing().await;
    for _ in 0..ATTEMPTS {
        let source = contents::contents_of(store, map).await?;
        // A draft is no further map.
        let limits = Limits { maps: usize::MAX, ..limits.clone() };
        let name = name.to_owned();
        let written = store.write(move |tx| Box::pin(async move { write(tx, source, &name, &limits).await }));
        match written.await {
            Err(StoreError::Changed) => {}
            done => return done,
        }
    }
    Err(StoreError::Busy)
}

async fn write(
    tx: &mut Tx,
    (map, contents): (MapRow, MapContents),
    name: &str,
    limits: &Limits,
) -> Result<DraftRow, StoreError> {
    let now = maps::recheck(tx, map.clone()).await?;
    if now.revision != map.revision {
        return Err(StoreError::Changed);
    }
    if let Some(of) = now.draft_of {
        let why = format!("map `{}` is a draft of map `{of}`; drafts have none themselves", map.name);
        return Err(StoreError::InUse(why));
    }
    let commit = history::newest(&mut tx.conn, map.id).await?;
    let written = contents::write(tx, name, &contents, limits).await?;
    let draft = written.map.id;
    let marked = db::query(MARK).bind(draft).bind(map.id).bind(commit).execute(&mut tx.conn).await;
    marked.map_err(StoreError::during("mark a draft"))?;
    let count = db::query_scalar(COUNT).bind(map.id).fetch_one(&mut tx.conn).await;
    within(count.map_err(StoreError::during("count drafts"))?, MAX_DRAFTS, "drafts of a map")?;
    let of: BTreeMap<_, _> = written.landmarks.iter().map(|(of, own)| (*own, *of)).collect();
    for (own, of) in &of {
        let put = db::query(PUT_LANDMARK).bind(draft).bind(own.0 as i64).bind(of.0 as i64);
        put.execute(&mut tx.conn).await.map_err(StoreError::during("note a landmark of a draft"))?;
    }
    let (_, copied) = contents::read(&mut tx.conn, name).await?;
    let in_draft = rows::rows(&copied, |own| of.get(&own).map_or(Owner::New(own), |of| Owner::Of(*of)));
    for (key, in_map) in rows::rows(&contents, Owner::Of) {
        let Some(own) = in_draft.get(&key) else { continue };
        let put = db::query(PUT_ROW).bind(draft).bind(key.text()).bind(&in_map[..]).bind(&own[..]);
        put.execute(&mut tx.conn).await.map_err(StoreError::during("note a row of a draft"))?;
    }
    // Tokens that are for the map are for its drafts.
    tx.changed(CommittedChange::Tokens);
    get(&mut tx.conn, map.id, name).await
}

/// Deletes a draft with all that is in it. Errors: `NotFound`; `InUse` while a job works on it.
pub(crate) async fn discard(tx: &mut Tx, map: &str, draft: &str) -> Result<(), StoreError> {
    let map = maps::of(tx, map).await?;
    get(&mut tx.conn, map.id, draft).await?;
    let row = maps::of(tx, draft).await?;
    history::no_job_on(tx, &row).await?;
    maps::delete(tx, draft).await
}

#[cfg(test)]
mod tests;
