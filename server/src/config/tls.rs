//! Settings of encryption. In: names and paths of files. Out: checked names, and which files are
//! the operator's own.

use super::{
    ConfigError,
    addresses::{is_loopback, zenoh_address},
    invalid,
};
use serde::{Deserialize, Serialize};
use std::{net::IpAddr, path::PathBuf};

/// Most names of the server's certificate.
pub const MAX_TLS_NAMES: usize = 64;
/// Longest DNS name, in bytes.
const MAX_DNS_BYTES: usize = 253;
/// Longest part of a DNS name between dots, in bytes.
const MAX_LABEL_BYTES: usize = 63;

/// `[tls]`, unchecked. An empty path is none.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawTls {
    /// Whether connections are encrypted.
    pub enabled: bool,
    /// DNS names and addresses by which clients reach the server; `localhost` and loopback
    /// addresses are always added.
    pub names: Vec<String>,
    /// PEM file of the operator's own: the server's certificate, followed by its chain.
    pub certificate: PathBuf,
    /// PEM file with its private key.
    pub key: PathBuf,
    /// PEM file of the authorities whose certificates robots show. Empty: the built-in authority
    /// signs them.
    pub client_authority: PathBuf,
    /// A plain endpoint on loopback beside the encrypted one, `tcp/127.0.0.1:7446`: any local
    /// user can then impersonate any robot. Empty: none.
    pub local_zenoh: String,
}

/// How connections are encrypted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tls {
    /// DNS names and addresses of the server's certificate, without loopback.
    pub names: Vec<String>,
    /// The operator's own certificate; `None`: the built-in authority signs one for `names`.
    pub own: Option<OwnCertificate>,
    /// The operator's own authority for robots; `None`: the built-in one.
    pub client_authority: Option<PathBuf>,
    /// The plain endpoint on loopback.
    pub local_zenoh: Option<String>,
}

/// Files of the operator's own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnCertificate {
    /// PEM of the certificate with its chain.
    pub certificate: PathBuf,
    /// PEM of its private key.
    pub key: PathBuf,
}

/// Checks names, and that files come in pairs. `None` if encryption is off.
pub(super) fn checked(raw: RawTls) -> Result<Option<Tls>, ConfigError> {
    if !raw.enabled {
        return Ok(None);
    }
    if raw.names.len() > MAX_TLS_NAMES {
        return Err(invalid("tls.names", format!("{} are more than {MAX_TLS_NAMES}", raw.names.len())));
    }
    for (i, name) in raw.names.iter().enumerate() {
        if name.parse::<IpAddr>().is_err() && !is_dns_name(name) {
            let reason = format!("`{name}` is neither a DNS name nor an address");
            return Err(invalid(format!("tls.names[{i}]"), reason));
        }
    }
    let file = |path: PathBuf| Some(path).filter(|path| !path.as_os_str().is_empty());
    let own = match (file(raw.certificate), file(raw.key)) {
        (Some(certificate), Some(key)) => Some(OwnCertificate { certificate, key }),
        (None, None) => None,
        (Some(_), None) => return Err(invalid("tls.key", "the certificate's private key is missing".into())),
        (None, Some(_)) => return Err(invalid("tls.certificate", "the key's certificate is missing".into())),
    };
    let local_zenoh = Some(raw.local_zenoh).filter(|endpoint| !endpoint.is_empty());
    if let Some(endpoint) = &local_zenoh {
        let (is_tls, address) = zenoh_address("tls.local_zenoh", endpoint)?;
        if is_tls || !is_loopback(address.ip()) {
            let reason = format!("`{endpoint}` is not tcp/ with a loopback address");
            return Err(invalid("tls.local_zenoh", reason));
        }
    }
    Ok(Some(Tls { names: raw.names, own, client_authority: file(raw.client_authority), local_zenoh }))
}

/// Letters, digits and `-` between dots; no wildcard.
fn is_dns_name(text: &str) -> bool {
    let is_label = |label: &str| {
        let is_inner = |b: u8| b.is_ascii_alphanumeric() || b == b'-';
        (1..=MAX_LABEL_BYTES).contains(&label.len())
            && label.bytes().all(is_inner)
            && !label.starts_with('-')
            && !label.ends_with('-')
    };
    // A last part of digits would be a crooked address.
    let last_is_word = text.rsplit('.').next().is_some_and(|l| l.bytes().any(|b| b.is_ascii_alphabetic()));
    text.len() <= MAX_DNS_BYTES && last_is_word && text.split('.').all(is_label)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(raw: RawTls) -> Option<String> {
        match checked(raw) {
            Err(ConfigError::Invalid { field, .. }) => Some(field.into_owned()),
            Ok(_) => None,
            Err(other) => panic!("{other:?}"),
        }
    }

    #[test]
    fn names_and_files_are_checked_where_encryption_is_on() {
        let on = |names: &[&str], certificate: &str, key: &str| RawTls {
            enabled: true,
            names: names.iter().map(|&name| name.into()).collect(),
            certificate: certificate.into(),
            key: key.into(),
            ..RawTls::default()
        };
        assert_eq!(checked(RawTls { enabled: false, ..on(&["*"], "a", "") }).unwrap(), None);
        let good =
            checked(on(&["robots.example.org", "192.168.1.4", "::1", "r2-d2"], "", "")).unwrap().unwrap();
        assert_eq!((good.names.len(), good.own, good.client_authority), (4, None, None));
        for bad in ["", "*.example.org", "a b", "1.2.3", "-a", "a..b", "a/b", &"a".repeat(64)] {
            assert_eq!(refused(on(&["a", bad], "", "")), Some("tls.names[1]".into()), "{bad}");
        }
        assert_eq!(refused(on(&["a"; MAX_TLS_NAMES], "", "")), None);
        assert_eq!(refused(on(&["a"; MAX_TLS_NAMES + 1], "", "")), Some("tls.names".into()));
        assert_eq!(refused(on(&[], "c.pem", "")), Some("tls.key".into()));
        assert_eq!(refused(on(&[], "", "k.pem")), Some("tls.certificate".into()));
        for bad in ["tcp/192.168.1.4:1", "tls/127.0.0.1:1", "127.0.0.1:1"] {
            let raw = RawTls { local_zenoh: bad.into(), ..on(&[], "", "") };
            assert_eq!(refused(raw), Some("tls.local_zenoh".into()), "{bad}");
        }
        assert!(checked(on(&[], "c.pem", "k.pem")).unwrap().unwrap().own.is_some());
    }
}
