//! Maps made while a robot drives: the scans of one robot, each with its odometry, go to `map::slam` on a thread of their
//! own, by a bounded queue. In: scans in order. Out: progress, and the walls when somebody ends it. Nothing of it is on
//! disk before that: whoever ends it stores the walls.

mod session;

pub use session::{MAX_SCANS, QUEUE};

use super::motion::ScanJob;
use map::pose2::Pose2;
use protos::Name;
use serde::Serialize;
use session::Session;
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::sync::oneshot;
use utoipa::ToSchema;

/// Maps that are made at a time.
pub const MAX_MAPPINGS: usize = 4;
/// Maps whose last mapping is remembered; of those that are over the first by name gives way.
pub const MAX_REMEMBERED: usize = 64;

/// Walls: ends in metres, a.x, a.y, b.x, b.y, the free side on the left.
pub type Walls = Vec<[f64; 4]>;

/// How far a mapping has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
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
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Progress {
    /// The map.
    pub map: String,
    /// Whose scans.
    pub robot: String,
    /// How far it has come.
    pub stage: Stage,
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
pub struct Mappings(Mutex<BTreeMap<String, Session>>);

impl Mappings {
    /// Begins to make a map with a robot, whose first pose is `origin` on it.
    pub fn begin(&self, map: &str, robot: &Name, origin: Pose2) -> Result<Progress, MappingError> {
        let mut all = self.lock();
        if all.get(map).is_some_and(Session::is_open) {
            return Err(MappingError::Going);
        }
        let open = || all.values().filter(|s| s.is_open());
        if open().any(|s| s.takes() && s.robot == *robot) {
            return Err(MappingError::Busy);
        }
        if open().count() >= MAX_MAPPINGS {
            return Err(MappingError::TooMany);
        }
        let session = Session::begin(map, robot, origin).ok_or(MappingError::Thread)?;
        let progress = session.progress();
        all.insert(map.to_owned(), session);
        if all.len() > MAX_REMEMBERED {
            let over =
                all.iter().find(|(name, s)| !s.is_open() && *name != map).map(|(name, _)| name.clone());
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

    /// Ends the taking of scans; the walls come when everything is fitted. Tell [`Mappings::stored`] what became of them.
    pub fn finish(
        &self,
        map: &str,
    ) -> Result<(Progress, oneshot::Receiver<Result<Walls, String>>), MappingError> {
        let mut all = self.lock();
        let session = all.get_mut(map).filter(|s| s.takes()).ok_or(MappingError::None)?;
        let walls = session.finish().ok_or(MappingError::None)?;
        Ok((session.progress(), walls))
    }

    /// The walls were stored, so many; or why not.
    pub fn stored(&self, map: &str, stored: Result<usize, String>) {
        if let Some(session) = self.lock().get_mut(map) {
            session.end(stored);
        }
    }

    /// Gives a mapping up: the map stays as it is. False if there is none.
    pub fn cancel(&self, map: &str) -> bool {
        self.lock().remove(map).is_some_and(|session| session.is_open())
    }

    /// How far the mapping of a map has come: the one that goes on, or the last.
    pub fn progress(&self, map: &str) -> Option<Progress> {
        self.lock().get(map).map(Session::progress)
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Session>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The counters of one mapping, shared with its thread.
type Shared = Arc<Mutex<Progress>>;

#[cfg(test)]
mod tests;
