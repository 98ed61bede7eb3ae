//! Whom a request came from, as its connection tells.

use std::net::SocketAddr;

/// Whoever holds the other end of the connection.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peer {
    pub(crate) addr: SocketAddr,
    pub(crate) is_encrypted: bool,
}

impl Peer {
    /// One that speaks plain text.
    pub(crate) fn plain(addr: SocketAddr) -> Self {
        Self { addr, is_encrypted: false }
    }
}
