//! Models as bytes, stored once under their digest. The store does not interpret them. The schema
//! deletes bytes with the last row that refers to them, of today or of a kept commit.

use super::{
    StoreError, Tx,
    db::{self, Executor},
    kind::Kind,
    landmarks::ModelSummary,
    statements::statements,
};
use sha2::{Digest as _, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use vision::model::LandmarkId;

statements! {
    // The bytes of a digest are known: stored again, they mend what is damaged.
    PUT_BYTES = "INSERT INTO model_contents (sha256, bytes) SELECT $1, $2 \
                 WHERE EXISTS (SELECT 1 FROM landmarks WHERE id = $3 AND map_id = $4) \
                 ON CONFLICT (sha256) DO UPDATE SET bytes = excluded.bytes";
    PUT = "INSERT INTO models (landmark_id, sha256, params_hash, active, reasons, facts, views, generated_views, \
           learnt_ms, looks_like) SELECT $1, $2, $3, $4, $5, $6, $7, $8, $9, $11 \
           WHERE EXISTS (SELECT 1 FROM landmarks WHERE id = $1 AND map_id = $10) \
           ON CONFLICT (landmark_id) DO UPDATE SET sha256 = excluded.sha256, \
           params_hash = excluded.params_hash, active = excluded.active, reasons = excluded.reasons, \
           facts = excluded.facts, views = excluded.views, generated_views = excluded.generated_views, \
           learnt_ms = excluded.learnt_ms, looks_like = excluded.looks_like";
    DIGESTS = "SELECT coalesce(string_agg(m.landmark_id || ' ' || hex(m.sha256), ';'), '') FROM models m \
               JOIN landmarks l ON l.id = m.landmark_id WHERE l.map_id = $1 AND m.looks_like IS NULL";
    REFUSED = "SELECT m.landmark_id FROM models m JOIN landmarks l ON l.id = m.landmark_id \
               WHERE l.map_id = $1 AND m.looks_like IS NOT NULL";
    GET = "SELECT c.bytes FROM models m JOIN model_contents c ON c.sha256 = m.sha256 WHERE m.landmark_id = $1";
}

/// Digest of a stored model.
pub(crate) type ModelDigest = [u8; 32];

/// A model to be stored.
#[derive(Debug, Clone)]
pub(crate) struct NewModel {
    pub(crate) landmark: LandmarkId,
    pub(crate) bytes: Vec<u8>,
    pub(crate) params_hash: u64,
    pub(crate) summary: ModelSummary,
}

/// The digest of a model's bytes.
pub(crate) fn digest(bytes: &[u8]) -> ModelDigest {
    Sha256::digest(bytes).into()
}

/// Stores a model unless its landmark is gone from the map meanwhile; says whether it did.
pub(crate) async fn put(tx: &mut Tx, map_id: i64, new: &NewModel) -> Result<bool, StoreError> {
    let sha256 = digest(&new.bytes);
    db::query(PUT_BYTES)
        .bind(&sha256[..])
        .bind(&new.bytes)
        .bind(new.landmark.0 as i64)
        .bind(map_id)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("store the bytes of a model"))?;
    let done = db::query(PUT)
        .bind(new.landmark.0 as i64)
        .bind(&sha256[..])
        .bind(&new.params_hash.to_le_bytes()[..])
        .bind(new.summary.active)
        .bind(&new.summary.reasons)
        .bind(&new.summary.facts)
        .bind(new.summary.views as i64)
        .bind(new.summary.generated_views as i64)
        .bind(new.summary.learnt_ms)
        .bind(map_id)
        .bind(&new.summary.looks_like)
        .execute(&mut tx.conn)
        .await
        .map_err(StoreError::during("store model"))?;
    Ok(done.rows_affected() == 1)
}

/// Landmarks of a map that are refused because they look like one in use.
pub(crate) async fn refused(db: impl Executor<'_>, map_id: i64) -> Result<BTreeSet<LandmarkId>, StoreError> {
    let ids = db::query_scalar::<i64>(REFUSED).bind(map_id).fetch_all(db).await;
    let ids = ids.map_err(StoreError::during("list refused landmarks"))?;
    Ok(ids.into_iter().map(|id| LandmarkId(id as u64)).collect())
}

/// Landmark and digest of every model of a map, without those of refused landmarks. One row for all
/// of them, as of the landmarks' revisions.
pub(crate) async fn digests(
    db: impl Executor<'_>,
    map_id: i64,
) -> Result<BTreeMap<LandmarkId, ModelDigest>, StoreError> {
    let all: Result<String, _> = db::query_scalar(DIGESTS).bind(map_id).fetch_one(db).await;
    let all = all.map_err(StoreError::during("list models"))?;
    let pair = |text: &str| {
        let (id, digest) = text.split_once(' ')?;
        // The schema says 32 bytes; were it otherwise, no model would have this digest.
        Some((LandmarkId(id.parse::<i64>().ok()? as u64), from_hex(digest).unwrap_or_default()))
    };
    all.split_terminator(';').map(pair).collect::<Option<_>>().ok_or_else(|| StoreError::Damaged {
        what: "the list of models".to_owned(),
        reason: "it cannot be read".to_owned(),
    })
}

fn from_hex(digits: &str) -> Option<ModelDigest> {
    let (mut digest, mut parts) = (ModelDigest::default(), digits.as_bytes().chunks_exact(2));
    for (byte, pair) in digest.iter_mut().zip(&mut parts) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    (digits.len() == 2 * digest.len()).then_some(digest)
}

/// The bytes of a landmark's model.
pub(crate) async fn get(db: impl Executor<'_>, landmark: LandmarkId) -> Result<Vec<u8>, StoreError> {
    let bytes = db::query_scalar(GET).bind(landmark.0 as i64).fetch_optional(db).await;
    let bytes = bytes.map_err(StoreError::during("read model"))?;
    bytes.ok_or_else(|| StoreError::NotFound { what: Kind::Model, name: landmark.0.to_string() })
}
