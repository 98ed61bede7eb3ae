//! Claim: on one machine nothing needs to be set: SDK and commands find the local token, also after
//! a restart of the server. Elsewhere a token gives what its role and maps allow, from the next
//! request on.

use client::{
    ClientError, LandmarkRegion, MapClient,
    api::{NewMap, NewToken, Role},
};
use server::config::Limits;
use std::{
    fs,
    io::Write as _,
    path::Path,
    process::{Command, Stdio},
    time::Duration,
};
use tempfile::TempDir;
use tests::{
    Child, Inside, SOON,
    command::{program, waymark},
    pictures::picture,
    plain_http,
};

fn code(result: Result<impl std::fmt::Debug, ClientError>) -> String {
    match result {
        Err(ClientError::Refused { code, .. }) => code,
        other => panic!("not refused: {other:?}"),
    }
}

fn new(name: &str, role: Role, map: Option<&str>) -> NewToken {
    NewToken { name: name.into(), role, maps: map.map(|map| vec![map.into()]), valid_s: None }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_local_token_is_found_at_the_first_request_and_after_a_restart() {
    let data = TempDir::new().expect("a temporary directory");
    let server = Child::start(data.path());
    let (maps, file) = (server.maps(), data.path().join("local-token"));
    // A form is sent once only: its token must be right before.
    let upload = maps.upload_view("hall", "p1", picture(1), LandmarkRegion::WholeImage).await;
    assert_eq!(code(upload), "unknown_map");
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    assert_eq!(maps.whoami().await.expect("who").name, "local");
    let first = fs::read_to_string(&file).expect("the local token");
    server.kill();
    assert!(file.exists(), "a kill removes nothing");
    let server = Child::start(data.path());
    assert_ne!(fs::read_to_string(&file).expect("the local token"), first);
    let stale = plain_http()
        .build()
        .expect("a client")
        .get(format!("{}/api/v1/maps", server.url))
        .bearer_auth(first.trim());
    assert_eq!(stale.send().await.expect("an answer").status(), 401);
    assert_eq!(server.maps().maps().await.expect("maps").len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_goes_on_when_its_server_has_started_again() {
    let data = TempDir::new().expect("a temporary directory");
    let settings = |http: &str| server::config::RawConfig {
        data: data.path().to_owned(),
        http: http.to_owned(),
        zenoh: "tcp/127.0.0.1:0".into(),
        ..server::config::RawConfig::default()
    };
    let start = async |http: &str| {
        let config = server::config::Config::try_from(settings(http)).expect("a valid configuration");
        server::Server::start(config).await.expect("the server starts")
    };
    let server = start("127.0.0.1:0").await;
    let (address, file) = (server.http_addr.to_string(), server.local_token_file().to_owned());
    let maps = MapClient::new(&format!("http://{address}")).expect("a client");
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    server.stop().await;
    assert!(!file.exists(), "a clean stop removes the local token");
    let server = start(&address).await;
    let upload = maps.upload_view("hall", "p1", picture(1), LandmarkRegion::WholeImage).await;
    assert_eq!(code(upload), "unknown_landmark");
    assert_eq!(maps.maps().await.expect("maps").len(), 1);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_gives_what_its_role_and_maps_allow() {
    let inside = Inside::start(Limits::default()).await;
    let maps = inside.maps();
    for map in ["hall", "yard"] {
        maps.create_map(&NewMap::new(map)).await.expect("map");
    }
    let made = maps.create_token(&new("kim", Role::Teacher, Some("hall"))).await.expect("token");
    assert!(!format!("{made:?}").contains(&made.text));
    let kim = inside.maps().with_token(&made.text);
    assert!(!format!("{kim:?}").contains(&made.text));
    kim.add_landmark("hall", "poster", None, None).await.expect("a teacher teaches");
    assert_eq!(code(kim.add_landmark("yard", "poster", None, None).await), "unknown_map");
    assert_eq!(code(kim.create_map(&NewMap::new("attic")).await), "forbidden");
    assert_eq!(code(kim.tokens().await), "forbidden");
    assert_eq!(kim.maps().await.expect("maps").len(), 1);
    assert_eq!(kim.token_in_use().await.expect("who"), Some(made.text.clone()));
    let link = kim.page_link().await.expect("a link");
    assert!(link.path.starts_with("/open?code=") && !format!("{link:?}").contains(&link.path));
    maps.revoke_token(made.token.id).await.expect("revoked");
    assert_eq!(code(kim.maps().await), "unauthenticated");
    assert_eq!(maps.tokens().await.expect("tokens").len(), 1);
    // A wrong token is not replaced by the local one: who gives one means it.
    assert_eq!(code(inside.maps().with_token("wmk_1_x").maps().await), "unauthenticated");
    inside.server.stop().await;
}

/// Runs `waymark` as a user with this folder of settings and this standard input; status and
/// output.
fn as_user(home: &Path, url: &str, input: &str, args: &[&str]) -> (i32, String) {
    let mut command = Command::new(program());
    command.args(args).args(["--server", url]).env("XDG_CONFIG_HOME", home).env_remove("WAYMARK_TOKEN");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    // It may end without reading.
    child.stdin.take().expect("its input").write_all(input.as_bytes()).ok();
    let done = child.wait_with_output().expect("its output");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (done.status.code().unwrap_or(-1), text(&done.stdout) + &text(&done.stderr))
}

#[tokio::test(flavor = "multi_thread")]
async fn commands_sign_in_with_a_token_and_out_again() {
    let (inside, home) = (Inside::start(Limits::default()).await, TempDir::new().expect("a folder"));
    let (url, home) = (inside.url(), home.path());
    let run = |input: &str, args: &[&str]| as_user(home, &url, input, args);
    let (status, made) = run("", &["token", "create", "kim", "--role", "viewer", "--valid", "1h", "--json"]);
    assert_eq!(status, 0, "{made}");
    let made: serde_json::Value = serde_json::from_str(made.lines().next().expect("a line")).expect("JSON");
    let text = made["text"].as_str().expect("a token").to_owned();
    let (status, list) = run("", &["token", "list"]);
    assert!(status == 0 && list.starts_with("1\tkim\tviewer\tall\t") && !list.contains(&text), "{list}");

    let (status, wrong) = run("wmk_1_x\n", &["login"]);
    assert_eq!((status, wrong.contains("waymark token create")), (7, true), "{wrong}");
    assert!(!home.join("waymark").exists(), "a wrong token is not kept");
    let (status, who) = run(&format!("{text}\n"), &["login"]);
    assert!(status == 0 && who.contains("kim, role viewer") && !who.contains(&text), "{who}");
    assert_eq!(run("", &["map", "list"]).0, 0);
    let (status, refused) = run("", &["map", "create", "hall"]);
    assert!(status == 7 && refused.contains("needs operator"), "{status} {refused}");
    let (status, link) = run("", &["open"]);
    assert!(status == 0 && link.starts_with(&format!("{url}/open?code=")), "{link}");
    let http = plain_http().build().expect("a client");
    let opened = http.get(link.lines().next().expect("the link")).send().await.expect("the page");
    assert_eq!(opened.status(), 200);

    assert_eq!(run("", &["logout"]).0, 0);
    assert_eq!(run("", &["map", "create", "hall"]).0, 0, "the local token again");
    let gone = inside.data().join("local-token");
    fs::remove_file(&gone).expect("the local token");
    let (status, refused) = run("", &["map", "list"]);
    assert!(status == 7 && refused.contains("the local token is not used"), "{status} {refused}");
    inside.server.stop().await;
}

#[test]
fn no_token_and_no_code_is_in_the_log() {
    let data = TempDir::new().expect("a temporary directory");
    let log = data.path().join("log");
    let mut server = Command::new(program());
    server.args(["serve", "--http", "127.0.0.1:0", "--zenoh", "tcp/127.0.0.1:0", "--log", "trace", "--data"]);
    server
        .arg(data.path().join("data"))
        .stdout(Stdio::piped())
        .stderr(fs::File::create(&log).expect("a file"));
    let mut server = server.spawn().expect("the program starts");
    let mut printed = String::new();
    let mut lines = std::io::BufReader::new(server.stdout.take().expect("its output"));
    for _ in 0..4 {
        std::io::BufRead::read_line(&mut lines, &mut printed).expect("a line");
    }
    let url = printed.split_whitespace().nth(1).expect("the address").trim_end_matches('/').to_owned();
    let run = |args: &[&str]| waymark(args.iter().copied().chain(["--server", url.as_str()]), SOON);
    let token = run(&["token", "create", "kim", "--role", "viewer"]).stdout;
    let link = run(&["open"]).stdout;
    let local = fs::read_to_string(data.path().join("data/local-token")).expect("the local token");
    tokio::runtime::Runtime::new().expect("a runtime").block_on(async {
        let http = plain_http().build().expect("a client");
        http.get(link.trim()).send().await.expect("the page");
        http.get(format!("{url}/api/v1/maps")).bearer_auth(token.trim()).send().await.expect("maps");
    });
    std::thread::sleep(Duration::from_millis(200));
    server.kill().expect("kill");
    server.wait().expect("wait");
    let log = fs::read_to_string(&log).expect("the log");
    assert!(log.contains("/api/v1/tokens") && log.contains("/open"), "requests are no longer logged");
    let secret_of = |token: &str| token.trim().splitn(3, '_').nth(2).expect("its secret").to_owned();
    let code = link.trim().split_once("code=").expect("a code").1.to_owned();
    let secrets =
        [("the token", secret_of(&token)), ("the local token", secret_of(&local)), ("the code", code)];
    for (what, secret) in secrets {
        assert!(secret.len() > 20, "{what}: {secret} is no secret");
        assert!(!log.contains(&secret), "{what} is in the log");
        assert!(!printed.contains(&secret), "{what} is in what a log may take");
    }
}
