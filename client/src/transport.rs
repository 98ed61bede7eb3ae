//! The zenoh session of a robot: client of one router, no discovery, bounded memory.

use crate::{ClientError, Delivery};
use std::time::Duration;
use tokio::runtime::{Handle, RuntimeFlavor};

/// Largest message taken from the server, in bytes.
const MAX_MESSAGE_BYTES: usize = 4 << 20;

/// Opens the session; gives up after `timeout`.
pub(crate) async fn open(
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
    let config = config(endpoint, delivery, timeout).map_err(|e| unreachable(e.to_string()))?;
    // zenoh's own timeout is per endpoint; a silent listener (not zenoh) can hold a handshake longer.
    match tokio::time::timeout(timeout + Duration::from_secs(1), zenoh::open(config)).await {
        Ok(session) => session.map_err(|e| unreachable(e.to_string())),
        Err(_) => Err(unreachable(format!("no session within {timeout:?}"))),
    }
}

fn config(endpoint: &str, delivery: Delivery, timeout: Duration) -> zenoh::Result<zenoh::Config> {
    // Both waits in microseconds. A frame larger than one batch needs the longer wait, or most of them are dropped
    // silently on a slow link; and a session whose sender waits must not be closed.
    let (drop_us, close_us) = match delivery {
        Delivery::Latest => (50_000, 5_000_000),
        Delivery::Every => (50_000, 60_000_000),
    };
    let endpoint = serde_json::to_string(endpoint)?;
    let timeout_ms = timeout.as_millis();
    zenoh::Config::from_json5(&format!(
        r#"{{
            mode: "client",
            connect: {{ endpoints: [{endpoint}], timeout_ms: {timeout_ms}, retry: {{ period_init_ms: 100, period_max_ms: 2000 }} }},
            scouting: {{ delay: 0, multicast: {{ enabled: false }}, gossip: {{ enabled: false }} }},
            adminspace: {{ enabled: false }},
            transport: {{
                link: {{
                    tx: {{ lease: 2000, queue: {{ congestion_control: {{
                        drop: {{ wait_before_drop: {drop_us}, max_wait_before_drop_fragments: {drop_us} }},
                        block: {{ wait_before_close: {close_us} }},
                    }} }} }},
                    rx: {{ max_message_size: {MAX_MESSAGE_BYTES} }},
                }},
                shared_memory: {{ enabled: false }},
            }},
        }}"#
    ))
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
            open("tcp/127.0.0.1:7447", Delivery::Latest, Duration::from_millis(10)).await.unwrap_err();
        assert!(error.to_string().contains("multi_thread"), "{error}");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn an_unreachable_server_gives_advice() {
        // A port that was just free: nobody listens.
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let endpoint = format!("tcp/{free}");
        let error = open(&endpoint, Delivery::Latest, Duration::from_millis(300)).await.unwrap_err();
        let text = error.to_string();
        assert!(text.contains("timeout, or no server reachable at") && text.contains(&endpoint), "{text}");
    }
}
