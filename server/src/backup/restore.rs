//! Restores a backup. In: the file of a backup, and a data directory that no server uses. Out: the
//! directory with the state of the backup; what was there before stays beside it.

use super::{
    BackupManifest,
    archive::{self, ArchiveError},
};
use crate::{
    config::PostgresAddress,
    store::{
        OpenError,
        copies::{self, Contents, MapDigest},
        now_ms, open, restore_database, restored,
        schema::known_schema,
    },
};
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// Why a backup was not restored. Nothing was changed.
#[derive(Debug, thiserror::Error)]
pub enum RestoreError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file is not what was written.
    #[error("the backup is damaged: {}", faults.join("; "))]
    Damaged {
        /// What is wrong, named.
        faults: Vec<String>,
    },
    /// A newer program wrote it.
    #[error(
        "the backup has schema {found}; this program knows schemas up to {known}: restore it with a newer one"
    )]
    Newer {
        /// Its schema.
        found: i64,
        /// The newest known one.
        known: i64,
    },
    /// The database does not take it.
    #[error("{0}")]
    Database(String),
    /// A server runs on the data directory, or it cannot be used.
    #[error(transparent)]
    Directory(#[from] DirectoryError),
}

/// The data directory cannot be taken.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct DirectoryError(String);

/// A backup that was verified.
#[derive(Debug, Clone)]
pub struct Verified {
    /// What the backup says of itself.
    pub manifest: BackupManifest,
    file: PathBuf,
    database_bytes: u64,
    database_sha256: String,
}

/// Reads the whole of a backup and compares it with its manifest: digest of the file, integrity of
/// the database, schema, digests of maps, models and pictures.
pub async fn verify(file: &Path) -> Result<Verified, RestoreError> {
    let at = |source| RestoreError::File { path: file.to_owned(), source };
    let damaged = |fault: String| RestoreError::Damaged { faults: vec![fault] };
    let read = file.to_owned();
    let read = move || -> Result<_, ArchiveError> {
        let (manifest, bytes) = archive::read(&read)?;
        let sha256 = archive::digest_of(&read, bytes)?;
        Ok((manifest, bytes, sha256))
    };
    let read = tokio::task::spawn_blocking(read).await.map_err(|e| at(io::Error::other(e)))?;
    let (manifest, database_bytes, sha256) = read.map_err(|error| match error {
        ArchiveError::Io(source) => at(source),
        other => damaged(other.to_string()),
    })?;
    let (found, known) = (manifest.contents.schema, known_schema());
    if found > known {
        return Err(RestoreError::Newer { found, known });
    }
    let mut faults = Vec::new();
    if sha256 != manifest.database_sha256 {
        faults.push("the database does not have the digest of the manifest".to_owned());
    }
    match copies::examine(file).await {
        Ok((contents, found)) => {
            // What was wrong when the backup was made is no damage of the file.
            faults.extend(found.into_iter().filter(|fault| !manifest.faults.contains(fault)));
            faults.extend(differences(&manifest.contents, &contents));
        }
        Err(error) => faults.push(with_cause(&error)),
    }
    if !faults.is_empty() {
        return Err(RestoreError::Damaged { faults });
    }
    let manifest_shown = BackupManifest::from(&manifest);
    Ok(Verified { manifest: manifest_shown, file: file.to_owned(), database_bytes, database_sha256: sha256 })
}

impl Verified {
    /// Puts it into an empty database of PostgreSQL.
    pub async fn restore_into(&self, address: &PostgresAddress) -> Result<(), RestoreError> {
        let restored = restore_database(&self.file, address.secret()).await;
        restored.map_err(|error| RestoreError::Database(with_cause(&error)))
    }
}

fn with_cause(error: &dyn std::error::Error) -> String {
    match error.source() {
        Some(cause) => format!("{error}: {cause}"),
        None => error.to_string(),
    }
}

/// What differs between two lists of digests, named.
fn differences(wanted: &Contents, found: &Contents) -> Vec<String> {
    let mut all = Vec::new();
    if wanted.schema != found.schema {
        all.push(format!("schema {} in place of {}", found.schema, wanted.schema));
    }
    if wanted.pictures != found.pictures {
        all.push(format!("{} pictures in place of {}", found.pictures, wanted.pictures));
    }
    for map in &wanted.maps {
        match found.maps.iter().find(|other| other.name == map.name) {
            None => all.push(format!("map {} is missing", map.name)),
            Some(other) => {
                all.extend(parts(map, other).map(|part| format!("{part} of map {} differ", map.name)));
            }
        }
    }
    let is_new = |map: &&MapDigest| !wanted.maps.iter().any(|other| other.name == map.name);
    all.extend(found.maps.iter().filter(is_new).map(|map| format!("map {} was not there", map.name)));
    all
}

/// Names of the parts of a map that differ.
fn parts<'m>(a: &'m MapDigest, b: &'m MapDigest) -> impl Iterator<Item = &'static str> + 'm {
    let all = [
        ("settings", a.map == b.map && a.version == b.version),
        ("landmarks", a.landmarks == b.landmarks),
        ("views", a.views == b.views),
        ("models", a.models == b.models),
        ("walls", a.walls == b.walls),
    ];
    all.into_iter().filter(|(_, same)| !same).map(|(name, _)| name)
}

/// A data directory that no server uses, for as long as this is held.
#[derive(Debug)]
pub struct StoppedServer {
    data: PathBuf,
    _lock: fs::File,
}

impl StoppedServer {
    /// Takes the lock of a data directory; the directory is made if it is not there.
    pub fn of(data: &Path) -> Result<Self, RestoreError> {
        let lock = open::lock(data).map_err(|error| match error {
            OpenError::Locked(_) => DirectoryError(format!("{error}: stop it first")),
            other => DirectoryError(other.to_string()),
        })?;
        Ok(Self { data: data.to_owned(), _lock: lock })
    }

    /// Whether there is a database that would be replaced.
    pub fn has_data(&self) -> bool {
        self.data.join(open::FILE).exists()
    }

    /// Puts a verified backup in the place of the data. Returns the folder with what was there
    /// before, if there was anything.
    pub fn restore(&self, backup: &Verified) -> Result<Option<PathBuf>, RestoreError> {
        let at = |source| RestoreError::File { path: self.data.clone(), source };
        let time = now_ms().to_string();
        let part = self.data.join(format!("restoring-{time}.part"));
        let copied = archive::copy_database(&backup.file, backup.database_bytes, &part);
        let done = match copied {
            Ok(sha256) if sha256 == backup.database_sha256 => Ok(()),
            Ok(_) => {
                Err(RestoreError::Damaged { faults: vec!["the file changed after it was verified".into()] })
            }
            Err(source) => Err(at(source)),
        };
        if let Err(error) = done {
            // The copy is of no use; an error here leaves a file with a name that says so.
            drop(fs::remove_file(&part));
            return Err(error);
        }
        fs::rename(&part, restored::decided(&self.data, &time)).map_err(at)?;
        restored::sync(&self.data).map_err(at)?;
        restored::put_in_place(&self.data, open::FILE).map_err(at)
    }
}
