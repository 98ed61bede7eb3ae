//! What is of SQLite alone: the file in the data directory, how it is opened, kept and copied, and
//! the disk that it lies on.

pub(super) mod checkpoint;
pub(crate) mod copies;
pub(crate) mod disk_guard;
pub(crate) mod integrity;
pub(super) mod migrations;
pub(crate) mod open;
pub(crate) mod restored;

/// Every statement of this folder.
#[cfg(test)]
pub(super) const EVERY: [&[(&str, &str)]; 2] = [copies::ALL, integrity::ALL];
