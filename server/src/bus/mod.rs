//! The zenoh side: frames, odometry, scans and presence in; answers, poses and map changes out. An embedded router on the configured endpoint, so robots need no other daemon; no
//! discovery, no shared memory, no administration space, bounded messages.
//!
//! Callbacks run on zenoh's threads and never wait: they check and hand over. What goes out passes a bounded queue
//! and its own thread, so a slow link holds up no worker.

mod access;
mod gate;
mod gaze;
mod hello;
mod inbox;
mod localise;
mod outbox;
mod ping;
mod router;
mod versions;
#[cfg(test)]
mod tests;

pub(crate) use inbox::{announce_presence, take_frame};
pub use outbox::Outbox;
pub(crate) use ping::Pinger;

use crate::{
    config::Config,
    identity::certificates::{CertificateRegistry, Certificates, LinkCertificates},
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
use gate::{Gate, GateSettings};
use localise::Localiser;
use protos::{Key, Keys, Name, v1};
use router::{RouterSettings, RouterTls};
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
    /// Certificates of robots, where connections are encrypted.
    pub(crate) certificates: Option<Arc<CertificateRegistry>>,
}

impl Receivers {
    /// Whether messages of a robot are taken: access control forbids those of revoked certificates, and this those that
    /// arrive until it does.
    pub(crate) fn admits(&self, robot: &Name) -> bool {
        self.certificates.as_ref().is_none_or(|certificates| certificates.admits(robot, now_ms()))
    }
}

/// The open bus.
pub struct Bus {
    endpoint: String,
    session: zenoh::Session,
    outbox: Outbox,
    changes: JoinHandle<()>,
    subscribers: Vec<Subscriber<()>>,
    queryables: [Queryable<()>; 4],
    pinger: Option<Pinger>,
    localiser: Localiser,
    gate: Option<Gate>,
}

impl std::fmt::Debug for Bus {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bus").field("endpoint", &self.endpoint).finish_non_exhaustive()
    }
}

impl Bus {
    /// Opens the router and starts to receive. Needs a multi-threaded runtime.
    pub(crate) async fn open(
        config: &Config,
        to: Receivers,
        certificates: Option<Arc<Certificates>>,
    ) -> Result<Self, BusError> {
        let endpoint = router::endpoint(&config.zenoh_endpoint)?;
        let encrypted = certificates.filter(|_| endpoint.starts_with("tls/"));
        let (session, link) = if encrypted.is_some() {
            linked(config).await.map(|(session, link)| (session, Some(link)))?
        } else {
            (router::open(&plain(config, vec![endpoint.clone()])).await?, None)
        };
        let keys = Keys::new(&config.fleet);
        let outbox = Outbox::start(session.clone(), keys.clone(), &to)?;
        let changes = tokio::spawn(forward_map_changes(
            to.clone(),
            outbox.clone(),
            to.vitals.begin("the task that forwards map changes"),
        ));
        let subscribers = inbox::subscribe(&session, &keys, &to, &outbox).await?;
        let asked = link.clone().map_or((endpoint.clone(), None), |(at, link)| (at, Some(link)));
        let (pings, pinger) = ping::answer_pings(&session, &keys, &to, asked).await?;
        let queryables = [
            pings,
            gaze::answer_gaze(&session, &keys, &to).await?,
            versions::answer_versions(&session, &keys, &to).await?,
            hello::answer_hellos(&session, &keys, &to).await?,
        ];
        let pixels = ImageLimits { bytes: config.limits.frame_bytes, pixels: config.limits.frame_pixels };
        let localiser = Localiser::start(&session, &keys, &to, pixels).await?;
        let gate = match encrypted.zip(link) {
            None => None,
            Some((certificates, (link_endpoint, link))) => {
                let settings = GateSettings {
                    endpoint: endpoint.clone(),
                    link_endpoint,
                    link,
                    keys,
                    certificates,
                    registry: to.certificates.clone().unwrap_or_default(),
                    snapshots: to.intake.snapshots.clone(),
                    ros2: config.ros2.clone(),
                    robots: config.limits.robots,
                    frame_bytes: config.limits.frame_bytes,
                };
                Some(Gate::open(settings, to.vitals.begin("the task that admits robots")).await?)
            }
        };
        tracing::info!(endpoint, fleet = %config.fleet, "robots may connect");
        let pinger = Some(pinger);
        Ok(Self { endpoint, session, outbox, changes, subscribers, queryables, pinger, localiser, gate })
    }

    /// Where robots connect, with the real port.
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// The session of the router, for robots of other middleware.
    pub(crate) fn session(&self) -> &zenoh::Session {
        &self.session
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
        let gate = self.gate;
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
        self.localiser.close().await;
        self.outbox.drain().await;
        if let Some(gate) = gate {
            gate.close().await;
        }
        if let Err(error) = self.session.close().await {
            tracing::warn!(%error, "zenoh_close_failed");
        }
    }
}

fn plain(config: &Config, listen: Vec<String>) -> RouterSettings<'_> {
    let (robots, frame_bytes) = (config.limits.robots, config.limits.frame_bytes);
    RouterSettings { listen, connect: None, tls: None, access: None, robots, frame_bytes }
}

/// The server's own router behind a gate: it listens for the gate, and on the plain endpoint of the settings.
async fn linked(config: &Config) -> Result<(zenoh::Session, (String, Arc<LinkCertificates>)), BusError> {
    let endpoint = router::endpoint("tls/127.0.0.1:0")?;
    let made = LinkCertificates::new(now_ms());
    let link = made.map_err(|e| BusError::Listen { endpoint: endpoint.clone(), detail: e.to_string() })?;
    let mut listen = vec![endpoint.clone()];
    listen.extend(config.tls.as_ref().and_then(|tls| tls.local_zenoh.clone()));
    let tls = RouterTls {
        authorities: link.authority_pem.clone(),
        listener: (&link.listener.0, &link.listener.1),
        client: None,
    };
    let session = router::open(&RouterSettings { tls: Some(tls), ..plain(config, listen) }).await?;
    Ok((session, (endpoint, Arc::new(link))))
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
                let version = change.version.filter(|_| !change.is_draft);
                if let (Some(version), Ok(map)) = (version, protos::Name::new(change.map.as_str())) {
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
