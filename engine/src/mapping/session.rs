//! One mapping: its queue, its thread, its progress.

use super::{
    MappingProgress, MappingStage, Shared, Walls,
    journal::{Journal, JournalHeader, JournalReader},
};
use crate::{
    panics::{Edge, Panics},
    scan_job::ScanJob,
};
use map::{
    pose2::Pose2,
    slam::{Slam, SlamMap, SlamParams},
};
use protos::Name;
use std::{
    io,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
};
use tokio::sync::oneshot;

/// Scans that wait to be mapped; more are dropped and counted.
pub const QUEUE: usize = 64;
/// Most scans of one mapping.
pub const MAX_SCANS: u64 = 100_000;

/// Handles of the progress that the thread itself has: with no more the session is gone.
const OWN_HANDLES: usize = 2;

/// What the thread is told.
enum Order {
    Scan(Box<ScanJob>),
    Finish(oneshot::Sender<Result<Walls, String>>),
}

/// How a mapping begins.
pub(super) enum Start {
    /// Anew; with its journal, if scans are kept, or why there is none.
    New(JournalHeader, Option<io::Result<Journal>>),
    /// With what was kept.
    Again(JournalReader),
}

/// A mapping, from its beginning until it is forgotten. Dropping it gives it up.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) robot: Name,
    /// That of the first scan: another is another odometry.
    epoch: Option<u64>,
    orders: Option<SyncSender<Order>>,
    progress: Shared,
}

impl Session {
    /// Starts its thread.
    pub(super) fn begin(mut start: Start, panics: Arc<Panics>) -> Option<Self> {
        let head = match &start {
            Start::New(head, _) => head.clone(),
            Start::Again(kept) => kept.head.clone(),
        };
        let origin = head.origin()?;
        let first = match &mut start {
            Start::New(..) => None,
            Start::Again(kept) => kept.next(),
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
            way_m: 0.0,
            pose: None,
            segments: None,
            loops: None,
            reason: None,
            not_kept: None,
        }));
        let (orders, received) = sync_channel(QUEUE);
        let shared = progress.clone();
        let work = move || {
            // Nothing shared is left half changed: the map so far is this thread's own.
            let mapper = Mapper::new(shared.clone(), origin);
            let run = || mapper.run(start, first, &received);
            if panics.catch(Edge::Mapping, "the making of a map", "this mapping has failed", run).is_none() {
                fail(&shared, "the server failed on these scans; see its log");
            }
        };
        let thread = std::thread::Builder::new().name("mapping".into()).spawn(work);
        thread.inspect_err(|error| tracing::error!(%error, "no thread for a mapping")).ok()?;
        Some(Self { robot: head.robot, epoch, orders: Some(orders), progress })
    }

    /// Whether it goes on, be it only to be stored.
    pub(super) fn is_open(&self) -> bool {
        matches!(
            own(&self.progress).stage,
            MappingStage::Resuming | MappingStage::Mapping | MappingStage::Finishing
        )
    }

    pub(super) fn has_failed(&self) -> bool {
        own(&self.progress).stage == MappingStage::Failed
    }

    /// Whether it takes scans.
    pub(super) fn takes(&self) -> bool {
        matches!(own(&self.progress).stage, MappingStage::Resuming | MappingStage::Mapping)
    }

    pub(super) fn progress(&self) -> MappingProgress {
        own(&self.progress).clone()
    }

    /// Passes a scan on; never waits.
    pub(super) fn offer(&mut self, job: ScanJob) {
        let same = *self.epoch.get_or_insert(job.epoch) == job.epoch;
        let room = own(&self.progress).scans < MAX_SCANS;
        let sent = |orders: &SyncSender<Order>| orders.try_send(Order::Scan(Box::new(job))).is_ok();
        if !(same && room && self.orders.as_ref().is_some_and(sent)) {
            own(&self.progress).dropped += 1;
        }
    }

    /// Asks for the walls; what waits is mapped before. `None` if the queue is full or the thread gone: ask again.
    pub(super) fn finish(&mut self) -> Option<oneshot::Receiver<Result<Walls, String>>> {
        let (reply, walls) = oneshot::channel();
        self.orders.as_ref()?.try_send(Order::Finish(reply)).ok()?;
        self.orders = None;
        own(&self.progress).stage = MappingStage::Finishing;
        Some(walls)
    }

    /// What became of it.
    pub(super) fn end(&mut self, stored: Result<usize, String>) {
        let mut progress = own(&self.progress);
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
}

impl Mapper {
    fn new(progress: Shared, origin: Pose2) -> Self {
        Self { slam: Slam::new(SlamParams::default()), progress, origin, last: None, journal: None }
    }

    /// Maps what was kept, then scans until it is told to finish, or given up.
    fn run(mut self, start: Start, first: Option<ScanJob>, orders: &Receiver<Order>) {
        let ready = match start {
            Start::New(_, journal) => {
                self.keep(journal);
                Ok(())
            }
            Start::Again(kept) => self.again(kept, first),
        };
        if let Err(reason) = ready.and_then(|()| self.orders(orders)) {
            fail(&self.progress, &reason);
        }
    }

    /// Maps the scans that were kept, as long as the session is there.
    fn again(&mut self, mut kept: JournalReader, first: Option<ScanJob>) -> Result<(), String> {
        let mut next = first;
        while let Some(job) = next {
            if Arc::strong_count(&self.progress) <= OWN_HANDLES {
                return Ok(());
            }
            self.add(&job)?;
            next = kept.next();
        }
        self.keep(Some(kept.reopened()));
        let mut progress = own(&self.progress);
        if progress.stage == MappingStage::Resuming {
            progress.stage = MappingStage::Mapping;
        }
        Ok(())
    }

    fn orders(&mut self, orders: &Receiver<Order>) -> Result<(), String> {
        while let Ok(order) = orders.recv() {
            match order {
                Order::Scan(job) => {
                    let kept = self.journal.as_mut().map(|journal| journal.scan(&job));
                    if let Some(Err(error)) = kept {
                        self.keep(Some(Err(error)));
                    }
                    self.add(&job)?;
                }
                Order::Finish(reply) => {
                    let slam = std::mem::replace(&mut self.slam, Slam::new(SlamParams::default()));
                    let made = slam.finish().map_err(|error| error.to_string());
                    if let Ok(map) = &made {
                        own(&self.progress).loops = Some(map.loops.len());
                    }
                    // Nobody waits any more: it was given up.
                    drop(reply.send(made.map(|map| walls(&map, &self.origin))));
                    break;
                }
            }
        }
        Ok(())
    }

    /// From now on scans are kept in this journal, or not at all: the mapping goes on without, and says why.
    fn keep(&mut self, journal: Option<io::Result<Journal>>) {
        self.journal = journal.and_then(|opened| {
            let failed = |error: &io::Error| {
                tracing::warn!(%error, "the scans of a mapping are not kept");
                own(&self.progress).not_kept = Some(error.to_string());
            };
            opened.inspect_err(failed).ok()
        });
    }

    fn add(&mut self, job: &ScanJob) -> Result<(), String> {
        let at = self.slam.add(&job.odom_from_robot, &job.scan).map_err(|error| error.to_string())?;
        let on_map = self.origin.compose(&at);
        let mut progress = own(&self.progress);
        progress.scans += 1;
        let odom = job.odom_from_robot;
        progress.way_m += self.last.replace(odom).map_or(0.0, |o| o.between(&odom).position().norm());
        progress.pose = Some([on_map.x_m, on_map.y_m, on_map.theta_rad]);
        Ok(())
    }
}

/// Of a map whose first pose is `origin`.
fn walls(map: &SlamMap, origin: &Pose2) -> Walls {
    let ends = |wall: &map::segments::LaserSegment| {
        let (a, b) = (origin.apply(&wall.a), origin.apply(&wall.b));
        [a.x, a.y, b.x, b.y]
    };
    map.walls.iter().map(ends).collect()
}

fn fail(progress: &Shared, reason: &str) {
    let mut progress = own(progress);
    (progress.stage, progress.reason) = (MappingStage::Failed, Some(reason.to_owned()));
}

fn own(progress: &Mutex<MappingProgress>) -> MutexGuard<'_, MappingProgress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}
