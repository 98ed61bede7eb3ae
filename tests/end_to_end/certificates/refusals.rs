//! Who has no valid certificate has nothing, and is told why. Private keys are their owner's.

use super::{Fleet, read, session};
use client::{Capture, ClientError, RobotClient, RobotOptions};
use protos::v1;
use rcgen::{CertificateParams, DnType, Issuer, KeyPair, date_time_ymd};
use std::{fs, path::Path, process::Stdio, time::Duration};
use tests::{Child, SOON};
use vision::frame::GrayImage;

fn picture() -> Capture {
    Capture::gray(&GrayImage::from_fn(64, 48, |u, _| u as u8))
}

fn soon(options: RobotOptions) -> RobotOptions {
    RobotOptions { timeout: Duration::from_secs(3), ..options }
}

/// A client's certificate of an authority, for a name, that ends in this year.
fn certificate(authority: &Issuer<'_, KeyPair>, name: &str, ends: i32) -> (String, String) {
    let key = KeyPair::generate().expect("a key");
    let mut params = CertificateParams::default();
    params.distinguished_name.push(DnType::CommonName, name);
    (params.not_before, params.not_after) = (date_time_ymd(2000, 1, 1), date_time_ymd(ends, 1, 1));
    (params.signed_by(&key, authority).expect("a certificate").pem(), key.serialize_pem())
}

/// The authority of a server, as who has read its private key has it.
fn stolen(data: &Path) -> Issuer<'static, KeyPair> {
    let folder = data.join("tls");
    let key = KeyPair::from_pem(&read(folder.join("authority.key"))).expect("a key");
    Issuer::from_ca_cert_pem(&read(folder.join("authority.pem")), key).expect("an authority")
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_valid_certificate_there_is_no_session_and_the_sdk_says_why() {
    let fleet = Fleet::start().await;
    let good = fleet.options("r1");
    let r1 = RobotClient::connect(&good).await.expect("connected");
    let answer = r1.recognise("front", picture(), SOON).await.expect("an answer");
    assert_eq!(answer.status(), v1::Status::NoMatch);
    let tls = good.tls.clone().expect("certificates");
    assert!(session(&good.endpoint, None).await.is_err(), "no certificate, no authority");
    let plain = good.endpoint.replace("tls/", "tcp/");
    assert!(session(&plain, None).await.is_err(), "plain text to the encrypted port");

    let refused = async |name: &str, (certificate, key): (String, String)| {
        let folder = fleet.folder(name);
        fs::create_dir_all(&folder).expect("a folder");
        let (certificate_pem, key_pem) = (folder.join("certificate.pem"), folder.join("key.pem"));
        fs::write(&certificate_pem, certificate).expect("a file");
        fs::write(&key_pem, key).expect("a file");
        let tls = client::RobotTls { certificate: certificate_pem, key: key_pem, ..tls.clone() };
        RobotClient::connect(&soon(RobotOptions { tls: Some(tls), ..good.clone() })).await.err()
    };
    let own_name = {
        let all = fleet.inside.maps().robot_certificates("r1").await.expect("certificates");
        format!("r1.{}", all[0].serial)
    };
    let key = KeyPair::generate().expect("a key");
    let foreign = Issuer::new(CertificateParams::default(), key);
    let error = refused("foreign", certificate(&foreign, &own_name, 2100)).await;
    assert!(matches!(error, Some(ClientError::TlsRefused { .. })), "a foreign authority: {error:?}");
    let ours = stolen(fleet.inside.data());
    let error = refused("expired", certificate(&ours, &own_name, 2001)).await;
    assert!(matches!(error, Some(ClientError::TlsRefused { .. })), "expired: {error:?}");
    let error = refused("unknown", certificate(&ours, "r1.0000000000000000", 2100)).await;
    assert!(matches!(error, Some(ClientError::NotAdmitted { .. })), "not issued: {error:?}");
    let error = refused("other", certificate(&ours, "r1", 2100)).await;
    assert!(matches!(error, Some(ClientError::NotAdmitted { .. })), "the bare name: {error:?}");

    let late = client::RobotTls { expires_ms: Some(1), ..tls.clone() };
    let late = RobotClient::connect(&RobotOptions { tls: Some(late), ..good.clone() }).await;
    assert!(matches!(late, Err(ClientError::CertificateExpired { .. })));
    let other = RobotOptions { robot: "r2".into(), ..soon(good.clone()) };
    assert!(matches!(RobotClient::connect(&other).await, Err(ClientError::NotAdmitted { .. })));
    let untrusted = client::RobotTls { authority: None, ..tls };
    let untrusted = RobotClient::connect(&soon(RobotOptions { tls: Some(untrusted), ..good })).await;
    assert!(matches!(untrusted, Err(ClientError::TlsRefused { .. })));
    let answer = r1.recognise("front", picture(), SOON).await.expect("the others go on");
    assert_eq!(answer.status(), v1::Status::NoMatch);
    fleet.inside.server.stop().await;
}

/// Whole lines of a private key, PEM.
fn lines(pem: &str) -> Vec<&str> {
    pem.lines().filter(|line| !line.starts_with("---")).collect()
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn private_keys_are_private_and_in_no_log() {
    use std::os::unix::fs::PermissionsExt as _;
    let folder = tempfile::TempDir::new().expect("a folder");
    let (data, log) = (folder.path().join("data"), folder.path().join("log"));
    let mut command = Child::command(&data, &[("WAYMARK_TLS__ENABLED", "true"), ("RUST_BACKTRACE", "0")]);
    command
        .env("WAYMARK_LOG", "debug,zenoh=trace")
        .stderr(Stdio::from(fs::File::create(&log).expect("a file")));
    let server = Child::start_from(&mut command);
    let maps = server.maps();
    maps.create_map(&client::api::NewMap::new("hall")).await.expect("a map");
    maps.put_robot("r1", "hall").await.expect("a robot");
    let out = folder.path().join("r1");
    let args = ["robot", "enrol", "r1", "--out", out.to_str().expect("a path"), "--server", &server.url];
    let run = tests::command::waymark(args, SOON);
    assert_eq!(run.status, 0, "{run:?}");
    let options = RobotOptions::from_file(out.join("robot.json")).expect("the robot's file");
    let r1 = RobotClient::connect(&options).await.expect("connected");
    r1.recognise("front", picture(), SOON).await.expect("an answer");
    drop(r1);
    server.kill();
    let mode = |path: &Path| fs::metadata(path).expect("a file").permissions().mode() & 0o777;
    let keys = [data.join("tls/authority.key"), out.join("key.pem")];
    assert_eq!(keys.each_ref().map(|key| mode(key)), [0o600, 0o600]);
    assert_eq!(mode(&data.join("tls")), 0o700);
    let log = read(&log);
    assert!(log.contains("zenoh") && log.contains("access_changed"), "the log is no longer read");
    assert!(!log.contains("PRIVATE KEY"));
    // As zenoh's settings have it, a key is in base64 once more.
    assert!(!log.contains("LS0tLS1CRUdJTiBQUklWQVRF"), "a key in base64");
    for key in &keys {
        let pem = read(key);
        assert!(lines(&pem).iter().all(|line| !log.contains(line) && !run.stdout.contains(line)));
        assert!(lines(&pem).len() >= 2);
    }
}
