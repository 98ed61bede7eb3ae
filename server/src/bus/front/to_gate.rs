//! The way from the front to the gate, inside the machine: QUIC on loopback, whose both ends are
//! sound under load, with a certificate of the robot's name that is made for each connection and
//! known to the gate alone.
//!
//! Both ends have one socket for all robots, and what finds it full is lost. A window that shrinks
//! by such losses would starve a robot while the processors are busy: in this direction it is small
//! and fixed, in the other the socket is large.
//!
//! Of zenoh's QUIC links this uses that the protocol `zenoh` has one stream, which the client
//! opens, framed as TLS is.

use super::{lasting::Lasting, relay::ToRouter};
use crate::identity::certificates::LinkCertificates;
use protos::Name;
use quinn::{
    ClientConfig, Connection, Endpoint, EndpointConfig, RecvStream, SendStream, TokioRuntime,
    TransportConfig, VarInt,
    congestion::{Controller, ControllerFactory},
    crypto::rustls::QuicClientConfig,
};
use rustix::net::sockopt::set_socket_recv_buffer_size;
use std::{
    any::Any,
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};
use tokio::sync::watch;

/// zenoh's protocol with one stream.
const PROTOCOL: &[u8] = b"zenoh";
/// Longest wait for a gate that opens again, and for its handshake.
const LONGEST: Duration = Duration::from_secs(10);
/// What the gate may have sent and the robot not taken, in bytes: more would only be older.
const WINDOW: u32 = 256 << 10;
/// What is on the way to the gate at most, in bytes of one robot: less than a socket of Linux takes
/// by default.
const ON_THE_WAY: u64 = 64 << 10;
/// Room for what is on the way from the gate, in bytes of all robots, if the system gives it.
const RECEIVED: usize = 4 << 20;

/// A window that losses do not shrink: on loopback a loss means a full socket, not a slow network.
#[derive(Debug, Clone)]
struct FixedWindow;

impl Controller for FixedWindow {
    fn on_congestion_event(&mut self, _: Instant, _: Instant, _: bool, _: u64) {}

    fn on_mtu_update(&mut self, _: u16) {}

    fn window(&self) -> u64 {
        ON_THE_WAY
    }

    fn clone_box(&self) -> Box<dyn Controller> {
        Box::new(Self)
    }

    fn initial_window(&self) -> u64 {
        ON_THE_WAY
    }

    fn into_any(self: Box<Self>) -> Box<dyn Any> {
        self
    }
}

impl ControllerFactory for FixedWindow {
    fn build(self: Arc<Self>, _: Instant, _: u16) -> Box<dyn Controller> {
        Box::new(Self)
    }
}

/// Connects robots with the gate.
pub(in crate::bus) struct ToGate {
    endpoint: Endpoint,
    link: Arc<LinkCertificates>,
    gate: watch::Receiver<Option<SocketAddr>>,
    /// What the gate keeps that listens there. Each one has an address of its own.
    lasting: Mutex<(Option<SocketAddr>, Arc<Lasting>)>,
}

/// A connection to the gate. Dropping it closes it.
pub(super) struct AtGate {
    connection: Connection,
    pub(super) ends: ToRouter<RecvStream, SendStream>,
    pub(super) lasting: Arc<Lasting>,
}

impl Drop for AtGate {
    fn drop(&mut self) {
        self.connection.close(VarInt::from_u32(0), b"");
    }
}

impl ToGate {
    /// `gate`: where it listens now, on loopback.
    pub(in crate::bus) fn new(
        link: Arc<LinkCertificates>,
        gate: watch::Receiver<Option<SocketAddr>>,
    ) -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        // With less room, more is sent twice.
        set_socket_recv_buffer_size(&socket, RECEIVED).unwrap_or_default();
        Ok(Self {
            endpoint: Endpoint::new(EndpointConfig::default(), None, socket, Arc::new(TokioRuntime))?,
            link,
            gate,
            lasting: Mutex::default(),
        })
    }

    /// A connection that the gate takes for the robot's.
    pub(super) async fn connect(&self, robot: &Name) -> io::Result<AtGate> {
        let mut gate = self.gate.clone();
        let connected = async {
            let at = *gate.wait_for(Option::is_some).await.map_err(io::Error::other)?;
            let at = at.ok_or(io::ErrorKind::NotConnected)?;
            let connecting = self.endpoint.connect_with(self.config(robot)?, at, LinkCertificates::HOST);
            let connection = connecting.map_err(io::Error::other)?.await?;
            let (write, read) = connection.open_bi().await?;
            Ok(AtGate { connection, ends: ToRouter { read, write }, lasting: self.lasting_of(at) })
        };
        tokio::time::timeout(LONGEST, connected).await?
    }

    fn lasting_of(&self, gate: SocketAddr) -> Arc<Lasting> {
        let mut lasting = self.lasting.lock().unwrap_or_else(PoisonError::into_inner);
        if lasting.0 != Some(gate) {
            *lasting = (Some(gate), Arc::default());
        }
        lasting.1.clone()
    }

    fn config(&self, robot: &Name) -> io::Result<ClientConfig> {
        let crypto =
            QuicClientConfig::try_from(self.link.client(robot.as_str(), PROTOCOL).map_err(io::Error::other)?);
        let crypto = crypto.map_err(io::Error::other)?;
        let mut transport = TransportConfig::default();
        transport.stream_receive_window(VarInt::from_u32(WINDOW));
        transport.congestion_controller_factory(Arc::new(FixedWindow));
        let mut config = ClientConfig::new(Arc::new(crypto));
        config.transport_config(Arc::new(transport));
        Ok(config)
    }
}
