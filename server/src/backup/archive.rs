//! The file of a backup: a SQLite database, then a manifest (JSON), then a foot of 64 bytes. SQLite
//! reads the file as it is; it leaves out what follows its last page.
//!
//! | foot | bytes |
//! |---|---|
//! | `waymark-backup-1` | 16 |
//! | length of the database, u64 little-endian | 8 |
//! | length of the manifest, u64 little-endian | 8 |
//! | SHA-256 of the manifest and of the 32 bytes above | 32 |
//!
//! The manifest has the SHA-256 of the database, so that no byte of the file can change unseen.

use crate::{
    private_file,
    store::{copies::Contents, pictures},
};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use std::{
    fs::File,
    io::{self, Read as _, Seek as _, SeekFrom, Write as _},
    path::Path,
};

const MAGIC: &[u8; 16] = b"waymark-backup-1";
const FOOT: u64 = 64;
/// Largest manifest: digests of the largest number of maps take less than a tenth.
const MAX_MANIFEST: u64 = 16 << 20;
/// Bytes read at a time.
const BUFFER: usize = 1 << 20;

/// What a backup says of itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Manifest {
    /// ms since the Unix epoch.
    pub(crate) created_ms: i64,
    /// Version of the program that made it.
    pub(crate) program: String,
    /// SHA-256 of the database, hexadecimal.
    pub(crate) database_sha256: String,
    /// What the database holds.
    pub(crate) contents: Contents,
    /// What was wrong with it when it was made.
    pub(crate) faults: Vec<String>,
}

/// Why a file is no sound backup.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ArchiveError {
    /// The file cannot be read or written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It is something else, or was cut off.
    #[error("this is no backup of Waymark, or its end is missing")]
    NotABackup,
    /// It was changed.
    #[error("the manifest is damaged: its digest does not fit")]
    Manifest,
}

/// Adds manifest and foot to a database, and brings the file to the disk.
pub(super) fn finish(file: &Path, manifest: &Manifest) -> Result<(), ArchiveError> {
    let mut file = File::options().append(true).open(file)?;
    let database = file.metadata()?.len();
    let text = serde_json::to_vec(manifest).map_err(io::Error::other)?;
    let head = head(database, text.len() as u64);
    let digest = digest(&text, &head);
    for part in [&text[..], &head, &digest] {
        file.write_all(part)?;
    }
    Ok(file.sync_all()?)
}

fn head(database: u64, manifest: u64) -> [u8; 32] {
    let mut head = [0; 32];
    head[..16].copy_from_slice(MAGIC);
    head[16..24].copy_from_slice(&database.to_le_bytes());
    head[24..].copy_from_slice(&manifest.to_le_bytes());
    head
}

fn digest(manifest: &[u8], head: &[u8; 32]) -> [u8; 32] {
    Sha256::new().chain_update(manifest).chain_update(head).finalize().into()
}

/// The manifest of a backup, and the length of its database.
pub(crate) fn read(path: &Path) -> Result<(Manifest, u64), ArchiveError> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let at = length.checked_sub(FOOT).ok_or(ArchiveError::NotABackup)?;
    file.seek(SeekFrom::Start(at))?;
    let (mut head_read, mut sha256) = ([0; 32], [0; 32]);
    file.read_exact(&mut head_read)?;
    file.read_exact(&mut sha256)?;
    if head_read[..16] != MAGIC[..] {
        return Err(ArchiveError::NotABackup);
    }
    let number = |bytes: &[u8]| bytes.iter().rev().fold(0_u64, |n, byte| n << 8 | u64::from(*byte));
    let (database, text) = (number(&head_read[16..24]), number(&head_read[24..]));
    if text > MAX_MANIFEST || database.checked_add(text) != Some(at) {
        return Err(ArchiveError::Manifest);
    }
    let mut manifest = vec![0; text as usize];
    file.seek(SeekFrom::Start(database))?;
    file.read_exact(&mut manifest)?;
    if digest(&manifest, &head_read) != sha256 {
        return Err(ArchiveError::Manifest);
    }
    let manifest = serde_json::from_slice(&manifest).map_err(|_newer_form| ArchiveError::NotABackup)?;
    Ok((manifest, database))
}

/// SHA-256 of the first `length` bytes of a file, hexadecimal.
pub(super) fn digest_of(path: &Path, length: u64) -> io::Result<String> {
    let mut hash = Sha256::new();
    each_part(path, length, |part| {
        hash.update(part);
        Ok(())
    })?;
    Ok(pictures::hex(&hash.finalize()))
}

/// Copies the first `length` bytes to a new file, and brings it to the disk. Returns their SHA-256,
/// hexadecimal.
pub(super) fn copy_database(from: &Path, length: u64, to: &Path) -> io::Result<String> {
    let (mut hash, mut copy) = (Sha256::new(), private_file::create(to)?);
    each_part(from, length, |part| {
        hash.update(part);
        copy.write_all(part)
    })?;
    copy.sync_all()?;
    Ok(pictures::hex(&hash.finalize()))
}

fn each_part(path: &Path, length: u64, mut each: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
    let mut file = File::open(path)?.take(length);
    let mut buffer = vec![0; BUFFER];
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(()),
            count => each(&buffer[..count])?,
        }
    }
}
