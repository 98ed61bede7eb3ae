//! Certificates. In: the settings of encryption and the folder `tls` of the data directory. Out:
//! the server's certificate in use, for HTTP and zenoh, and certificates of robots.

mod acceptor;
mod authority;
mod link;
mod registry;
mod server;
#[cfg(test)]
mod tests;

pub(crate) use acceptor::acceptor;
pub(crate) use authority::{Authority, common_name};
pub(crate) use link::LinkCertificates;
pub(crate) use registry::CertificateRegistry;
pub(crate) use server::ServerCertificate;

use crate::config::Tls;
use std::{
    fmt, fs, io,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tokio::sync::watch;

/// Folder in the data directory.
pub(crate) const FOLDER: &str = "tls";
/// How often files of the operator's own are read again, and the time left is looked at.
const CHECK_EVERY: Duration = Duration::from_hours(1);

/// Why there is no certificate. The text names the file.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CertificateError {
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// Which.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file is not what it should be.
    #[error("{path} cannot be used: {reason}")]
    Bad {
        /// Which.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The authority has lost its key.
    #[error(
        "{certificate} is there without {key}: put the key back, or remove the folder to make a new authority, which no \
         enrolled robot knows"
    )]
    NoKey {
        /// The authority.
        certificate: PathBuf,
        /// What is missing.
        key: PathBuf,
    },
    /// A request for a certificate that cannot be signed.
    #[error("the request for a certificate cannot be signed: {reason}")]
    Request {
        /// What is wrong with it.
        reason: String,
    },
    /// The system gives no random bytes.
    #[error("the system gives no random bytes: {0}")]
    Randomness(String),
}

impl CertificateError {
    fn at(path: &Path) -> impl Fn(io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::File { path: path.clone(), source }
    }

    fn bad(path: &Path) -> impl Fn(rcgen::Error) -> Self {
        let path = path.to_owned();
        move |error| Self::Bad { path: path.clone(), reason: error.to_string() }
    }
}

/// A private key, PEM: shown to nobody but TLS.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct PemKey(pub(crate) String);

impl fmt::Debug for PemKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("…")
    }
}

/// The certificates of a server with encryption.
#[derive(Debug)]
pub(crate) struct Certificates {
    settings: Tls,
    authority: Authority,
    current: watch::Sender<Arc<ServerCertificate>>,
}

impl Certificates {
    /// Loads or makes the authority, and the server's certificate.
    pub(crate) fn open(settings: &Tls, data: &Path, now_ms: i64) -> Result<Self, CertificateError> {
        // Once for the process; a program that embeds the server may have installed its own.
        drop(rustls::crypto::ring::default_provider().install_default());
        let authority = Authority::load_or_create(&data.join(FOLDER), now_ms)?;
        let first = certificate(settings, &authority, now_ms)?;
        Ok(Self { settings: settings.clone(), authority, current: watch::Sender::new(Arc::new(first)) })
    }

    /// The built-in authority.
    pub(crate) fn authority(&self) -> &Authority {
        &self.authority
    }

    /// The server's certificate in use, and each one that replaces it: listeners take it for new
    /// connections.
    pub(crate) fn current(&self) -> watch::Receiver<Arc<ServerCertificate>> {
        self.current.subscribe()
    }

    /// Authorities of robots' certificates, PEM.
    pub(crate) fn client_authorities_pem(&self) -> Result<String, CertificateError> {
        match &self.settings.client_authority {
            Some(path) => fs::read_to_string(path).map_err(CertificateError::at(path)),
            None => Ok(self.authority.certificate_pem().to_owned()),
        }
    }

    /// Whether the built-in authority signs robots' certificates.
    pub(crate) fn enrols_robots(&self) -> bool {
        self.settings.client_authority.is_none()
    }

    /// Its certificate, if it has signed that of the server.
    pub(crate) fn server_authority_pem(&self) -> Option<&str> {
        self.settings.own.is_none().then(|| self.authority.certificate_pem())
    }

    /// Names and addresses of the settings.
    pub(crate) fn names(&self) -> &[String] {
        &self.settings.names
    }

    /// Renews what is due. Whether there is another certificate now.
    fn renew(&self, now_ms: i64) -> Result<bool, CertificateError> {
        let present = self.current.borrow().clone();
        if present.renew_ms.is_some_and(|due| now_ms < due) {
            return Ok(false);
        }
        let next = certificate(&self.settings, &self.authority, now_ms)?;
        let is_other = next.chain_pem != present.chain_pem || next.key_pem != present.key_pem;
        if is_other {
            self.current.send_replace(Arc::new(next));
        }
        Ok(is_other)
    }

    /// Renews the server's certificate in time, and reads the operator's files again, until the
    /// server stops.
    pub(crate) async fn keep_valid(self: Arc<Self>, mut stopping: watch::Receiver<bool>) {
        loop {
            tokio::select! {
                _ = stopping.wait_for(|stop| *stop) => return,
                () = tokio::time::sleep(CHECK_EVERY) => {}
            }
            match self.renew(now_ms()) {
                Ok(true) => tracing::info!("certificate_renewed"),
                Ok(false) => {}
                Err(error) => {
                    tracing::error!(%error, follows = "the one in use stays", "certificate_not_renewed");
                }
            }
        }
    }
}

fn certificate(
    settings: &Tls,
    authority: &Authority,
    now_ms: i64,
) -> Result<ServerCertificate, CertificateError> {
    match &settings.own {
        Some(files) => ServerCertificate::read(files),
        None => ServerCertificate::issued(authority, &settings.names, now_ms),
    }
}

/// The present, ms since the Unix epoch.
fn now_ms() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as i64)
}
