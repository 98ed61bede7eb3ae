//! A zenoh router as an operator runs it, inside the test: it can end and begin again at the same
//! place.

use serde_json::{Value, json};
use std::net::TcpListener;

/// A router. It ends with [`ExternalRouter::stop`].
pub struct ExternalRouter {
    /// Where robots and servers connect.
    pub endpoint: String,
    /// Settings of encryption.
    tls: Option<Value>,
    session: Option<zenoh::Session>,
}

impl std::fmt::Debug for ExternalRouter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ExternalRouter").field("endpoint", &self.endpoint).finish_non_exhaustive()
    }
}

impl ExternalRouter {
    /// Starts one on a free port of loopback; with `tls`, zenoh's settings of it, encrypted.
    pub async fn start(tls: Option<Value>) -> Self {
        let free = TcpListener::bind("127.0.0.1:0").and_then(|free| free.local_addr()).expect("a free port");
        let protocol = if tls.is_some() { "tls" } else { "tcp" };
        let mut router = Self { endpoint: format!("{protocol}/{free}"), tls, session: None };
        router.restart().await;
        router
    }

    /// Ends it: every connection breaks.
    pub async fn stop(&mut self) {
        if let Some(session) = self.session.take() {
            session.close().await.expect("closed");
        }
    }

    /// Ends it, and begins again at the same place.
    pub async fn restart(&mut self) {
        self.stop().await;
        let mut config = json!({
            "mode": "router",
            "listen": { "endpoints": [self.endpoint], "timeout_ms": 10_000, "exit_on_failure": true },
            "scouting": { "delay": 0, "multicast": { "enabled": false }, "gossip": { "enabled": false } },
            "transport": { "shared_memory": { "enabled": false } },
        });
        if let Some(tls) = &self.tls {
            config["transport"]["link"] = json!({ "tls": tls });
        }
        let config = zenoh::Config::from_json5(&config.to_string()).expect("settings");
        self.session = Some(zenoh::open(config).await.expect("the router opens"));
    }

    /// Its session, to hear what passes.
    pub fn session(&self) -> &zenoh::Session {
        self.session.as_ref().expect("it runs")
    }
}
