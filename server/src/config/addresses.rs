//! Where the server listens. In: texts of the settings. Out: addresses, and whether they encrypt.

use super::{ConfigError, invalid};
use std::net::{IpAddr, SocketAddr};

/// Whether no other machine reaches it.
pub(super) fn is_loopback(ip: IpAddr) -> bool {
    ip.to_canonical().is_loopback()
}

/// `ADDRESS:PORT` of a setting.
pub(super) fn socket_address(field: &'static str, text: &str) -> Result<SocketAddr, ConfigError> {
    text.parse().map_err(|e| invalid(field, format!("`{text}` is not ADDRESS:PORT ({e})")))
}

/// Where robots connect if the settings do not say.
pub(super) fn zenoh_endpoint(asked: String, is_tls: bool) -> String {
    let default = if is_tls { "tls/127.0.0.1:7447" } else { "tcp/127.0.0.1:7447" };
    if asked.is_empty() { default.to_owned() } else { asked }
}

/// Whether it encrypts, and its address. Only `tcp/IP:PORT` and `tls/IP:PORT`: a host name could
/// resolve to anything, and the other transports are not compiled in.
pub(super) fn zenoh_address(field: &'static str, endpoint: &str) -> Result<(bool, SocketAddr), ConfigError> {
    let parts = endpoint.split_once('/').filter(|(protocol, _)| ["tcp", "tls"].contains(protocol));
    let parsed = parts.and_then(|(protocol, rest)| Some((protocol == "tls", rest.parse().ok()?)));
    parsed.ok_or_else(|| {
        let reason =
            format!("`{endpoint}` is not tcp/ADDRESS:PORT or tls/ADDRESS:PORT with a numeric address");
        invalid(field, reason)
    })
}
