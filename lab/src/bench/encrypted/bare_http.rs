//! Requests a second of the server and of a bare handler of axum that returns the same bytes, over
//! TLS with kept connections. The client is as small as it can be, so that its own share of the
//! time hides little.

use super::{MAP, Served};
use crate::evaluate::statistics::quantile;
use anyhow::Context as _;
use axum::{Router, body::Bytes, http::header, routing::get, serve::Listener};
use client::MapClient;
use rustls::{
    ClientConfig, RootCertStore, ServerConfig,
    crypto::ring,
    pki_types::{CertificateDer, PrivateKeyDer, ServerName, pem::PemObject as _},
};
use serde::Serialize;
use std::{io, net::SocketAddr, sync::Arc, time::Instant};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::{TcpListener, TcpStream},
};
use tokio_rustls::{TlsAcceptor, TlsConnector, server::TlsStream};

const ROUNDS: usize = 5;
/// Connections at a time.
const CONNECTIONS: [usize; 2] = [1, 8];
/// Largest answer that is read.
const MAX_ANSWER: usize = 1 << 20;

/// Medians of the rounds, requests a second.
#[derive(Debug, Serialize)]
pub(super) struct Rates {
    pub(super) path: String,
    pub(super) connections: usize,
    pub(super) waymark: f64,
    pub(super) bare: f64,
    pub(super) ratio: f64,
}

/// Measures the paths in turn.
pub(super) async fn rates(
    maps: &MapClient,
    waymark: SocketAddr,
    served: &Served,
    requests: usize,
) -> anyhow::Result<Vec<Rates>> {
    let token = maps.token_in_use().await?.context("the server asks for no token")?;
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(&served.authority)?)?;
    let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let config =
        builder.with_safe_default_protocol_versions()?.with_root_certificates(roots).with_no_client_auth();
    let tls = TlsConnector::from(Arc::new(config));
    let mut all = Vec::new();
    for path in [
        "/healthz".to_owned(),
        "/api/v1/whoami".to_owned(),
        format!("/api/v1/maps/{MAP}"),
        format!("/api/v1/maps/{MAP}/landmarks"),
    ] {
        let request =
            format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\n\r\n");
        let body = Connection::open(&tls, waymark).await?.ask(request.as_bytes()).await?;
        let bare = bare(served, path.clone(), body).await?;
        for connections in CONNECTIONS {
            let (mut ours, mut theirs) = (vec![], vec![]);
            for _ in 0..ROUNDS {
                ours.push(rate(&tls, waymark, &request, connections, requests).await?);
                theirs.push(rate(&tls, bare, &request, connections, requests).await?);
            }
            let [waymark, bare] =
                [ours, theirs].map(|mut rates| quantile(&mut rates, 0.5).unwrap_or(f64::NAN));
            all.push(Rates { path: path.clone(), connections, waymark, bare, ratio: waymark / bare });
        }
    }
    Ok(all)
}

/// Requests a second over so many connections at a time, without the handshakes.
async fn rate(
    tls: &TlsConnector,
    at: SocketAddr,
    request: &str,
    connections: usize,
    requests: usize,
) -> anyhow::Result<f64> {
    let mut open = Vec::new();
    for _ in 0..connections {
        let mut connection = Connection::open(tls, at).await?;
        connection.ask(request.as_bytes()).await?;
        open.push(connection);
    }
    let started = Instant::now();
    let mut running = tokio::task::JoinSet::new();
    for mut connection in open {
        let request = request.to_owned();
        running.spawn(async move {
            for _ in 0..requests {
                connection.ask(request.as_bytes()).await?;
            }
            anyhow::Ok(())
        });
    }
    while let Some(done) = running.join_next().await {
        done??;
    }
    Ok((connections * requests) as f64 / started.elapsed().as_secs_f64())
}

/// A kept connection.
struct Connection {
    stream: tokio_rustls::client::TlsStream<TcpStream>,
    buffer: Vec<u8>,
}

impl Connection {
    async fn open(tls: &TlsConnector, at: SocketAddr) -> anyhow::Result<Self> {
        let stream = TcpStream::connect(at).await?;
        stream.set_nodelay(true)?;
        let stream = tls.connect(ServerName::try_from("localhost")?, stream).await?;
        Ok(Self { stream, buffer: vec![0; MAX_ANSWER] })
    }

    /// Asks, and reads the whole answer. Errors: another status than 200.
    async fn ask(&mut self, request: &[u8]) -> anyhow::Result<Vec<u8>> {
        self.stream.write_all(request).await?;
        self.stream.flush().await?;
        let mut read = 0;
        loop {
            let more = self.stream.read(&mut self.buffer[read..]).await?;
            anyhow::ensure!(more > 0, "the server has ended the connection");
            read += more;
            // The bodies are text, too.
            let text = std::str::from_utf8(&self.buffer[..read])?;
            let Some(end) = text.find("\r\n\r\n") else { continue };
            let head = &text[..end];
            anyhow::ensure!(head.starts_with("HTTP/1.1 200"), "{head}");
            let (_, length) = head.split_once("content-length: ").context("an answer without a length")?;
            let length: usize = length.lines().next().unwrap_or_default().parse()?;
            if read >= end + 4 + length {
                return Ok(self.buffer[end + 4..end + 4 + length].to_vec());
            }
        }
    }
}

/// Starts axum with one handler.
async fn bare(served: &Served, path: String, body: Vec<u8>) -> anyhow::Result<SocketAddr> {
    let certificate = CertificateDer::from_pem_file(&served.certificate)?;
    let key = PrivateKeyDer::from_pem_file(&served.key)?;
    let builder = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let config = builder
        .with_safe_default_protocol_versions()?
        .with_no_client_auth()
        .with_single_cert(vec![certificate], key)?;
    let body = Bytes::from(body);
    let answer = move || async move { ([(header::CONTENT_TYPE, "application/json")], body) };
    let router = Router::new().route(&path, get(answer));
    let tcp = TcpListener::bind("127.0.0.1:0").await?;
    let at = tcp.local_addr()?;
    let listener = Encrypted { tcp, tls: TlsAcceptor::from(Arc::new(config)) };
    tokio::spawn(async move { axum::serve(listener, router).await });
    Ok(at)
}

/// Accepts one handshake at a time.
struct Encrypted {
    tcp: TcpListener,
    tls: TlsAcceptor,
}

impl Listener for Encrypted {
    type Io = TlsStream<TcpStream>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            let Ok((stream, peer)) = self.tcp.accept().await else { continue };
            if stream.set_nodelay(true).is_ok()
                && let Ok(stream) = self.tls.accept(stream).await
            {
                return (stream, peer);
            }
        }
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        self.tcp.local_addr()
    }
}
