//! The listeners of HTTP and of metrics, what is served there, and what looks after the parts of
//! the server meanwhile.

use crate::{
    bus::{Outbox, Pinger},
    config::{Config, Limits},
    http::{self, App},
    identity::certificates::{Certificates, acceptor},
    live_probes::LiveProbes,
    start_error::StartError,
    store::Store,
};
use axum::{extract::Request, response::Response};
use engine::vitals::Pulse;
use futures::FutureExt as _;
use std::{convert::Infallible, net::SocketAddr, sync::Arc, time::Duration};
use tokio::{net::TcpListener, sync::watch, task::JoinHandle};
use tokio_rustls::TlsAcceptor;
use tower::ServiceExt as _;

/// Connections of the listener for metrics at a time.
const METRICS_CONNECTIONS: usize = 8;

/// Open ports.
pub(crate) struct Listeners {
    http: TcpListener,
    tls: Option<TlsAcceptor>,
    metrics: Option<TcpListener>,
    /// With the real port.
    pub(crate) http_addr: SocketAddr,
    /// The same, if metrics have a listener of their own.
    pub(crate) metrics_addr: Option<SocketAddr>,
}

impl Listeners {
    /// Takes the ports of the settings. They are taken before all else: one that another program
    /// has is told at once.
    pub(crate) async fn open(config: &Config) -> Result<Self, StartError> {
        crate::metrics::process::started();
        let (http, http_addr) = bind("--http", config.http_addr).await?;
        let metrics = match config.metrics_addr {
            Some(addr) => Some(bind("--metrics", addr).await?),
            None => None,
        };
        let (metrics, metrics_addr) = metrics.unzip();
        Ok(Self { http, tls: None, metrics, http_addr, metrics_addr })
    }

    /// Encrypted with these certificates, or plain.
    pub(crate) fn encrypted(self, certificates: Option<&Arc<Certificates>>) -> Result<Self, StartError> {
        let tls = certificates.map(|all| acceptor(all.current(), None, &[b"http/1.1"])).transpose();
        Ok(Self { tls: tls.map_err(|e| StartError::Certificates(e.to_string()))?, ..self })
    }
}

async fn bind(option: &'static str, addr: SocketAddr) -> Result<(TcpListener, SocketAddr), StartError> {
    let at = |source| StartError::Http { option, addr, source };
    let listener = TcpListener::bind(addr).await.map_err(at)?;
    let real = listener.local_addr().map_err(at)?;
    Ok((listener, real))
}

/// What is served, and the watch over the parts.
#[derive(Debug)]
pub(crate) struct Serving {
    http: JoinHandle<()>,
    metrics: Option<JoinHandle<()>>,
    probes: LiveProbes,
    watch: JoinHandle<()>,
}

impl Serving {
    /// Begins to serve, to probe and to watch.
    pub(crate) fn start(
        listeners: Listeners,
        app: &Arc<App>,
        probed: (Store, Outbox, Option<Pinger>),
        stopping: &watch::Receiver<bool>,
    ) -> Self {
        let (vitals, limits) = (app.store.vitals().clone(), &app.config.limits);
        let probes = LiveProbes::start(probed, &vitals, stopping);
        let metrics = listeners.metrics.map(|listener| {
            let limits = Limits { connections: METRICS_CONNECTIONS, ..limits.clone() };
            let pulse = vitals.begin("the listener for metrics");
            let router = http::metrics_alone(app);
            let metrics = move |request| router.clone().oneshot(request);
            serve((listener, None, pulse), metrics, limits, stopping)
        });
        let listener = (listeners.http, listeners.tls, vitals.begin("the HTTP listener"));
        let service = http::Service::new(app.clone());
        let answer = move |request| service.clone().answer(request).map(Ok);
        let http = serve(listener, answer, limits.clone(), stopping);
        vitals.fail_stalled_after(Duration::from_secs(limits.stalled_s));
        Self { http, metrics, probes, watch: tokio::spawn(vitals.watch()) }
    }

    /// Ends the probes and the watch: from now on parts end because they are told to.
    pub(crate) async fn unwatch(&mut self) {
        self.watch.abort();
        self.probes.close().await;
    }

    /// What ends when the server stops.
    pub(crate) fn tasks(self) -> impl Iterator<Item = (&'static str, JoinHandle<()>)> {
        self.metrics.map(|task| ("metrics", task)).into_iter().chain([("HTTP", self.http)])
    }
}

fn serve<Answering: Future<Output = Result<Response, Infallible>> + Send + 'static>(
    (listener, tls, pulse): (TcpListener, Option<TlsAcceptor>, Pulse),
    answer: impl Fn(Request) -> Answering + Clone + Send + Sync + 'static,
    limits: Limits,
    stopping: &watch::Receiver<bool>,
) -> JoinHandle<()> {
    let stopping = stopping.clone();
    tokio::spawn(async move {
        http::listen::serve(listener, answer, tls, limits, stopping).await;
        drop(pulse);
    })
}
