//! Errors of the engines, sorted by what follows of them.

use super::Error;
use futures::future::BoxFuture;
use sqlx::postgres::PgDatabaseError;
use std::time::Duration;
use tokio::time::timeout;

/// What an error means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ErrorClass {
    /// There is no room for what is written; everything else goes on.
    Full,
    /// Nothing can be written.
    ReadOnly,
    /// A row with this name or key is there.
    Taken,
    /// The content is wrong at the place that was read. Reading it again gives the same.
    Damaged,
    /// What is on the disk is unknown. A failed sync cannot be repeated, since it marks the pages
    /// clean: the only safe way is to stop, and to open the file again.
    Lost,
    /// The database cannot be reached, or has ended the connection: it comes back by itself.
    Away,
    /// Others are at work on the same, or it took too long: it may be tried again.
    Busy,
    /// Anything else: the statement was not done.
    Other,
}

/// Longest wait for an answer of PostgreSQL. It ends a statement before that itself: who has no
/// answer by then has lost it.
pub(super) const ANSWER_TIMEOUT: Duration = Duration::from_secs(12);

/// A connection to PostgreSQL that was lost. Its errors of reading and writing have a class of
/// their own: those of a file end the process.
#[derive(Debug, thiserror::Error)]
#[error("the connection to the store was lost: {0}")]
struct ConnectionLost(Error);

/// The error of PostgreSQL, with what means that its connection was lost told from the rest.
pub(super) fn of_postgres(error: Error) -> Error {
    match error {
        Error::Io(_) | Error::Tls(_) | Error::PoolTimedOut | Error::PoolClosed => {
            Error::AnyDriverError(Box::new(ConnectionLost(error)))
        }
        other => other,
    }
}

/// The answer of PostgreSQL. Errors: also that there is none. It is boxed, so that futures of
/// SQLite do not have its size.
pub(super) fn answered<'a, T>(
    work: impl Future<Output = Result<T, Error>> + Send + 'a,
) -> BoxFuture<'a, Result<T, Error>> {
    Box::pin(async {
        let answer = timeout(ANSWER_TIMEOUT, work).await;
        answer.unwrap_or_else(|late| Err(Error::Io(late.into()))).map_err(of_postgres)
    })
}

/// SQLite result codes (primary, the low byte).
const SQLITE_READONLY: i32 = 8;
const SQLITE_IOERR: i32 = 10;
const SQLITE_CORRUPT: i32 = 11;
const SQLITE_FULL: i32 = 13;
const SQLITE_CANTOPEN: i32 = 14;
const SQLITE_NOTADB: i32 = 26;

/// SQLite extended result codes of shared memory that cannot be made: it has nothing to do with
/// what is stored.
const SQLITE_IOERR_SHMOPEN: i32 = 4618;
const SQLITE_IOERR_SHMSIZE: i32 = 4874;
const SQLITE_IOERR_SHMMAP: i32 = 5386;

/// What an error means.
pub(crate) fn class(error: &Error) -> ErrorClass {
    let database = match error {
        Error::Database(database) => database,
        Error::Io(_) | Error::WorkerCrashed => return ErrorClass::Lost,
        // As the layer has it of PostgreSQL.
        Error::AnyDriverError(cause) if cause.is::<ConnectionLost>() => return ErrorClass::Away,
        _ => return ErrorClass::Other,
    };
    if database.is_unique_violation() {
        return ErrorClass::Taken;
    }
    if let Some(error) = database.try_downcast_ref::<PgDatabaseError>() {
        return class_of_state(error.code());
    }
    match sqlite_code(error).map(|code| (code & 0xff, code)) {
        Some((SQLITE_FULL, _) | (_, SQLITE_IOERR_SHMSIZE)) => ErrorClass::Full,
        Some((SQLITE_READONLY, _)) => ErrorClass::ReadOnly,
        Some((SQLITE_CORRUPT | SQLITE_NOTADB, _)) => ErrorClass::Damaged,
        Some((SQLITE_IOERR, _)) => ErrorClass::Lost,
        _ => ErrorClass::Other,
    }
}

/// Of a SQLSTATE of PostgreSQL. None ends the process: PostgreSQL ends itself after a failed sync.
fn class_of_state(state: &str) -> ErrorClass {
    match state {
        "53100" => ErrorClass::Full,
        // It has become a standby, or has ended a transaction in which nothing happened.
        "25006" | "25P03" => ErrorClass::Away,
        // Lock and statement timeouts, and too many connections.
        "55P03" | "57014" | "53300" => ErrorClass::Busy,
        _ => match state.get(..2) {
            Some("08" | "57") => ErrorClass::Away,
            Some("40") => ErrorClass::Busy,
            _ => ErrorClass::Other,
        },
    }
}

/// The extended result code of SQLite.
fn sqlite_code(error: &Error) -> Option<i32> {
    error.as_database_error()?.code()?.parse().ok()
}

/// Whether SQLite cannot make or enlarge a file beside the database.
pub(crate) fn is_without_room(error: &Error) -> bool {
    sqlite_code(error).is_some_and(|code| {
        matches!(code, SQLITE_FULL | SQLITE_IOERR_SHMOPEN | SQLITE_IOERR_SHMSIZE | SQLITE_IOERR_SHMMAP)
            || code & 0xff == SQLITE_CANTOPEN
    })
}
