//! Hears what the robots of a fleet and the server send, for recordings. In: samples of zenoh. Out:
//! messages as bytes with their keys, in the order of receipt. Sends nothing.

use crate::{ClientError, Delivery, transport};
use protos::{Key, Keys, Name};
use std::{
    sync::{
        Arc,
        atomic::{AtomicU64, AtomicUsize, Ordering},
    },
    time::Duration,
};
use tokio::sync::mpsc;
use zenoh::{pubsub::Subscriber, sample::Sample};

/// Messages that wait for a slow reader; what does not fit is dropped and counted.
pub const MAX_WAITING: usize = 4096;
/// Bytes of all messages that wait.
pub const MAX_WAITING_BYTES: usize = 64 << 20;

/// A message as it was received.
#[derive(Debug, Clone, PartialEq)]
pub struct ListenedMessage {
    /// Its key.
    pub key: Key,
    /// Its bytes, not looked at.
    pub bytes: Vec<u8>,
    /// When it was received, by the system clock, ns since the Unix epoch.
    pub received_ns: i64,
}

/// What does not fit, and what waits.
#[derive(Debug, Default)]
struct Counters {
    waiting_bytes: AtomicUsize,
    dropped: AtomicU64,
}

/// A connection that hears a fleet. Dropping it ends the session.
pub struct FleetListener {
    session: zenoh::Session,
    waiting: mpsc::Receiver<ListenedMessage>,
    counters: Arc<Counters>,
    // Held: dropping them ends the subscription.
    _subscribers: Vec<Subscriber<()>>,
}

impl FleetListener {
    /// Connects, and hears frames, answers, odometry, scans and poses of `robots`, of all if that
    /// is empty, and the changes of all maps.
    pub async fn connect(
        endpoint: &str,
        fleet: &Name,
        robots: &[Name],
        timeout: Duration,
    ) -> Result<Self, ClientError> {
        let session = transport::open_at(endpoint, Delivery::Latest, timeout).await?;
        let keys = Keys::new(fleet);
        let (to, waiting) = mpsc::channel(MAX_WAITING);
        let counters = Arc::new(Counters::default());
        let expressions = [
            keys.all_frames(),
            keys.all_answers(),
            keys.all_odometry(),
            keys.all_scans(),
            keys.all_poses(),
            keys.all_map_changes(),
        ];
        let mut subscribers = Vec::new();
        for expression in expressions {
            let (keys, robots) = (keys.clone(), robots.to_vec());
            let (to, counters) = (to.clone(), counters.clone());
            let receive = move |sample: Sample| {
                let Ok(key) = transport::received(&keys, &sample) else { return };
                if is_wanted(&key, &robots) {
                    counters.queue(&to, key, &sample);
                }
            };
            let declared = session.declare_subscriber(expression).callback(receive).await;
            subscribers.push(declared.map_err(|error| ClientError::Transport {
                action: "subscribe",
                detail: error.to_string(),
            })?);
        }
        Ok(Self { session, waiting, counters, _subscribers: subscribers })
    }

    /// The next message; `None` after the end of the session. It may be cancelled.
    pub async fn next(&mut self) -> Option<ListenedMessage> {
        let message = self.waiting.recv().await?;
        self.counters.waiting_bytes.fetch_sub(message.bytes.len(), Ordering::Relaxed);
        Some(message)
    }

    /// Messages dropped until now because the reader was too slow.
    pub fn dropped(&self) -> u64 {
        self.counters.dropped.load(Ordering::Relaxed)
    }

    /// Ends the session in order.
    pub async fn close(self) -> Result<(), ClientError> {
        self.session.close().await.map_err(|error| ClientError::Transport {
            action: "close the session",
            detail: error.to_string(),
        })
    }
}

impl Counters {
    /// Queues a message, or counts it as dropped; on zenoh's thread, which must not wait.
    fn queue(&self, to: &mpsc::Sender<ListenedMessage>, key: Key, sample: &Sample) {
        let bytes = sample.payload().len();
        let before = self.waiting_bytes.fetch_add(bytes, Ordering::Relaxed);
        let is_sent = before + bytes <= MAX_WAITING_BYTES && {
            let bytes = sample.payload().to_bytes().into_owned();
            let received_ns = crate::capture::now_ns();
            to.try_send(ListenedMessage { key, bytes, received_ns }).is_ok()
        };
        if !is_sent {
            self.waiting_bytes.fetch_sub(bytes, Ordering::Relaxed);
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

fn is_wanted(key: &Key, robots: &[Name]) -> bool {
    match key {
        Key::Frame(robot, _)
        | Key::Answer(robot, _)
        | Key::Odometry(robot)
        | Key::Scan(robot)
        | Key::Pose(robot) => robots.is_empty() || robots.contains(robot),
        Key::MapChanged(_) => true,
        // Recordings hold images; of quads none can be replayed against another detector.
        Key::Quads(..)
        | Key::Localise(_)
        | Key::Alive(..)
        | Key::Gaze(_)
        | Key::Hello(_)
        | Key::Server(..)
        | Key::MapVersion(_) => false,
    }
}
