//! `/robots/{robot}/certificates`: what robots show on encrypted connections.

use serde::{Deserialize, Serialize};

/// A request for a certificate. The robot's private key stays where it was made.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CertificateRequest {
    /// PKCS #10, PEM, signed with the private key. Of it only the public key is taken.
    pub request: String,
    /// Seconds for which the certificate is valid, by the server's clock: 60 to ten years; a year
    /// if absent.
    #[serde(default)]
    pub valid_s: Option<u64>,
}

/// A certificate of a robot, without its key.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RobotCertificate {
    /// 16 hexadecimal digits.
    pub serial: String,
    /// Whose it is.
    pub robot: String,
    /// SHA-256 of the certificate (DER), hexadecimal.
    pub sha256: String,
    /// Milliseconds since the Unix epoch.
    pub issued_ms: i64,
    /// Not valid from then on.
    pub expires_ms: i64,
    /// Not valid since then; null if it was not revoked.
    pub revoked_ms: Option<i64>,
}

/// A new certificate, with what a robot needs to connect.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct EnrolledRobot {
    /// The certificate, PEM.
    pub certificate_pem: String,
    /// Who has signed the server's certificate, PEM; null if that is a file of the operator's own.
    pub authority_pem: Option<String>,
    /// Where robots connect, as the server listens: its host may be `0.0.0.0`.
    pub zenoh: String,
    /// Names and addresses of the server's settings.
    pub names: Vec<String>,
    /// Name in every key.
    pub fleet: String,
    /// What was stored of it.
    pub certificate: RobotCertificate,
}
