//! The audit log: who changed what, in a chain of digests. In: every transaction that has changed
//! something. Out: its entry in the same transaction, pages of entries, and whether the chain is
//! whole.
//!
//! The digest of an entry is SHA-256 over the digest before it, `seq`, `time_ms`, `actor`, `token`,
//! `action`, `target`, `request` and `why`: numbers as 8 bytes little-endian, texts as their length
//! in bytes (so, too) and their bytes, an absent value as the length `u64::MAX`.

use super::{
    StoreError, Tx,
    actor::Actor,
    db::{self, Conn, Executor, Row},
    now_ms,
    pictures::hex,
    statements::statements,
};
use futures::TryStreamExt as _;
use protos::api::{AuditCheck, AuditEntry, AuditHead};
use sha2::{Digest as _, Sha256};

statements! {
    HEAD = "SELECT seq, sha256 FROM audit WHERE seq = (SELECT max(seq) FROM audit) \
            UNION ALL SELECT seq, sha256 FROM audit_start ORDER BY seq DESC LIMIT 1";
    START = "SELECT seq, sha256 FROM audit_start";
    INSERT = "INSERT INTO audit (seq, time_ms, actor, token, action, target, request, why, sha256) \
              VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)";
    NEW_START = "UPDATE audit_start SET (seq, sha256) = (SELECT seq, sha256 FROM audit ORDER BY seq LIMIT 1)";
    FORGET = "DELETE FROM audit WHERE seq = (SELECT seq FROM audit_start)";
    ALL_ENTRIES = "SELECT seq, time_ms, actor, token, action, target, request, why, sha256 FROM audit ORDER BY seq";
    PAGE = "SELECT seq, time_ms, actor, token, action, target, request, why, sha256 FROM audit WHERE seq < $1 \
            AND (CAST($2 AS TEXT) IS NULL OR actor = $2) \
            AND (CAST($3 AS TEXT) IS NULL OR substr(target, 1, length($3)) = $3) \
            AND (CAST($4 AS BIGINT) IS NULL OR time_ms >= $4) AND (CAST($5 AS BIGINT) IS NULL OR time_ms < $5) ORDER BY seq DESC LIMIT $6";
    COUNT = "SELECT count(*) FROM audit WHERE (CAST($1 AS TEXT) IS NULL OR actor = $1) \
             AND (CAST($2 AS TEXT) IS NULL OR substr(target, 1, length($2)) = $2) \
             AND (CAST($3 AS BIGINT) IS NULL OR time_ms >= $3) AND (CAST($4 AS BIGINT) IS NULL OR time_ms < $4)";
}

/// Most entries that one transaction forgets: after `limits.audit_entries` was lowered, there may
/// be many.
const FORGOTTEN_AT_ONCE: u64 = 16;

/// SHA-256.
pub(crate) type EntryDigest = [u8; 32];

/// A place in the chain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ChainLink {
    /// 0 before the first entry.
    pub(crate) seq: u64,
    pub(crate) sha256: EntryDigest,
}

/// An entry.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AuditRow {
    pub(crate) seq: u64,
    pub(crate) time_ms: i64,
    pub(crate) actor: String,
    pub(crate) token: Option<i64>,
    pub(crate) action: String,
    pub(crate) target: String,
    pub(crate) request: Option<String>,
    pub(crate) why: Option<String>,
    pub(crate) sha256: EntryDigest,
}

/// Which entries are listed.
#[derive(Debug, Clone, Default)]
pub(crate) struct AuditFilter {
    pub(crate) actor: Option<String>,
    /// Beginning of the target.
    pub(crate) target: Option<String>,
    pub(crate) since_ms: Option<i64>,
    pub(crate) before_ms: Option<i64>,
}

impl AuditRow {
    /// What its digest has to be after the entry before.
    fn digest(&self, before: &EntryDigest) -> EntryDigest {
        let mut digest = Sha256::new();
        digest.update(before);
        digest.update(self.seq.to_le_bytes());
        digest.update(self.time_ms.to_le_bytes());
        let mut bytes = |bytes: Option<&[u8]>| {
            digest.update(bytes.map_or(u64::MAX, |b| b.len() as u64).to_le_bytes());
            digest.update(bytes.unwrap_or_default());
        };
        let token = self.token.map(i64::to_le_bytes);
        bytes(Some(self.actor.as_bytes()));
        bytes(token.as_ref().map(|token| &token[..]));
        bytes(Some(self.action.as_bytes()));
        bytes(Some(self.target.as_bytes()));
        bytes(self.request.as_ref().map(String::as_bytes));
        bytes(self.why.as_ref().map(String::as_bytes));
        digest.finalize().into()
    }
}

fn link(row: &Row) -> Result<ChainLink, db::Error> {
    let sha256: Vec<u8> = row.try_get("sha256")?;
    // The schema holds its length.
    Ok(ChainLink { seq: row.try_get::<i64, _>("seq")? as u64, sha256: sha256.try_into().unwrap_or_default() })
}

fn audit_row(row: &Row) -> Result<AuditRow, db::Error> {
    let ChainLink { seq, sha256 } = link(row)?;
    Ok(AuditRow {
        seq,
        time_ms: row.try_get("time_ms")?,
        actor: row.try_get("actor")?,
        token: row.try_get("token")?,
        action: row.try_get("action")?,
        target: row.try_get("target")?,
        request: row.try_get("request")?,
        why: row.try_get("why")?,
        sha256,
    })
}

/// How many rows this connection has changed since it was opened.
pub(super) async fn total_changes(tx: &mut Tx) -> Result<i64, StoreError> {
    tx.conn.total_changes().await.map_err(StoreError::during("count changes"))
}

/// Adds the entry of a transaction. Of more than `max` entries the oldest are forgotten.
pub(super) async fn append(tx: &mut Tx, actor: &Actor, max: usize) -> Result<(), StoreError> {
    let at = || StoreError::during("write the audit log");
    let before = head(&mut tx.conn).await?;
    let mut row = AuditRow {
        seq: before.seq + 1,
        time_ms: now_ms(),
        actor: actor.name.clone(),
        token: actor.token,
        action: actor.action.clone(),
        target: actor.target.clone(),
        request: actor.request.clone(),
        why: tx.author.why.clone(),
        sha256: [0; 32],
    };
    row.sha256 = row.digest(&before.sha256);
    let insert = db::query(INSERT)
        .bind(row.seq as i64)
        .bind(row.time_ms)
        .bind(row.actor)
        .bind(row.token)
        .bind(row.action)
        .bind(row.target)
        .bind(row.request)
        .bind(row.why)
        .bind(&row.sha256[..]);
    insert.execute(&mut tx.conn).await.map_err(at())?;
    let kept = row.seq - start(&mut tx.conn).await?.seq;
    for _ in 0..kept.saturating_sub(max as u64).min(FORGOTTEN_AT_ONCE) {
        db::query(NEW_START).execute(&mut tx.conn).await.map_err(at())?;
        db::query(FORGET).execute(&mut tx.conn).await.map_err(at())?;
    }
    Ok(())
}

async fn start(db: impl Executor<'_>) -> Result<ChainLink, StoreError> {
    let row = db::query(START).fetch_one(db).await;
    row.and_then(|row| link(&row)).map_err(StoreError::during("read the start of the audit log"))
}

/// The newest place of the chain.
pub(crate) async fn head(db: impl Executor<'_>) -> Result<ChainLink, StoreError> {
    let row = db::query(HEAD).fetch_one(db).await;
    row.and_then(|row| link(&row)).map_err(StoreError::during("read the audit log"))
}

/// Entries with numbers below `before`, newest first.
pub(crate) async fn page(
    db: impl Executor<'_>,
    filter: &AuditFilter,
    before: i64,
    limit: usize,
) -> Result<Vec<AuditRow>, StoreError> {
    let at = || StoreError::during("read the audit log");
    let rows = db::query(PAGE)
        .bind(before)
        .bind(&filter.actor)
        .bind(&filter.target)
        .bind(filter.since_ms)
        .bind(filter.before_ms)
        .bind(limit as i64)
        .fetch_all(db)
        .await
        .map_err(at())?;
    rows.iter().map(|row| audit_row(row).map_err(at())).collect()
}

/// How many entries a filter finds.
pub(crate) async fn count(db: impl Executor<'_>, filter: &AuditFilter) -> Result<u64, StoreError> {
    let count: i64 = db::query_scalar(COUNT)
        .bind(&filter.actor)
        .bind(&filter.target)
        .bind(filter.since_ms)
        .bind(filter.before_ms)
        .fetch_one(db)
        .await
        .map_err(StoreError::during("count the audit log"))?;
    Ok(count as u64)
}

/// Computes the digest of every entry anew. An entry that was `noted` elsewhere has to have its
/// digest still.
pub(crate) async fn check(conn: &mut Conn, noted: Option<ChainLink>) -> Result<AuditCheck, StoreError> {
    let at = || StoreError::during("read the audit log");
    let start = start(&mut *conn).await?;
    let (mut head, mut entries, mut fault) = (start, 0, None);
    let mut found = (noted.map(|noted| noted.seq) == Some(start.seq)).then_some(start.sha256);
    let mut rows = db::query(ALL_ENTRIES).fetch(conn);
    while let Some(row) = rows.try_next().await.map_err(at())? {
        let row = audit_row(&row).map_err(at())?;
        let wrong = if row.seq != head.seq + 1 {
            Some(format!("entry {} is missing", head.seq + 1))
        } else if row.digest(&head.sha256) != row.sha256 {
            Some(format!("entry {} is not as it was written", row.seq))
        } else {
            None
        };
        fault = fault.or(wrong);
        if noted.is_some_and(|noted| noted.seq == row.seq) {
            found = Some(row.sha256);
        }
        (head, entries) = (ChainLink { seq: row.seq, sha256: row.sha256 }, entries + 1);
    }
    if let Some(noted) = noted {
        let wrong = match found {
            Some(digest) if digest == noted.sha256 => None,
            Some(_) => Some(format!("entry {} has another digest than was noted", noted.seq)),
            None if noted.seq < start.seq => {
                Some(format!("entry {} was forgotten: note a newer one", noted.seq))
            }
            None => Some(format!("entry {} is missing: the log ends at {}", noted.seq, head.seq)),
        };
        fault = fault.or(wrong);
    }
    Ok(AuditCheck { entries, forgotten: start.seq, head: head.into(), fault })
}

/// A text that is no digest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NoDigest;

impl TryFrom<&AuditHead> for ChainLink {
    type Error = NoDigest;

    fn try_from(head: &AuditHead) -> Result<Self, NoDigest> {
        let text = &head.sha256;
        if text.len() != 64 || !text.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(NoDigest);
        }
        let mut sha256 = [0; 32];
        for (i, byte) in sha256.iter_mut().enumerate() {
            *byte = u8::from_str_radix(&text[2 * i..2 * i + 2], 16).map_err(|_bad| NoDigest)?;
        }
        Ok(Self { seq: head.seq, sha256 })
    }
}

impl From<ChainLink> for AuditHead {
    fn from(link: ChainLink) -> Self {
        Self { seq: link.seq, sha256: hex(&link.sha256) }
    }
}

impl From<AuditRow> for AuditEntry {
    fn from(row: AuditRow) -> Self {
        let AuditRow { seq, time_ms, actor, token, action, target, request, why, sha256 } = row;
        Self { seq, time_ms, actor, token, action, target, request, why, sha256: hex(&sha256) }
    }
}

#[cfg(test)]
mod tests;
