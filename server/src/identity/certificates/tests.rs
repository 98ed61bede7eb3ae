//! Certificates are accepted by rustls where they should be, and files are private.

use super::{authority::SignedCertificate, server::RENEWED_AFTER, *};
use protos::Name;
use rcgen::{CertificateParams, KeyPair};
use rustls::{
    ClientConfig, ClientConnection, RootCertStore, ServerConfig, ServerConnection,
    pki_types::{CertificateDer, PrivateKeyDer, ServerName, pem::PemObject as _},
    server::WebPkiClientVerifier,
};

const DAY: Duration = Duration::from_hours(24);

fn tls(names: &[&str]) -> Tls {
    Tls {
        names: names.iter().map(|&name| name.into()).collect(),
        own: None,
        client_authority: None,
        local_zenoh: None,
    }
}

fn roots(pem: &str) -> Arc<RootCertStore> {
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_slice_iter(pem.as_bytes()) {
        roots.add(certificate.unwrap()).unwrap();
    }
    Arc::new(roots)
}

/// A key and a request for it, PEM.
fn request() -> (String, String) {
    let key = KeyPair::generate().unwrap();
    (key.serialize_pem(), CertificateParams::default().serialize_request(&key).unwrap().pem().unwrap())
}

#[test]
fn a_common_name_has_at_most_64_characters_and_is_of_one_certificate() {
    let serials = ["4000000000000001", "4000000000000002"];
    let [one, other] = [63, 64].map(|length| "r".repeat(length));
    assert_eq!(common_name("r1", serials[0]), "r1.4000000000000001");
    assert_eq!(common_name(&"r".repeat(47), serials[0]).len(), 64);
    assert_eq!(common_name(&other, serials[0]).len(), 64);
    assert_ne!(common_name(&one, serials[0]), common_name(&other, serials[1]));
}

/// Shakes hands in memory; the certificate that the client has shown.
fn shake(
    server: &Certificates,
    name: &str,
    trusted: &str,
    (certificate, key): (&str, &str),
) -> Result<CertificateDer<'static>, rustls::Error> {
    let certified = server.current().borrow().certified.clone();
    let resolver = rustls::sign::SingleCertAndKey::from((*certified).clone());
    let verifier = WebPkiClientVerifier::builder(roots(&server.client_authorities_pem().unwrap()));
    let config = ServerConfig::builder()
        .with_client_cert_verifier(verifier.build().unwrap())
        .with_cert_resolver(Arc::new(resolver));
    let mut server = ServerConnection::new(Arc::new(config)).unwrap();
    let shown = vec![CertificateDer::from_pem_slice(certificate.as_bytes()).unwrap()];
    let config = ClientConfig::builder()
        .with_root_certificates(roots(trusted))
        .with_client_auth_cert(shown, PrivateKeyDer::from_pem_slice(key.as_bytes()).unwrap())
        .unwrap();
    let name = ServerName::try_from(name.to_owned()).unwrap();
    let mut client = ClientConnection::new(Arc::new(config), name).unwrap();
    while server.is_handshaking() || client.is_handshaking() {
        let mut bytes = Vec::new();
        client.write_tls(&mut bytes).unwrap();
        server.read_tls(&mut bytes.as_slice()).unwrap();
        server.process_new_packets()?;
        let mut bytes = Vec::new();
        server.write_tls(&mut bytes).unwrap();
        client.read_tls(&mut bytes.as_slice()).unwrap();
        client.process_new_packets()?;
    }
    Ok(server.peer_certificates().unwrap()[0].clone().into_owned())
}

#[test]
fn a_robot_and_the_server_accept_each_other_and_no_stranger() {
    let data = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let [ours, foreign] =
        [0, 1].map(|i| Certificates::open(&tls(&["robots.example.org"]), data[i].path(), now_ms()).unwrap());
    let (key, request) = request();
    let r1 = Name::new("r1").unwrap();
    let issue = |of: &Certificates, now_ms| of.authority().issue_robot(&r1, &request, now_ms, DAY).unwrap();
    let authority = ours.authority().certificate_pem();
    let shown = |signed: &SignedCertificate, name: &str, authority: &str| {
        shake(&ours, name, authority, (&signed.certificate_pem, &key))
    };
    let good = issue(&ours, now_ms());
    for name in ["robots.example.org", "localhost", "127.0.0.1", "::1"] {
        use sha2::{Digest as _, Sha256};
        let seen = shown(&good, name, authority).unwrap();
        assert_eq!(<[u8; 32]>::from(Sha256::digest(&seen)), good.sha256, "{name}");
    }
    assert!(shown(&good, "other.example.org", authority).is_err(), "another server's name");
    assert!(shown(&good, "localhost", foreign.authority().certificate_pem()).is_err(), "a foreign server");
    assert!(shown(&issue(&foreign, now_ms()), "localhost", authority).is_err(), "a foreign robot");
    let expired = issue(&ours, now_ms() - 2 * DAY.as_millis() as i64);
    assert!(shown(&expired, "localhost", authority).is_err(), "an expired certificate");
    let slow_clock = issue(&ours, now_ms() + DAY.as_millis() as i64);
    assert!(shown(&slow_clock, "localhost", authority).is_ok(), "a clock that is behind");
    let (server, server_key) = ours.authority().issue_server(vec!["r1".into()], now_ms(), DAY).unwrap();
    assert!(
        shake(&ours, "localhost", authority, (&server, &server_key.0)).is_err(),
        "no client's certificate"
    );
    assert_ne!(good.serial, issue(&ours, now_ms()).serial);
    assert_eq!(good.serial.len(), 16);
}

#[test]
fn a_request_without_the_private_key_is_not_signed() {
    let data = tempfile::tempdir().unwrap();
    let ours = Certificates::open(&tls(&[]), data.path(), now_ms()).unwrap();
    let r1 = Name::new("r1").unwrap();
    let refused = |request: &str| ours.authority().issue_robot(&r1, request, now_ms(), DAY).unwrap_err();
    let (key, request) = request();
    for bad in ["", "x", &key, &request.replace('A', "B"), &" ".repeat(authority::MAX_REQUEST_BYTES + 1)] {
        let error = refused(bad);
        assert!(matches!(error, CertificateError::Request { .. }), "{error:?}");
        assert!(!error.to_string().contains("PRIVATE"), "{error}");
    }
}

#[test]
fn the_authority_stays_and_its_key_is_private() {
    let data = tempfile::tempdir().unwrap();
    let open = || Certificates::open(&tls(&[]), data.path(), now_ms());
    let first = open().unwrap();
    let folder = data.path().join(FOLDER);
    let key = folder.join(authority::KEY_FILE);
    assert_eq!(open().unwrap().authority().certificate_pem(), first.authority().certificate_pem());
    assert!(!format!("{first:?} {:?}", first.current().borrow()).contains("PRIVATE"));
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        assert_eq!((mode(&folder), mode(&key)), (0o700, 0o600));
        fs::set_permissions(&key, fs::Permissions::from_mode(0o644)).unwrap();
        open().unwrap();
        assert_eq!(mode(&key), 0o600);
    }
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 2, "no draft is left");
    // Another's key, and none.
    fs::write(&key, KeyPair::generate().unwrap().serialize_pem()).unwrap();
    assert!(matches!(open().unwrap_err(), CertificateError::Bad { .. }));
    fs::remove_file(&key).unwrap();
    assert!(matches!(open().unwrap_err(), CertificateError::NoKey { .. }));
}

#[test]
fn the_servers_certificate_is_renewed_in_time_and_files_are_read_again() {
    let data = tempfile::tempdir().unwrap();
    let now = now_ms();
    let ours = Certificates::open(&tls(&[]), data.path(), now).unwrap();
    let first = ours.current().borrow().clone();
    let due = now + RENEWED_AFTER.as_millis() as i64;
    assert!(!ours.renew(due - 1).unwrap() && ours.renew(due).unwrap());
    assert_ne!(ours.current().borrow().chain_pem, first.chain_pem);

    let files = ["c.pem", "k.pem"].map(|name| data.path().join(name));
    let put = |of: &ServerCertificate| {
        fs::write(&files[0], &of.chain_pem).unwrap();
        fs::write(&files[1], &of.key_pem.0).unwrap();
    };
    put(&first);
    let own = crate::config::OwnCertificate { certificate: files[0].clone(), key: files[1].clone() };
    let settings = Tls { own: Some(own), ..tls(&[]) };
    let theirs = Certificates::open(&settings, data.path(), now).unwrap();
    assert_eq!(theirs.current().borrow().chain_pem, first.chain_pem);
    assert!(!theirs.renew(now).unwrap());
    put(&ours.current().borrow());
    assert!(theirs.renew(now).unwrap());
    // The one in use stays where the files do not fit.
    fs::write(&files[1], &first.key_pem.0).unwrap();
    assert!(theirs.renew(now).is_err());
    assert_eq!(theirs.current().borrow().chain_pem, ours.current().borrow().chain_pem);
}
