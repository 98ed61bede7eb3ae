//! Outgoing messages: a bounded queue and one thread that puts them on zenoh. A full queue drops
//! the message and counts it.
//!
//! Every message is sent with `CongestionControl::Drop`: a subscriber that does not read loses its
//! own messages and delays no other. No message must arrive: the next answer or pose replaces the
//! last, and `map/{map}/version` answers queries for the version of a map.

use super::{BusError, Receivers};
use engine::{
    heartbeats::Heartbeat,
    panics::{Edge, Panics},
    slots::SlotKey,
    threads::{self, Class},
    workers::Publish,
};
use protos::{Key, Keys, Name, prost::Message, v1};
use std::{
    sync::{
        Arc, Mutex, OnceLock, PoisonError,
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

struct OutgoingMessage {
    key: String,
    camera: Option<String>,
    bytes: Vec<u8>,
    priority: Priority,
}

enum Queued {
    Message(OutgoingMessage),
    /// Shows that the thread goes on.
    Probe,
}

/// Puts answers, poses and map changes on zenoh.
#[derive(Clone)]
pub struct Outbox {
    keys: Keys,
    /// Who may get messages.
    to: Receivers,
    queue: Arc<Mutex<Option<SyncSender<Queued>>>>,
    thread: Arc<Mutex<Option<JoinHandle<()>>>>,
    dropped: Arc<AtomicU64>,
    waiting: Arc<AtomicU64>,
    heart: Arc<Heartbeat>,
}

impl std::fmt::Debug for Outbox {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Outbox").field("dropped", &self.dropped()).finish_non_exhaustive()
    }
}

impl Outbox {
    /// Sends on the session in `session`; what is sent while there is none is lost, as there is
    /// nobody to hear it.
    pub(super) fn start(
        session: Arc<OnceLock<zenoh::Session>>,
        keys: Keys,
        to: &Receivers,
    ) -> Result<Self, BusError> {
        let panics = to.vitals.panics().clone();
        let (queue, messages) = sync_channel(QUEUE);
        let (heart, waiting) = (to.vitals.hearts().begin("the outbox"), Arc::<AtomicU64>::default());
        let counted = (heart.clone(), waiting.clone());
        let run = move || deliver(&session, &messages, &panics, &counted);
        let thread = threads::spawn(Class::Answers, "outbox", run)
            .map_err(|source| BusError::Thread { name: "outbox", source })?;
        Ok(Self {
            keys,
            to: to.clone(),
            queue: Arc::new(Mutex::new(Some(queue))),
            thread: Arc::new(Mutex::new(Some(thread))),
            dropped: Arc::default(),
            waiting,
            heart,
        })
    }

    /// Whether the sending thread runs; false after it ended, whatever the reason.
    pub fn is_running(&self) -> bool {
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner);
        thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Messages that were dropped because the queue was full.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    /// Messages that wait to be sent.
    pub fn waiting(&self) -> u64 {
        self.waiting.load(Ordering::Relaxed)
    }

    /// Beats with each message that is sent.
    pub(crate) fn heart(&self) -> &Heartbeat {
        &self.heart
    }

    /// Has the sending thread beat, once what waits before is sent.
    pub(crate) fn probe(&self) {
        let queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        self.waiting.fetch_add(1, Ordering::Relaxed);
        // A full queue beats by its messages, and one that is drained needs no probe.
        if queue.as_ref().is_none_or(|queue| queue.try_send(Queued::Probe).is_err()) {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        }
    }

    pub(super) fn send(&self, key: &Key, message: &impl Message) {
        self.send_bytes(key, message.encode_to_vec());
    }

    /// A message and what it lacks, as one: the bytes of two messages one after the other are those
    /// of both merged.
    fn send_parts<M: Message>(&self, key: &Key, message: &M, rest: &M) {
        let mut bytes = message.encode_to_vec();
        bytes.extend(rest.encode_to_vec());
        self.send_bytes(key, bytes);
    }

    fn send_bytes(&self, key: &Key, bytes: Vec<u8>) {
        let priority =
            if matches!(key, Key::MapChanged(_)) { Priority::Data } else { Priority::InteractiveHigh };
        let (key, camera) = self.keys.on_wire(key);
        let message = OutgoingMessage { key, camera: camera.map(str::to_owned), bytes, priority };
        let queue = self.queue.lock().unwrap_or_else(PoisonError::into_inner);
        // Counted first: the thread may have sent it before this one goes on.
        self.waiting.fetch_add(1, Ordering::Relaxed);
        let sent = queue.as_ref().is_some_and(|queue| queue.try_send(Queued::Message(message)).is_ok());
        if !sent {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Takes no more messages, and returns when the queued ones are sent.
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
        if !self.to.admits(&key.robot) {
            return;
        }
        let server = v1::Answer { server: self.to.server.to_string(), ..v1::Answer::default() };
        self.send_parts(&Key::Answer(key.robot.clone(), key.camera.clone()), answer, &server);
    }

    fn pose(&self, robot: &Name, pose: &v1::RobotPose) {
        if !self.to.admits(robot) {
            return;
        }
        let server = v1::RobotPose { server: self.to.server.to_string(), ..v1::RobotPose::default() };
        self.send_parts(&Key::Pose(robot.clone()), pose, &server);
    }
}

fn deliver(
    session: &OnceLock<zenoh::Session>,
    messages: &Receiver<Queued>,
    panics: &Panics,
    (heart, waiting): &(Arc<Heartbeat>, Arc<AtomicU64>),
) {
    for queued in messages {
        waiting.fetch_sub(1, Ordering::Relaxed);
        heart.beat();
        let Queued::Message(OutgoingMessage { key, camera, bytes, priority }) = queued else { continue };
        let Some(session) = session.get() else { continue };
        let put = || {
            let put = session.put(key.as_str(), bytes).attachment(camera).express(true);
            put.congestion_control(CongestionControl::Drop).priority(priority).wait()
        };
        if let Some(Err(error)) = panics.catch(Edge::Delivery, &key, "the message is lost", put) {
            tracing::debug!(%error, key, "message_not_sent");
        }
    }
}
