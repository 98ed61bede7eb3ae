//! Certificates of the link between the front and the gate of one server process: made at the start
//! and for each connection, only in memory.

use super::{Authority, CertificateError, PemKey, authority::AUTHORITY_VALID, server::certified};
use rustls::{
    ClientConfig, RootCertStore,
    crypto::ring,
    pki_types::{CertificateDer, pem::PemObject as _},
    sign::SingleCertAndKey,
};
use std::{path::Path, sync::Arc};

/// An authority, and the certificate with key of the end that listens, PEM.
#[derive(Debug)]
pub(crate) struct LinkCertificates {
    authority: Authority,
    made_ms: i64,
    /// The end that listens, on [`LinkCertificates::HOST`].
    pub(crate) listener: (String, PemKey),
}

impl LinkCertificates {
    /// Name of the end that listens.
    pub(crate) const HOST: &'static str = "127.0.0.1";

    /// Fresh ones.
    pub(crate) fn new(now_ms: i64) -> Result<Self, CertificateError> {
        let made = || {
            let authority = Authority::ephemeral(now_ms)?;
            let here = vec![Self::HOST.to_owned()];
            let listener = authority.issue_listener("Waymark gate", here, now_ms, AUTHORITY_VALID)?;
            Ok(Self { authority, made_ms: now_ms, listener })
        };
        made().map_err(CertificateError::bad(Path::new(IN_MEMORY)))
    }

    /// Who signs the certificates of both ends, PEM.
    pub(crate) fn authority_pem(&self) -> &str {
        self.authority.certificate_pem()
    }

    /// What connects under a name, and speaks `protocol`.
    pub(crate) fn client(&self, name: &str, protocol: &[u8]) -> Result<ClientConfig, CertificateError> {
        let at = Path::new(IN_MEMORY);
        let bad = |reason: String| CertificateError::Bad { path: at.to_owned(), reason };
        let issued = self.authority.issue_client(name, self.made_ms, AUTHORITY_VALID);
        let (certificate, key) = issued.map_err(CertificateError::bad(at))?;
        let shown = SingleCertAndKey::from(certified(&certificate, &key, at)?);
        let authority = CertificateDer::from_pem_slice(self.authority_pem().as_bytes());
        let mut roots = RootCertStore::empty();
        roots.add(authority.map_err(|e| bad(e.to_string()))?).map_err(|e| bad(e.to_string()))?;
        let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
        let builder = builder.with_safe_default_protocol_versions().map_err(|e| bad(e.to_string()))?;
        let mut config = builder.with_root_certificates(roots).with_client_cert_resolver(Arc::new(shown));
        config.alpn_protocols = vec![protocol.to_vec()];
        Ok(config)
    }
}

const IN_MEMORY: &str = "a certificate in memory";
