//! Errors of the engines, sorted by what follows of them.

use super::Error;

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
    /// Anything else: the statement was not done.
    Other,
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
        _ => return ErrorClass::Other,
    };
    if database.is_unique_violation() {
        return ErrorClass::Taken;
    }
    match sqlite_code(error).map(|code| (code & 0xff, code)) {
        Some((SQLITE_FULL, _) | (_, SQLITE_IOERR_SHMSIZE)) => ErrorClass::Full,
        Some((SQLITE_READONLY, _)) => ErrorClass::ReadOnly,
        Some((SQLITE_CORRUPT | SQLITE_NOTADB, _)) => ErrorClass::Damaged,
        Some((SQLITE_IOERR, _)) => ErrorClass::Lost,
        _ => ErrorClass::Other,
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
