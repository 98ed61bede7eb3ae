//! Who has no valid certificate has nothing, and is told why. Private keys are their owner's.

use super::{Fleet, read, session};
use client::{Capture, ClientError, RobotClient, RobotOptions};
use protos::v1;
use rcgen::{CertificateParams, DnType, Issuer, KeyPair, date_time_ymd};
use server::config::{RawConfig, RawTls};
use std::{fs, path::Path, process::Stdio, time::Duration};
use tempfile::TempDir;
use tests::{Child, Inside, SOON};
use tokio::{
    io::copy_bidirectional,
    net::{TcpListener, TcpStream},
};
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

/// Everything that is sent to an address that is not in the server's certificate goes to the
/// server.
async fn relay(server: &str) -> String {
    let listener = TcpListener::bind("127.0.0.2:0").await.expect("a port");
    let at = listener.local_addr().expect("its address");
    let server = server.trim_start_matches("tls/").to_owned();
    tokio::spawn(async move {
        while let Ok((mut robot, _)) = listener.accept().await {
            let server = server.clone();
            tokio::spawn(async move {
                let mut upstream = TcpStream::connect(server).await.expect("the server");
                copy_bidirectional(&mut robot, &mut upstream).await
            });
        }
    });
    format!("tls/{at}")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_believes_the_names_in_the_servers_certificate_alone() {
    let fleet = Fleet::start().await;
    let good = fleet.options("r1");
    RobotClient::connect(&good).await.expect("connected").close().await.expect("closed");
    let other = soon(RobotOptions { endpoint: relay(&good.endpoint).await, ..good.clone() });
    let error = RobotClient::connect(&other).await.err();
    assert!(
        matches!(error, Some(ClientError::TlsRefused { .. })),
        "an address that it does not name: {error:?}"
    );
    assert!(session(&other.endpoint, good.tls.as_ref()).await.is_err());
    // Nothing but the name is wrong with that way: a server whose certificate has it is believed
    // there.
    let names = RawTls { enabled: true, names: vec!["127.0.0.2".into()], ..RawTls::default() };
    let named = Inside::start_with(RawConfig { tls: names, ..RawConfig::default() }).await;
    let named = Fleet { inside: named, local: String::new(), folders: TempDir::new().expect("a folder") };
    named.add("r1", "hall").await;
    let options = named.options("r1");
    let options = RobotOptions { endpoint: relay(&named.inside.server.zenoh_endpoint).await, ..options };
    RobotClient::connect(&options).await.expect("connected by its name");
    for fleet in [fleet, named] {
        fleet.inside.server.stop().await;
    }
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
