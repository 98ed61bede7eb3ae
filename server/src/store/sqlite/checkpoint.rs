//! The write-ahead log: written anew at the start, and moved into the file. SQLite would move it by
//! itself after a commit, and tell nobody of an error in it; so it is told not to, and the store
//! does it.

use crate::store::StoreError;
use sqlx::SqliteConnection;
use std::{
    fs::File,
    io::{self, Read as _, Seek as _, SeekFrom, Write as _},
    path::Path,
};

/// Pages of the log from which on it is moved into the file: 4 MB, as SQLite has it.
pub(in crate::store) const LOG_PAGES: i64 = 1000;

/// Bytes that are written anew at a time.
const PIECE_BYTES: usize = 1 << 20;

/// Writes the log as it is once more, in its place, and syncs it. Before the database is opened:
/// after an error of the disk the log may hold a commit that can be read and is not on the disk,
/// since Linux takes pages whose sync has failed for clean. What is written after it would be lost
/// with it by a power cut, and a file into which it was moved would be damaged.
pub(super) fn renew_log(log: &Path) -> io::Result<()> {
    let mut file = match File::options().read(true).write(true).open(log) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        opened => opened?,
    };
    let (mut piece, mut at) = (vec![0; PIECE_BYTES], 0);
    loop {
        let read = file.read(&mut piece)?;
        if read == 0 {
            break;
        }
        file.seek(SeekFrom::Start(at))?;
        file.write_all(&piece[..read])?;
        at += read as u64;
    }
    file.sync_all()?;
    #[cfg(test)]
    power_cut::synced(log);
    Ok(())
}

/// Moves a log of at least `pages` pages into the file, as far as nobody reads it. Waits for
/// nobody.
pub(in crate::store) async fn move_long_log(
    conn: &mut SqliteConnection,
    pages: i64,
) -> Result<(), StoreError> {
    let at = || StoreError::during("look at the log");
    // Busy, pages of the log, pages that are in the file.
    let (_, length, _): (i64, i64, i64) =
        sqlx::query_as("PRAGMA wal_checkpoint(NOOP)").fetch_one(&mut *conn).await.map_err(at())?;
    if length < pages {
        return Ok(());
    }
    let moved = sqlx::query("PRAGMA wal_checkpoint(PASSIVE)").execute(conn).await;
    moved.map(drop).map_err(StoreError::during("move the log into the file"))
}

/// Moves the whole log into the file and empties it, so that the file alone is complete. Waits for
/// readers. False: one still reads, and the log stays.
pub(in crate::store) async fn empty_log(conn: &mut SqliteConnection) -> Result<bool, sqlx::Error> {
    let busy: i64 = sqlx::query_scalar("PRAGMA wal_checkpoint(TRUNCATE)").fetch_one(conn).await?;
    Ok(busy == 0)
}
