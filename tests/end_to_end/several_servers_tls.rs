//! Claim: a server joins an encrypted router by a certificate, and nobody without one; the settings
//! say what is missing.

use client::{Capture, RobotClient, RobotOptions, RobotTls, api::NewMap};
use rcgen::{BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair};
use serde_json::json;
use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
    time::Duration,
};
use tests::{Child, SOON, eventually, pictures, router::ExternalRouter};

/// An authority with its certificate in a file.
fn authority(folder: &Path, name: &str) -> (Issuer<'static, KeyPair>, PathBuf) {
    let pair = KeyPair::generate().expect("a key");
    let mut params = CertificateParams::default();
    params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    params.distinguished_name.push(DnType::CommonName, name);
    let file = folder.join(format!("{name}.pem"));
    fs::write(&file, params.self_signed(&pair).expect("a certificate").pem()).expect("a file");
    (Issuer::new(params, pair), file)
}

/// Files of a certificate and its key, for 127.0.0.1.
fn certificate(by: &Issuer<'_, KeyPair>, folder: &Path, name: &str) -> (PathBuf, PathBuf) {
    let pair = KeyPair::generate().expect("a key");
    let mut params = CertificateParams::new(vec!["127.0.0.1".to_owned()]).expect("an address");
    params.distinguished_name.push(DnType::CommonName, name);
    params.extended_key_usages =
        vec![ExtendedKeyUsagePurpose::ClientAuth, ExtendedKeyUsagePurpose::ServerAuth];
    let (certificate, key) = (folder.join(format!("{name}.pem")), folder.join(format!("{name}.key")));
    fs::write(&certificate, params.signed_by(&pair, by).expect("signed").pem()).expect("a file");
    fs::write(&key, pair.serialize_pem()).expect("a file");
    (certificate, key)
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_joins_an_encrypted_router_by_its_certificate() {
    let folder = tempfile::tempdir().expect("a folder");
    let (signs, authority_file) = authority(folder.path(), "authority");
    let (router_certificate, router_key) = certificate(&signs, folder.path(), "router");
    let mut router = ExternalRouter::start(Some(json!({
        "root_ca_certificate": authority_file,
        "listen_certificate": router_certificate,
        "listen_private_key": router_key,
        "enable_mtls": true,
    })))
    .await;
    let (own, key) = certificate(&signs, folder.path(), "server");
    let credentials = |certificate: &Path, key: &Path| {
        [
            ("WAYMARK_ROUTER__CERTIFICATE", text(certificate).to_owned()),
            ("WAYMARK_ROUTER__KEY", text(key).to_owned()),
            ("WAYMARK_ROUTER__AUTHORITY", text(&authority_file).to_owned()),
        ]
    };
    let start = |data: &Path, name: &str, with: &[(&str, String)]| {
        let with: Vec<(&str, &str)> = with.iter().map(|(name, value)| (*name, value.as_str())).collect();
        Child::joined(data, (&router.endpoint, name), &with)
    };
    let (data, other) = (tempfile::tempdir().expect("data"), tempfile::tempdir().expect("data"));
    let a = start(data.path(), "a", &credentials(&own, &key));
    a.maps().create_map(&NewMap::new("hall")).await.expect("map");
    a.maps().put_robot("r1", "hall").await.expect("robot");
    let ready = || async { (a.maps().readiness().await.ok()?.status == "ready").then_some(()) };
    eventually("it has joined", ready).await;

    // A certificate that the router does not believe.
    let (stranger, _) = authority(folder.path(), "stranger");
    let (foreign, foreign_key) = certificate(&stranger, folder.path(), "foreign");
    let b = start(other.path(), "b", &credentials(&foreign, &foreign_key));

    let (robot, robot_key) = certificate(&signs, folder.path(), "r1");
    let tls = RobotTls {
        certificate: robot,
        key: robot_key,
        authority: Some(authority_file.clone()),
        expires_ms: None,
    };
    let options = RobotOptions {
        tls: Some(tls),
        timeout: SOON,
        ..RobotOptions::new(&router.endpoint, "default", "r1")
    };
    let robot = RobotClient::connect(&options).await.expect("connected");
    let frame = || Capture::encoded(pictures::picture(1)).expect("a picture").with_deadline_ms(60_000);
    let answered = || async { robot.recognise("front", frame(), Duration::from_secs(5)).await.ok() };
    let answer = eventually("an answer", answered).await;
    assert_eq!((answer.server.as_str(), answer.rejection), ("a", None));
    let readiness = b.maps().readiness().await.expect("it answers");
    assert!(readiness.status == "degraded" && readiness.router.is_some(), "{readiness:?}");

    // What is missing or no certificate is named, at the start.
    let missing = folder.path().join("nothing.pem");
    let refusals = [(&missing, &key, "router.certificate"), (&own, &missing, "router.key")];
    let third = tempfile::tempdir().expect("data");
    for (certificate, key, field) in refusals {
        let mut command: Command = Child::joins(third.path(), (&router.endpoint, "c"), &[]);
        let ended = command.envs(credentials(certificate, key)).output().expect("the program");
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(!ended.status.success() && said.contains(field), "{said}");
    }
    drop((a, b));
    router.stop().await;
}
