//! One mapping: its queue, its thread, its progress.

use super::{
    MadeMap, MappingProgress, MappingStage, Shared,
    fitted::{fitted, no_landmarks},
    journal::{Journal, JournalHeader, JournalReader},
    record::Record,
};
use crate::{
    scan_job::ScanJob,
    supervision::{
        panics::{Edge, Panics},
        threads::{self, Class},
    },
    survey::{DriveReading, ScanStamp, WHILE_DRIVING},
};
use map::{
    pose2::Pose2,
    slam::{Slam, SlamParams},
};
use protos::{CheckedFrame, Name};
use std::{
    io,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, AtomicUsize, Ordering},
        mpsc::{Receiver, SyncSender, sync_channel},
    },
};
use tokio::sync::oneshot;

/// Scans and frames that wait to be mapped; more are dropped and counted.
pub const QUEUE: usize = 64;
/// Frames among them: one may take some megabytes.
pub const FRAMES_WAITING: usize = 4;
/// Most scans of one mapping.
pub const MAX_SCANS: u64 = 100_000;

/// References to the progress that the thread itself holds. If there are no more, the session was
/// dropped.
const OWN_HANDLES: usize = 2;

/// What the thread shall do next.
enum Command {
    Record(Box<Record>),
    Finish(oneshot::Sender<Result<MadeMap, String>>),
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
    /// What waits to be accepted.
    pub(super) held: Option<MadeMap>,
    /// Whether frames are taken, and how many wait.
    landmarks: bool,
    waiting: Arc<AtomicUsize>,
    progress: Shared,
}

impl Session {
    /// Starts its thread.
    pub(super) fn begin(mut start: Start, (panics, no_room): (Arc<Panics>, Arc<AtomicBool>)) -> Option<Self> {
        let head = match &start {
            Start::New(head, _) => head.clone(),
            Start::Resumed(journal) => journal.head.clone(),
        };
        let origin = head.origin().ok()?;
        let first = match &mut start {
            Start::New(..) => None,
            Start::Resumed(journal) => journal.next(),
        };
        let epoch = first.as_ref().and_then(Record::epoch);
        let landmarks = head.landmarks;
        let stage =
            if matches!(start, Start::New(..)) { MappingStage::Mapping } else { MappingStage::Resuming };
        let progress = Arc::new(Mutex::new(MappingProgress {
            map: head.map.to_string(),
            robot: head.robot.to_string(),
            stage,
            scans: 0,
            dropped: 0,
            frames: landmarks.then_some(0),
            frames_refused: None,
            frames_dropped: 0,
            landmarks: None,
            left_out: Vec::new(),
            gathering: None,
            distance_m: 0.0,
            pose: None,
            segments: None,
            loop_closures: None,
            reason: None,
            journal_error: None,
        }));
        let (commands, received) = sync_channel(QUEUE);
        let (shared, waiting) = (progress.clone(), Arc::new(AtomicUsize::new(0)));
        let waits = waiting.clone();
        let work = move || {
            // A panic leaves nothing shared half changed: the map so far belongs to this thread.
            let mapper = Mapper::new(shared.clone(), (origin, landmarks), no_room);
            let run = || mapper.run(start, first, (&received, &waits));
            if panics.catch(Edge::Mapping, "a mapping", "this mapping has failed", run).is_none() {
                fail(&shared, "the server failed on these scans; see its log");
            }
        };
        let thread = threads::spawn(Class::Background, "mapping", work);
        thread.inspect_err(|error| tracing::error!(%error, "mapping_thread_failed")).ok()?;
        let (robot, commands) = (head.robot, Some(commands));
        Some(Self { robot, epoch, commands, held: None, landmarks, waiting, progress })
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
        let sent = |commands: &SyncSender<Command>| {
            commands.try_send(Command::Record(Box::new(Record::Scan(job)))).is_ok()
        };
        if !(is_same && has_room && self.commands.as_ref().is_some_and(sent)) {
            lock(&self.progress).dropped += 1;
        }
    }

    /// Queues a frame, or drops it; never waits. One of another epoch has another odometry.
    pub(super) fn offer_frame(&mut self, camera: &Name, frame: &CheckedFrame) {
        let is_ours = self.landmarks && self.epoch == Some(frame.epoch);
        let Some(commands) = self.commands.as_ref().filter(|_| is_ours) else { return };
        // Only the thread takes from them meanwhile.
        if self.waiting.load(Ordering::Relaxed) < FRAMES_WAITING {
            self.waiting.fetch_add(1, Ordering::Relaxed);
            let record = Record::Frame(camera.clone(), Box::new(frame.clone()));
            if commands.try_send(Command::Record(Box::new(record))).is_ok() {
                return;
            }
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        }
        lock(&self.progress).frames_dropped += 1;
    }

    /// Asks for what was made: what is held, or that of all scans, after those that wait. `None` if
    /// the queue is full or the thread has ended.
    pub(super) fn finish(&mut self) -> Option<oneshot::Receiver<Result<MadeMap, String>>> {
        let (reply, made) = oneshot::channel();
        if let Some(held) = self.held.take() {
            lock(&self.progress).stage = MappingStage::Finishing;
            return reply.send(Ok(held)).is_ok().then_some(made);
        }
        self.commands.as_ref()?.try_send(Command::Finish(reply)).ok()?;
        self.commands = None;
        lock(&self.progress).stage = MappingStage::Finishing;
        Some(made)
    }

    /// Holds what was made until it is asked for again.
    pub(super) fn hold(&mut self, made: Result<MadeMap, String>) {
        let mut progress = lock(&self.progress);
        match made {
            Ok(made) => {
                (progress.stage, progress.segments) = (MappingStage::Found, Some(made.walls.len()));
                self.held = Some(made);
            }
            Err(reason) => (progress.stage, progress.reason) = (MappingStage::Failed, Some(reason)),
        }
    }

    /// Records where landmarks are proposed.
    pub(super) fn proposed(&self, gathering: Result<Option<i64>, String>) {
        let mut progress = lock(&self.progress);
        match gathering {
            Ok(gathering) => progress.gathering = gathering,
            Err(reason) => progress.reason = Some(no_landmarks(&reason)),
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
    /// Where its first pose is known to be.
    origin: Option<Pose2>,
    last: Option<Pose2>,
    /// The drive, where landmarks are wanted.
    drive: Option<DriveReading>,
    journal: Option<Journal>,
    no_room: Arc<AtomicBool>,
}

impl Mapper {
    fn new(progress: Shared, (origin, landmarks): (Option<Pose2>, bool), no_room: Arc<AtomicBool>) -> Self {
        let slam = Slam::new(SlamParams::default());
        let drive = landmarks.then(|| DriveReading::new(WHILE_DRIVING));
        Self { slam, progress, origin, last: None, drive, journal: None, no_room }
    }

    /// Maps the journal, then scans until the mapping finishes or is cancelled.
    fn run(
        mut self,
        start: Start,
        first: Option<Record>,
        (commands, waiting): (&Receiver<Command>, &AtomicUsize),
    ) {
        let ready = match start {
            Start::New(_, journal) => {
                self.write_to(journal);
                Ok(())
            }
            Start::Resumed(journal) => self.resume(journal, first),
        };
        if let Err(reason) = ready.and_then(|()| self.obey(commands, waiting)) {
            fail(&self.progress, &reason);
        }
    }

    /// Maps the scans of a journal, as long as the session exists.
    fn resume(&mut self, mut journal: JournalReader, first: Option<Record>) -> Result<(), String> {
        let mut next = first;
        while let Some(record) = next {
            if Arc::strong_count(&self.progress) <= OWN_HANDLES {
                return Ok(());
            }
            self.add(&record)?;
            next = journal.next();
        }
        self.write_to(Some(journal.reopened()));
        let mut progress = lock(&self.progress);
        if progress.stage == MappingStage::Resuming {
            progress.stage = MappingStage::Mapping;
        }
        Ok(())
    }

    fn obey(&mut self, commands: &Receiver<Command>, waiting: &AtomicUsize) -> Result<(), String> {
        while let Ok(command) = commands.recv() {
            match command {
                Command::Record(record) => {
                    if matches!(*record, Record::Frame(..)) {
                        waiting.fetch_sub(1, Ordering::Relaxed);
                    }
                    if self.add(&record)? {
                        self.write(&record);
                    }
                }
                Command::Finish(reply) => {
                    // An error means that nobody waits: the mapping was cancelled.
                    drop(reply.send(self.made()));
                    break;
                }
            }
        }
        Ok(())
    }

    /// Fits everything once more, and looks at the frames.
    fn made(&mut self) -> Result<MadeMap, String> {
        let slam = std::mem::replace(&mut self.slam, Slam::new(SlamParams::default()));
        let map = slam.finish().map_err(|error| error.to_string())?;
        lock(&self.progress).loop_closures = Some(map.loops.len());
        let drive = self.drive.take().map(|reading| reading.finished().0);
        let fitted = fitted(map, drive, self.origin.as_ref());
        let mut progress = lock(&self.progress);
        (progress.landmarks, progress.left_out) = (fitted.landmarks, fitted.left_out);
        progress.reason = fitted.reason;
        Ok(fitted.made)
    }

    fn write(&mut self, record: &Record) {
        let no_room = self.no_room.load(Ordering::Relaxed);
        let write = |journal: &mut Journal| {
            if no_room {
                return Err(io::Error::other("the disk of the data directory is nearly full"));
            }
            journal.put_record(record)
        };
        let written = self.journal.as_mut().map(write);
        if let Some(Err(error)) = written {
            self.write_to(Some(Err(error)));
        }
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

    /// Takes a scan or a frame; whether it is to be kept.
    fn add(&mut self, record: &Record) -> Result<bool, String> {
        match record {
            Record::Scan(job) => self.add_scan(job).map(|()| true),
            Record::Frame(camera, frame) => {
                let Some(drive) = &mut self.drive else { return Ok(false) };
                let kept = drive.frame(camera, (**frame).clone());
                let mut progress = lock(&self.progress);
                progress.frames = Some(drive.frames());
                progress.frames_refused = drive.problems().values().max_by_key(|(count, _)| *count).cloned();
                Ok(kept)
            }
        }
    }

    fn add_scan(&mut self, job: &ScanJob) -> Result<(), String> {
        let at = self.slam.add(&job.odom_from_robot, &job.scan).map_err(|error| error.to_string())?;
        if let Some(drive) = &mut self.drive {
            drive.scan(ScanStamp { captured_ns: job.captured_ns, odom: job.odom_from_robot });
        }
        let on_map = self.origin.unwrap_or_default().compose(&at);
        let mut progress = lock(&self.progress);
        progress.scans += 1;
        let odom = job.odom_from_robot;
        progress.distance_m += self.last.replace(odom).map_or(0.0, |o| o.between(&odom).position().norm());
        progress.pose = Some([on_map.x_m, on_map.y_m, on_map.theta_rad]);
        Ok(())
    }
}

fn fail(progress: &Shared, reason: &str) {
    let mut progress = lock(progress);
    (progress.stage, progress.reason) = (MappingStage::Failed, Some(reason.to_owned()));
}

fn lock(progress: &Mutex<MappingProgress>) -> MutexGuard<'_, MappingProgress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}
