//! One mapping: its queue, its thread, its progress.

use super::{Progress, Shared, Stage, Walls};
use crate::engine::motion::ScanJob;
use map::{
    pose2::Pose2,
    slam::{Slam, SlamMap, SlamParams},
};
use protos::Name;
use std::{
    panic::{AssertUnwindSafe, catch_unwind},
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

/// What the thread is told.
enum Order {
    Scan(Box<ScanJob>),
    Finish(oneshot::Sender<Result<Walls, String>>),
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
    pub(super) fn begin(map: &str, robot: &Name, origin: Pose2) -> Option<Self> {
        let progress = Arc::new(Mutex::new(Progress {
            map: map.to_owned(),
            robot: robot.to_string(),
            stage: Stage::Mapping,
            scans: 0,
            dropped: 0,
            way_m: 0.0,
            pose: None,
            segments: None,
            loops: None,
            reason: None,
        }));
        let (orders, received) = sync_channel(QUEUE);
        let shared = progress.clone();
        let work = move || {
            // Nothing shared is left half changed: the map so far is this thread's own.
            if catch_unwind(AssertUnwindSafe(|| run(&received, &shared, &origin))).is_err() {
                tracing::error!("making a map panicked");
                fail(&shared, "the server failed on these scans; see its log");
            }
        };
        let thread = std::thread::Builder::new().name("mapping".into()).spawn(work);
        thread.inspect_err(|error| tracing::error!(%error, "no thread for a mapping")).ok()?;
        Some(Self { robot: robot.clone(), epoch: None, orders: Some(orders), progress })
    }

    /// Whether it goes on, be it only to be stored.
    pub(super) fn is_open(&self) -> bool {
        matches!(own(&self.progress).stage, Stage::Mapping | Stage::Finishing)
    }

    /// Whether it takes scans.
    pub(super) fn takes(&self) -> bool {
        own(&self.progress).stage == Stage::Mapping
    }

    pub(super) fn progress(&self) -> Progress {
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
        own(&self.progress).stage = Stage::Finishing;
        Some(walls)
    }

    /// What became of it.
    pub(super) fn end(&mut self, stored: Result<usize, String>) {
        let mut progress = own(&self.progress);
        match stored {
            Ok(segments) => (progress.stage, progress.segments) = (Stage::Done, Some(segments)),
            Err(reason) => (progress.stage, progress.reason) = (Stage::Failed, Some(reason)),
        }
    }
}

/// Maps scans until it is told to finish, or given up.
fn run(orders: &Receiver<Order>, progress: &Shared, origin: &Pose2) {
    let mut slam = Slam::new(SlamParams::default());
    let mut last: Option<Pose2> = None;
    while let Ok(order) = orders.recv() {
        match order {
            Order::Scan(job) => {
                let at = match slam.add(&job.odom_from_robot, &job.scan) {
                    Ok(at) => at,
                    Err(error) => return fail(progress, &error.to_string()),
                };
                let on_map = origin.compose(&at);
                let mut progress = own(progress);
                progress.scans += 1;
                let odom = job.odom_from_robot;
                progress.way_m += last.replace(odom).map_or(0.0, |o| o.between(&odom).position().norm());
                progress.pose = Some([on_map.x_m, on_map.y_m, on_map.theta_rad]);
            }
            Order::Finish(reply) => {
                let made = slam.finish().map_err(|error| error.to_string());
                if let Ok(map) = &made {
                    own(progress).loops = Some(map.loops.len());
                }
                // Nobody waits any more: it was given up.
                drop(reply.send(made.map(|map| walls(&map, origin))));
                return;
            }
        }
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
    (progress.stage, progress.reason) = (Stage::Failed, Some(reason.to_owned()));
}

fn own(progress: &Mutex<Progress>) -> MutexGuard<'_, Progress> {
    progress.lock().unwrap_or_else(PoisonError::into_inner)
}
