//! `[router]`: a router of the operator that the server joins instead of being one. In: endpoints
//! and paths of files. Out: checked endpoints, and which files are shown at encrypted ones.

use super::{ConfigError, RawRos2, Tls, addresses::is_loopback, invalid};
use serde::{Deserialize, Serialize};
use std::{net::IpAddr, path::PathBuf};

/// Most endpoints that are tried in turn.
pub const MAX_ROUTER_ENDPOINTS: usize = 8;

/// `[router]`, unchecked. An empty path is none.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawRouter {
    /// Endpoints of a zenoh router, tried in turn: `tls/router.example.org:7447`. Empty: the server
    /// is the router.
    pub connect: Vec<String>,
    /// PEM file of the certificate that is shown at `tls/` endpoints, followed by its chain.
    pub certificate: PathBuf,
    /// PEM file with its private key.
    pub key: PathBuf,
    /// PEM file of the authorities that sign the router's certificate.
    pub authority: PathBuf,
}

/// A router that the server joins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JoinedRouter {
    /// Its endpoints, at least one.
    pub connect: Vec<String>,
    /// What is shown at `tls/` endpoints; always there where one of them is.
    pub credentials: Option<RouterCredentials>,
}

/// Files for encrypted connections to a router.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RouterCredentials {
    /// PEM of the certificate with its chain.
    pub certificate: PathBuf,
    /// PEM of its private key.
    pub key: PathBuf,
    /// PEM of who signs the router's certificate.
    pub authority: PathBuf,
}

impl JoinedRouter {
    /// The endpoints in plain text that may be on other machines.
    pub(super) fn plain_beyond_loopback(&self) -> impl Iterator<Item = &String> {
        self.connect.iter().filter(|endpoint| {
            parts(endpoint).is_some_and(|(is_tls, host)| !is_tls && !is_loopback_host(host))
        })
    }
}

/// Checks endpoints, and that the files for encrypted ones are all there. `None` without endpoints.
pub(super) fn checked(raw: RawRouter, insecure: bool) -> Result<Option<JoinedRouter>, ConfigError> {
    let file = |path: PathBuf| Some(path).filter(|path| !path.as_os_str().is_empty());
    let files = [
        ("router.certificate", file(raw.certificate)),
        ("router.key", file(raw.key)),
        ("router.authority", file(raw.authority)),
    ];
    if raw.connect.is_empty() {
        return match files.into_iter().find(|(_, path)| path.is_some()) {
            Some((field, _)) => Err(invalid(field, "needs a tls/ endpoint in router.connect".into())),
            None => Ok(None),
        };
    }
    if raw.connect.len() > MAX_ROUTER_ENDPOINTS {
        let reason = format!("{} are more than {MAX_ROUTER_ENDPOINTS}", raw.connect.len());
        return Err(invalid("router.connect", reason));
    }
    let mut needs_files = false;
    for (i, endpoint) in raw.connect.iter().enumerate() {
        let Some((is_tls, _)) = parts(endpoint) else {
            let reason = format!("`{endpoint}` is not tcp/HOST:PORT or tls/HOST:PORT");
            return Err(invalid(format!("router.connect[{i}]"), reason));
        };
        needs_files |= is_tls;
    }
    let credentials = match files {
        [(_, Some(certificate)), (_, Some(key)), (_, Some(authority))] if needs_files => {
            Some(RouterCredentials { certificate, key, authority })
        }
        files => match files.into_iter().find(|(_, path)| path.is_some() != needs_files) {
            Some((field, None)) => {
                return Err(invalid(field, "tls/ endpoints need certificate, key and authority".into()));
            }
            Some((field, Some(_))) => {
                return Err(invalid(field, "needs a tls/ endpoint in router.connect".into()));
            }
            None => None,
        },
    };
    let router = JoinedRouter { connect: raw.connect, credentials };
    if let Some(plain) = router.plain_beyond_loopback().next().filter(|_| !insecure) {
        return Err(ConfigError::NotLoopback { field: "router.connect", value: plain.clone() });
    }
    Ok(Some(router))
}

/// What needs a router of the server's own.
pub(super) fn listens_for_no_robots(
    zenoh: &str,
    tls: Option<&Tls>,
    ros2: &RawRos2,
) -> Result<(), ConfigError> {
    let refused =
        |field: &'static str, what: &str| Err(invalid(field, format!("{what} with router.connect")));
    if !zenoh.is_empty() {
        return refused("zenoh", "the server opens no listener for robots");
    }
    if tls.is_some_and(|tls| tls.local_zenoh.is_some()) {
        return refused("tls.local_zenoh", "the server opens no listener for robots");
    }
    if !ros2.robot.is_empty() {
        return refused("ros2.robot", "robots of ROS 2 are not served");
    }
    Ok(())
}

/// Whether an endpoint encrypts, and its host.
fn parts(endpoint: &str) -> Option<(bool, &str)> {
    let (protocol, address) = endpoint.split_once('/')?;
    let (host, port) = address.rsplit_once(':')?;
    let is_port = port.bytes().all(|b| b.is_ascii_digit()) && port.parse::<u16>().is_ok_and(|port| port != 0);
    let bare = host.strip_prefix('[').and_then(|host| host.strip_suffix(']'));
    let is_host = match bare {
        Some(bare) => bare.parse::<IpAddr>().is_ok(),
        None => !host.is_empty() && host.bytes().all(|b| b.is_ascii_alphanumeric() || b"-._".contains(&b)),
    };
    let is_known = ["tcp", "tls"].contains(&protocol);
    (is_known && is_port && is_host).then(|| (protocol == "tls", bare.unwrap_or(host)))
}

fn is_loopback_host(host: &str) -> bool {
    host == "localhost" || host.parse().is_ok_and(is_loopback)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn to(endpoints: &[&str]) -> RawRouter {
        RawRouter { connect: endpoints.iter().map(|&e| e.into()).collect(), ..RawRouter::default() }
    }

    fn refused(raw: RawRouter) -> Option<String> {
        match checked(raw, false) {
            Err(ConfigError::Invalid { field, .. }) => Some(field.into_owned()),
            Err(ConfigError::NotLoopback { field, .. }) => Some(format!("{field} beyond loopback")),
            Ok(_) => None,
            Err(other) => panic!("{other:?}"),
        }
    }

    #[test]
    fn endpoints_and_files_are_checked() {
        assert_eq!(checked(to(&[]), false).unwrap(), None);
        let good = checked(to(&["tcp/127.0.0.1:7447", "tcp/[::1]:1", "tcp/localhost:1"]), false);
        assert_eq!(good.unwrap().unwrap().connect.len(), 3);
        for bad in
            ["", "127.0.0.1:7447", "udp/127.0.0.1:7447", "tcp/:1", "tcp/a", "tcp/a:0", "tcp/a:x", "tcp/a b:1"]
        {
            assert_eq!(refused(to(&["tcp/127.0.0.1:1", bad])), Some("router.connect[1]".into()), "{bad}");
        }
        assert_eq!(refused(to(&["tcp/127.0.0.1:1"; MAX_ROUTER_ENDPOINTS])), None);
        assert_eq!(
            refused(to(&["tcp/127.0.0.1:1"; MAX_ROUTER_ENDPOINTS + 1])),
            Some("router.connect".into())
        );
        for plain in ["tcp/192.168.1.4:7447", "tcp/router.example.org:7447"] {
            assert_eq!(refused(to(&[plain])), Some("router.connect beyond loopback".into()), "{plain}");
            assert!(checked(to(&[plain]), true).unwrap().is_some());
        }
        let tls = |certificate: &str, key: &str, authority: &str| RawRouter {
            certificate: certificate.into(),
            key: key.into(),
            authority: authority.into(),
            ..to(&["tls/router.example.org:7447"])
        };
        assert_eq!(refused(tls("c", "k", "a")), None);
        assert_eq!(refused(tls("", "k", "a")), Some("router.certificate".into()));
        assert_eq!(refused(tls("c", "", "a")), Some("router.key".into()));
        assert_eq!(refused(tls("c", "k", "")), Some("router.authority".into()));
        assert_eq!(refused(RawRouter { connect: Vec::new(), ..tls("", "k", "") }), Some("router.key".into()));
        let plain = RawRouter { authority: "a".into(), ..to(&["tcp/127.0.0.1:1"]) };
        assert_eq!(refused(plain), Some("router.authority".into()));
    }
}
