//! Encryption of HTTP. In: the server's address and whom to believe. Out: a client that speaks to
//! it, plain or encrypted.

use crate::ClientError;
use reqwest::ClientBuilder;
use rustls::{
    ClientConfig, RootCertStore,
    crypto::ring,
    pki_types::{CertificateDer, pem::PemObject as _},
};
use std::{io, sync::Arc};

/// Adds what `https` needs. Without `authority_pem`, the authorities of the system are believed;
/// with it, no other.
pub(super) fn encrypted(
    builder: ClientBuilder,
    base: &str,
    authority_pem: Option<&[u8]>,
) -> Result<ClientBuilder, ClientError> {
    // Once for the process; a program may have installed its own.
    drop(ring::default_provider().install_default());
    let is_https = base.get(..8).is_some_and(|scheme| scheme.eq_ignore_ascii_case("https://"));
    match authority_pem {
        None if is_https => Ok(builder),
        // Plain text: nobody has to be believed, and a system without authorities is no error.
        None => Ok(builder.tls_backend_preconfigured(config(RootCertStore::empty())?)),
        Some(pem) => Ok(builder.tls_backend_preconfigured(config(authorities(pem)?)?)),
    }
}

fn authorities(pem: &[u8]) -> Result<RootCertStore, ClientError> {
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_slice_iter(pem) {
        let certificate = certificate.map_err(|e| ClientError::Authority(e.to_string()))?;
        roots.add(certificate).map_err(|e| ClientError::Authority(e.to_string()))?;
    }
    if roots.is_empty() {
        return Err(ClientError::Authority("there is no certificate in it".to_owned()));
    }
    Ok(roots)
}

fn config(roots: RootCertStore) -> Result<ClientConfig, ClientError> {
    let builder = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()));
    let builder = builder.with_safe_default_protocol_versions();
    let builder = builder.map_err(|e| ClientError::Authority(e.to_string()))?;
    Ok(builder.with_root_certificates(roots).with_no_client_auth())
}

/// What is wrong with the server's certificate, if that is why a request failed.
pub(super) fn untrusted(error: &reqwest::Error) -> Option<String> {
    let mut cause = std::error::Error::source(error);
    while let Some(inner) = cause {
        if let Some(rustls::Error::InvalidCertificate(reason)) = inner.downcast_ref() {
            return Some(reason.to_string());
        }
        // The source of an `io::Error` is that of the error in it, which itself is left out.
        let within = inner.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
        cause = match within {
            Some(within) => Some(within),
            None => inner.source(),
        };
    }
    None
}
