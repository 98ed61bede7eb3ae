//! Claim: with the standard variables of OpenTelemetry, traces of requests and frames reach a
//! collector; without a collector the server does its work all the same; what cannot be meant is
//! refused at the start.

use client::{Capture, RobotClient, RobotOptions, api::NewMap};
use std::{
    io::{BufRead as _, BufReader, Read as _, Write as _},
    net::{TcpListener, TcpStream},
    process::{Command, Stdio},
    sync::{Arc, Mutex},
};
use tempfile::TempDir;
use tests::{Child, SOON, eventually};
use vision::frame::GrayImage;

/// What was posted: path and body.
type Posts = Arc<Mutex<Vec<(String, Vec<u8>)>>>;

/// An endpoint, and what is posted to it.
fn collector() -> (String, Posts) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let endpoint = format!("http://{}", listener.local_addr().expect("its address"));
    let posted = Arc::new(Mutex::new(Vec::new()));
    let keep = posted.clone();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let (stream, keep) = (stream.expect("a connection"), keep.clone());
            std::thread::spawn(move || {
                while let Some(post) = taken(&stream) {
                    keep.lock().expect("kept").push(post);
                }
            });
        }
    });
    (endpoint, posted)
}

/// Reads one request and answers it; `None` at the end of the connection.
fn taken(stream: &TcpStream) -> Option<(String, Vec<u8>)> {
    let mut reader = BufReader::new(stream);
    let mut first = String::new();
    reader.read_line(&mut first).ok().filter(|bytes| *bytes > 0)?;
    let mut length = 0;
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let line = line.trim_end().to_ascii_lowercase();
        if let Some(number) = line.strip_prefix("content-length:") {
            length = number.trim().parse().ok()?;
        }
        if line.is_empty() {
            break;
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    (&mut &*stream).write_all(b"HTTP/1.1 200 OK\r\ncontent-length: 0\r\n\r\n").ok()?;
    Some((first.split(' ').nth(1)?.to_owned(), body))
}

fn command(data: &TempDir, endpoint: &str) -> Command {
    let mut command = Child::command(data.path(), &[]);
    command.env("OTEL_EXPORTER_OTLP_ENDPOINT", endpoint).env("OTEL_BSP_SCHEDULE_DELAY", "200");
    command
}

/// A map is made and a frame answered.
async fn used(server: &Child) {
    let maps = server.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    maps.put_robot("r1", "hall").await.expect("robot");
    let robot =
        RobotClient::connect(&RobotOptions::new(&server.zenoh, "default", "r1")).await.expect("robot");
    let picture = GrayImage::from_fn(64, 48, |u, v| (u * v) as u8);
    robot.recognise("front", Capture::gray(&picture), SOON).await.expect("an answer");
    robot.close().await.expect("closed");
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_and_frames_reach_a_collector() {
    let (endpoint, posted) = collector();
    let data = TempDir::new().expect("a folder");
    let server = Child::start_from(&mut command(&data, &endpoint));
    used(&server).await;
    for expected in
        ["request", "/api/v1/maps", "frame", "waited_ms", "front", "stage_ended", "frame_answered"]
    {
        eventually(&format!("`{expected}` in a trace"), || async {
            let posted = posted.lock().expect("kept");
            posted.iter().any(|(_, body)| contains(body, expected)).then_some(())
        })
        .await;
    }
    let posts = posted.lock().expect("kept").clone();
    assert!(posts.iter().all(|(path, _)| path == "/v1/traces"), "another path");
    assert!(posts.iter().all(|(_, body)| contains(body, "waymark")), "a post without the service");
    server.stop();
}

fn contains(body: &[u8], text: &str) -> bool {
    body.windows(text.len()).any(|window| window == text.as_bytes())
}

#[tokio::test(flavor = "multi_thread")]
async fn without_its_collector_the_server_works_and_stops() {
    let nobody = TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("its address");
    let data = TempDir::new().expect("a folder");
    let server = Child::start_from(&mut command(&data, &format!("http://{nobody}")));
    used(&server).await;
    server.stop();
}

#[test]
fn what_traces_cannot_be_sent_by_is_refused_with_the_variable_that_helps() {
    for (name, value, says) in [
        ("OTEL_EXPORTER_OTLP_PROTOCOL", "grpc", "OTEL_EXPORTER_OTLP_PROTOCOL=http/protobuf"),
        ("OTEL_EXPORTER_OTLP_ENDPOINT", "no address", "OTEL_EXPORTER_OTLP_ENDPOINT=http://127.0.0.1:4318"),
    ] {
        let data = TempDir::new().expect("a folder");
        let mut command = command(&data, "http://127.0.0.1:4318");
        let ended =
            command.env(name, value).stdout(Stdio::null()).stderr(Stdio::piped()).output().expect("it ends");
        let said = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(2), "{name}: {said}");
        assert!(said.contains(says) && said.contains(value), "{name}: {said}");
    }
}
