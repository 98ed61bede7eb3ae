//! The encrypted end of a program that connects to a zenoh router. In: where the router listens,
//! and certificates. Out: a socket of this process that zenoh connects to; what goes through it
//! travels encrypted.
//!
//! zenoh's own links of TLS read and write one stream from two threads at once, which can end the
//! process under load (eclipse-zenoh/zenoh#2557). Here each connection is relayed by one task,
//! through tokio-rustls.
#![cfg(unix)]

use rustls::{
    ClientConfig, RootCertStore,
    crypto::ring,
    pki_types::{CertificateDer, PrivateKeyDer, ServerName, pem::PemObject as _},
};
use std::{
    io,
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};
use tempfile::TempDir;
use tokio::{
    io::{AsyncWriteExt as _, copy_bidirectional_with_sizes},
    net::{TcpStream, UnixListener, UnixStream},
    sync::watch,
    task::{JoinHandle, JoinSet},
    time::timeout,
};
use tokio_rustls::TlsConnector;

/// Longest time in which a connection is made.
const CONNECT: Duration = Duration::from_secs(10);
/// Longest wait for what was sent last.
const LINGER: Duration = Duration::from_secs(1);
/// Pause after a failed accept: too many open files.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// Largest part that is read at once, in bytes: a batch of zenoh.
const PART: usize = 64 << 10;

/// Who the program is, and whom it believes, PEM.
#[derive(Clone)]
pub struct Credentials {
    /// The program's certificate.
    pub certificate: Vec<u8>,
    /// Its private key.
    pub key: Vec<u8>,
    /// Authorities of the other end, besides those that browsers know.
    pub authority: Vec<u8>,
}

impl std::fmt::Debug for Credentials {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Credentials").finish_non_exhaustive()
    }
}

/// A socket of this process whose connections lead to a router. Dropped, it takes no further ones;
/// those that are open end with zenoh's ends of them.
#[derive(Debug)]
pub struct EncryptedLink {
    folder: TempDir,
    stop: watch::Sender<bool>,
    task: JoinHandle<JoinSet<()>>,
    last_end: Arc<Mutex<Option<Ended>>>,
}

/// How a connection ended: in order, by whichever end, or why not.
pub type Ended = Result<(), String>;

/// Where a connection leads.
#[derive(Clone)]
struct Remote {
    address: String,
    name: ServerName<'static>,
    connector: TlsConnector,
}

impl EncryptedLink {
    /// Listens for zenoh, and connects to `address` (`host:port`) for each of its connections.
    /// Needs a runtime of tokio. Errors: a name or PEM text that cannot be used, no folder for the
    /// socket.
    pub fn open(address: &str, credentials: &Credentials) -> io::Result<Self> {
        let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
        let host = host.trim_start_matches('[').trim_end_matches(']').to_owned();
        let name = ServerName::try_from(host).map_err(io::Error::other)?;
        let connector = TlsConnector::from(Arc::new(config(credentials)?));
        let remote = Remote { address: address.to_owned(), name, connector };
        // Of mode 0700: no other user enters.
        let folder = tempfile::Builder::new().prefix("waymark-link-").tempdir()?;
        let listener = UnixListener::bind(folder.path().join(SOCKET))?;
        let last_end = Arc::<Mutex<Option<Ended>>>::default();
        let (stop, stopping) = watch::channel(false);
        let task = tokio::spawn(accept(listener, remote, last_end.clone(), stopping));
        Ok(Self { folder, stop, task, last_end })
    }

    /// What zenoh connects to.
    pub fn endpoint(&self) -> String {
        format!("unixsock-stream/{}", self.folder.path().join(SOCKET).display())
    }

    /// How the last connection that ended did: a router that does not believe the certificate says
    /// so in the error; one that knows it and does not admit its holder closes in order.
    pub fn last_end(&self) -> Option<Ended> {
        self.last_end.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits until what zenoh has sent before it closed its ends has left, a second at most.
    pub async fn close(self) {
        self.stop.send_replace(true);
        let ended = async {
            if let Ok(mut open) = self.task.await {
                while open.join_next().await.is_some() {}
            }
        };
        drop(timeout(LINGER, ended).await);
    }
}

const SOCKET: &str = "router";

fn config(credentials: &Credentials) -> io::Result<ClientConfig> {
    let mut roots = RootCertStore { roots: webpki_roots::TLS_SERVER_ROOTS.to_vec() };
    for authority in CertificateDer::pem_slice_iter(&credentials.authority) {
        roots.add(authority.map_err(io::Error::other)?).map_err(io::Error::other)?;
    }
    let chain: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&credentials.certificate).collect();
    let key = PrivateKeyDer::from_pem_slice(&credentials.key).map_err(io::Error::other)?;
    let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let builder = builder.with_safe_default_protocol_versions().map_err(io::Error::other)?;
    let builder = builder.with_root_certificates(roots);
    builder.with_client_auth_cert(chain.map_err(io::Error::other)?, key).map_err(io::Error::other)
}

/// Until `stopping` is true or its sender is gone. The connections that are open then.
async fn accept(
    listener: UnixListener,
    remote: Remote,
    last_end: Arc<Mutex<Option<Ended>>>,
    mut stopping: watch::Receiver<bool>,
) -> JoinSet<()> {
    let mut open = JoinSet::new();
    loop {
        while open.try_join_next().is_some() {}
        let accepted = tokio::select! {
            stopped = stopping.wait_for(|stop| *stop) => {
                if stopped.is_err() {
                    open.detach_all();
                }
                return open;
            }
            accepted = listener.accept() => accepted,
        };
        match accepted {
            Ok((zenoh, _)) => {
                let (remote, last_end) = (remote.clone(), last_end.clone());
                open.spawn(async move {
                    let ended = remote.relay(zenoh).await.map_err(|error| error.to_string());
                    *last_end.lock().unwrap_or_else(PoisonError::into_inner) = Some(ended);
                });
            }
            Err(_) => tokio::time::sleep(ACCEPT_PAUSE).await,
        }
    }
}

impl Remote {
    async fn relay(&self, mut zenoh: UnixStream) -> io::Result<()> {
        let connected = async {
            let stream = TcpStream::connect(&self.address).await?;
            stream.set_nodelay(true)?;
            self.connector.connect(self.name.clone(), stream).await
        };
        let mut router = timeout(CONNECT, connected).await??;
        let ended = copy_bidirectional_with_sizes(&mut zenoh, &mut router, PART, PART).await;
        drop(router.shutdown().await);
        ended.map(|_| ())
    }
}
