//! The zenoh session of a robot: client of one router, no discovery, bounded memory.

use crate::{ClientError, Delivery, RobotOptions, RobotTls, error::in_words};
use link::{Credentials, EncryptedLink};
use protos::{Key, Keys, keys::KeyError};
use serde_json::json;
use std::{path::Path, time::Duration};
use tokio::runtime::{Handle, RuntimeFlavor};
use zenoh::sample::Sample;

/// Largest message taken from the server, in bytes.
const MAX_MESSAGE_BYTES: usize = 4 << 20;

/// Longest wait for a connection that only shows whether something listens.
const PROBE: Duration = Duration::from_millis(500);

/// An open session, and the encrypted link that it goes through.
pub(crate) struct Opened {
    pub(crate) session: zenoh::Session,
    link: Option<EncryptedLink>,
}

impl Opened {
    /// Ends the session in order; what was sent last arrives.
    pub(crate) async fn close(self) -> zenoh::Result<()> {
        let closed = self.session.close().await;
        if let Some(link) = self.link {
            link.close().await;
        }
        closed
    }
}

/// Opens the session of a robot; gives up after the options' time.
pub(crate) async fn open(options: &RobotOptions) -> Result<Opened, ClientError> {
    if let Some(tls) = &options.tls
        && tls.expires_ms.is_some_and(|end| end <= crate::capture::now_ns() / 1_000_000)
    {
        let path = tls.certificate.display().to_string();
        return Err(ClientError::CertificateExpired { robot: options.robot.clone(), path });
    }
    let address = options.endpoint.strip_prefix("tls/");
    let link = match options.tls.as_ref().zip(address) {
        Some((tls, address)) => Some(encrypted(address, tls, &options.endpoint)?),
        None => None,
    };
    let through = link.as_ref().map_or_else(|| options.endpoint.clone(), EncryptedLink::endpoint);
    match (open_at(&through, options.delivery, options.timeout).await, link) {
        (Ok(session), link) => Ok(Opened { session, link }),
        (Err(ClientError::Unreachable { detail, .. }), Some(link)) => {
            let endpoint = options.endpoint.clone();
            Err(match (link.last_end(), listens(&endpoint).await) {
                (Some(Ok(())), true) => ClientError::NotAdmitted { robot: options.robot.clone(), endpoint },
                (Some(Err(detail)), true) => ClientError::TlsRefused { endpoint, detail },
                (None, true) => ClientError::TlsRefused { endpoint, detail },
                (ended, false) => {
                    let detail = ended.and_then(Result::err).unwrap_or(detail);
                    ClientError::Unreachable { endpoint, detail }
                }
            })
        }
        (Err(error), _) => Err(error),
    }
}

/// A link with the robot's certificate.
fn encrypted(address: &str, tls: &RobotTls, endpoint: &str) -> Result<EncryptedLink, ClientError> {
    let read = |path: &Path| {
        let unreadable = |error| ClientError::File { path: path.display().to_string(), error };
        std::fs::read(path).map_err(unreadable)
    };
    let credentials = Credentials {
        certificate: read(&tls.certificate)?,
        key: read(&tls.key)?,
        authority: tls.authority.as_deref().map(read).transpose()?.unwrap_or_default(),
    };
    let fault =
        |e: std::io::Error| ClientError::Encryption { endpoint: endpoint.to_owned(), detail: e.to_string() };
    EncryptedLink::open(address, &credentials).map_err(fault)
}

/// What a message is, by its key and its attachment.
pub(crate) fn received(keys: &Keys, sample: &Sample) -> Result<Key, KeyError> {
    let attached = sample.attachment().map(zenoh::bytes::ZBytes::to_bytes);
    keys.received(sample.key_expr().as_str(), attached.as_deref())
}

/// Opens a session; gives up after `timeout`.
pub(crate) async fn open_at(
    endpoint: &str,
    delivery: Delivery,
    timeout: Duration,
) -> Result<zenoh::Session, ClientError> {
    if Handle::current().runtime_flavor() == RuntimeFlavor::CurrentThread {
        // zenoh would panic in one.
        let detail = "it needs a multi-threaded tokio runtime: #[tokio::main], or flavor = \"multi_thread\""
            .to_owned();
        return Err(ClientError::Transport { action: "open a session", detail });
    }
    let unreachable = |detail: String| ClientError::Unreachable { endpoint: endpoint.to_owned(), detail };
    let config = config(endpoint, delivery, timeout).map_err(|e| unreachable(in_words(&e)))?;
    // zenoh's own timeout is per endpoint; a silent listener (not zenoh) can hold a handshake
    // longer.
    match tokio::time::timeout(timeout + Duration::from_secs(1), zenoh::open(config)).await {
        Ok(session) => session.map_err(|e| unreachable(in_words(&e))),
        Err(_) => Err(unreachable(format!("no session within {timeout:?}"))),
    }
}

/// Whether something takes connections at an encrypted endpoint.
async fn listens(endpoint: &str) -> bool {
    let Some(address) = endpoint.strip_prefix("tls/") else { return false };
    let connected = tokio::time::timeout(PROBE, tokio::net::TcpStream::connect(address)).await;
    matches!(connected, Ok(Ok(_)))
}

fn config(endpoint: &str, delivery: Delivery, timeout: Duration) -> zenoh::Result<zenoh::Config> {
    // Both waits in microseconds. A frame larger than one batch needs the longer wait, or most of
    // them are dropped silently on a slow link; and a session whose sender waits must not be
    // closed.
    let (drop_us, close_us) = match delivery {
        Delivery::Latest => (50_000, 5_000_000),
        Delivery::Every => (50_000, 60_000_000),
    };
    let config = json!({
        "mode": "client",
        "connect": {
            "endpoints": [endpoint],
            "timeout_ms": timeout.as_millis() as u64,
            "retry": { "period_init_ms": 100, "period_max_ms": 2000 },
        },
        "scouting": { "delay": 0, "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "adminspace": { "enabled": false },
        "transport": {
            "link": {
                "tx": { "lease": 2000, "queue": { "congestion_control": {
                    "drop": { "wait_before_drop": drop_us, "max_wait_before_drop_fragments": drop_us },
                    "block": { "wait_before_close": close_us },
                } } },
                "rx": { "max_message_size": MAX_MESSAGE_BYTES },
            },
            "shared_memory": { "enabled": false },
        },
    });
    zenoh::Config::from_json5(&config.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zenoh_accepts_the_settings() {
        for delivery in [Delivery::Latest, Delivery::Every] {
            let config = config("tcp/127.0.0.1:7447", delivery, Duration::from_secs(1)).unwrap();
            assert_eq!(config.get_json("scouting/delay").unwrap(), "0");
            assert_eq!(
                config.get_json("transport/link/rx/max_message_size").unwrap(),
                MAX_MESSAGE_BYTES.to_string()
            );
        }
    }

    #[tokio::test]
    async fn a_runtime_of_one_thread_is_an_error_not_a_panic() {
        let error =
            open_at("tcp/127.0.0.1:7447", Delivery::Latest, Duration::from_millis(10)).await.unwrap_err();
        assert!(error.to_string().contains("multi_thread"), "{error}");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_unreachable_server_gives_advice() {
        // A port that was just free: nobody listens.
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let endpoint = format!("tcp/{free}");
        let error = open_at(&endpoint, Delivery::Latest, Duration::from_millis(300)).await.unwrap_err();
        let text = error.to_string();
        assert!(text.contains("timeout, or no server reachable at") && text.contains(&endpoint), "{text}");
        assert!(!text.contains(".rs"), "no path of a builder: {text}");
    }
}
