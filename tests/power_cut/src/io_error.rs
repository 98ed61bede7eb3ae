//! Errors of single calls: which call of which file fails, once or from then on.

use std::path::Path;

/// A call that changes a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Call {
    /// A write. Its first half reaches the file.
    Write,
    /// A change of the length, which stays as it was.
    Truncate,
    /// A sync. What it was to keep is lost by a power cut, also if a later sync succeeds: Linux
    /// marks the pages clean.
    Sync,
}

/// A file of a database.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OfFile {
    /// The database itself.
    Database,
    /// The write-ahead log.
    Log,
}

impl OfFile {
    fn is(self, path: &Path) -> bool {
        let is_log = path.as_os_str().as_encoded_bytes().ends_with(b"-wal");
        is_log == (self == Self::Log)
    }
}

/// The errors that a disk is to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct IoError {
    /// Which calls.
    pub call: Call,
    /// Of which file.
    pub file: OfFile,
    /// The number of the call that fails, from 1 on.
    pub number: u64,
    /// All later ones fail, too.
    pub is_lasting: bool,
}

/// Counts calls.
#[derive(Debug, Clone)]
pub(crate) struct Planned {
    error: IoError,
    calls: u64,
    pub(crate) failed: u64,
}

impl Planned {
    pub(crate) fn new(error: IoError) -> Self {
        Self { error, calls: 0, failed: 0 }
    }

    /// Whether this call fails.
    pub(crate) fn fails(&mut self, call: Call, path: &Path) -> bool {
        if call != self.error.call || !self.error.file.is(path) {
            return false;
        }
        self.calls += 1;
        let fails =
            self.calls == self.error.number || (self.error.is_lasting && self.calls > self.error.number);
        self.failed += u64::from(fails);
        fails
    }
}
