//! The turn to write: one row that a transaction locks before it changes anything, so that writes
//! come one after the other, and that names the server that may. Each write leaves a row with its
//! number in the order of commits and a name that nobody else has: by it, a commit whose answer was
//! lost is found.

use crate::store::{
    db::{self, Conn, Error, ErrorClass, class},
    now_ms,
};

const HOLD: &str = "UPDATE turn SET holder = $1 WHERE id = 1";
const TAKE: &str = "SELECT seq FROM turn WHERE id = 1 AND holder = $1 FOR UPDATE";
const COUNT: &str = "UPDATE turn SET seq = $1 WHERE id = 1";
const NOTE: &str = "INSERT INTO changes (seq, write_id, at_ms) VALUES ($1, $2, $3)";
const FIND: &str = "SELECT count(*) FROM changes WHERE write_id = $1";
const FORGET: &str = "DELETE FROM changes WHERE seq <= $1";

/// Changes that are kept.
const KEPT: i64 = 100_000;
/// Writes between two deletions of those that are not kept.
const FORGOTTEN_EVERY: i64 = 1_000;

/// A write at work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::store) struct Turn {
    /// Number of the write, if it is committed.
    seq: i64,
    write_id: [u8; 16],
}

/// How a commit ended.
#[derive(Debug)]
pub(in crate::store) enum Commit {
    /// It is on the disk.
    Done,
    /// Nothing was changed.
    Refused(Error),
    /// The answer was lost: see [`is_committed`].
    Unknown(Error),
}

/// Gives the turn to a server: whoever had it writes no more.
pub(in crate::store) async fn hold(conn: &mut Conn, holder: &[u8]) -> Result<(), Error> {
    db::query(HOLD).bind(holder).execute(conn).await.map(drop)
}

/// Begins a transaction and waits for the turn. `None`: it was given to another server.
pub(in crate::store) async fn begin(
    conn: &mut Conn,
    holder: &[u8],
    write_id: [u8; 16],
) -> Result<Option<Turn>, Error> {
    db::raw_sql("BEGIN").execute(&mut *conn).await?;
    let last: Option<i64> = db::query_scalar(TAKE).bind(holder).fetch_optional(conn).await?;
    Ok(last.map(|last| Turn { seq: last + 1, write_id }))
}

/// Commits what was changed in the turn.
pub(in crate::store) async fn commit(conn: &mut Conn, turn: Turn) -> Commit {
    if let Err(error) = note(conn, turn).await {
        return Commit::Refused(error);
    }
    match db::raw_sql("COMMIT").execute(conn).await {
        Ok(_) => Commit::Done,
        Err(error) if class(&error) == ErrorClass::Away => Commit::Unknown(error),
        Err(error) => Commit::Refused(error),
    }
}

/// Errors: also that a statement of the transaction has failed before, which PostgreSQL would roll
/// back without an error of the commit.
async fn note(conn: &mut Conn, Turn { seq, write_id }: Turn) -> Result<(), Error> {
    db::query(COUNT).bind(seq).execute(&mut *conn).await?;
    db::query(NOTE).bind(seq).bind(&write_id[..]).bind(now_ms()).execute(&mut *conn).await?;
    if seq % FORGOTTEN_EVERY == 0 {
        db::query(FORGET).bind(seq - KEPT).execute(conn).await?;
    }
    Ok(())
}

/// Whether a write was committed whose answer was lost. Asked on a new connection. It takes the
/// turn: a transaction that still ends is waited for.
pub(in crate::store) async fn is_committed(
    conn: &mut Conn,
    holder: &[u8],
    turn: Turn,
) -> Result<bool, Error> {
    begin(conn, holder, turn.write_id).await?;
    let found = db::query_scalar::<i64>(FIND).bind(&turn.write_id[..]).fetch_one(&mut *conn).await?;
    db::raw_sql("ROLLBACK").execute(conn).await?;
    Ok(found > 0)
}
