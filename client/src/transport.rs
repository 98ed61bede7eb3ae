//! The zenoh session of a robot: client of one router, no discovery, bounded memory.

use crate::{ClientError, Delivery, RobotOptions, RobotTls};
use protos::{Key, Keys, keys::KeyError};
use serde_json::{Value, json};
use std::time::Duration;
use tokio::runtime::{Handle, RuntimeFlavor};
use zenoh::sample::Sample;

/// Largest message taken from the server, in bytes.
const MAX_MESSAGE_BYTES: usize = 4 << 20;

/// Longest wait for a connection that only shows whether something listens.
const PROBE: Duration = Duration::from_millis(500);

/// Opens the session of a robot; gives up after the options' time.
pub(crate) async fn open(options: &RobotOptions) -> Result<zenoh::Session, ClientError> {
    if let Some(tls) = &options.tls
        && tls.expires_ms.is_some_and(|end| end <= crate::capture::now_ns() / 1_000_000)
    {
        let path = tls.certificate.display().to_string();
        return Err(ClientError::CertificateExpired { robot: options.robot.clone(), path });
    }
    let opened = open_at(&options.endpoint, options.delivery, options.timeout, options.tls.as_ref()).await;
    match opened {
        Err(ClientError::Unreachable { endpoint, detail }) if listens(&endpoint).await => {
            Err(ClientError::TlsRefused { endpoint, detail })
        }
        opened => opened,
    }
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
    tls: Option<&RobotTls>,
) -> Result<zenoh::Session, ClientError> {
    if Handle::current().runtime_flavor() == RuntimeFlavor::CurrentThread {
        // zenoh would panic in one.
        let detail = "it needs a multi-threaded tokio runtime: #[tokio::main], or flavor = \"multi_thread\""
            .to_owned();
        return Err(ClientError::Transport { action: "open a session", detail });
    }
    let unreachable = |detail: String| ClientError::Unreachable { endpoint: endpoint.to_owned(), detail };
    let config = config(endpoint, delivery, timeout, tls).map_err(|e| unreachable(e.to_string()))?;
    // zenoh's own timeout is per endpoint; a silent listener (not zenoh) can hold a handshake longer.
    match tokio::time::timeout(timeout + Duration::from_secs(1), zenoh::open(config)).await {
        Ok(session) => session.map_err(|e| unreachable(e.to_string())),
        Err(_) => Err(unreachable(format!("no session within {timeout:?}"))),
    }
}

/// Whether something takes connections at an encrypted endpoint.
async fn listens(endpoint: &str) -> bool {
    let Some(address) = endpoint.strip_prefix("tls/") else { return false };
    let connected = tokio::time::timeout(PROBE, tokio::net::TcpStream::connect(address)).await;
    matches!(connected, Ok(Ok(_)))
}

fn config(
    endpoint: &str,
    delivery: Delivery,
    timeout: Duration,
    tls: Option<&RobotTls>,
) -> zenoh::Result<zenoh::Config> {
    // Both waits in microseconds. A frame larger than one batch needs the longer wait, or most of them are dropped
    // silently on a slow link; and a session whose sender waits must not be closed.
    let (drop_us, close_us) = match delivery {
        Delivery::Latest => (50_000, 5_000_000),
        Delivery::Every => (50_000, 60_000_000),
    };
    let mut config = json!({
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
    if let Some(RobotTls { certificate, key, authority, .. }) = tls {
        config["transport"]["link"]["tls"] = json!({
            "enable_mtls": true,
            "connect_certificate": certificate,
            "connect_private_key": key,
            "root_ca_certificate": authority.as_ref().map_or(Value::Null, |path| json!(path)),
            "verify_name_on_connect": true,
        });
    }
    zenoh::Config::from_json5(&config.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zenoh_accepts_the_settings() {
        for delivery in [Delivery::Latest, Delivery::Every] {
            let config = config("tcp/127.0.0.1:7447", delivery, Duration::from_secs(1), None).unwrap();
            assert_eq!(config.get_json("scouting/delay").unwrap(), "0");
            assert_eq!(
                config.get_json("transport/link/rx/max_message_size").unwrap(),
                MAX_MESSAGE_BYTES.to_string()
            );
        }
    }

    #[tokio::test]
    async fn a_runtime_of_one_thread_is_an_error_not_a_panic() {
        let error = open_at("tcp/127.0.0.1:7447", Delivery::Latest, Duration::from_millis(10), None)
            .await
            .unwrap_err();
        assert!(error.to_string().contains("multi_thread"), "{error}");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_unreachable_server_gives_advice() {
        // A port that was just free: nobody listens.
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let endpoint = format!("tcp/{free}");
        let error = open_at(&endpoint, Delivery::Latest, Duration::from_millis(300), None).await.unwrap_err();
        let text = error.to_string();
        assert!(text.contains("timeout, or no server reachable at") && text.contains(&endpoint), "{text}");
    }
}
