//! A router of the operator that the server joins as a client. In: endpoints and credentials. Out:
//! a session that hears robots, for as long as the server runs; the tokens by which servers know
//! each other.
//!
//! The connection is made on a task of its own and tried for ever: HTTP does not wait for it. zenoh
//! makes a lost one again by itself, with subscriptions and tokens.

use super::{
    BusError, Outbox, Receivers, caught,
    receiving::Receiving,
    router::{self, client_config},
};
use crate::{config::JoinedRouter, fleet::Fleet};
use engine::{decode::ImageLimits, vitals::Pulse};
use link::{Credentials, EncryptedLink};
use protos::{Key, Keys, ServerToken};
use std::{
    collections::{BTreeMap, btree_map::Entry},
    fs,
    path::Path,
    sync::{Arc, OnceLock},
    time::{Duration, Instant},
};
use tokio::{sync::watch, task::JoinHandle};
use zenoh::{
    Session,
    liveliness::LivelinessToken,
    sample::{Sample, SampleKind},
};

/// Largest file of a certificate, key or authority, in bytes.
const MAX_PEM_BYTES: u64 = 1 << 20;
/// First and longest time between two attempts.
const RETRY: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(4));
/// How often the state of the connection and of the other servers is looked at.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// How often a failed attempt is in the log.
const TELL_EVERY: Duration = Duration::from_mins(1);

/// What a connection rests on.
pub(super) struct JoinSettings {
    router: JoinedRouter,
    /// Where zenoh connects in place of the router's encrypted endpoints.
    links: Vec<EncryptedLink>,
    keys: Keys,
    pixels: ImageLimits,
    frame_bytes: usize,
}

/// The task that keeps the connection.
pub(super) struct Join {
    task: JoinHandle<Option<Announced>>,
    stop: watch::Sender<bool>,
}

/// A session that hears robots no longer, while others still know of the server: what is queued is
/// sent first.
pub(super) struct Announced {
    pub(super) session: Session,
    // Held: dropping them withdraws them.
    _tokens: BTreeMap<ServerToken, LivelinessToken>,
}

impl JoinSettings {
    /// Reads the files. Needs a runtime.
    pub(super) fn read(router: &JoinedRouter, keys: Keys, pixels: ImageLimits) -> Result<Self, BusError> {
        let mut links = Vec::new();
        if let Some(files) = &router.credentials {
            let credentials = Credentials {
                certificate: pem("router.certificate", &files.certificate)?,
                key: pem("router.key", &files.key)?,
                authority: pem("router.authority", &files.authority)?,
            };
            for endpoint in &router.connect {
                let address = endpoint.strip_prefix("tls/").unwrap_or(endpoint);
                links.push(
                    EncryptedLink::open(address, &credentials)
                        .map_err(|e| BusError::Join { endpoints: endpoint.clone(), detail: e.to_string() })?,
                );
            }
        }
        Ok(Self { router: router.clone(), links, keys, pixels, frame_bytes: pixels.bytes })
    }

    async fn connect(&self) -> Result<Session, BusError> {
        let mut through: Vec<String> = self.links.iter().map(EncryptedLink::endpoint).collect();
        if through.is_empty() {
            through.clone_from(&self.router.connect);
        }
        let endpoints = self.router.connect.join(", ");
        let opened = router::opened(&endpoints, client_config(&through, self.frame_bytes)).await;
        opened.map_err(|error| match self.links.iter().find_map(|link| link.last_end()?.err()) {
            Some(detail) => BusError::Join { endpoints, detail },
            None => error,
        })
    }
}

fn pem(field: &'static str, path: &Path) -> Result<Vec<u8>, BusError> {
    let fault = |detail: String| BusError::File { field, path: path.to_owned(), detail };
    let size = fs::metadata(path).map_err(|e| fault(e.to_string()))?.len();
    if size > MAX_PEM_BYTES {
        return Err(fault(format!("more than {MAX_PEM_BYTES} bytes")));
    }
    let text = fs::read_to_string(path).map_err(|e| fault(e.to_string()))?;
    if text.contains("-----BEGIN ") { Ok(text.into_bytes()) } else { Err(fault("it is not PEM".into())) }
}

impl Join {
    /// Connects from now on, and puts the session into `cell`.
    pub(super) fn start(
        settings: JoinSettings,
        (to, outbox): (Receivers, Outbox),
        fleet: Arc<Fleet>,
        cell: Arc<OnceLock<Session>>,
        pulse: Pulse,
    ) -> Self {
        let (stop, mut stopping) = watch::channel(false);
        let task = tokio::spawn(async move {
            let session = tokio::select! {
                _ = stopping.wait_for(|stop| *stop) => {
                    pulse.end();
                    return None;
                }
                session = connected(&settings) => session,
            };
            cell.get_or_init(|| session.clone());
            let kept = keep(session, &settings, (&to, &outbox), &fleet, stopping).await;
            match kept {
                Ok(announced) => {
                    pulse.end();
                    Some(announced)
                }
                Err(error) => {
                    // The pulse ends untold: the server stops, and is started again.
                    tracing::error!(%error, "router_not_joined");
                    None
                }
            }
        });
        Self { task, stop }
    }

    /// Stops hearing robots; gives the session, on which queued messages still go.
    pub(super) async fn end(self) -> Option<Announced> {
        self.stop.send_replace(true);
        self.task.await.unwrap_or_else(|error| {
            tracing::error!(%error, "join_panicked");
            None
        })
    }
}

/// Tries until there is a session.
async fn connected(settings: &JoinSettings) -> Session {
    let (mut wait, mut told) = (RETRY.0, None::<Instant>);
    loop {
        match settings.connect().await {
            Ok(session) => return session,
            Err(error) if told.is_none_or(|told| told.elapsed() >= TELL_EVERY) => {
                tracing::warn!(%error, follows = "it is tried again; robots are not heard meanwhile", "router_unreachable");
                told = Some(Instant::now());
            }
            Err(error) => tracing::debug!(%error, "router_unreachable"),
        }
        tokio::time::sleep(wait).await;
        wait = (wait * 2).min(RETRY.1);
    }
}

/// Hears robots and other servers, and announces what this one has, until it stops.
async fn keep(
    session: Session,
    settings: &JoinSettings,
    to: (&Receivers, &Outbox),
    fleet: &Arc<Fleet>,
    mut stopping: watch::Receiver<bool>,
) -> Result<Announced, BusError> {
    let declared = |action| move |e: zenoh::Error| BusError::Declare { action, detail: e.to_string() };
    let hear = {
        let (keys, fleet) = (settings.keys.clone(), fleet.clone());
        move |sample: Sample| {
            if let Ok(Key::Server(server, token)) = keys.parse(sample.key_expr().as_str()) {
                fleet.hear(&server, token, sample.kind() == SampleKind::Put);
            }
        }
    };
    let others = session
        .liveliness()
        .declare_subscriber(settings.keys.all_server_tokens())
        .history(true)
        .callback(caught(&to.0.vitals, "a token of a server", hear))
        .await
        .map_err(declared("watch other servers"))?;
    let receiving = Receiving::start(session.clone(), &settings.keys, to, settings.pixels).await?;
    let mut shown = BTreeMap::<ServerToken, LivelinessToken>::new();
    loop {
        let is_connected = session.info().routers_zid().await.next().is_some();
        let wanted = fleet.step(is_connected, Instant::now());
        // What is no longer true goes first.
        let ended: Vec<ServerToken> =
            shown.keys().filter(|token| !wanted.contains(*token)).cloned().collect();
        for token in ended {
            if let Some(Err(error)) = undeclared(shown.remove(&token)).await {
                tracing::warn!(%error, ?token, "zenoh_undeclare_failed");
            }
        }
        for token in wanted {
            if let Entry::Vacant(place) = shown.entry(token) {
                let token = place.key();
                let key = settings.keys.build(&Key::Server(to.0.server.clone(), token.clone()));
                let made = session.liveliness().declare_token(key).await;
                place.insert(made.map_err(declared("announce the server"))?);
            }
        }
        tokio::select! {
            _ = stopping.wait_for(|stop| *stop) => break,
            () = tokio::time::sleep(LOOK_EVERY) => {}
        }
    }
    let session = receiving.end().await;
    drop(others);
    Ok(Announced { session, _tokens: shown })
}

async fn undeclared(token: Option<LivelinessToken>) -> Option<zenoh::Result<()>> {
    Some(token?.undeclare().await)
}
