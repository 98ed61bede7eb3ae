//! The way from the front to the gate, inside the machine: QUIC on loopback, whose both ends are sound under load, with a
//! certificate of the robot's name that is made for each connection and known to the gate alone.
//!
//! Of zenoh's QUIC links this uses that the protocol `zenoh` has one stream, which the client opens, framed as TLS is.

use super::{lasting::Lasting, relay::ToRouter};
use crate::identity::certificates::LinkCertificates;
use protos::Name;
use quinn::{
    ClientConfig, Connection, Endpoint, RecvStream, SendStream, TransportConfig, VarInt,
    crypto::rustls::QuicClientConfig,
};
use std::{
    io,
    net::{Ipv4Addr, SocketAddr},
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};
use tokio::sync::watch;

/// zenoh's protocol with one stream.
const PROTOCOL: &[u8] = b"zenoh";
/// Longest wait for a gate that opens again, and for its handshake.
const LONGEST: Duration = Duration::from_secs(10);
/// What the gate may have sent and the robot not taken, in bytes: more would only be older.
const WINDOW: u32 = 256 << 10;

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
        Ok(Self {
            endpoint: Endpoint::client((Ipv4Addr::LOCALHOST, 0).into())?,
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
        let mut config = ClientConfig::new(Arc::new(crypto));
        config.transport_config(Arc::new(transport));
        Ok(config)
    }
}
