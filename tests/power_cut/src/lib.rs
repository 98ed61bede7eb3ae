//! Power cuts and I/O errors below SQLite. In: a directory whose database is opened through the
//! layer [`NAME`]. Out: calls that fail, and the files as a disk may hold them after the power was
//! cut at some call.
//!
//! The layer passes everything on to SQLite's own. Before a write or a truncation it keeps the
//! content of each touched sector since the last sync of the file; a sync forgets it. After the cut
//! every write, truncation, sync and deletion fails. Then each sector that was not synced is new or
//! old by chance, and a file may be as long as at its last sync.
//!
//! A call that fails by itself ([`IoError`]) is told to SQLite, and the process goes on. What a
//! failed sync was to keep counts as not synced until it is written again: a later sync does not
//! bring it to the disk.
//!
//! The index of the write-ahead log is passed on, too: a pool of connections works as in the
//! product. It is not part of what the disk holds.

mod disk;
mod io_error;
mod layer;

pub use disk::{Disk, Random, synced};
pub use io_error::{Call, IoError, OfFile};
pub use layer::{NAME, install};
