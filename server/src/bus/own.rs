//! The server's own routers and the listeners before them. In: the settings. Out: a router that
//! hears robots, on a socket that no other program reaches; the front; with encryption, the gate
//! between the two.

use super::{
    BusError, Receivers, close,
    front::{self, Admission, Destination, Front, Lasting, ToGate},
    gate::{Gate, GateSettings},
    router::{self, RouterSettings},
};
use crate::{
    config::{Config, Middleware, Ros2Robot},
    identity::certificates::{Certificates, LinkCertificates},
    store::now_ms,
};
use protos::Keys;
use std::{path::PathBuf, sync::Arc};
use tempfile::TempDir;
use tokio::{net::TcpListener, sync::watch};

/// The sockets at which robots will connect. They are taken before all else: an address that
/// another program has is told at once.
#[derive(Debug, Default)]
pub(crate) struct Sockets {
    /// With the endpoint and its real port; none where the server joins a router.
    robots: Option<(TcpListener, String)>,
    /// Plain, for programs of this machine, where robots connect encrypted.
    local: Option<TcpListener>,
}

impl Sockets {
    /// Takes the addresses of the settings.
    pub(crate) async fn take(config: &Config) -> Result<Self, BusError> {
        if config.router.is_some() {
            return Ok(Self::default());
        }
        let (listener, endpoint) = front::bind(&config.zenoh_endpoint).await?;
        let asked = config.tls.as_ref().and_then(|tls| tls.local_zenoh.as_deref());
        let local = match asked.filter(|_| endpoint.starts_with("tls/")) {
            Some(asked) => Some(front::bind(asked).await?.0),
            None => None,
        };
        Ok(Self { robots: Some((listener, endpoint)), local })
    }
}

/// The server's own router, and the sockets at which robots will connect.
pub(super) struct OwnRouter {
    pub(super) session: zenoh::Session,
    /// Where robots connect, with the real port.
    pub(super) endpoint: String,
    socket: Socket,
    /// At `endpoint`.
    listener: TcpListener,
    /// Plain, for programs of this machine, where `endpoint` is encrypted.
    local: Option<TcpListener>,
    certificates: Option<Arc<Certificates>>,
}

/// The socket of the server's own router, in a folder that nobody else can enter.
struct Socket(TempDir);

/// Listeners at work, and the gate behind them.
pub(super) struct Doors {
    fronts: Vec<Front>,
    gate: Option<Gate>,
    _socket: Socket,
}

impl Socket {
    fn new() -> Result<Self, BusError> {
        let made = tempfile::Builder::new().prefix("waymark-").tempdir();
        let fault = |e: std::io::Error| BusError::Listen {
            endpoint: std::env::temp_dir().display().to_string(),
            detail: format!("no folder for a socket: {e}. Set TMPDIR to a folder that can be written"),
        };
        made.map(Self).map_err(fault)
    }

    fn path(&self) -> PathBuf {
        self.0.path().join("router")
    }

    fn endpoint(&self) -> String {
        format!("unixsock-stream/{}", self.path().display())
    }
}

impl OwnRouter {
    pub(super) async fn open(
        config: &Config,
        sockets: Sockets,
        certificates: Option<Arc<Certificates>>,
    ) -> Result<Self, BusError> {
        let Sockets { robots, local } = sockets;
        let (listener, endpoint) = match robots {
            Some(taken) => taken,
            None => front::bind(&config.zenoh_endpoint).await?,
        };
        let certificates = certificates.filter(|_| endpoint.starts_with("tls/"));
        let socket = Socket::new()?;
        let (robots, frame_bytes) = (config.limits.robots, config.limits.frame_bytes);
        let listen = vec![socket.endpoint()];
        let settings = RouterSettings { listen, connect: None, tls: None, access: None, robots, frame_bytes };
        let session = router::open(&settings).await?;
        Ok(Self { session, endpoint, socket, listener, local, certificates })
    }

    /// Where the server asks itself: as a robot would, where it needs no certificate.
    pub(super) fn ping_endpoint(&self) -> String {
        if self.certificates.is_some() { self.socket.endpoint() } else { self.endpoint.clone() }
    }

    /// Robots may connect from now on.
    pub(super) async fn admit(self, config: &Config, keys: Keys, to: &Receivers) -> Result<Doors, BusError> {
        let (robots, path) = (config.limits.robots, self.socket.path());
        let lasting = Arc::new(Lasting::default());
        let way = || Destination::Plain(path.clone(), lasting.clone());
        let plain = |listener| Front::open(listener, way(), robots, to.live.clone());
        let Some(certificates) = self.certificates else {
            return Ok(Doors { fronts: vec![plain(self.listener)], gate: None, _socket: self.socket });
        };
        warn_of_ros2(&config.ros2);
        let fault = |detail: String| BusError::Listen { endpoint: self.endpoint.clone(), detail };
        let link = Arc::new(LinkCertificates::new(now_ms()).map_err(|e| fault(e.to_string()))?);
        let registry = to.certificates.clone().unwrap_or_default();
        let snapshots = to.intake.snapshots.clone();
        let admission = Admission::new(certificates.clone(), registry.clone(), snapshots.clone());
        let admission = Arc::new(admission.map_err(|e| fault(e.to_string()))?);
        let (listens, gate_at) = watch::channel(None);
        let to_gate = ToGate::new(link.clone(), gate_at).map_err(|e| fault(e.to_string()))?;
        let settings = GateSettings {
            inner: self.socket.endpoint(),
            link,
            keys,
            certificates,
            registry,
            admission: admission.clone(),
            snapshots,
            ros2: config.ros2.clone(),
            robots,
            frame_bytes: config.limits.frame_bytes,
            listens,
        };
        let gate = Gate::open(settings, to.vitals.begin("the task that admits robots")).await?;
        let mut fronts: Vec<Front> = self.local.into_iter().map(plain).collect();
        fronts.push(Front::open(
            self.listener,
            Destination::Certified(admission, to_gate),
            robots,
            to.live.clone(),
        ));
        Ok(Doors { fronts, gate: Some(gate), _socket: self.socket })
    }
}

impl Doors {
    /// Takes no connection any more, and closes the routers.
    pub(super) async fn close(self, session: &zenoh::Session) {
        for front in &self.fronts {
            front.stop();
        }
        if let Some(gate) = self.gate {
            gate.close().await;
        }
        close(session).await;
        for front in self.fronts {
            front.ended().await;
        }
    }
}

/// Robots of ROS that access control does not let through.
fn warn_of_ros2(robots: &[Ros2Robot]) {
    for Ros2Robot { robot, middleware, .. } in robots.iter().filter(|robot| robot.own_prefix().is_none()) {
        let follows = "with a certificate it is never heard: give it a `key_prefix`";
        tracing::warn!(%robot, ?middleware, follows, "ros2_robot_without_prefix");
    }
    for Ros2Robot { robot, .. } in robots.iter().filter(|robot| robot.middleware == Middleware::BridgeDds) {
        let follows =
            "with a certificate it is never heard: its bridge declares its graph outside of its prefix";
        tracing::warn!(%robot, follows, "ros2_bridge_in_plain_text_only");
    }
}
