//! Pictures by content: each is stored once, under its SHA-256. The schema deletes a picture with
//! the last row that refers to it. Whoever reads one gets bytes of that digest, or
//! [`StoreError::PictureDamaged`]: the damage is noted, `/readyz` names what shows the picture, and
//! everything else goes on. The same picture, stored again, mends it.

use super::{
    Store, StoreError, Tx,
    db::{self, Executor},
    kind::Kind,
    now_ms,
    statements::statements,
};
use sha2::{Digest as _, Sha256};
use std::time::Duration;
use tokio::sync::watch;

statements! {
    PUT = "INSERT INTO pictures (sha256, bytes) VALUES ($1, $2) ON CONFLICT DO NOTHING";
    MEND = "UPDATE pictures SET bytes = $2 WHERE sha256 = $1";
    MENDED = "DELETE FROM damaged_pictures WHERE sha256 = $1";
    IS_DAMAGED = "SELECT count(*) FROM damaged_pictures WHERE sha256 = $1";
    READ = "SELECT bytes FROM pictures WHERE sha256 = $1";
    NEXT = "SELECT sha256 FROM pictures WHERE sha256 > $1 ORDER BY sha256 LIMIT 1";
    NOTE = "INSERT INTO damaged_pictures (sha256, reason, found_ms) SELECT $1, $2, $3 \
            WHERE EXISTS (SELECT 1 FROM pictures WHERE sha256 = $1) ON CONFLICT DO NOTHING";
    DAMAGED = "WITH shown (map, what) AS (\
               SELECT m.name, 'view ' || v.id || ' of landmark ' || l.name || ', map ' || m.name FROM damaged_pictures d \
               JOIN views v ON v.image_sha256 = d.sha256 JOIN landmarks l ON l.id = v.landmark_id \
               JOIN maps m ON m.id = l.map_id \
               UNION ALL SELECT m.name, 'track ' || v.track || ' of gathering ' || v.gathering_id FROM damaged_pictures d \
               JOIN track_views v ON v.image_sha256 = d.sha256 JOIN gatherings g ON g.id = v.gathering_id \
               JOIN maps m ON m.id = g.map_id \
               UNION ALL SELECT m.name, 'underlay of map ' || m.name FROM damaged_pictures d \
               JOIN underlays u ON u.image_sha256 = d.sha256 JOIN maps m ON m.id = u.map_id) \
               SELECT a.places, n.what FROM (SELECT count(*) AS places FROM shown) a LEFT JOIN (SELECT what FROM shown \
               WHERE CAST($2 AS TEXT) IS NULL OR map IN (SELECT value FROM json_each($2)) ORDER BY what LIMIT $1) n \
               ON true ORDER BY n.what";
}

/// SHA-256 of a picture.
pub(crate) type Digest = [u8; 32];

/// Places with a damaged picture that are named.
const MAX_NAMED: i64 = 100;
/// The check of all pictures reads this much a second, so that it takes no more than a share of the
/// disk from robots.
const CHECK_BYTES_PER_S: f64 = 32e6;

/// The digest of a picture.
pub(crate) fn digest(bytes: &[u8]) -> Digest {
    Sha256::digest(bytes).into()
}

/// Bytes as text: two hexadecimal digits each.
pub(crate) fn hex(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    digits.map(|digit| char::from(DIGITS[usize::from(digit)])).collect()
}

/// Stores a picture, if it is not there. One that is known to be damaged gets its bytes again.
pub(crate) async fn put(tx: &mut Tx, sha256: &Digest, bytes: &[u8]) -> Result<(), StoreError> {
    let done = db::query(PUT).bind(&sha256[..]).bind(bytes).execute(&mut tx.conn).await;
    let done = done.map_err(|error| not_readable(sha256, error))?;
    if done.rows_affected() == 1 {
        return Ok(());
    }
    mend(tx, sha256, bytes).await
}

/// Gives a picture that is known to be damaged its bytes again. Errors: `PictureDamaged`, where the
/// database itself is damaged at this place; nothing is changed then.
pub(super) async fn mend(tx: &mut Tx, sha256: &Digest, bytes: &[u8]) -> Result<(), StoreError> {
    let at = || StoreError::during("mend picture");
    let damaged: i64 =
        db::query_scalar(IS_DAMAGED).bind(&sha256[..]).fetch_one(&mut tx.conn).await.map_err(at())?;
    if damaged == 0 {
        return Ok(());
    }
    let mended = db::query(MEND).bind(&sha256[..]).bind(bytes).execute(&mut tx.conn).await;
    mended.map_err(|error| not_readable(sha256, error))?;
    db::query(MENDED).bind(&sha256[..]).execute(&mut tx.conn).await.map_err(at())?;
    tracing::info!(picture = hex(sha256), "picture_mended");
    Ok(())
}

/// Damage at the place of one picture is not a reason to stop; other errors of the database may be.
fn not_readable(sha256: &Digest, error: db::Error) -> StoreError {
    if db::class(&error) == db::ErrorClass::Damaged {
        return StoreError::PictureDamaged { picture: hex(sha256), reason: error.to_string() };
    }
    StoreError::during("read or store a picture")(error)
}

/// The bytes of a picture, checked. Errors: `PictureDamaged`, which is noted then; `NotFound` if no
/// row refers to it any more.
pub(crate) async fn read(store: &Store, sha256: &Digest) -> Result<Vec<u8>, StoreError> {
    let found = checked(store.reads(), sha256).await;
    if let Err(StoreError::PictureDamaged { reason, .. }) = &found {
        note(store, *sha256, reason.clone()).await;
    }
    found
}

/// The bytes of a picture, if they are those of its digest.
pub(crate) async fn checked(db: impl Executor<'_>, sha256: &Digest) -> Result<Vec<u8>, StoreError> {
    let found = db::query_scalar::<Vec<u8>>(READ).bind(&sha256[..]).fetch_optional(db).await;
    let found = found.map_err(|error| not_readable(sha256, error))?;
    let bytes = found.ok_or_else(|| StoreError::NotFound { what: Kind::Picture, name: hex(sha256) })?;
    if digest(&bytes) == *sha256 {
        return Ok(bytes);
    }
    let reason = "its bytes do not have its digest".to_owned();
    Err(StoreError::PictureDamaged { picture: hex(sha256), reason })
}

/// Notes that a picture is damaged. Where that fails it is noted at the next reading.
async fn note(store: &Store, sha256: Digest, reason: String) {
    tracing::error!(picture = hex(&sha256), reason, follows = "it is not used", "picture_damaged");
    let noted = store.write(move |tx| {
        Box::pin(async move {
            let short: String = reason.chars().take(256).collect();
            let note = db::query(NOTE).bind(&sha256[..]).bind(short).bind(now_ms());
            note.execute(&mut tx.conn).await.map_err(StoreError::during("note damage")).map(drop)
        })
    });
    if let Err(error) = noted.await {
        tracing::error!(%error, "picture_damage_not_noted");
    }
}

/// How many views, tracks and underlays show a damaged picture, and at most [`MAX_NAMED`] of those
/// of these maps, or of all maps.
pub(crate) async fn damaged(
    db: impl Executor<'_>,
    maps: Option<&[String]>,
) -> Result<(u64, Vec<String>), StoreError> {
    let at = || StoreError::during("list damaged pictures");
    let maps = maps.map(|maps| serde_json::json!(maps).to_string());
    let rows = db::query_as::<(i64, Option<String>)>(DAMAGED).bind(MAX_NAMED).bind(maps);
    let rows = rows.fetch_all(db).await.map_err(at())?;
    let count = rows.first().map_or(0, |(places, _)| places.unsigned_abs());
    Ok((count, rows.into_iter().filter_map(|(_, what)| what).collect()))
}

/// Digest of the first picture after `after`, in the order of digests.
pub(crate) async fn next(db: impl Executor<'_>, after: &[u8]) -> Result<Option<Digest>, StoreError> {
    let found = db::query_scalar::<Vec<u8>>(NEXT).bind(after).fetch_optional(db).await;
    let found = found.map_err(StoreError::during("list pictures"))?;
    // The schema says 32 bytes.
    Ok(found.and_then(|bytes| bytes.try_into().ok()))
}

/// Reads every picture once, slowly, and notes damage: what the check at the start leaves out. Ends
/// early when the server stops, or when the list of pictures cannot be read.
pub(crate) async fn check_all(store: Store, mut stopping: watch::Receiver<bool>) {
    let (mut after, mut count, mut damaged) = (Vec::new(), 0_u64, 0_u64);
    loop {
        let sha256 = match next(store.reads(), &after).await {
            Ok(Some(sha256)) => sha256,
            Ok(None) => break,
            Err(error) => {
                tracing::error!(%error, follows = "the pictures after it are checked when read", "picture_check_ended");
                return;
            }
        };
        after = sha256.to_vec();
        let bytes = match read(&store, &sha256).await {
            Ok(bytes) => bytes.len(),
            Err(StoreError::PictureDamaged { .. }) => {
                damaged += 1;
                0
            }
            Err(_gone_or_closing) => 0,
        };
        count += 1;
        let pause = Duration::from_secs_f64(bytes as f64 / CHECK_BYTES_PER_S);
        tokio::select! {
            _ = stopping.wait_for(|stop| *stop) => return,
            () = tokio::time::sleep(pause) => {}
        }
    }
    tracing::info!(count, damaged, "pictures_checked");
}

#[cfg(test)]
mod tests;
