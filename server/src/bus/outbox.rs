//! What goes out: a bounded queue and one thread that puts it on zenoh. A full queue drops and counts; nobody waits.

use crate::engine::{slots::SlotKey, workers::Publish};
use protos::{Key, Keys, Name, prost::Message, v1};
use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread::JoinHandle,
};
use zenoh::{
    Wait,
    qos::{CongestionControl, Priority},
};

/// Messages waiting to be sent.
const QUEUE: usize = 1024;

struct Letter {
    key: String,
    bytes: Vec<u8>,
    important: bool,
}

/// Puts answers, poses and map changes on zenoh.
#[derive(Clone)]
pub struct Outbox {
    keys: Keys,
    queue: Arc<Mutex<Option<SyncSender<Letter>>>>,
    thread: Arc<Mutex<Option<JoinHandle<()>>>>,
    dropped: Arc<AtomicU64>,
}

impl std::fmt::Debug for Outbox {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Outbox").field("dropped", &self.dropped()).finish_non_exhaustive()
    }
}

impl Outbox {
    pub(super) fn start(session: zenoh::Session, keys: Keys) -> Self {
        let (queue, letters) = sync_channel(QUEUE);
        let thread =
            std::thread::Builder::new().name("outbox".into()).spawn(move || deliver(&session, &letters));
        let thread = thread.inspect_err(|error| tracing::error!(%error, "no thread for the outbox")).ok();
        Self {
            keys,
            queue: Arc::new(Mutex::new(Some(queue))),
            thread: Arc::new(Mutex::new(thread)),
            dropped: Arc::default(),
        }
    }

    /// Messages that were dropped because the queue was full.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    pub(super) fn send(&self, key: &Key, message: &impl Message) {
        let important = matches!(key, Key::MapChanged(_));
        let letter = Letter { key: self.keys.build(key), bytes: message.encode_to_vec(), important };
        let queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        let sent = queue.as_ref().is_some_and(|queue| queue.try_send(letter).is_ok());
        if !sent {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Takes nothing more, and returns when what was queued is sent.
    pub(super) async fn drain(&self) {
        drop(self.queue.lock().unwrap_or_else(PoisonError::into_inner).take());
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        let joined = tokio::task::spawn_blocking(move || thread.map(JoinHandle::join)).await;
        if !matches!(joined, Ok(None | Some(Ok(())))) {
            tracing::error!("the outbox thread panicked");
        }
    }
}

impl Publish for Outbox {
    fn answer(&self, key: &SlotKey, answer: &v1::Answer) {
        self.send(&Key::Answer(key.robot.clone(), key.camera.clone()), answer);
    }

    fn pose(&self, robot: &Name, pose: &v1::RobotPose) {
        self.send(&Key::Pose(robot.clone()), pose);
    }
}

fn deliver(session: &zenoh::Session, letters: &Receiver<Letter>) {
    for Letter { key, bytes, important } in letters {
        let put = session.put(key.as_str(), bytes).express(true);
        let put = if important {
            put.congestion_control(CongestionControl::Block).priority(Priority::Data)
        } else {
            put.congestion_control(CongestionControl::Drop).priority(Priority::InteractiveHigh)
        };
        if let Err(error) = put.wait() {
            tracing::debug!(%error, key, "not sent");
        }
    }
}
