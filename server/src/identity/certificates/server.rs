//! The server's certificate in use. In: names, or files of the operator's own. Out: chain and key,
//! renewed in time.

use super::{Authority, CertificateError, PemKey};
use crate::config::OwnCertificate;
use rustls::{
    crypto::ring,
    pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject as _},
    sign::CertifiedKey,
};
use std::{collections::BTreeSet, fs, path::Path, sync::Arc, time::Duration};

/// Time for which a certificate of the built-in authority is valid. It is made anew at each start.
const VALID: Duration = Duration::from_hours(90 * 24);
/// It is renewed after this time.
pub(super) const RENEWED_AFTER: Duration = Duration::from_hours(60 * 24);
/// Always in the certificate: clients on the same machine.
const LOOPBACK: [&str; 3] = ["localhost", "127.0.0.1", "::1"];

/// Chain and key. Only the digest of the chain shows in `Debug`.
#[derive(Clone)]
pub(crate) struct ServerCertificate {
    /// PEM, the server's own first.
    pub(crate) chain_pem: String,
    pub(crate) key_pem: PemKey,
    /// The same for rustls.
    pub(crate) certified: Arc<CertifiedKey>,
    /// When it is to be renewed, ms since the Unix epoch; `None` for files of the operator's own.
    pub(super) renew_ms: Option<i64>,
}

impl std::fmt::Debug for ServerCertificate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ServerCertificate").field("renew_ms", &self.renew_ms).finish_non_exhaustive()
    }
}

impl ServerCertificate {
    /// Signed by the built-in authority for these names and loopback.
    pub(super) fn issued(
        authority: &Authority,
        names: &[String],
        now_ms: i64,
    ) -> Result<Self, CertificateError> {
        let all: BTreeSet<String> = names.iter().cloned().chain(LOOPBACK.map(str::to_owned)).collect();
        let issued = authority.issue_server(all.into_iter().collect(), now_ms, VALID);
        let at = Path::new("the server's certificate");
        let (chain_pem, key_pem) = issued.map_err(CertificateError::bad(at))?;
        let certified = Arc::new(certified(&chain_pem, &key_pem, at)?);
        let renew_ms = now_ms + RENEWED_AFTER.as_millis() as i64;
        Ok(Self { chain_pem, key_pem, certified, renew_ms: Some(renew_ms) })
    }

    /// That of the operator's files.
    pub(super) fn read(files: &OwnCertificate) -> Result<Self, CertificateError> {
        let read = |path: &Path| fs::read_to_string(path).map_err(CertificateError::at(path));
        let (chain_pem, key_pem) = (read(&files.certificate)?, PemKey(read(&files.key)?));
        let certified = Arc::new(certified(&chain_pem, &key_pem, &files.certificate)?);
        Ok(Self { chain_pem, key_pem, certified, renew_ms: None })
    }
}

/// Chain and key of PEM texts; an error names `path` if they do not belong together.
pub(super) fn certified(
    chain_pem: &str,
    key_pem: &PemKey,
    path: &Path,
) -> Result<CertifiedKey, CertificateError> {
    let bad = |reason: String| CertificateError::Bad { path: path.to_owned(), reason };
    let chain: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(chain_pem.as_bytes()).collect();
    let chain = chain.map_err(|e| bad(e.to_string()))?;
    let key = PrivateKeyDer::from_pem_slice(key_pem.0.as_bytes());
    let key = key.map_err(|e| bad(format!("its private key: {e}")))?;
    CertifiedKey::from_der(chain, key, &ring::default_provider()).map_err(|e| bad(e.to_string()))
}
