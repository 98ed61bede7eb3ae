//! Claim: a request that two programs may read differently is refused over a real connection, with
//! what to send instead.

use client::api::NewMap;
use server::config::Limits;
use tests::{Inside, token};
use tokio::{
    io::{AsyncReadExt as _, AsyncWriteExt as _},
    net::TcpStream,
};

/// What a server answers to these bytes.
async fn answered(inside: &Inside, request: &str) -> String {
    let mut stream = TcpStream::connect(inside.server.http_addr).await.expect("connection");
    stream.write_all(request.as_bytes()).await.expect("sent");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.expect("an answer");
    answer
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_that_two_programs_read_differently_is_refused_with_what_to_send() {
    let inside = Inside::start(Limits::default()).await;
    inside.maps().create_map(&NewMap::new("hall")).await.expect("map");
    let (token, own) = (token(&inside.url()).await, inside.server.http_addr);
    let ask = |first: &str, more: &str| {
        format!("{first} HTTP/1.1\r\nAuthorization: Bearer {token}\r\nConnection: close\r\n{more}\r\n")
    };
    let host = format!("Host: {own}\r\n");
    let absolute = format!("GET http://{own}/api/v1/maps/hall");
    for (first, more) in [("GET /api/v1/maps/hall", &host), (absolute.as_str(), &host)] {
        let answer = answered(&inside, &ask(first, more)).await;
        assert!(answer.starts_with("HTTP/1.1 200"), "{first}: {answer}");
    }
    let twice = format!("{host}If-Match: \"1\"\r\nIf-Match: *\r\n");
    for (first, more, code, next) in [
        ("GET /api/v1/maps/hall", &format!("{host}{host}"), "repeated_header", "send it once"),
        ("GET /api/v1/maps/hall", &format!("{host}Host: localhost\r\n"), "repeated_header", "send it once"),
        ("DELETE /api/v1/maps/hall", &twice, "repeated_header", "send it once"),
        ("GET http://evil.example/api/v1/maps/hall", &host, "foreign_authority", "ask for the path alone"),
        (
            "GET http://evil.example/api/v1/maps/hall",
            &String::new(),
            "foreign_authority",
            "ask for the path alone",
        ),
    ] {
        let answer = answered(&inside, &ask(first, more)).await;
        assert!(answer.starts_with("HTTP/1.1 400"), "{first} {more}: {answer}");
        for part in ["application/problem+json", code, next] {
            assert!(answer.contains(part), "{first} {more}: no {part} in {answer}");
        }
    }
    assert!(inside.maps().map("hall").await.is_ok(), "nothing is deleted");
    inside.server.stop().await;
}
