//! Mappings: walls of a map made while a robot drives, and landmarks where they are asked for. In:
//! the scans of one robot in order, each with its odometry, and its frames. Out: progress, and what
//! was made once somebody finishes the mapping and stores it. A bounded queue passes scans to
//! `map::slam` on a thread of its own; frames wait for `survey`. A journal stores both, so that a
//! mapping resumes after a restart of the server.

mod record;
mod journal;
mod fitted;
mod session;

pub use fitted::{LeftOut, MAX_LEFT_OUT};
pub use session::{FRAMES_WAITING, MAX_SCANS, QUEUE};

use crate::scan_job::ScanJob;
use crate::supervision::panics::Panics;
use crate::survey::{Drive, SurveyedBuilding};
use journal::{Journal, JournalHeader, JournalReader};
use map::pose2::Pose2;
use protos::{CheckedFrame, Name};
use session::{Session, Start};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, MutexGuard, OnceLock, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};
use tokio::sync::oneshot;

/// Mappings at a time.
pub const MAX_MAPPINGS: usize = 4;
/// Maps with a stored mapping; a further one replaces the first by name that is over.
pub const MAX_SESSIONS: usize = 64;

/// Walls in the map frame.
pub type Walls = Vec<map::segments::LaserSegment>;

/// What a mapping made.
#[derive(Debug, Clone)]
pub struct MadeMap {
    /// The walls: those of the survey, where there is one.
    pub walls: Walls,
    /// What the frames showed, where landmarks were asked for.
    pub survey: Option<Arc<MadeSurvey>>,
}

/// A drive and what it gave.
#[derive(Debug)]
pub struct MadeSurvey {
    /// The drive.
    pub drive: Drive,
    /// What it gave.
    pub building: SurveyedBuilding,
}

/// Stage of a mapping.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MappingStage {
    /// The server has restarted: the scans in the journal are mapped once more. New ones wait in
    /// the queue.
    Resuming,
    /// Scans are mapped as they come.
    Mapping,
    /// The pose graph is optimised; then the walls are held or stored.
    Finishing,
    /// The walls are held until somebody accepts them or cancels; the map is as before.
    Found,
    /// The map has the new walls.
    Done,
    /// See `reason`; the map is as before.
    Failed,
}

/// How far a mapping has come.
#[derive(Debug, Clone, PartialEq)]
pub struct MappingProgress {
    /// Name of the map.
    pub map: String,
    /// Name of the robot.
    pub robot: String,
    /// Its stage.
    pub stage: MappingStage,
    /// Scans that were mapped.
    pub scans: u64,
    /// Scans that were dropped: the queue was full, a new epoch began, or there were too many.
    pub dropped: u64,
    /// Frames that were taken; `None` where no landmarks were asked for.
    pub frames: Option<usize>,
    /// Frames that cannot be used: how many of the most frequent kind, and why.
    pub frames_refused: Option<(u64, String)>,
    /// Frames that were dropped: [`FRAMES_WAITING`] waited.
    pub frames_dropped: u64,
    /// Landmarks that are proposed, once they are found.
    pub landmarks: Option<usize>,
    /// Objects that are no landmarks, [`MAX_LEFT_OUT`] at most.
    pub left_out: Vec<LeftOut>,
    /// Number of the gathering that has them, once they are stored.
    pub gathering: Option<i64>,
    /// Distance driven by odometry, m.
    pub distance_m: f64,
    /// `map_from_robot`: x, y (m), theta (rad); absent before the first scan.
    pub pose: Option<[f64; 3]>,
    /// Walls, once they are found.
    pub segments: Option<usize>,
    /// Loop closures, once the pose graph is optimised.
    pub loop_closures: Option<usize>,
    /// Why it failed.
    pub reason: Option<String>,
    /// Why further scans are not in the journal: a restart of the server would lose them. Absent
    /// while they are.
    pub journal_error: Option<String>,
}

/// Why a mapping cannot start or finish.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MappingError {
    /// The map has an open mapping.
    #[error("this map is being made already")]
    AlreadyMapping,
    /// The robot maps another map.
    #[error("this robot makes another map already")]
    Busy,
    /// Too many at a time.
    #[error("{MAX_MAPPINGS} maps are being made already")]
    TooMany,
    /// There is no open mapping.
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
    /// Folder of the journals.
    dir: OnceLock<PathBuf>,
    /// Counts the panics of mappings.
    panics: OnceLock<Arc<Panics>>,
    /// Whether the disk has no room for journals.
    no_room: Arc<AtomicBool>,
}

impl MappingSessions {
    /// Counts the panics of mappings in `panics` from now on.
    pub fn count_in(&self, panics: Arc<Panics>) {
        self.panics.get_or_init(|| panics);
    }

    /// Says whether the disk has room for journals. Without, a journal ends with its next scan; the
    /// mapping goes on.
    pub fn set_room(&self, has_room: bool) {
        self.no_room.store(!has_room, Ordering::Relaxed);
    }

    /// Writes journals to a folder from now on, and resumes the mappings there whose robot is still
    /// on the map (`is_on`); the other journals are removed.
    pub fn resume_in(&self, dir: PathBuf, is_on: impl Fn(&Name, &Name) -> bool) {
        let dir = self.dir.get_or_init(|| dir);
        let mut all = self.lock();
        for journal in JournalReader::all(dir) {
            let (map, robot) = (journal.head.map.clone(), journal.head.robot.clone());
            if !is_on(&map, &robot) {
                tracing::warn!(%map, %robot, "mapping removed: the robot is on another map now");
                journal::remove(dir, map.as_str());
            } else if all.len() >= MAX_MAPPINGS {
                tracing::warn!(%map, "mapping not resumed before the next start: {MAX_MAPPINGS} are open");
            } else if let Some(session) = Session::begin(Start::Resumed(journal), self.around()) {
                tracing::info!(%map, %robot, "mapping_resumed");
                all.insert(map.to_string(), session);
            }
        }
    }

    /// Starts a mapping with a robot; `origin` is its first pose where that is known in the frame
    /// of the map. Its frames are taken as well if `landmarks` are wanted.
    pub fn begin(
        &self,
        map: &Name,
        robot: &Name,
        (origin, landmarks): (Option<Pose2>, bool),
    ) -> Result<MappingProgress, MappingError> {
        let mut all = self.lock();
        if all.get(map.as_str()).is_some_and(Session::is_open) {
            return Err(MappingError::AlreadyMapping);
        }
        let open = || all.values().filter(|s| s.is_open());
        if open().any(|s| s.takes() && s.robot == *robot) {
            return Err(MappingError::Busy);
        }
        if open().count() >= MAX_MAPPINGS {
            return Err(MappingError::TooMany);
        }
        let head = JournalHeader::new(map, robot, (origin.as_ref(), landmarks));
        let journal = self.dir.get().map(|dir| Journal::create(dir, &head));
        let session = Session::begin(Start::New(head, journal), self.around()).ok_or(MappingError::Thread)?;
        let progress = session.progress();
        all.insert(map.to_string(), session);
        if all.len() > MAX_SESSIONS {
            let over = all
                .iter()
                .find(|(name, s)| !s.is_open() && *name != map.as_str())
                .map(|(name, _)| name.clone());
            over.map(|name| all.remove(&name));
        }
        Ok(progress)
    }

    /// Takes a scan of a robot with an open mapping; gives back any other scan.
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

    /// Takes a frame of a robot with an open mapping that looks for landmarks.
    pub fn offer_frame(&self, (robot, camera): (&Name, &Name), map: &str, frame: &CheckedFrame) {
        // A worker does not wait while a mapping begins: a frame may be missed.
        let Ok(mut all) = self.all.try_lock() else { return };
        if let Some(session) = all.get_mut(map).filter(|s| s.takes() && s.robot == *robot) {
            session.offer_frame(camera, frame);
        }
    }

    /// Takes no more scans; the walls come once the pose graph is optimised, or at once where they
    /// are held already. Their fate is reported to [`MappingSessions::stored`] or
    /// [`MappingSessions::hold`].
    pub fn finish(
        &self,
        map: &str,
    ) -> Result<(MappingProgress, oneshot::Receiver<Result<MadeMap, String>>), MappingError> {
        let mut all = self.lock();
        let session = all.get_mut(map).filter(|s| s.can_finish()).ok_or(MappingError::None)?;
        let made = session.finish().ok_or(MappingError::None)?;
        Ok((session.progress(), made))
    }

    /// The number of walls that were stored, or why they were not.
    pub fn stored(&self, map: &str, stored: Result<usize, String>) {
        if let Some(session) = self.lock().get_mut(map) {
            // After a failure the journal stays: the next start resumes the mapping, unless it is
            // cancelled.
            if stored.is_ok() {
                self.remove_journal(map);
            }
            session.end(stored);
        }
    }

    /// Where the landmarks of a stored map are proposed, or why they are not.
    pub fn proposed(&self, map: &str, gathering: Result<Option<i64>, String>) {
        if let Some(session) = self.lock().get(map) {
            session.proposed(gathering);
        }
    }

    /// Holds the walls until somebody accepts them with [`MappingSessions::finish`], or says why
    /// there are none. The journal stays: after a restart the mapping resumes, and is finished once
    /// more.
    pub fn hold(&self, map: &str, made: Result<MadeMap, String>) {
        // Another mapping of the map may have begun after this one was cancelled.
        if let Some(session) = self.lock().get_mut(map).filter(|session| session.is_finishing()) {
            session.hold(made);
        }
    }

    /// The walls that are held.
    pub fn held(&self, map: &str) -> Option<Walls> {
        self.lock().get(map).and_then(|session| session.held.as_ref().map(|made| made.walls.clone()))
    }

    /// Cancels a mapping: the map stays as it is. False if there is none.
    pub fn cancel(&self, map: &str) -> bool {
        let mut all = self.lock();
        let Some(session) = all.remove(map) else { return false };
        self.remove_journal(map);
        session.is_open() || session.has_failed()
    }

    /// Progress of a map's mapping: the open one, or the last.
    pub fn progress(&self, map: &str) -> Option<MappingProgress> {
        self.lock().get(map).map(Session::progress)
    }

    /// Removes a mapping's journal.
    fn remove_journal(&self, map: &str) {
        if let Some(dir) = self.dir.get() {
            journal::remove(Path::new(dir), map);
        }
    }

    fn around(&self) -> (Arc<Panics>, Arc<AtomicBool>) {
        (self.panics(), self.no_room.clone())
    }

    fn panics(&self) -> Arc<Panics> {
        self.panics.get_or_init(Arc::default).clone()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Session>> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The progress of one mapping, shared with its thread.
type Shared = Arc<Mutex<MappingProgress>>;

#[cfg(test)]
mod tests;
