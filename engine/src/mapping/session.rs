//! One mapping: its queue, its thread, its progress.

use super::{
    MappingProgress, MappingStage, Shared, Walls,
    journal::{Journal, JournalHeader, JournalReader},
};
use crate::{
    scan_job::ScanJob,
    supervision::{
        panics::{Edge, Panics},
        threads::{self, Class},
    },
};
use map::{
    pose2::{Pose2, Pose2Covariance},
    slam::{Slam, SlamMap, SlamParams},
};
use nalgebra::Matrix3;
use protos::Name;
use std::{
    io,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, SyncSender, sync_channel},
    },
};
use tokio::sync::oneshot;

/// Scans that wait to be mapped; more are dropped and counted.
pub const QUEUE: usize = 64;
/// Most scans of one mapping.
pub const MAX_SCANS: u64 = 100_000;

/// References to the progress that the thread itself holds. If there are no more, the session was
/// dropped.
const OWN_HANDLES: usize = 2;

/// What the thread shall do next.
enum Command {
    Scan(Box<ScanJob>),
    Finish(oneshot::Sender<Result<Walls, String>>),
}

/// How a mapping starts.
pub(super) enum Start {
    /// New, with its journal if there is a folder for journals, or why it cannot be written.
    New(JournalHeader, Option<io::Result<Journal>>),
    /// From a journal.
    Resumed(JournalReader),
}

/// A mapping, from its start until it is removed. Dropping it cancels it.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) robot: Name,
    /// Epoch of the first scan: another epoch has another odometry.
    epoch: Option<u64>,
    commands: Option<SyncSender<Command>>,
    /// Walls that wait to be accepted.
    pub(super) held: Option<Walls>,
    progress: Shared,
}

impl Session {
    /// Starts its thread.
    pub(super) fn begin(mut start: Start, (panics, no_room): (Arc<Panics>, Arc<AtomicBool>)) -> Option<Self> {
        let head = match &start {
            Start::New(head, _) => head.clone(),
            Start::Resumed(journal) => journal.head.clone(),
        };
        let origin = head.origin()?;
        let first = match &mut start {
            Start::New(..) => None,
            Start::Resumed(journal) => journal.next(),
        };
        let epoch = first.as_ref().map(|job| job.epoch);
        let stage =
            if matches!(start, Start::New(..)) { MappingStage::Mapping } else { MappingStage::Resuming };
        let progress = Arc::new(Mutex::new(MappingProgress {
            map: head.map.to_string(),
            robot: head.robot.to_string(),
            stage,
            scans: 0,
            dropped: 0,
            distance_m: 0.0,
            pose: None,
            segments: None,
            loop_closures: None,
            reason: None,
            journal_error: None,
        }));
        let (commands, received) = sync_channel(QUEUE);
        let shared = progress.clone();
        let work = move || {
            // A panic leaves nothing shared half changed: the map so far belongs to this thread.
            let mapper = Mapper::new(shared.clone(), origin, no_room);
            let run = || mapper.run(start, first, &received);
            if panics.catch(Edge::Mapping, "a mapping", "this mapping has failed", run).is_none() {
                fail(&shared, "the server failed on these scans; see its log");
            }
        };
        let thread = threads::spawn(Class::Background, "mapping", work);
        thread.inspect_err(|error| tracing::error!(%error, "mapping_thread_failed")).ok()?;
        Some(Self { robot: head.robot, epoch, commands: Some(commands), held: None, progress })
    }

    /// Whether it is open: resuming, mapping, or waiting to be accepted or stored.
    pub(super) fn is_open(&self) -> bool {
        !matches!(lock(&self.progress).stage, MappingStage::Done | MappingStage::Failed)
    }

    pub(super) fn has_failed(&self) -> bool {
        lock(&self.progress).stage == MappingStage::Failed
    }

    /// Whether it takes scans.
    pub(super) fn takes(&self) -> bool {
        matches!(lock(&self.progress).stage, MappingStage::Resuming | MappingStage::Mapping)
    }

    pub(super) fn is_finishing(&self) -> bool {
        lock(&self.progress).stage == MappingStage::Finishing
    }

    /// Whether there are walls, or will be once it is finished.
    pub(super) fn can_finish(&self) -> bool {
        self.takes() || self.held.is_some()
    }

    pub(super) fn progress(&self) -> MappingProgress {
        lock(&self.progress).clone()
    }

    /// Queues a scan, or drops and counts it; never waits.
    pub(super) fn offer(&mut self, job: ScanJob) {
        let is_same = *self.epoch.get_or_insert(job.epoch) == job.epoch;
        let has_room = lock(&self.progress).scans < MAX_SCANS;
        let sent = |commands: &SyncSender<Command>| commands.try_send(Command::Scan(Box::new(job))).is_ok();
        if !(is_same && has_room && self.commands.as_ref().is_some_and(sent)) {
            lock(&self.progress).dropped += 1;
        }
    }

    /// Asks for the walls: those that are held, or those of all scans, after the scans that wait.
    /// `None` if the queue is full or the thread has ended.
    pub(super) fn finish(&mut self) -> Option<oneshot::Receiver<Result<Walls, String>>> {
        let (reply, walls) = oneshot::channel();
        if let Some(held) = self.held.take() {
            lock(&self.progress).stage = MappingStage::Finishing;
            return reply.send(Ok(held)).is_ok().then_some(walls);
        }
        self.commands.as_ref()?.try_send(Command::Finish(reply)).ok()?;
        self.commands = None;
        lock(&self.progress).stage = MappingStage::Finishing;
        Some(walls)
    }

    /// Holds the walls until they are asked for again.
    pub(super) fn hold(&mut self, walls: Result<Walls, String>) {
        let mut progress = lock(&self.progress);
        match walls {
            Ok(walls) => {
                (progress.stage, progress.segments) = (MappingStage::Found, Some(walls.len()));
                self.held = Some(walls);
            }
            Err(reason) => (progress.stage, progress.reason) = (MappingStage::Failed, Some(reason)),
        }
    }

    /// Records whether the walls were stored.
    pub(super) fn end(&mut self, stored: Result<usize, String>) {
        let mut progress = lock(&self.progress);
        match stored {
            Ok(segments) => (progress.stage, progress.segments) = (MappingStage::Done, Some(segments)),
            Err(reason) => (progress.stage, progress.reason) = (MappingStage::Failed, Some(reason)),
        }
    }
}

/// What the thread of a mapping works with.
struct Mapper {
    slam: Slam,
    progress: Shared,
    origin: Pose2,
    last: Option<Pose2>,
    journal: Option<Journal>,
    no_room: Arc<AtomicBool>,
}

impl Mapper {
    fn new(progress: Shared, origin: Pose2, no_room: Arc<AtomicBool>) -> Self {
        let slam = Slam::new(SlamParams::default());
        Self { slam, progress, origin, last: None, journal: None, no_room }
    }

    /// Maps the journal, then scans until the mapping finishes or is cancelled.
    fn run(mut self, start: Start, first: Option<ScanJob>, commands: &Receiver<Command>) {
        let ready = match start {
            Start::New(_, journal) => {
                self.write_to(journal);
                Ok(())
            }
            Start::Resumed(journal) => self.resume(journal, first),
        };
        if let Err(reason) = ready.and_then(|()| self.obey(commands)) {
            fail(&self.progress, &reason);
        }
    }

    /// Maps the scans of a journal, as long as the session exists.
    fn resume(&mut self, mut journal: JournalReader, first: Option<ScanJob>) -> Result<(), String> {
        let mut next = first;
        while let Some(job) = next {
            if Arc::strong_count(&self.progress) <= OWN_HANDLES {
                return Ok(());
            }
            self.add(&job)?;
            next = journal.next();
        }
        self.write_to(Some(journal.reopened()));
        let mut progress = lock(&self.progress);
        if progress.stage == MappingStage::Resuming {
            progress.stage = MappingStage::Mapping;
        }
        Ok(())
    }

    fn obey(&mut self, commands: &Receiver<Command>) -> Result<(), String> {
        while let Ok(command) = commands.recv() {
            match command {
                Command::Scan(job) => {
                    let no_room = self.no_room.load(Ordering::Relaxed);
                    let write = |journal: &mut Journal| {
                        if no_room {
                            return Err(io::Error::other("the disk of the data directory is nearly full"));
                        }
                        journal.scan(&job)
                    };
                    let written = self.journal.as_mut().map(write);
                    if let Some(Err(error)) = written {
                        self.write_to(Some(Err(error)));
                    }
                    self.add(&job)?;
                }
                Command::Finish(reply) => {
                    let slam = std::mem::replace(&mut self.slam, Slam::new(SlamParams::default()));
                    let made = slam.finish().map_err(|error| error.to_string());
                    if let Ok(map) = &made {
                        lock(&self.progress).loop_closures = Some(map.loops.len());
                    }
                    // An error means that nobody waits: the mapping was cancelled.
                    drop(reply.send(made.map(|map| walls(&map, &self.origin))));
                    break;
                }
            }
        }
        Ok(())
    }

    /// Writes scans to this journal from now on. Without a journal the mapping continues, and its
    /// progress says why.
    fn write_to(&mut self, journal: Option<io::Result<Journal>>) {
        self.journal = journal.and_then(|opened| {
            let failed = |error: &io::Error| {
                tracing::warn!(%error, follows = "a restart loses this mapping", "journal_failed");
                lock(&self.progress).journal_error = Some(error.to_string());
            };
            opened.inspect_err(failed).ok()
        });
    }

    fn add(&mut self, job: &ScanJob) -> Result<(), String> {
        let at = self.slam.add(&job.odom_from_robot, &job.scan).map_err(|error| error.to_string())?;
        let on_map = self.origin.compose(&at);
        let mut progress = lock(&self.progress);
        progress.scans += 1;
        let odom = job.odom_from_robot;
        progress.distance_m += self.last.replace(odom).map_or(0.0, |o| o.between(&odom).position().norm());
        progress.pose = Some([on_map.x_m, on_map.y_m, on_map.theta_rad]);
        Ok(())
    }
}

/// The walls in the map frame, for a map whose first pose is `origin`.
fn walls(map: &SlamMap, origin: &Pose2) -> Walls {
    // Where the first pose lies in the map is a definition: it adds no error.
    let origin = Pose2Covariance { pose: *origin, covariance: Matrix3::zeros() };
    map.walls.iter().map(|wall| wall.transformed(&origin)).collect()
}

fn fail(progress: &Shared, reason: &str) {
    let mut progress = lock(progress);
    (progress.stage, progress.reason) = (MappingStage::Failed, Some(reason.to_owned()));
}

fn lock(progress: &Mutex<MappingProgress>) -> MutexGuard<'_, MappingProgress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}
