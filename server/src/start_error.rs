//! Why a server does not start.

use crate::{
    bus::BusError,
    store::{OpenError, PostgresError},
};
use std::net::SocketAddr;

/// Why the server did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The database does not open.
    #[error("{0}")]
    Store(String),
    /// The database cannot be reached.
    #[error("{0}")]
    StoreAway(String),
    /// Robots cannot connect.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// There is no certificate.
    #[error("no certificate for encryption: {0}")]
    Certificates(String),
    /// The server has no name.
    #[error("{0}")]
    Name(String),
    /// There is no token for this machine.
    #[error("{0}")]
    LocalToken(String),
    /// The system gives no threads.
    #[error("no threads for the workers: {0}")]
    Threads(#[source] std::io::Error),
    /// The address cannot be listened on.
    #[error("cannot listen on {addr}: {source}")]
    Http {
        /// The option of `waymark serve` that names it.
        option: &'static str,
        /// The address asked for.
        addr: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
}

impl StartError {
    /// The option of `waymark serve` that names an address that another program has.
    pub fn taken_address(&self) -> Option<&'static str> {
        let (option, source) = match self {
            Self::Http { option, source, .. } => (*option, source),
            Self::Bus(BusError::Address { source, .. }) => ("--zenoh", source),
            _ => return None,
        };
        (source.kind() == std::io::ErrorKind::AddrInUse).then_some(option)
    }
}

impl From<OpenError> for StartError {
    fn from(error: OpenError) -> Self {
        let mut text = error.to_string();
        let mut cause = std::error::Error::source(&error);
        while let Some(error) = cause {
            text = format!("{text}: {error}");
            cause = error.source();
        }
        if matches!(error, OpenError::Postgres(PostgresError::Unreachable(_))) {
            Self::StoreAway(text)
        } else {
            Self::Store(text)
        }
    }
}
