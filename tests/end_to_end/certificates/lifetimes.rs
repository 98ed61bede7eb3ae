//! A connection ends with its certificate, and certificates of the operator's own authority are for
//! the robot in their name.

use super::{Fleet, read, session};
use client::{ClientError, RobotClient, RobotOptions, RobotTls, api::NewMap, v1};
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    date_time_ymd,
};
use server::config::{RawConfig, RawTls};
use std::{
    fs,
    path::Path,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tempfile::TempDir;
use tests::{Inside, SOON, eventually};
use vision::frame::GrayImage;

/// Long enough to connect on a busy machine.
const VALID: Duration = Duration::from_secs(20);

/// A client's certificate for a name, and its key, as files of a folder; it ends after `valid`.
fn certificate(authority: &Issuer<'_, KeyPair>, name: &str, valid: Duration, folder: &Path) -> RobotTls {
    let pair = KeyPair::generate().expect("a key");
    let mut params = CertificateParams::default();
    params.distinguished_name.push(DnType::CommonName, name);
    params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
    let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970");
    let ends = Duration::from_secs((now + valid).as_secs());
    params.not_before = date_time_ymd(2000, 1, 1);
    params.not_after = date_time_ymd(1970, 1, 1) + ends;
    fs::create_dir_all(folder).expect("a folder");
    let (certificate, key) = (folder.join("certificate.pem"), folder.join("key.pem"));
    fs::write(&certificate, params.signed_by(&pair, authority).expect("a certificate").pem())
        .expect("a file");
    fs::write(&key, pair.serialize_pem()).expect("a file");
    RobotTls { certificate, key, authority: None, expires_ms: None }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_open_connection_ends_when_its_certificate_expires() {
    let fleet = Fleet::start().await;
    let RobotOptions { endpoint, tls, .. } = fleet.options("r1");
    let tls = tls.expect("certificates");
    // What the authority signs for the robot, with another end.
    let serial = fleet.inside.maps().robot_certificates("r1").await.expect("certificates")[0].serial.clone();
    let folder = fleet.inside.data().join("tls");
    let key = KeyPair::from_pem(&read(folder.join("authority.key"))).expect("a key");
    let authority = Issuer::from_ca_cert_pem(&read(folder.join("authority.pem")), key).expect("an authority");
    let short = certificate(&authority, &format!("r1.{serial}"), VALID, &fleet.folder("short"));
    let short = RobotTls { authority: tls.authority.clone(), ..short };
    let ends = session(&endpoint, Some(&short)).await.expect("a session");
    let lasts = session(&endpoint, Some(&tls)).await.expect("a session");
    assert!(ends.info().routers_zid().await.next().is_some(), "valid as yet");
    let closed = || async { ends.info().routers_zid().await.next().is_none().then_some(()) };
    eventually("the end of the connection", closed).await;
    assert!(lasts.info().routers_zid().await.next().is_some(), "another certificate of the robot goes on");
    fleet.inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_operators_own_authority_signs_for_the_robot_in_the_name() {
    let folder = TempDir::new().expect("a folder");
    let pair = KeyPair::generate().expect("a key");
    let mut params = CertificateParams::default();
    params.distinguished_name.push(DnType::CommonName, "Authority of the operator");
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let client_authority = folder.path().join("authority.pem");
    fs::write(&client_authority, params.self_signed(&pair).expect("a certificate").pem()).expect("a file");
    let own = Issuer::new(params, pair);
    let tls = RawTls { enabled: true, client_authority, ..RawTls::default() };
    let inside = Inside::start_with(RawConfig { tls, ..RawConfig::default() }).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("a map");
    maps.put_robot("r1", "hall").await.expect("a robot");
    let server = inside.data().join("tls/authority.pem");
    let options = |tls: RobotTls, timeout| RobotOptions {
        tls: Some(RobotTls { authority: Some(server.clone()), ..tls }),
        timeout,
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
    };
    let named = |name: &str| certificate(&own, name, Duration::from_hours(1), &folder.path().join(name));
    let r1 = RobotClient::connect(&options(named("r1"), SOON)).await.expect("connected");
    let picture = client::Capture::gray(&GrayImage::from_fn(64, 48, |u, _| u as u8));
    let answer = r1.recognise("front", picture, SOON).await.expect("an answer");
    assert_eq!(answer.status(), v1::Status::NoMatch);
    let soon = Duration::from_secs(3);
    for other in ["r2", "r1.4000000000000001"] {
        let refused = RobotClient::connect(&options(named(other), soon)).await.err();
        assert!(matches!(refused, Some(ClientError::NotAdmitted { .. })), "{other}: {refused:?}");
    }
    let built_in = KeyPair::from_pem(&read(inside.data().join("tls/authority.key"))).expect("a key");
    let built_in = Issuer::from_ca_cert_pem(&read(&server), built_in).expect("an authority");
    let foreign = certificate(&built_in, "r1", Duration::from_hours(1), &folder.path().join("foreign"));
    let refused = RobotClient::connect(&options(foreign, soon)).await.err();
    assert!(matches!(refused, Some(ClientError::TlsRefused { .. })), "the built-in authority: {refused:?}");
    inside.server.stop().await;
}
