//! Closes the commits of a transaction, before it is committed: who, when, what, why. Then it
//! forgets the oldest commits beyond the bounds; what only they referred to goes with them.

use super::{Author, difference};
use crate::store::{
    StoreError, Tx,
    db::{self, Conn},
    now_ms,
    statements::statements,
};

statements! {
    OPEN = "SELECT id, map_id FROM commits WHERE open = 1 ORDER BY id";
    CLOSE = "UPDATE commits SET open = 0, created_ms = $2, author = $3, job = $4, operation = $5, why = $6, summary = $7, \
             parent_id = (SELECT max(o.id) FROM commits o WHERE o.map_id = commits.map_id AND o.id < $1), bytes = \
             (SELECT coalesce(sum(length(m.bytes)), 0) FROM past_models p JOIN model_contents m ON m.sha256 = p.sha256 \
             WHERE p.commit_id = $1) + (SELECT coalesce(sum(length(i.bytes) + length(p.icon)), 0) FROM past_views p \
             JOIN pictures i ON i.sha256 = p.image_sha256 WHERE p.commit_id = $1) + \
             (SELECT coalesce(sum(length(i.bytes)), 0) FROM past_underlays p JOIN pictures i ON i.sha256 = p.image_sha256 \
             WHERE p.commit_id = $1) + (SELECT coalesce(sum(length(cells)), 0) FROM past_runs WHERE commit_id = $1 \
             AND present = 1) + (SELECT 64 * count(*) FROM past_walls WHERE commit_id = $1) WHERE id = $1";
    CLOSE_OUTSIDE = "UPDATE commits SET open = 0, created_ms = $1, operation = 'outside' WHERE open = 1";
    FORGET = "DELETE FROM commits WHERE map_id = $1 AND id <= (SELECT max(id) FROM (SELECT id, row_number() OVER w AS n, \
              sum(bytes) OVER w AS total FROM commits WHERE map_id = $1 WINDOW w AS (ORDER BY id DESC)) AS c \
              WHERE n > $2 OR (total > $3 AND n > 1))";
}

/// Closes what another program has left open: nobody knows who wrote it.
pub(in crate::store) async fn close_outside(conn: &mut Conn) -> Result<(), db::Error> {
    db::query(CLOSE_OUTSIDE).bind(now_ms()).execute(conn).await.map(drop)
}

/// How much history of each map is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct HistoryLimits {
    /// Most commits.
    pub(crate) commits: usize,
    /// Most bytes that are stored only for them, about. The newest commit is kept in any case.
    pub(crate) bytes: usize,
}

/// Closes what is open, in the name of the transaction's author.
pub(in crate::store) async fn close(tx: &mut Tx) -> Result<(), StoreError> {
    let at = || StoreError::during("close commits");
    let open = db::query(OPEN).fetch_all(&mut tx.conn).await.map_err(at())?;
    for row in &open {
        let (id, map): (i64, i64) = (row.try_get("id").map_err(at())?, row.try_get("map_id").map_err(at())?);
        let changed = difference::between(&mut tx.conn, map, (id - 1, id)).await?;
        let summary = difference::summary(&mut tx.conn, &changed, id).await?;
        let summary = serde_json::to_string(&summary).unwrap_or_default();
        let Author { name, job, operation, why } = tx.author.clone();
        let closed = db::query(CLOSE).bind(id).bind(now_ms()).bind(name).bind(job).bind(operation).bind(why);
        closed.bind(summary).execute(&mut tx.conn).await.map_err(at())?;
        let HistoryLimits { commits, bytes } = tx.history;
        let forgotten = db::query(FORGET).bind(map).bind(commits as i64).bind(bytes as i64);
        forgotten.execute(&mut tx.conn).await.map_err(StoreError::during("forget commits"))?;
    }
    Ok(())
}
