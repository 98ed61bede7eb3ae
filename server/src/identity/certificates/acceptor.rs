//! TLS of a listener: the server's certificate in use, and where it asks for them, certificates of
//! clients.

use super::{CertificateError, ServerCertificate};
use rustls::{
    RootCertStore, ServerConfig,
    crypto::ring,
    pki_types::{CertificateDer, pem::PemObject as _},
    server::{ClientHello, ResolvesServerCert, WebPkiClientVerifier},
    sign::CertifiedKey,
};
use std::{path::Path, sync::Arc};
use tokio::sync::watch;
use tokio_rustls::TlsAcceptor;

/// The certificate in use, looked up for each connection.
#[derive(Debug)]
struct Current(watch::Receiver<Arc<ServerCertificate>>);

impl ResolvesServerCert for Current {
    fn resolve(&self, _: ClientHello<'_>) -> Option<Arc<CertifiedKey>> {
        Some(self.0.borrow().certified.clone())
    }
}

/// TLS 1.2 or 1.3. `authorities`: PEM of those whose certificates a client must have. `protocols`:
/// what may be spoken inside; whatever the client likes, if there is none.
pub(crate) fn acceptor(
    certificate: watch::Receiver<Arc<ServerCertificate>>,
    authorities: Option<&str>,
    protocols: &[&[u8]],
) -> Result<TlsAcceptor, CertificateError> {
    let at = Path::new("the authorities of robots");
    let bad = |reason: String| CertificateError::Bad { path: at.to_owned(), reason };
    let provider = Arc::new(ring::default_provider());
    let builder = ServerConfig::builder_with_provider(provider.clone());
    let builder = builder.with_safe_default_protocol_versions().map_err(|e| bad(e.to_string()))?;
    let builder = match authorities {
        None => builder.with_no_client_auth(),
        Some(pem) => {
            let mut roots = RootCertStore::empty();
            for authority in CertificateDer::pem_slice_iter(pem.as_bytes()) {
                let authority = authority.map_err(|e| bad(e.to_string()))?;
                roots.add(authority).map_err(|e| bad(e.to_string()))?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider).build();
            builder.with_client_cert_verifier(verifier.map_err(|e| bad(e.to_string()))?)
        }
    };
    let mut config = builder.with_cert_resolver(Arc::new(Current(certificate)));
    config.alpn_protocols = protocols.iter().map(|protocol| protocol.to_vec()).collect();
    Ok(TlsAcceptor::from(Arc::new(config)))
}
