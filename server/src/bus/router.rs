//! The embedded zenoh router: settings and opening.

use super::BusError;
use std::{net::TcpListener, time::Duration};

/// Sessions beyond the robots: tools and a second connection while the first times out.
const SPARE_SESSIONS: usize = 8;
/// Room for keys and headers besides the largest frame.
const MESSAGE_SPARE_BYTES: usize = 64 << 10;
/// A robot whose link is silent for so long is gone.
const LEASE_MS: u64 = 2000;
/// A message for a robot whose queue is full is dropped after this wait. All answers share one sending thread, so this bounds
/// what one robot that does not read costs the others: a thousandth of a second a message.
const WAIT_BEFORE_DROP_US: u64 = 1000;
/// Batches that wait for each link at the priority of answers and poses. Each message is a batch of its own there: a frame
/// of ROS gives up to four at once (pose, detections, initial pose, transform), and zenoh's two lose the third of them
/// while the sending task waits for a core. At most 64 KiB each, allocated when they are needed.
const ANSWER_BATCHES: usize = 8;
/// A robot that does not take a reply to its own query for this long is disconnected.
const WAIT_BEFORE_CLOSE_US: u64 = 1_000_000;
/// Longest wait for the router to open.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);

/// The endpoint with a real port: port 0 is replaced by a free one, because zenoh does not say which it took.
pub(super) fn endpoint(asked: &str) -> Result<String, BusError> {
    let Some(address) = asked.strip_prefix("tcp/").and_then(|a| a.strip_suffix(":0")) else {
        return Ok(asked.to_owned());
    };
    let fault = |e: std::io::Error| BusError::Listen { endpoint: asked.to_owned(), detail: e.to_string() };
    let free = TcpListener::bind(format!("{address}:0")).map_err(fault)?;
    Ok(format!("tcp/{address}:{}", free.local_addr().map_err(fault)?.port()))
}

/// Opens the router on `endpoint`.
pub(super) async fn open(
    endpoint: &str,
    robots: usize,
    frame_bytes: usize,
) -> Result<zenoh::Session, BusError> {
    let fault = |detail: String| BusError::Listen { endpoint: endpoint.to_owned(), detail };
    let config = config(endpoint, robots, frame_bytes).map_err(|e| fault(e.to_string()))?;
    match tokio::time::timeout(OPEN_TIMEOUT, zenoh::open(config)).await {
        Ok(opened) => opened.map_err(|e| fault(e.to_string())),
        Err(_) => Err(fault(format!("not open after {OPEN_TIMEOUT:?}"))),
    }
}

fn config(endpoint: &str, robots: usize, frame_bytes: usize) -> zenoh::Result<zenoh::Config> {
    let endpoint = serde_json::to_string(endpoint)?;
    let sessions = robots + SPARE_SESSIONS;
    let message_bytes = frame_bytes + MESSAGE_SPARE_BYTES;
    // No time stamps: clocks of robots decide nothing here, and a clock far ahead would have its samples refused.
    zenoh::Config::from_json5(&format!(
        r#"{{
            mode: "router",
            listen: {{ endpoints: [{endpoint}], timeout_ms: 0, exit_on_failure: true }},
            connect: {{ endpoints: [] }},
            scouting: {{ delay: 0, multicast: {{ enabled: false }}, gossip: {{ enabled: false }} }},
            timestamping: {{ enabled: {{ router: false, peer: false, client: false }} }},
            adminspace: {{ enabled: false }},
            transport: {{
                unicast: {{ max_sessions: {sessions}, max_links: 1 }},
                link: {{
                    tx: {{ lease: {LEASE_MS}, queue: {{
                        size: {{ interactive_high: {ANSWER_BATCHES} }},
                        congestion_control: {{
                            drop: {{
                                wait_before_drop: {WAIT_BEFORE_DROP_US},
                                max_wait_before_drop_fragments: {WAIT_BEFORE_DROP_US},
                            }},
                            block: {{ wait_before_close: {WAIT_BEFORE_CLOSE_US} }},
                        }},
                    }} }},
                    rx: {{ max_message_size: {message_bytes} }},
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
    fn port_0_becomes_a_real_one() {
        let endpoint = endpoint("tcp/127.0.0.1:0").unwrap();
        let port: u16 = endpoint.strip_prefix("tcp/127.0.0.1:").unwrap().parse().unwrap();
        assert_ne!(port, 0);
        assert_eq!(super::endpoint("tcp/[::1]:7447").unwrap(), "tcp/[::1]:7447");
        assert_eq!(super::endpoint("tcp/127.0.0.1:70").unwrap(), "tcp/127.0.0.1:70");
    }

    #[test]
    fn the_settings_are_understood() {
        let config = config("tcp/127.0.0.1:7447", 10, 1000).unwrap();
        assert_eq!(config.get_json("transport/unicast/max_sessions").unwrap(), "18");
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
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", taken.local_addr().unwrap());
        let error = open(&endpoint, 1, 1000).await.unwrap_err().to_string();
        assert!(error.contains(&endpoint), "{error}");
    }
}
