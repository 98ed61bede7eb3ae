//! Certificates of the link between the two routers of one server process: made at the start, only in memory.

use super::{Authority, CertificateError, PemKey, authority::AUTHORITY_VALID};
use std::path::Path;

/// Authority, and certificates with keys of both ends, PEM.
#[derive(Debug)]
pub(crate) struct LinkCertificates {
    pub(crate) authority_pem: String,
    /// The end that listens, on 127.0.0.1.
    pub(crate) listener: (String, PemKey),
    /// The end that connects.
    pub(crate) client: (String, PemKey),
    /// Name in the listener's certificate; nobody can guess it.
    pub(crate) listener_name: String,
}

impl LinkCertificates {
    /// Fresh ones. Whoever signs them is forgotten at once.
    pub(crate) fn new(now_ms: i64) -> Result<Self, CertificateError> {
        let mut number = [0; 16];
        getrandom::fill(&mut number).map_err(|e| CertificateError::Randomness(e.to_string()))?;
        let listener_name = format!("Waymark router {:032x}", u128::from_be_bytes(number));
        let made = || {
            let authority = Authority::ephemeral(now_ms)?;
            let here = vec!["127.0.0.1".to_owned()];
            let listener = authority.issue_listener(&listener_name, here, now_ms, AUTHORITY_VALID)?;
            let client = authority.issue_client("Waymark gate", now_ms, AUTHORITY_VALID)?;
            Ok((authority.certificate_pem().to_owned(), listener, client))
        };
        let made: Result<_, rcgen::Error> = made();
        let at = Path::new("a certificate in memory");
        let (authority_pem, listener, client) = made.map_err(CertificateError::bad(at))?;
        Ok(Self { authority_pem, listener, client, listener_name })
    }
}
