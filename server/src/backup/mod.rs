//! Backups of a running server. In: the data directory, a request or the schedule. Out: files in
//! its folder `backups`, each one committed state with a manifest of digests (`archive`); `restore`
//! puts one in the place of the data.
//!
//! One backup is made at a time, beside the writer, which waits for nothing. A file gets its name
//! when it is complete and compared with its digests. The newest `backup.keep` stay.

pub(crate) mod archive;
mod restore;
mod timetable;

pub use protos::api::BackupManifest;
pub use restore::{DirectoryError, RestoreError, StoppedServer, Verified, verify};

use crate::{
    config::{BackupSettings, Config, MAX_KEPT},
    events::EventLog,
    private_file,
    store::{
        StoreError, copies, copy_database, database_bytes, db::Pool, disk_guard::DiskGuard, kind::Kind,
        now_ms, open, pictures, restored,
    },
};
use archive::{ArchiveError, Manifest};
use engine::panics::{Edge, Panics};
use protos::api::{Backup, BackupHealth, BackupMap, BackupState, ServerEventBody};
use sha2::{Digest as _, Sha256};
use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};
use tokio::{runtime::Handle, sync::watch, task::JoinHandle};

/// Ending of a complete backup.
const SUFFIX: &str = ".waymark";
/// Ending of one that is being written.
const PART: &str = ".part";

/// Why a backup was not made.
#[derive(Debug, thiserror::Error)]
enum BackupError {
    /// The database.
    #[error("{}", with_cause(.0))]
    Store(#[from] StoreError),
    /// The file.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// The folder.
    #[error(transparent)]
    Io(#[from] io::Error),
}

fn with_cause(error: &dyn std::error::Error) -> String {
    error.source().map_or_else(|| error.to_string(), |cause| format!("{error}: {cause}"))
}

/// What is known of the newest backups.
#[derive(Debug, Default)]
struct State {
    /// Name and time of the one in work.
    running: Option<(String, i64)>,
    /// Name and time of the newest complete one.
    newest: Option<(String, i64)>,
    /// Name, time and reason of the last attempt, if it failed.
    failed: Option<(String, i64, String)>,
}

/// The backups of one server.
#[derive(Debug)]
pub(crate) struct Backups {
    data: PathBuf,
    folder: PathBuf,
    settings: BackupSettings,
    /// The database, if it is not the file in `data`.
    database: Option<Pool>,
    panics: Arc<Panics>,
    events: Arc<EventLog>,
    disk: Arc<DiskGuard>,
    state: Mutex<State>,
}

impl Backups {
    /// Begins to keep the timetable. Removes what an earlier server has left half written.
    pub(crate) fn start(
        config: &Config,
        (panics, events, disk, database): (Arc<Panics>, Arc<EventLog>, Arc<DiskGuard>, Option<Pool>),
        stopping: watch::Receiver<bool>,
    ) -> (Arc<Self>, JoinHandle<()>) {
        let folder = config.data.join("backups");
        remove_parts(&folder);
        let newest = complete(&folder).pop().map(|(name, path)| (name, created_ms(&path)));
        let backups = Arc::new(Self {
            data: config.data.clone(),
            folder,
            settings: config.backup,
            database,
            panics,
            events,
            disk,
            state: Mutex::new(State { newest, ..State::default() }),
        });
        let task = tokio::spawn(backups.clone().keep_timetable(stopping));
        (backups, task)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    async fn keep_timetable(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        let Some(every) = timetable::every(self.settings) else { return };
        loop {
            let wait = {
                let state = self.state();
                let newest = state.newest.as_ref().map(|(_, ms)| *ms);
                timetable::wait(every, newest, state.failed.as_ref().map(|(_, ms, _)| *ms), now_ms())
            };
            tokio::select! {
                _ = stopping.wait_for(|stop| *stop) => return,
                () = tokio::time::sleep(wait) => {}
            }
            // One that was asked for is as good.
            match self.begin() {
                Ok((_, task)) => drop(task.await),
                Err(_running) => tokio::time::sleep(Duration::from_secs(1)).await,
            }
        }
    }

    /// Begins a backup. Errors: `InUse` while another one is being made.
    pub(crate) fn begin(self: &Arc<Self>) -> Result<(Backup, JoinHandle<()>), StoreError> {
        let created_ms = now_ms();
        let name = {
            let mut state = self.state();
            if let Some((name, _)) = &state.running {
                return Err(StoreError::InUse(format!("backup `{name}` is being made")));
            }
            let name = timetable::name(created_ms, |name| self.path(name).exists());
            state.running = Some((name.clone(), created_ms));
            name
        };
        self.tell(&name, BackupState::Running);
        let (backups, runtime, work_name) = (self.clone(), Handle::current(), name.clone());
        let work =
            tokio::task::spawn_blocking(move || runtime.block_on(backups.make(&work_name, created_ms)));
        let (backups, ended_name) = (self.clone(), name.clone());
        let task = tokio::spawn(async move {
            let made = backups.panics.joined(Edge::Job, "a backup", "it is not made", work.await);
            backups.ended(&ended_name, created_ms, made.map_err(|e| e.to_string()).flatten());
        });
        Ok((running(name, created_ms), task))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(format!("{name}{SUFFIX}"))
    }

    /// Makes a backup. An error leaves nothing behind.
    async fn make(&self, name: &str, created_ms: i64) -> Result<(), String> {
        let part = self.folder.join(format!("{name}{PART}"));
        let made = self.written(&part, created_ms).await;
        let named = made.and_then(|()| {
            fs::rename(&part, self.path(name))?;
            Ok(restored::sync(&self.folder)?)
        });
        named.map_err(|error| {
            drop(fs::remove_file(&part));
            error.to_string()
        })
    }

    async fn written(&self, part: &Path, created_ms: i64) -> Result<(), BackupError> {
        let bytes = if let Some(database) = &self.database {
            database_bytes(database).await?
        } else {
            // About as large as the file that it is copied from.
            fs::metadata(self.data.join(open::FILE))?.len()
        };
        self.disk.check_for(bytes)?;
        private_file::folder(&self.folder)?;
        if let Some(database) = &self.database {
            copy_database(database, part).await?;
        } else {
            copies::copy(&self.data, part).await?;
        }
        let (contents, faults) = copies::examine(part).await?;
        for fault in &faults {
            tracing::error!(fault, follows = "the backup has it, too", "stored_data_is_damaged");
        }
        let bytes = fs::metadata(part)?.len();
        let manifest = Manifest {
            created_ms,
            program: env!("CARGO_PKG_VERSION").to_owned(),
            database_sha256: archive::digest_of(part, bytes)?,
            contents,
            faults,
        };
        Ok(archive::finish(part, &manifest)?)
    }

    fn ended(&self, name: &str, created_ms: i64, made: Result<(), String>) {
        match made {
            Ok(()) => {
                tracing::info!(name, "backup_made");
                self.prune();
                let mut state = self.state();
                (state.running, state.failed) = (None, None);
                state.newest = Some((name.to_owned(), created_ms));
                drop(state);
                self.tell(name, BackupState::Complete);
            }
            Err(reason) => {
                tracing::error!(name, reason, "backup_failed");
                let mut state = self.state();
                state.running = None;
                state.failed = Some((name.to_owned(), created_ms, reason));
                drop(state);
                self.tell(name, BackupState::Failed);
            }
        }
    }

    fn tell(&self, name: &str, state: BackupState) {
        self.events.tell(ServerEventBody::Backup { backup: name.to_owned(), state });
    }

    /// Removes all but the newest.
    fn prune(&self) {
        let all = complete(&self.folder);
        let old = all.len().saturating_sub(self.settings.keep);
        for (name, path) in &all[..old] {
            match fs::remove_file(path) {
                Ok(()) => tracing::info!(name, "old_backup_removed"),
                Err(error) => tracing::warn!(name, %error, "old_backup_not_removed"),
            }
        }
    }

    /// All backups by time, with the one in work and the one that failed last.
    pub(crate) fn list(&self) -> Vec<Backup> {
        let state = self.state();
        let in_work = |name: &str| state.running.as_ref().is_some_and(|(running, _)| running == name);
        let complete = complete(&self.folder).into_iter().filter(|(name, _)| !in_work(name));
        let mut all: Vec<Backup> = complete.map(|(name, path)| shown(name, &path)).collect();
        if let Some((name, created_ms, reason)) = &state.failed {
            let failed = running(name.clone(), *created_ms);
            all.push(Backup { state: BackupState::Failed, reason: Some(reason.clone()), ..failed });
        }
        all.extend(state.running.clone().map(|(name, created_ms)| running(name, created_ms)));
        all
    }

    /// One backup.
    pub(crate) fn get(&self, name: &str) -> Result<Backup, StoreError> {
        let found = self.list().into_iter().find(|backup| backup.name == name);
        found.ok_or_else(|| StoreError::NotFound { what: Kind::Backup, name: name.to_owned() })
    }

    /// The file of a complete backup.
    pub(crate) fn file(&self, name: &str) -> Result<PathBuf, StoreError> {
        // Only names of the listing become paths.
        let found = complete(&self.folder).into_iter().find(|(other, _)| other == name);
        let found = found.ok_or_else(|| StoreError::NotFound { what: Kind::Backup, name: name.to_owned() });
        found.map(|(_, path)| path)
    }

    /// Deletes a complete backup.
    pub(crate) fn delete(&self, name: &str) -> Result<(), StoreError> {
        let path = self.file(name)?;
        fs::remove_file(path).map_err(|error| StoreError::InUse(format!("backup `{name}`: {error}")))?;
        let newest = complete(&self.folder).pop().map(|(name, path)| (name, created_ms(&path)));
        self.state().newest = newest;
        Ok(())
    }

    /// For `/readyz`.
    pub(crate) fn health(&self) -> BackupHealth {
        let state = self.state();
        let (newest, newest_ms) = state.newest.clone().unzip();
        let failed = state.failed.as_ref().map(|(.., reason)| reason.clone());
        BackupHealth { every_hours: self.settings.every_hours, newest, newest_ms, failed }
    }
}

fn running(name: String, created_ms: i64) -> Backup {
    Backup { name, state: BackupState::Running, created_ms, bytes: 0, reason: None, manifest: None }
}

fn shown(name: String, path: &Path) -> Backup {
    let bytes = fs::metadata(path).map_or(0, |data| data.len());
    let (state, reason, manifest) = match archive::read(path) {
        Ok((manifest, _)) => (BackupState::Complete, None, Some(BackupManifest::from(&manifest))),
        Err(error) => (BackupState::Damaged, Some(error.to_string()), None),
    };
    let created_ms = manifest.as_ref().map_or(0, |manifest| manifest.created_ms);
    Backup { name, state, created_ms, bytes, reason, manifest }
}

fn created_ms(path: &Path) -> i64 {
    archive::read(path).map_or(0, |(manifest, _)| manifest.created_ms)
}

/// Names and files of the complete backups, oldest first.
fn complete(folder: &Path) -> Vec<(String, PathBuf)> {
    let mut all: Vec<_> = entries(folder)
        .filter_map(|path| {
            let name = path.file_name()?.to_str()?.strip_suffix(SUFFIX)?;
            timetable::is_name(name).then(|| (name.to_owned(), path.clone()))
        })
        .collect();
    all.sort();
    all.drain(..all.len().saturating_sub(MAX_KEPT));
    all
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> {
    // No folder: no backup yet.
    fs::read_dir(folder).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()))
}

fn remove_parts(folder: &Path) {
    for path in entries(folder).filter(|path| path.to_string_lossy().ends_with(PART)) {
        if let Err(error) = fs::remove_file(&path) {
            tracing::warn!(path = %path.display(), %error, "half_written_backup_not_removed");
        }
    }
}

impl From<&Manifest> for BackupManifest {
    fn from(manifest: &Manifest) -> Self {
        let map = |map: &copies::MapDigest| {
            let parts = [&map.map, &map.landmarks, &map.views, &map.models, &map.walls];
            let mut hash = Sha256::new();
            for part in parts {
                hash.update(&part.sha256);
            }
            BackupMap {
                name: map.name.clone(),
                version: map.version,
                landmarks: map.landmarks.rows,
                views: map.views.rows,
                models: map.models.rows,
                walls: map.walls.rows,
                sha256: pictures::hex(&hash.finalize()),
            }
        };
        Self {
            created_ms: manifest.created_ms,
            program: manifest.program.clone(),
            schema: manifest.contents.schema,
            maps: manifest.contents.maps.iter().map(map).collect(),
            pictures: manifest.contents.pictures,
            faults: manifest.faults.clone(),
        }
    }
}

#[cfg(test)]
mod tests;
