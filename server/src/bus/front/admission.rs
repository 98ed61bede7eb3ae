//! Who a client with a certificate is. In: the certificate that TLS has verified. Out: the robot,
//! for as long as its certificate is valid and not revoked.

use crate::identity::certificates::{CertificateError, CertificateRegistry, Certificates, acceptor};
use arc_swap::ArcSwap;
use engine::snapshot::Snapshots;
use protos::Name;
use std::{
    sync::Arc,
    time::{Duration, SystemTime},
};
use tokio_rustls::TlsAcceptor;
use x509_parser::{certificate::X509Certificate, prelude::FromDer as _};

/// What tells whom a certificate belongs to.
pub(in crate::bus) struct Admission {
    certificates: Arc<Certificates>,
    registry: Arc<CertificateRegistry>,
    snapshots: Arc<Snapshots>,
    acceptor: ArcSwap<TlsAcceptor>,
}

/// A robot with a valid certificate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Admitted {
    pub(super) robot: Name,
    /// In its certificate.
    common_name: String,
    expires: SystemTime,
}

/// Why there is no robot.
#[derive(Debug, thiserror::Error)]
pub(super) enum NotAdmitted {
    #[error("its certificate cannot be read")]
    Unreadable,
    #[error("the certificate `{0}` is revoked, has expired, or belongs to no robot of this server")]
    Unknown(String),
}

impl Admission {
    pub(in crate::bus) fn new(
        certificates: Arc<Certificates>,
        registry: Arc<CertificateRegistry>,
        snapshots: Arc<Snapshots>,
    ) -> Result<Self, CertificateError> {
        let acceptor = ArcSwap::from_pointee(made(&certificates)?);
        Ok(Self { certificates, registry, snapshots, acceptor })
    }

    /// Reads the authorities of robots again, for connections from now on.
    pub(in crate::bus) fn renew(&self) {
        match made(&self.certificates) {
            Ok(acceptor) => self.acceptor.store(Arc::new(acceptor)),
            Err(error) => {
                tracing::error!(%error, follows = "those in use stay", "authorities_not_read");
            }
        }
    }

    pub(super) fn acceptor(&self) -> Arc<TlsAcceptor> {
        self.acceptor.load_full()
    }

    /// Whose certificate it is.
    pub(super) fn admit(&self, certificate: &[u8]) -> Result<Admitted, NotAdmitted> {
        let Ok((_, parsed)) = X509Certificate::from_der(certificate) else {
            return Err(NotAdmitted::Unreadable);
        };
        let name = parsed.subject().iter_common_name().next().and_then(|name| name.as_str().ok());
        let common_name = name.ok_or(NotAdmitted::Unreadable)?.to_owned();
        let end_s = u64::try_from(parsed.validity().not_after.timestamp()).unwrap_or_default();
        let robot = self.robot(&common_name).ok_or_else(|| NotAdmitted::Unknown(common_name.clone()))?;
        Ok(Admitted { robot, common_name, expires: SystemTime::UNIX_EPOCH + Duration::from_secs(end_s) })
    }

    fn robot(&self, common_name: &str) -> Option<Name> {
        let holder = if self.certificates.enrols_robots() {
            self.registry.holder(common_name, crate::store::now_ms())?
        } else {
            // The operator's own authority signs for the robots' names.
            common_name.to_owned()
        };
        self.snapshots.robot_map(&holder)?;
        Name::new(holder).ok()
    }

    /// Waits until the certificate is not valid any more. Why it is not.
    pub(super) async fn lapse(&self, admitted: &Admitted) -> &'static str {
        let mut changes = self.registry.changes();
        loop {
            // Marked before it is looked at: no change is missed.
            changes.mark_unchanged();
            if self.robot(&admitted.common_name).as_ref() != Some(&admitted.robot) {
                return "its certificate is revoked, or the robot is not registered any more";
            }
            let left = admitted.expires.duration_since(SystemTime::now()).unwrap_or_default();
            tokio::select! {
                Ok(()) = changes.changed() => {}
                () = tokio::time::sleep(left.min(LOOK_AGAIN)) => {
                    if SystemTime::now() >= admitted.expires {
                        return "its certificate has expired";
                    }
                }
            }
        }
    }
}

/// A clock that is set is noticed after so long.
const LOOK_AGAIN: Duration = Duration::from_mins(1);

fn made(certificates: &Certificates) -> Result<TlsAcceptor, CertificateError> {
    let authorities = certificates.client_authorities_pem()?;
    acceptor(certificates.current(), Some(&authorities), &[])
}
