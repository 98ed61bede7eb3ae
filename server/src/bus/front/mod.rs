//! Where robots connect. In: TCP connections, with TLS where it is on. Out: each is relayed to a
//! router of this process, which no other program reaches: plain ones to the server's own, those
//! with a certificate to the gate, under the robot's name.
//!
//! zenoh's own listener of TLS reads and writes one stream from two threads at once
//! (eclipse-zenoh/zenoh#2557); this one does not. Handshakes have a deadline and places of their
//! own, a robot has [`LINKS_OF_ROBOT`] connections, and what a connection sends is read before a
//! router gets it ([`inspection`]), at a bounded pace ([`pace`]). What a router would keep for ever
//! is bounded ([`lasting`]).

mod admission;
mod inspection;
mod lasting;
mod pace;
mod refusal;
mod relay;
#[cfg(test)]
mod tests;
mod to_gate;

pub(super) use admission::Admission;
pub(super) use lasting::Lasting;
pub(crate) use refusal::advice;
pub(super) use to_gate::ToGate;

use super::{BusError, router::SPARE_SESSIONS};
use crate::accepting::{Bounds, Place, Shares, accept_each};
use engine::{
    live::LiveHub,
    robot_activity::{Input, Refused},
};
use lasting::{InterestKeys, Peer};
use protos::Name;
use refusal::Refusal;
use relay::{End, ToRouter, relay};
use std::{
    collections::BTreeMap,
    net::{IpAddr, SocketAddr},
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};
use tokio::{
    io::{AsyncRead, AsyncWrite, AsyncWriteExt as _},
    net::{TcpListener, TcpStream, UnixStream},
    sync::{Semaphore, watch},
    task::{JoinHandle, JoinSet},
    time::timeout,
};

/// Handshakes at once: of all, and of one address.
const HANDSHAKES: Bounds = Bounds { all: 4096, of_address: 2048 };
/// Longest handshake.
const HANDSHAKE: Duration = Duration::from_secs(10);
/// Connections of one robot: its programs, and one that ends while the next begins.
pub(crate) const LINKS_OF_ROBOT: usize = 16;
/// How often the same refusal of the same address is in the log.
const TELL_EVERY: Duration = Duration::from_mins(1);
/// Refusals that are remembered for that. Further ones are told each time.
const TOLD: usize = 1024;
/// Time that connections have to end in order.
const STOP_GRACE: Duration = Duration::from_secs(3);

/// Where connections lead.
pub(super) enum Destination {
    /// To the server's own router, whoever it is.
    Plain(PathBuf, Arc<Lasting>),
    /// To the gate, where the client's certificate is a robot's.
    Certified(Arc<Admission>, ToGate),
}

/// A listener at work.
pub(super) struct Front {
    stop: watch::Sender<bool>,
    task: JoinHandle<()>,
}

/// What all connections of a listener share.
struct Connections {
    way: Destination,
    places: Arc<Semaphore>,
    of_robot: Arc<Shares<Name>>,
    /// Where refusals of robots are counted.
    live: Arc<LiveHub>,
    /// Those of addresses that the log was told of.
    told: Mutex<BTreeMap<(IpAddr, &'static str), Instant>>,
}

/// A socket of the address of an endpoint, and the endpoint with its real port.
pub(super) async fn bind(endpoint: &str) -> Result<(TcpListener, String), BusError> {
    let fault = |source| BusError::Address { endpoint: endpoint.to_owned(), source };
    let none = || fault(std::io::Error::other("it is no endpoint"));
    let (protocol, address) = endpoint.split_once('/').ok_or_else(none)?;
    let listener = TcpListener::bind(address).await.map_err(fault)?;
    let port = listener.local_addr().map_err(fault)?.port();
    let real = match address.strip_suffix(":0") {
        Some(host) => format!("{protocol}/{host}:{port}"),
        None => endpoint.to_owned(),
    };
    Ok((listener, real))
}

impl Front {
    /// Takes connections from now on; at most `robots`, and some to spare.
    pub(super) fn open(listener: TcpListener, way: Destination, robots: usize, live: Arc<LiveHub>) -> Self {
        let connections = Arc::new(Connections {
            way,
            places: Arc::new(Semaphore::new(robots + SPARE_SESSIONS)),
            of_robot: Arc::default(),
            live,
            told: Mutex::default(),
        });
        let (stop, stopping) = watch::channel(false);
        let task = tokio::spawn(async move {
            let mut open = JoinSet::new();
            accept_each(&listener, HANDSHAKES, stopping, |stream, peer, place| {
                while open.try_join_next().is_some() {}
                open.spawn(connections.clone().connection(stream, peer, place));
            })
            .await;
            drop(listener);
            // The routers close their sessions next; what is left after that is cut.
            drop(timeout(STOP_GRACE, async { while open.join_next().await.is_some() {} }).await);
        });
        Self { stop, task }
    }

    /// Takes no connection any more. Those that are open end with their routers.
    pub(super) fn stop(&self) {
        self.stop.send_replace(true);
    }

    /// Waits until all have ended, which they do three seconds after [`Front::stop`] at the latest.
    pub(super) async fn ended(self) {
        if let Err(error) = self.task.await {
            tracing::error!(%error, "front_panicked");
        }
    }
}

/// Closes an encrypted connection, and reads what was on the way: the client can tell this end from
/// a certificate that is not believed.
async fn end_in_order(mut stream: impl AsyncRead + AsyncWrite + Unpin) {
    let ended = async {
        stream.shutdown().await?;
        tokio::io::copy(&mut stream, &mut tokio::io::sink()).await
    };
    drop(timeout(STOP_GRACE, ended).await);
}

impl Connections {
    async fn connection(self: Arc<Self>, stream: TcpStream, peer: SocketAddr, place: Place) {
        match &self.way {
            Destination::Plain(router, lasting) => {
                // One that sends nothing takes no place of a robot.
                match timeout(HANDSHAKE, stream.peek(&mut [0])).await {
                    Ok(Ok(1)) => {}
                    Ok(_) => return,
                    Err(_) => return self.refused(None, peer, &Refusal::Silent),
                }
                let router = match timeout(HANDSHAKE, UnixStream::connect(router)).await {
                    Ok(Ok(router)) => router,
                    failed => return tracing::error!(?failed, "router_not_reached"),
                };
                drop(place);
                let (read, write) = router.into_split();
                let interests = lasting.of(Peer::Address(peer.ip()));
                self.relayed(None, peer, stream, ToRouter { read, write }, interests).await;
            }
            Destination::Certified(admission, gate) => {
                let handshake = admission.acceptor().accept(stream);
                let stream = match timeout(HANDSHAKE, handshake).await {
                    Ok(Ok(stream)) => stream,
                    Ok(Err(error)) => {
                        return self.refused(None, peer, &Refusal::NoHandshake(error.to_string()));
                    }
                    Err(_) => {
                        let why = format!("it is not complete after {} s", HANDSHAKE.as_secs());
                        return self.refused(None, peer, &Refusal::NoHandshake(why));
                    }
                };
                drop(place);
                let certificate = stream.get_ref().1.peer_certificates().and_then(<[_]>::first);
                let admitted = match admission.admit(certificate.map_or(&[], |certificate| certificate)) {
                    Ok(admitted) => admitted,
                    Err(error) => {
                        self.refused(None, peer, &error.into());
                        return end_in_order(stream).await;
                    }
                };
                let robot = &admitted.robot;
                let Some(_share) = self.of_robot.take(robot.clone(), LINKS_OF_ROBOT) else {
                    self.refused(Some(robot), peer, &Refusal::ManyOfRobot);
                    return end_in_order(stream).await;
                };
                let mut at_gate = match gate.connect(robot).await {
                    Ok(at_gate) => at_gate,
                    Err(error) => return tracing::error!(%error, %robot, "gate_not_reached"),
                };
                let interests = at_gate.lasting.of(Peer::Robot(robot.clone()));
                let ToRouter { read, write } = &mut at_gate.ends;
                tokio::select! {
                    () = self.relayed(Some(robot), peer, stream, ToRouter { read, write }, interests) => {}
                    why = admission.lapse(&admitted) => {
                        self.refused(Some(robot), peer, &Refusal::CertificateEnded(why));
                    }
                }
            }
        }
    }

    /// Relays until it ends, if there is a place.
    async fn relayed<R: AsyncRead + Unpin, W: AsyncWrite + Unpin>(
        &self,
        robot: Option<&Name>,
        peer: SocketAddr,
        stream: impl AsyncRead + AsyncWrite + Unpin,
        router: ToRouter<R, W>,
        interests: Arc<InterestKeys>,
    ) {
        let Ok(_place) = self.places.clone().try_acquire_owned() else {
            return self.refused(robot, peer, &Refusal::NoPlace);
        };
        match relay(stream, router, interests).await {
            End::Closed(error) => {
                let robot = robot.map(Name::as_str);
                tracing::debug!(%error, robot, %peer, "robot_connection_closed");
            }
            End::Violation(violation) => self.refused(robot, peer, &violation.into()),
        }
    }

    /// Counts it for the robot, or tells the log of an address, once in a while for each reason.
    fn refused(&self, robot: Option<&Name>, peer: SocketAddr, refusal: &Refusal) {
        let (code, detail, now) = (refusal.word(), refusal.to_string(), Instant::now());
        if let Some(robot) = robot {
            let refused = Refused { code, field: "connection", detail: &detail };
            return self.live.refused(robot, Input::Connection, refused, now);
        }
        let ip = peer.ip();
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        told.retain(|_, at| now.duration_since(*at) < TELL_EVERY);
        if told.contains_key(&(ip, code)) {
            return tracing::debug!(%ip, code, detail, "robot_connection_refused");
        }
        tracing::warn!(%ip, code, detail, follows = advice(code), "robot_connection_refused");
        if told.len() < TOLD {
            told.insert((ip, code), now);
        }
    }
}
