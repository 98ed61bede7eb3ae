//! The embedded zenoh routers: settings and opening.

use super::BusError;
use crate::identity::certificates::PemKey;
use base64::{Engine as _, prelude::BASE64_STANDARD};
use serde_json::{Value, json};
use std::time::Duration;

/// Sessions beyond the robots: tools, a second connection while the first times out, and the
/// server's own probe.
pub(super) const SPARE_SESSIONS: usize = 9;
/// Room for keys and headers besides the largest frame.
const MESSAGE_SPARE_BYTES: usize = 64 << 10;
/// A robot whose link is silent for so long is gone.
const LEASE_MS: u64 = 2000;
/// A message for a robot whose queue is full is dropped after this wait. All answers share one
/// sending thread, so this bounds what one robot that does not read costs the others: a thousandth
/// of a second a message.
const WAIT_BEFORE_DROP_US: u64 = 1000;
/// Batches that wait for each link at the priority of answers and poses. Each message is a batch of
/// its own there: a frame of ROS gives up to four at once (pose, detections, initial pose,
/// transform), and zenoh's two lose the third of them while the sending task waits for a core. At
/// most 64 KiB each, allocated when they are needed.
const ANSWER_BATCHES: usize = 8;
/// The same for a message of several parts. Through the gate only frames are, on their way to the
/// server.
const FRAGMENTS_WAIT_US: u64 = 50_000;
/// A robot that does not take a reply to its own query for this long is disconnected.
const WAIT_BEFORE_CLOSE_US: u64 = 1_000_000;
/// Longest wait for the router to open.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest attempt to join a router, within [`OPEN_TIMEOUT`].
const JOIN_TIMEOUT: Duration = Duration::from_secs(5);

/// Certificates of a router that listens encrypted, PEM.
pub(super) struct RouterTls<'a> {
    /// Who signs the certificates of the other ends.
    pub(super) authorities: &'a str,
    /// What it shows.
    pub(super) listener: (&'a str, &'a PemKey),
}

/// What a router is opened with.
pub(super) struct RouterSettings<'a> {
    pub(super) listen: Vec<String>,
    /// Another router.
    pub(super) connect: Option<&'a str>,
    pub(super) tls: Option<RouterTls<'a>>,
    /// `access_control`; everything is allowed without.
    pub(super) access: Option<Value>,
    pub(super) robots: usize,
    pub(super) frame_bytes: usize,
}

pub(super) async fn open(settings: &RouterSettings<'_>) -> Result<zenoh::Session, BusError> {
    let endpoint = settings.listen.first().cloned().unwrap_or_default();
    let fault = |detail: String| BusError::Listen { endpoint: endpoint.clone(), detail };
    session(config(settings), fault).await
}

/// Opens a session that joins a router at `endpoints`.
pub(super) async fn opened(
    endpoints: &str,
    config: zenoh::Result<zenoh::Config>,
) -> Result<zenoh::Session, BusError> {
    session(config, |detail| BusError::Join { endpoints: endpoints.to_owned(), detail }).await
}

async fn session(
    config: zenoh::Result<zenoh::Config>,
    fault: impl Fn(String) -> BusError,
) -> Result<zenoh::Session, BusError> {
    let config = config.map_err(|e| fault(e.to_string()))?;
    match tokio::time::timeout(OPEN_TIMEOUT, zenoh::open(config)).await {
        Ok(opened) => opened.map_err(|e| fault(e.to_string())),
        Err(_) => Err(fault(format!("not open after {OPEN_TIMEOUT:?}"))),
    }
}

/// Opens a client of a router of this process.
pub(super) async fn open_client(endpoint: &str) -> Result<zenoh::Session, BusError> {
    let fault = |detail: String| BusError::Listen { endpoint: endpoint.to_owned(), detail };
    let config = json!({
        "mode": "client",
        "connect": { "endpoints": [endpoint], "timeout_ms": OPEN_TIMEOUT.as_millis() as u64 },
        "scouting": { "delay": 0, "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "adminspace": { "enabled": false },
        "transport": { "link": { "tx": { "lease": LEASE_MS } }, "shared_memory": { "enabled": false } },
    });
    let config = zenoh::Config::from_json5(&config.to_string()).map_err(|e| fault(e.to_string()))?;
    zenoh::open(config).await.map_err(|e| fault(e.to_string()))
}

/// A client of a router at one of `endpoints`; links and queues are as those of the server's own
/// router.
pub(super) fn client_config(endpoints: &[String], frame_bytes: usize) -> zenoh::Result<zenoh::Config> {
    let settings =
        RouterSettings { listen: Vec::new(), connect: None, tls: None, access: None, robots: 0, frame_bytes };
    let mut config = settings_of(&settings);
    config["mode"] = "client".into();
    config["connect"] = json!({
        "endpoints": endpoints,
        "timeout_ms": JOIN_TIMEOUT.as_millis() as u64,
        "exit_on_failure": true,
        "retry": { "period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2 },
    });
    zenoh::Config::from_json5(&config.to_string())
}

fn config(settings: &RouterSettings<'_>) -> zenoh::Result<zenoh::Config> {
    zenoh::Config::from_json5(&settings_of(settings).to_string())
}

fn settings_of(settings: &RouterSettings<'_>) -> Value {
    let RouterSettings { listen, connect, tls, access, robots, frame_bytes } = settings;
    let fragments_us = if connect.is_some() { FRAGMENTS_WAIT_US } else { WAIT_BEFORE_DROP_US };
    // No time stamps: clocks of robots decide nothing here, and a clock far ahead would have its
    // samples refused.
    let mut config = json!({
        "mode": "router",
        "listen": { "endpoints": listen, "timeout_ms": 0, "exit_on_failure": true },
        "connect": {
            "endpoints": connect.as_slice(),
            "timeout_ms": OPEN_TIMEOUT.as_millis() as u64,
            "exit_on_failure": true,
            "retry": { "period_init_ms": 20, "period_max_ms": 200 },
        },
        "scouting": { "delay": 0, "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "timestamping": { "enabled": { "router": false, "peer": false, "client": false } },
        "adminspace": { "enabled": false },
        "transport": {
            "unicast": { "max_sessions": robots + SPARE_SESSIONS, "max_links": 1 },
            "link": {
                "tx": { "lease": LEASE_MS, "queue": {
                    "size": { "interactive_high": ANSWER_BATCHES },
                    "congestion_control": {
                        "drop": {
                            "wait_before_drop": WAIT_BEFORE_DROP_US,
                            "max_wait_before_drop_fragments": fragments_us,
                        },
                        "block": { "wait_before_close": WAIT_BEFORE_CLOSE_US },
                    },
                } },
                "rx": { "max_message_size": frame_bytes + MESSAGE_SPARE_BYTES },
            },
            "shared_memory": { "enabled": false },
        },
    });
    if let Some(tls) = tls {
        config["transport"]["link"]["tls"] = tls_config(tls);
    }
    if let Some(access) = access {
        config["access_control"] = access.clone();
    }
    config
}

fn tls_config(RouterTls { authorities, listener }: &RouterTls<'_>) -> Value {
    let encoded = |pem: &str| BASE64_STANDARD.encode(pem);
    json!({
        "root_ca_certificate_base64": encoded(authorities),
        "listen_certificate_base64": encoded(listener.0),
        "listen_private_key_base64": encoded(&listener.1.0),
        "enable_mtls": true,
        "verify_name_on_connect": true,
        "close_link_on_expiration": true,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(endpoint: &str) -> RouterSettings<'_> {
        let listen = vec![endpoint.to_owned()];
        RouterSettings { listen, connect: None, tls: None, access: None, robots: 10, frame_bytes: 1000 }
    }

    #[test]
    fn the_settings_are_understood() {
        let config = config(&plain("tcp/127.0.0.1:7447")).unwrap();
        assert_eq!(config.get_json("transport/unicast/max_sessions").unwrap(), "19");
        assert_eq!(config.get_json("transport/link/rx/max_message_size").unwrap(), "66536");
        let of_queue =
            |setting: &str| config.get_json(&format!("transport/link/tx/queue/{setting}")).unwrap();
        assert_eq!(of_queue("size/interactive_high"), "8");
        assert_eq!(of_queue("congestion_control/drop/wait_before_drop"), "1000");
        assert_eq!(config.get_json("scouting/multicast/enabled").unwrap(), "false");
        assert_eq!(config.get_json("adminspace/enabled").unwrap(), "false");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_taken_port_is_an_error_that_names_it() {
        let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
        let error = open(&plain(&endpoint)).await.unwrap_err().to_string();
        assert!(error.contains(&endpoint), "{error}");
    }
}
