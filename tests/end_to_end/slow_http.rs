//! Claim: clients that send heads slowly, bodies slowly, or do not read what they asked for hold up
//! nobody else; they are cut off, and what they held returns.

use reqwest::Method;
use std::{
    net::{IpAddr, Ipv4Addr, SocketAddr},
    time::{Duration, Instant},
};
use tempfile::TempDir;
use tests::{Child, SOON, eventually, plain_http, token};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
    task::JoinSet,
};

/// Slow clients of each kind.
const SLOW: usize = 100;
/// Time between two bytes of a slow client.
const DRIP: Duration = Duration::from_millis(500);
const SETTINGS: [(&str, &str); 4] = [
    ("WAYMARK_LIMITS__HEADER_TIMEOUT_S", "2"),
    ("WAYMARK_LIMITS__WRITE_TIMEOUT_S", "2"),
    ("WAYMARK_LIMITS__REQUEST_TIMEOUT_S", "4"),
    ("WAYMARK_LIMITS__CONNECTIONS_PER_ADDRESS", "200"),
];

/// Another address of this machine than that of the slow clients.
const HONEST: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));

/// What a slow client begins with, and what it sends byte by byte.
#[derive(Clone)]
struct Slow {
    first: String,
    drips: bool,
    reads: bool,
}

/// Behaves so until the server ends the connection.
async fn held(at: SocketAddr, slow: Slow) {
    let Ok(mut stream) = TcpStream::connect(at).await else { return };
    if stream.write_all(slow.first.as_bytes()).await.is_err() {
        return;
    }
    let mut buffer = [0; 1024];
    loop {
        if slow.drips && stream.write_all(b"x").await.is_err() {
            return;
        }
        if !slow.reads {
            // Until the test ends: of a closed connection it learns only by reading.
            std::future::pending::<()>().await;
        }
        if let Ok(Ok(0) | Err(_)) = tokio::time::timeout(DRIP, stream.read(&mut buffer)).await {
            return;
        }
    }
}

fn files(process: u32) -> usize {
    std::fs::read_dir(format!("/proc/{process}/fd")).expect("the files of the server").count()
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn slow_clients_hold_up_nobody_and_are_cut_off() {
    let data = TempDir::new().expect("a folder");
    let child = Child::start_with(data.path(), &SETTINGS);
    let at: SocketAddr = child.url.strip_prefix("http://").expect("a URL").parse().expect("an address");
    let token = token(&child.url).await;
    let get = |path: &str| {
        format!("GET {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\n\r\n")
    };
    let post = format!(
        "POST /api/v1/maps HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {token}\r\n\
         Content-Type: application/json\r\nContent-Length: 60000\r\n\r\n"
    );
    let kinds = [
        Slow { first: "GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ".into(), drips: true, reads: true },
        Slow { first: post, drips: true, reads: true },
        // More answers than the buffers of a connection take.
        Slow { first: get("/api/v1/openapi.json").repeat(40), drips: false, reads: false },
    ];
    let client = plain_http().local_address(HONEST).build().expect("a client");
    let url = child.url.clone();
    let ask = async || {
        let request = client.request(Method::GET, format!("{url}/api/v1/maps")).bearer_auth(&token);
        tokio::time::timeout(SOON, request.send()).await.expect("an answer in time").expect("an answer")
    };
    assert!(ask().await.status().is_success());
    let before = files(child.id());
    let mut slow = JoinSet::new();
    for kind in kinds.iter().flat_map(|kind| std::iter::repeat_n(kind, SLOW)) {
        slow.spawn(held(at, kind.clone()));
    }
    let began = Instant::now();
    let mut answered = 0;
    let mut most = before;
    // While they are there.
    while began.elapsed() < Duration::from_secs(3) {
        assert!(ask().await.status().is_success());
        answered += 1;
        most = most.max(files(child.id()));
    }
    assert!(answered > 0 && most > before + SLOW, "{answered} answers, {most} files: nobody was slow");
    // Those that do not read are still there, and hold nothing.
    eventually("every slow client is cut off", || async { (files(child.id()) <= before + 8).then_some(()) })
        .await;
    assert!(ask().await.status().is_success());
    slow.abort_all();
}
