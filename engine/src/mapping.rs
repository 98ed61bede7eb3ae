//! Maps made while a robot drives: the scans of one robot, each with its odometry, go to `map::slam` on a thread of their
//! own, by a bounded queue. In: scans in order. Out: progress, and the walls when somebody ends it: whoever does stores
//! them. Until then the scans are kept in a journal, from which a restart of the server goes on.

mod journal;
mod session;

pub use session::{MAX_SCANS, QUEUE};

use super::panics::Panics;
use crate::scan_job::ScanJob;
use journal::{Journal, JournalHeader, JournalReader};
use map::pose2::Pose2;
use protos::Name;
use session::{Session, Start};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};
use tokio::sync::oneshot;

/// Maps that are made at a time.
pub const MAX_MAPPINGS: usize = 4;
/// Maps whose last mapping is remembered; of those that are over the first by name gives way.
pub const MAX_REMEMBERED: usize = 64;

/// Walls: ends in metres, a.x, a.y, b.x, b.y, the free side on the left.
pub type Walls = Vec<[f64; 4]>;

/// How far a mapping has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MappingStage {
    /// The server was started again: the scans that were kept are mapped once more. New ones wait, as many as there is room
    /// for.
    Resuming,
    /// Scans are taken.
    Mapping,
    /// Everything is fitted once more; then the walls are stored.
    Finishing,
    /// The walls are those of the map.
    Done,
    /// See `reason`; the map is as before.
    Failed,
}

/// A mapping as it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct MappingProgress {
    /// The map.
    pub map: String,
    /// Whose scans.
    pub robot: String,
    /// How far it has come.
    pub stage: MappingStage,
    /// Scans that were taken.
    pub scans: u64,
    /// Scans that were not: the queue was full, the robot's software was started again, or there were too many.
    pub dropped: u64,
    /// Way driven, metres.
    pub way_m: f64,
    /// Where the robot is in the map so far: x, y, theta; absent before the first scan.
    pub pose: Option<[f64; 3]>,
    /// Walls, once it is done.
    pub segments: Option<usize>,
    /// Loops that were closed, once fitted.
    pub loops: Option<usize>,
    /// Why it failed.
    pub reason: Option<String>,
    /// Why further scans are not kept on disk: a restart of the server would lose them. Absent while they are.
    pub not_kept: Option<String>,
}

/// Why a mapping cannot begin or end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MappingError {
    /// One is going on.
    #[error("this map is being made already")]
    Going,
    /// The robot makes another map.
    #[error("this robot makes another map already")]
    Busy,
    /// Too many at a time.
    #[error("{MAX_MAPPINGS} maps are being made already")]
    TooMany,
    /// There is none to end.
    #[error("this map is not being made")]
    None,
    /// The system gives no thread.
    #[error("no thread for it")]
    Thread,
}

/// All mappings, by map.
#[derive(Debug, Default)]
pub struct MappingSessions {
    all: Mutex<BTreeMap<String, Session>>,
    /// Where their scans are kept.
    dir: OnceLock<PathBuf>,
    /// Where their panics are counted.
    panics: OnceLock<Arc<Panics>>,
}

impl MappingSessions {
    /// Counts the panics of mappings here from now on.
    pub fn count_in(&self, panics: Arc<Panics>) {
        self.panics.get_or_init(|| panics);
    }

    /// Keeps scans in a folder from now on, and goes on with what is there: with those mappings whose robot still stands on
    /// the map (`stands`); the others are forgotten.
    pub fn keep_in(&self, dir: PathBuf, stands: impl Fn(&Name, &Name) -> bool) {
        let dir = self.dir.get_or_init(|| dir);
        let mut all = self.lock();
        for kept in JournalReader::all(dir) {
            let (map, robot) = (kept.head.map.clone(), kept.head.robot.clone());
            if !stands(&map, &robot) {
                tracing::warn!(%map, %robot, "a mapping is forgotten: the robot stands elsewhere now");
                journal::remove(dir, map.as_str());
            } else if all.len() >= MAX_MAPPINGS {
                tracing::warn!(%map, "a mapping waits for another start: {MAX_MAPPINGS} go on already");
            } else if let Some(session) = Session::begin(Start::Again(kept), self.panics()) {
                tracing::info!(%map, %robot, "a mapping goes on");
                all.insert(map.to_string(), session);
            }
        }
    }

    /// Begins to make a map with a robot, whose first pose is `origin` on it.
    pub fn begin(&self, map: &Name, robot: &Name, origin: Pose2) -> Result<MappingProgress, MappingError> {
        let mut all = self.lock();
        if all.get(map.as_str()).is_some_and(Session::is_open) {
            return Err(MappingError::Going);
        }
        let open = || all.values().filter(|s| s.is_open());
        if open().any(|s| s.takes() && s.robot == *robot) {
            return Err(MappingError::Busy);
        }
        if open().count() >= MAX_MAPPINGS {
            return Err(MappingError::TooMany);
        }
        let head = JournalHeader::new(map, robot, &origin);
        let journal = self.dir.get().map(|dir| Journal::create(dir, &head));
        let session = Session::begin(Start::New(head, journal), self.panics()).ok_or(MappingError::Thread)?;
        let progress = session.progress();
        all.insert(map.to_string(), session);
        if all.len() > MAX_REMEMBERED {
            let over = all
                .iter()
                .find(|(name, s)| !s.is_open() && *name != map.as_str())
                .map(|(name, _)| name.clone());
            over.map(|name| all.remove(&name));
        }
        Ok(progress)
    }

    /// Takes a scan of a robot that makes its map; gives back any other.
    pub fn offer(&self, robot: &Name, job: ScanJob) -> Option<ScanJob> {
        let mut all = self.lock();
        match all.get_mut(&job.map).filter(|s| s.takes() && s.robot == *robot) {
            Some(session) => {
                session.offer(job);
                None
            }
            None => Some(job),
        }
    }

    /// Ends the taking of scans; the walls come when everything is fitted. Tell [`MappingSessions::stored`] what became of them.
    pub fn finish(
        &self,
        map: &str,
    ) -> Result<(MappingProgress, oneshot::Receiver<Result<Walls, String>>), MappingError> {
        let mut all = self.lock();
        let session = all.get_mut(map).filter(|s| s.takes()).ok_or(MappingError::None)?;
        let walls = session.finish().ok_or(MappingError::None)?;
        Ok((session.progress(), walls))
    }

    /// The walls were stored, so many; or why not.
    pub fn stored(&self, map: &str, stored: Result<usize, String>) {
        if let Some(session) = self.lock().get_mut(map) {
            // Of what failed the scans stay: the next start goes on with them, unless it is given up.
            if stored.is_ok() {
                self.forget(map);
            }
            session.end(stored);
        }
    }

    /// Gives a mapping up: the map stays as it is. False if there is none.
    pub fn cancel(&self, map: &str) -> bool {
        let mut all = self.lock();
        let Some(session) = all.remove(map) else { return false };
        self.forget(map);
        session.is_open() || session.has_failed()
    }

    /// How far the mapping of a map has come: the one that goes on, or the last.
    pub fn progress(&self, map: &str) -> Option<MappingProgress> {
        self.lock().get(map).map(Session::progress)
    }

    /// What is on disk of a mapping.
    fn forget(&self, map: &str) {
        if let Some(dir) = self.dir.get() {
            journal::remove(Path::new(dir), map);
        }
    }

    fn panics(&self) -> Arc<Panics> {
        self.panics.get_or_init(Arc::default).clone()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Session>> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The counters of one mapping, shared with its thread.
type Shared = Arc<Mutex<MappingProgress>>;

#[cfg(test)]
mod tests;
