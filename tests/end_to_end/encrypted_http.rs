//! Claim: with TLS a client believes the server by its authority and its name, and nothing else;
//! who is on the server's machine needs no certificate; a session's cookie stays encrypted; a
//! certificate that is renewed is taken at once.

use client::{
    ClientError, MapClient,
    api::{NewMap, NewToken, Role},
};
use reqwest::{
    StatusCode,
    header::{COOKIE, SET_COOKIE},
};
use server::config::{RawConfig, RawTls};
use std::{fs, process::Command};
use tempfile::TempDir;
use tests::{
    Inside,
    command::{program, waymark},
    plain_http,
};

async fn encrypted() -> Inside {
    let tls = RawTls { enabled: true, names: vec!["maps.example".into()], ..RawTls::default() };
    Inside::start_with(RawConfig { tls, ..RawConfig::default() }).await
}

fn authority(inside: &Inside) -> Vec<u8> {
    fs::read(inside.data().join("tls/authority.pem")).expect("the authority")
}

fn at(inside: &Inside, host: &str) -> String {
    format!("https://{host}:{}", inside.server.http_addr.port())
}

async fn token(inside: &Inside) -> String {
    let new = NewToken { name: "kim".into(), role: Role::Operator, maps: None, valid_s: None };
    inside.maps().create_token(&new).await.expect("a token").text
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_believes_the_authority_and_the_name_alone() {
    let (inside, other) = (encrypted().await, encrypted().await);
    let (pem, token) = (authority(&inside), token(&inside).await);
    for host in ["localhost", "127.0.0.1"] {
        let maps = MapClient::with_authority(&at(&inside, host), &pem).expect("a client").with_token(&token);
        assert_eq!(maps.whoami().await.expect(host).name, "kim");
    }
    let untrusted = async |host: &str, pem: &[u8]| {
        let maps = MapClient::with_authority(&at(&inside, host), pem).expect("a client").with_token(&token);
        match maps.whoami().await {
            Err(ClientError::Untrusted { detail, .. }) => detail,
            other => panic!("{host} is believed: {other:?}"),
        }
    };
    untrusted("localhost", &authority(&other)).await;
    // The right authority, and a name that is not in the certificate.
    let roots = [reqwest::Certificate::from_pem(&pem).expect("a certificate")];
    let http = reqwest::Client::builder().no_proxy().tls_certs_only(roots);
    let http = http.resolve("other.example", inside.server.http_addr).build().expect("a client");
    let other_name = http.get(at(&inside, "other.example")).send().await.expect_err("another name");
    assert!(format!("{other_name:?}").contains("NotValidForName"), "{other_name:?}");
    let without = plain_http().build().expect("a client").get(at(&inside, "localhost")).send().await;
    assert!(without.is_err(), "nobody is believed without an authority");
    assert!(matches!(MapClient::with_authority("https://x", b"no"), Err(ClientError::Authority(_))));
    // On the server's machine, as without TLS.
    inside.maps().create_map(&NewMap::new("hall")).await.expect("plain text on loopback");
    let foreign = plain_http().build().expect("a client");
    let foreign = foreign.get(format!("{}/healthz", inside.url())).header("host", "maps.example");
    assert_eq!(foreign.send().await.expect("an answer").status(), StatusCode::FORBIDDEN, "a rebound name");
    for server in [inside, other] {
        server.server.stop().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_session_of_the_page_stays_encrypted() {
    let inside = encrypted().await;
    let pem = reqwest::Certificate::from_pem(&authority(&inside)).expect("a certificate");
    let name = format!("maps.example:{}", inside.server.http_addr.port());
    // Installs the provider of cryptography.
    inside.maps().maps().await.expect("maps");
    let http = reqwest::Client::builder().no_proxy().tls_certs_only([pem]);
    let http = http.resolve("maps.example", inside.server.http_addr).build().expect("a client");
    let form = serde_json::json!({ "token": token(&inside).await });
    let login = http.post(format!("https://{name}/login")).header("x-waymark-page", "1").json(&form);
    let login = login.send().await.expect("an answer");
    assert_eq!(login.status(), StatusCode::NO_CONTENT);
    let cookie = login.headers()[SET_COOKIE].to_str().expect("text").to_owned();
    assert!(cookie.ends_with("; Secure") && cookie.contains("; HttpOnly"), "{cookie}");
    let value = cookie.split(';').next().expect("a value");
    let who = http.get(format!("https://{name}/api/v1/whoami")).header(COOKIE, value).send().await;
    assert_eq!(who.expect("an answer").status(), StatusCode::OK);
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn commands_keep_token_and_authority_of_a_server() {
    let (inside, home) = (encrypted().await, TempDir::new().expect("a folder"));
    let (url, token) = (at(&inside, "localhost"), token(&inside).await);
    let run = |args: &[&str]| {
        let mut command = Command::new(program());
        command.args(args).args(["--server", &url]).env("XDG_CONFIG_HOME", home.path());
        let done = command.env_remove("WAYMARK_TOKEN").output().expect("the program");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (done.status.code().unwrap_or(-1), text(&done.stdout) + &text(&done.stderr))
    };
    let (status, said) = run(&["map", "list", "--token", &token]);
    assert!(
        status == 7 && said.contains("is not trusted") && said.contains("--authority"),
        "{status} {said}"
    );
    let pem = inside.data().join("tls/authority.pem");
    let pem = pem.to_str().expect("text");
    assert_eq!(run(&["map", "create", "hall", "--token", &token, "--authority", pem]).0, 0);
    let (status, said) = run(&["login", "--token", &token, "--authority", pem]);
    assert!(status == 0 && said.contains("token and the authority"), "{said}");
    let (status, said) = run(&["map", "list"]);
    assert!(status == 0 && said.contains("hall"), "{said}");
    let (status, said) = run(&["map", "list", "--authority", "/nowhere"]);
    assert!(status == 3 && said.contains("/nowhere"), "{status} {said}");
    // On the server's machine nothing is to be given.
    let plain = inside.url();
    assert_eq!(waymark(["map", "list", "--server", &plain], tests::SOON).status, 0);
    inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_authority_stays_when_the_server_starts_again() {
    let data = TempDir::new().expect("a folder");
    let start = async || {
        let tls = RawTls { enabled: true, ..RawTls::default() };
        let raw = RawConfig {
            data: data.path().to_owned(),
            http: "127.0.0.1:0".into(),
            zenoh: "tcp/127.0.0.1:0".into(),
            tls,
            ..RawConfig::default()
        };
        let config = server::config::Config::try_from(raw).expect("settings");
        server::Server::start(config).await.expect("the server starts")
    };
    let server = start().await;
    let pem = fs::read(data.path().join("tls/authority.pem")).expect("the authority");
    server.stop().await;
    let server = start().await;
    let base = format!("https://localhost:{}", server.http_addr.port());
    let health = MapClient::with_authority(&base, &pem).expect("a client").readiness().await;
    assert_eq!(health.expect("the same authority").status, "ready");
    server.stop().await;
}
