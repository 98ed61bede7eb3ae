//! The zenoh side: frames, odometry, scans and presence in; answers, poses and map changes out. An
//! embedded router, so robots need no other daemon; no discovery, no shared memory, no
//! administration space, bounded messages.
//!
//! Callbacks run on zenoh's threads and never wait: they check and hand over. What goes out passes
//! a bounded queue and its own thread, so a slow link holds up no worker.

mod access;
mod front;
mod gate;
mod gaze;
mod hello;
mod inbox;
mod join;
mod localise;
mod outbox;
mod own;
mod ping;
mod receiving;
mod router;
mod versions;
#[cfg(test)]
mod tests;

pub use access::access_control_for_router;
pub(crate) use front::advice as connection_advice;
pub(crate) use inbox::{announce_presence, take_frame};
pub use outbox::Outbox;
pub(crate) use ping::Pinger;

use crate::{
    config::Config,
    fleet::{Fleet, Responsibility},
    identity::certificates::{CertificateRegistry, Certificates},
    store::now_ms,
};
use engine::{
    decode::ImageLimits,
    gaze::GazeControllers,
    intake::Intake,
    live::LiveHub,
    motion::MotionTracker,
    panics::Edge,
    vitals::{Pulse, Vitals},
};
use join::{Join, JoinSettings};
pub(crate) use own::Sockets;
use own::{Doors, OwnRouter};
use protos::{Key, Keys, Name, v1};
use receiving::Receiving;
use std::{
    path::PathBuf,
    sync::{Arc, OnceLock},
    time::Instant,
};
use tokio::{sync::broadcast::error::RecvError, task::JoinHandle};
use zenoh::query::Queryable;

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
    /// The address for robots cannot be listened on.
    #[error("cannot listen for robots on {endpoint}: {source}")]
    Address {
        /// Endpoint asked for.
        endpoint: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A router that is to be joined does not answer.
    #[error("cannot join the router at {endpoints}: {detail}")]
    Join {
        /// Endpoints that were tried.
        endpoints: String,
        /// What was said.
        detail: String,
    },
    /// A file of the settings cannot be used.
    #[error("setting `{field}`: {}: {detail}", .path.display())]
    File {
        /// Name of the setting.
        field: &'static str,
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
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
    /// Certificates of robots, where connections are encrypted.
    pub(crate) certificates: Option<Arc<CertificateRegistry>>,
    /// This server's name.
    pub server: Name,
    /// The other servers, where it shares a router with them.
    pub(crate) fleet: Option<Arc<Fleet>>,
}

impl Receivers {
    /// Whether messages of a robot are taken: access control forbids those of revoked certificates,
    /// and this those that arrive until it does.
    pub(crate) fn admits(&self, robot: &Name) -> bool {
        self.certificates.as_ref().is_none_or(|certificates| certificates.admits(robot, now_ms()))
    }

    /// What this server does with a message of a robot; `map` reads the map that it names.
    pub(crate) fn responsibility(&self, robot: &Name, map: impl FnOnce() -> String) -> Responsibility {
        self.fleet
            .as_ref()
            .map_or(Responsibility::Take, |fleet| fleet.responsibility(robot, &map(), Instant::now()))
    }

    /// Whether robots are answered on a map here.
    pub(crate) fn serves(&self, map: &Name) -> bool {
        self.fleet.as_ref().is_none_or(|fleet| fleet.serves(map))
    }
}

/// The open bus.
pub struct Bus {
    endpoint: String,
    outbox: Outbox,
    changes: JoinHandle<()>,
    way: Router,
    /// Who asks the server itself, over its own router; with what answers, which is held.
    pinger: Option<Pinger>,
    _pings: Option<Queryable<()>>,
}

/// How robots reach the server.
enum Router {
    /// By its own router, and what is before it.
    Own(Box<Receiving>, Doors),
    /// By a router of the operator.
    Joined(Join),
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bus").field("endpoint", &self.endpoint).finish_non_exhaustive()
    }
}

impl Bus {
    /// Opens the router, or joins one, and starts to receive. Needs a multi-threaded runtime.
    pub(crate) async fn open(
        config: &Config,
        to: Receivers,
        sockets: Sockets,
        certificates: Option<Arc<Certificates>>,
    ) -> Result<Self, BusError> {
        let pixels = ImageLimits { bytes: config.limits.frame_bytes, pixels: config.limits.frame_pixels };
        let keys = Keys::new(&config.fleet);
        if let Some((router, fleet)) = config.router.as_ref().zip(to.fleet.clone()) {
            let endpoint = router.connect.first().cloned().unwrap_or_default();
            let settings = JoinSettings::read(router, keys.clone(), pixels)?;
            let cell = Arc::<OnceLock<zenoh::Session>>::default();
            let outbox = Outbox::start(cell.clone(), keys, &to)?;
            let changes = begin_changes(&to, &outbox);
            let pulse = to.vitals.begin("the task that joins the router");
            tracing::info!(endpoint, fleet = %config.fleet, server = %to.server, "the router is joined");
            let way = Router::Joined(Join::start(settings, (to, outbox.clone()), fleet, cell, pulse));
            return Ok(Self { endpoint, outbox, changes, way, pinger: None, _pings: None });
        }
        let own = OwnRouter::open(config, sockets, certificates).await?;
        let (session, endpoint) = (own.session.clone(), own.endpoint.clone());
        let outbox = Outbox::start(Arc::new(OnceLock::from(session.clone())), keys.clone(), &to)?;
        let changes = begin_changes(&to, &outbox);
        let (pings, pinger) = ping::answer_pings(&session, &keys, &to, &own.ping_endpoint()).await?;
        let receiving = Receiving::start(session, &keys, (&to, &outbox), pixels).await?;
        let doors = own.admit(config, keys, &to).await?;
        tracing::info!(endpoint, fleet = %config.fleet, "robots may connect");
        let way = Router::Own(Box::new(receiving), doors);
        Ok(Self { endpoint, outbox, changes, way, pinger: Some(pinger), _pings: Some(pings) })
    }

    /// Where robots connect, with the real port.
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// The session of the server's own router, for robots of other middleware.
    pub(crate) fn session(&self) -> Option<&zenoh::Session> {
        match &self.way {
            Router::Own(receiving, _) => Some(&receiving.session),
            Router::Joined(_) => None,
        }
    }

    /// Who asks the server itself. Taken once.
    pub(crate) fn take_pinger(&mut self) -> Option<Pinger> {
        self.pinger.take()
    }

    /// Where answers and poses are put.
    pub fn outbox(&self) -> &Outbox {
        &self.outbox
    }

    /// Stops receiving, sends what is queued, closes the router.
    pub async fn close(self) {
        self.changes.abort();
        match self.way {
            Router::Own(receiving, doors) => {
                let session = receiving.end().await;
                self.outbox.drain().await;
                doors.close(&session).await;
            }
            Router::Joined(join) => {
                let announced = join.end().await;
                self.outbox.drain().await;
                if let Some(announced) = announced {
                    close(&announced.session).await;
                }
            }
        }
    }
}

async fn close(session: &zenoh::Session) {
    if let Err(error) = session.close().await {
        tracing::warn!(%error, "zenoh_close_failed");
    }
}

fn begin_changes(to: &Receivers, outbox: &Outbox) -> JoinHandle<()> {
    let pulse = to.vitals.begin("the task that forwards map changes");
    tokio::spawn(forward_map_changes(to.clone(), outbox.clone(), pulse))
}

/// A zenoh callback that catches panics: a panic would end the task that receives from a robot.
/// `kind` names the message.
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
                let version = change.version.filter(|_| !change.is_draft);
                if let (Some(version), Ok(map)) = (version, protos::Name::new(change.map.as_str()))
                    && to.serves(&map)
                {
                    let server = to.server.to_string();
                    let message = v1::MapChanged { map: change.map.clone(), version, server };
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
