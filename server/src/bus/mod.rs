//! The zenoh side: frames, odometry, scans and presence in; answers, poses and map changes out. An embedded router on the configured endpoint, so robots need no other daemon; no
//! discovery, no shared memory, no administration space, bounded messages.
//!
//! Callbacks run on zenoh's threads and never wait: they check and hand over. What goes out passes a bounded queue
//! and its own thread, so a slow link holds up no worker.

mod gaze;
mod inbox;
mod outbox;
mod router;
mod versions;
#[cfg(test)]
mod tests;

pub(crate) use inbox::{announce_presence, take_frame};
pub use outbox::Outbox;

use crate::config::Config;
use engine::{
    gaze::GazeControllers,
    intake::Intake,
    live::LiveHub,
    motion::MotionTracker,
    panics::Edge,
    vitals::{Pulse, Vitals},
};
use protos::{Key, Keys, v1};
use std::sync::Arc;
use tokio::{sync::broadcast::error::RecvError, task::JoinHandle};
use zenoh::{pubsub::Subscriber, query::Queryable};

/// Why the bus did not open.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The endpoint cannot be listened on.
    #[error("cannot listen for robots on {endpoint}: {detail}")]
    Listen {
        /// Endpoint asked for.
        endpoint: String,
        /// What was said.
        detail: String,
    },
    /// zenoh refused a declaration on the open session.
    #[error("zenoh could not {action}: {detail}")]
    Declare {
        /// What was tried.
        action: &'static str,
        /// What it said.
        detail: String,
    },
    /// The system gives no thread.
    #[error("no thread `{name}`: {source}")]
    Thread {
        /// What the thread is for.
        name: &'static str,
        /// What the system says.
        source: std::io::Error,
    },
}

/// What the bus hands messages to.
#[derive(Debug, Clone)]
pub struct Receivers {
    /// Frames.
    pub intake: Arc<Intake>,
    /// Odometry and scans.
    pub motion: Arc<MotionTracker>,
    /// Presence, and refusals for pages.
    pub live: Arc<LiveHub>,
    /// The gaze target of each robot.
    pub gazes: Arc<GazeControllers>,
    /// Pulses of tasks, and counters of panics.
    pub vitals: Arc<Vitals>,
}

/// The open bus.
pub struct Bus {
    endpoint: String,
    session: zenoh::Session,
    outbox: Outbox,
    changes: JoinHandle<()>,
    subscribers: Vec<Subscriber<()>>,
    queryables: [Queryable<()>; 2],
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bus").field("endpoint", &self.endpoint).finish_non_exhaustive()
    }
}

impl Bus {
    /// Opens the router and starts to receive. Needs a multi-threaded runtime.
    pub async fn open(config: &Config, to: Receivers) -> Result<Self, BusError> {
        let endpoint = router::endpoint(&config.zenoh_endpoint)?;
        let session = router::open(&endpoint, config.limits.robots, config.limits.frame_bytes).await?;
        let keys = Keys::new(&config.fleet);
        let outbox = Outbox::start(session.clone(), keys.clone(), to.vitals.panics().clone())?;
        let changes = tokio::spawn(forward_map_changes(
            to.clone(),
            outbox.clone(),
            to.vitals.begin("the task that forwards map changes"),
        ));
        let subscribers = inbox::subscribe(&session, &keys, &to, &outbox).await?;
        let queryables = [
            gaze::answer_gaze(&session, &keys, &to).await?,
            versions::answer_versions(&session, &keys, &to).await?,
        ];
        tracing::info!(endpoint, fleet = %config.fleet, "robots may connect");
        Ok(Self { endpoint, session, outbox, changes, subscribers, queryables })
    }

    /// Where robots connect, with the real port.
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// The session of the router, for robots of other middleware.
    pub(crate) fn session(&self) -> &zenoh::Session {
        &self.session
    }

    /// Where answers and poses are put.
    pub fn outbox(&self) -> &Outbox {
        &self.outbox
    }

    /// Stops receiving, sends what is queued, closes the router.
    pub async fn close(self) {
        self.changes.abort();
        for subscriber in self.subscribers {
            if let Err(error) = subscriber.undeclare().await {
                tracing::warn!(%error, "zenoh_undeclare_failed");
            }
        }
        for queryable in self.queryables {
            if let Err(error) = queryable.undeclare().await {
                tracing::warn!(%error, "zenoh_undeclare_failed");
            }
        }
        self.outbox.drain().await;
        if let Err(error) = self.session.close().await {
            tracing::warn!(%error, "zenoh_close_failed");
        }
    }
}

/// A zenoh callback that catches panics: a panic would end the task that receives from a robot. `kind` names the message.
pub(crate) fn caught<T>(
    vitals: &Arc<Vitals>,
    kind: &'static str,
    receive: impl Fn(T) + Send + Sync + 'static,
) -> impl Fn(T) + Send + Sync + 'static {
    let vitals = vitals.clone();
    move |received| {
        vitals.panics().catch(Edge::Message, kind, "it is dropped", || receive(received));
    }
}

/// Forwards map changes to robots and pages.
async fn forward_map_changes(to: Receivers, outbox: Outbox, pulse: Pulse) {
    let mut changes = to.intake.snapshots.changes();
    loop {
        match changes.recv().await {
            Ok(change) => {
                if let (Some(version), Ok(map)) = (change.version, protos::Name::new(change.map.as_str())) {
                    let message = v1::MapChanged { map: change.map.clone(), version };
                    outbox.send(&Key::MapChanged(map), &message);
                }
                to.live.map_changed(change.map, change.version);
            }
            // A robot that missed a change sees the version in its next answer, or asks for it.
            Err(RecvError::Lagged(_)) => {}
            Err(RecvError::Closed) => return pulse.end(),
        }
    }
}
