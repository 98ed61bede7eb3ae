//! The built-in authority: a key and a self-signed certificate in the folder `tls` of the data
//! directory, made once. It signs the server's certificate and those of robots.

use super::{CertificateError, PemKey};
use crate::identity::private_file;
use protos::Name;
use rcgen::{
    BasicConstraints, CertificateParams, CertificateSigningRequestParams, DistinguishedName, DnType,
    ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose, SerialNumber, date_time_ymd,
};
use sha2::{Digest, Sha256};
use std::{fmt, fs, path::Path, time::Duration};

/// The authority's certificate in the folder.
pub(crate) const AUTHORITY_FILE: &str = "authority.pem";
/// Its private key, of mode 0600.
pub(crate) const KEY_FILE: &str = "authority.key";
/// Time for which a new authority is valid: robots keep its certificate.
pub(super) const AUTHORITY_VALID: Duration = Duration::from_hours(20 * 365 * 24);
/// Certificates begin so long ago: clocks of robots may be behind.
const BEGINS_BEFORE: Duration = Duration::from_hours(48);
/// Longest request for a certificate that is read, in bytes.
pub(crate) const MAX_REQUEST_BYTES: usize = 16 << 10;

/// Who signs.
pub(crate) struct Authority {
    certificate_pem: String,
    issuer: Issuer<'static, KeyPair>,
}

impl fmt::Debug for Authority {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Authority").finish_non_exhaustive()
    }
}

/// A certificate of a robot, as it was signed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct SignedCertificate {
    /// 16 hexadecimal digits, random.
    pub(crate) serial: String,
    pub(crate) certificate_pem: String,
    /// Of the certificate, DER.
    pub(crate) sha256: [u8; 32],
    /// ms since the Unix epoch.
    pub(crate) expires_ms: i64,
}

/// Longest common name of a certificate, in characters (RFC 5280, `ub-common-name`): OpenSSL
/// refuses longer ones.
const MAX_COMMON_NAME: usize = 64;

/// The name in a robot's certificate: `{robot}.{serial}`, the robot's name cut where the two are
/// too long for a common name. Robots' names have no dot, and each certificate has a serial and so
/// a name of its own: one can be revoked and the others stay, and none is another robot's.
pub(crate) fn common_name(robot: &str, serial: &str) -> String {
    let room = MAX_COMMON_NAME.saturating_sub(serial.len() + 1);
    let shown = robot.get(..room).unwrap_or(robot);
    format!("{shown}.{serial}")
}

impl Authority {
    /// That of the folder; made if there is none.
    pub(crate) fn load_or_create(folder: &Path, now_ms: i64) -> Result<Self, CertificateError> {
        private_file::folder(folder).map_err(CertificateError::at(folder))?;
        let (certificate, key) = (folder.join(AUTHORITY_FILE), folder.join(KEY_FILE));
        match (certificate.exists(), key.exists()) {
            (true, true) => Self::load(&certificate, &key),
            // A crash between the two files: nobody has got a certificate of this key.
            (false, _) => Self::create(&certificate, &key, now_ms),
            (true, false) => Err(CertificateError::NoKey { certificate, key }),
        }
    }

    /// One in memory, for what is needed only in this process.
    pub(super) fn ephemeral(now_ms: i64) -> Result<Self, rcgen::Error> {
        let pair = KeyPair::generate()?;
        let params = authority_params(now_ms);
        let certificate_pem = params.self_signed(&pair)?.pem();
        Ok(Self { certificate_pem, issuer: Issuer::new(params, pair) })
    }

    fn load(certificate: &Path, key: &Path) -> Result<Self, CertificateError> {
        let read = |path: &Path| fs::read_to_string(path).map_err(CertificateError::at(path));
        private_file::close_to_others(key, 0o600).map_err(CertificateError::at(key))?;
        let (certificate_pem, key_pem) = (read(certificate)?, PemKey(read(key)?));
        super::server::certified(&certificate_pem, &key_pem, certificate)?;
        let bad = CertificateError::bad(certificate);
        let key = KeyPair::from_pem(&key_pem.0).map_err(&bad)?;
        let issuer = Issuer::from_ca_cert_pem(&certificate_pem, key).map_err(&bad)?;
        Ok(Self { certificate_pem, issuer })
    }

    fn create(certificate: &Path, key: &Path, now_ms: i64) -> Result<Self, CertificateError> {
        let bad = CertificateError::bad(certificate);
        let pair = KeyPair::generate().map_err(&bad)?;
        let params = authority_params(now_ms);
        let certificate_pem = params.self_signed(&pair).map_err(&bad)?.pem();
        // The certificate last: it is there only together with its key.
        private_file::write(key, &pair.serialize_pem()).map_err(CertificateError::at(key))?;
        private_file::write(certificate, &certificate_pem).map_err(CertificateError::at(certificate))?;
        Ok(Self { certificate_pem, issuer: Issuer::new(params, pair) })
    }

    /// Its own certificate, PEM: what robots and people trust.
    pub(crate) fn certificate_pem(&self) -> &str {
        &self.certificate_pem
    }

    /// A fresh certificate of the server for these names, with its key, PEM.
    pub(super) fn issue_server(
        &self,
        names: Vec<String>,
        now_ms: i64,
        valid: Duration,
    ) -> Result<(String, PemKey), rcgen::Error> {
        self.issue_listener("Waymark server", names, now_ms, valid)
    }

    /// A fresh certificate of a listener, with its key, PEM.
    pub(super) fn issue_listener(
        &self,
        common_name: &str,
        names: Vec<String>,
        now_ms: i64,
        valid: Duration,
    ) -> Result<(String, PemKey), rcgen::Error> {
        let pair = KeyPair::generate()?;
        let mut params = params(common_name, now_ms, valid);
        params.subject_alt_names = CertificateParams::new(names)?.subject_alt_names;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
        let certificate = params.signed_by(&pair, &self.issuer)?;
        Ok((certificate.pem(), PemKey(pair.serialize_pem())))
    }

    /// A fresh certificate of a program that connects, with its key, PEM.
    pub(super) fn issue_client(
        &self,
        common_name: &str,
        now_ms: i64,
        valid: Duration,
    ) -> Result<(String, PemKey), rcgen::Error> {
        let pair = KeyPair::generate()?;
        let mut params = params(common_name, now_ms, valid);
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        Ok((params.signed_by(&pair, &self.issuer)?.pem(), PemKey(pair.serialize_pem())))
    }

    /// Signs a robot's request (PKCS #10, PEM). Of the request only the public key is taken; it
    /// must prove that its sender has the private one.
    pub(crate) fn issue_robot(
        &self,
        robot: &Name,
        request_pem: &str,
        now_ms: i64,
        valid: Duration,
    ) -> Result<SignedCertificate, CertificateError> {
        let refused = |reason: String| CertificateError::Request { reason };
        if request_pem.len() > MAX_REQUEST_BYTES {
            return Err(refused(format!("it has more than {MAX_REQUEST_BYTES} bytes")));
        }
        let request = CertificateSigningRequestParams::from_pem(request_pem);
        let request = request.map_err(|e| refused(e.to_string()))?;
        let mut number = [0; 8];
        getrandom::fill(&mut number).map_err(|e| CertificateError::Randomness(e.to_string()))?;
        // A positive number of exactly eight bytes.
        number[0] = number[0] & 0x7f | 0x40;
        let serial = format!("{:016x}", u64::from_be_bytes(number));
        let mut params = params(&common_name(robot.as_str(), &serial), now_ms, valid);
        params.serial_number = Some(SerialNumber::from_slice(&number));
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        let signed = params.signed_by(&request.public_key, &self.issuer);
        let signed = signed.map_err(|e| refused(e.to_string()))?;
        Ok(SignedCertificate {
            serial,
            certificate_pem: signed.pem(),
            sha256: Sha256::digest(signed.der()).into(),
            expires_ms: now_ms + valid.as_millis() as i64,
        })
    }
}

fn authority_params(now_ms: i64) -> CertificateParams {
    let mut params = params("Waymark authority", now_ms, AUTHORITY_VALID);
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    params
}

/// A name and a time; the ends are whole seconds.
fn params(common_name: &str, now_ms: i64, valid: Duration) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name = DistinguishedName::new();
    params.distinguished_name.push(DnType::CommonName, common_name);
    let epoch = date_time_ymd(1970, 1, 1);
    let now = Duration::from_secs((now_ms / 1000).max(0).unsigned_abs());
    params.not_before = epoch + now.saturating_sub(BEGINS_BEFORE);
    params.not_after = epoch + now.saturating_add(valid);
    params.use_authority_key_identifier_extension = true;
    params
}
