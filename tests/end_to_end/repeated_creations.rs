//! Claim: a creation that is repeated with its key has one effect, through a connection that is cut
//! before the answer, and through a kill of the server between the commit and the answer.

use client::{
    ClientError, LandmarkRegion, MapClient, NewView,
    api::{LandmarkLesson, NewMap},
    http::operations,
};
use reqwest::Method;
use serde_json::Value;
use server::config::Limits;
use std::{collections::BTreeSet, net::SocketAddr, time::Duration};
use tempfile::TempDir;
use tests::{Child, Inside, eventually, pictures, robots::call};
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, copy_bidirectional},
    net::{TcpListener, TcpStream},
};

/// A relay to the server that cuts every connection whose first answer is the first to this path:
/// the request arrives, its answer does not.
async fn cutting_relay(server: SocketAddr, path: &'static str) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let at = listener.local_addr().expect("its address");
    tokio::spawn(async move {
        let mut is_cut = false;
        while let Ok((mut client, _)) = listener.accept().await {
            let mut upstream = TcpStream::connect(server).await.expect("the server");
            let mut head = vec![0; 1 << 16];
            let read = client.read(&mut head).await.expect("a request");
            upstream.write_all(&head[..read]).await.expect("sent");
            if !is_cut && String::from_utf8_lossy(&head[..read]).contains(path) {
                is_cut = true;
                // The rest of a large request follows; its answer begins once it was made.
                let mut answer = [0; 1];
                let (mut from, mut to) = client.split();
                let (mut back, mut forth) = upstream.split();
                tokio::select! {
                    _ = tokio::io::copy(&mut from, &mut forth) => {}
                    _ = back.read(&mut answer) => {}
                }
                drop(to.shutdown().await);
                continue;
            }
            tokio::spawn(async move { copy_bidirectional(&mut client, &mut upstream).await });
        }
    });
    at
}

#[tokio::test(flavor = "multi_thread")]
async fn a_creation_through_a_cut_connection_is_made_once() {
    let inside = Inside::start(Limits::default()).await;
    let direct = inside.maps();
    // The local token is for the server's own port.
    let token = tests::token(&inside.url()).await;
    let through = async |path| {
        let relay = cutting_relay(inside.server.http_addr, path).await;
        MapClient::new(&format!("http://{relay}")).expect("a client").with_token(&token)
    };
    let map = through("POST /api/v1/maps ").await.create_map(&NewMap::new("hall")).await.expect("map");
    assert_eq!(map.name, "hall");
    let maps = through("/landmarks ").await;
    // Without its key, the second request is refused: the landmark exists.
    let made = maps.add_landmark("hall", "poster", None, None).await.expect("one landmark");
    assert_eq!(made.name, "poster");
    let maps = through("/views ").await;
    let new = NewView::new(pictures::picture(1), LandmarkRegion::WholeImage);
    let view = maps.upload_view_with("hall", "poster", new).await.expect("one view");
    assert_eq!(view.outcome, Some(client::api::UploadOutcomeBody::New), "taken for a second picture");
    let maps = through("/learn ").await;
    let job = maps.learn("hall", None, Some(0)).await.expect("one lesson");
    assert_eq!(job.id, 1, "a second lesson was queued");
    assert!(direct.job(2).await.is_err(), "a second lesson was queued");
    assert_eq!(direct.landmarks("hall").await.expect("landmarks").len(), 1);
    assert_eq!(direct.views("hall", "poster").await.expect("views").len(), 1);
    inside.server.stop().await;
}

/// Kills of the server, each at another moment of a creation.
const KILLS: u64 = 12;

#[tokio::test(flavor = "multi_thread")]
async fn a_kill_between_commit_and_answer_and_a_repeat_are_one_effect() {
    let data = TempDir::new().expect("a temporary directory");
    let mut server = Child::start(data.path());
    server.maps().create_map(&NewMap::new("hall")).await.expect("map");
    server.maps().add_landmark("hall", "p0", None, None).await.expect("landmark");
    let view =
        server.maps().upload_view("hall", "p0", pictures::picture(0), LandmarkRegion::WholeImage).await;
    view.expect("view");
    let (mut replayed, mut jobs) = (0, BTreeSet::new());
    for kill in 0..KILLS {
        let url = format!("{}/api/v1/maps/hall/landmarks/p0/learn", server.url);
        let send = |http: reqwest::Client, url: String| {
            let lesson = LandmarkLesson { generated_views: Some(kill as usize % 3) };
            http.post(url).header("idempotency-key", format!("lesson-{kill}")).json(&lesson).send()
        };
        let first = tokio::spawn(send(tests::http(&server.url).await, url));
        // Another moment each time, about when the row is written.
        tokio::time::sleep(Duration::from_micros(700 * kill)).await;
        server.kill();
        drop(first.await);
        server = Child::start(data.path());
        let url = format!("{}/api/v1/maps/hall/landmarks/p0/learn", server.url);
        let answer = send(tests::http(&server.url).await, url).await.expect("an answer");
        assert_eq!(answer.status(), 202);
        replayed += u64::from(answer.headers().contains_key("idempotency-replayed"));
        let job: Value = answer.json().await.expect("JSON");
        jobs.insert(job["id"].as_i64().expect("a number"));
    }
    println!("{replayed} of {KILLS} lessons were accepted before the kill");
    // One job for each key: the numbers have no gap and there is none beside them.
    assert_eq!(jobs.into_iter().collect::<Vec<_>>(), (1..=KILLS as i64).collect::<Vec<_>>());
    let maps = server.maps();
    assert!(maps.job(KILLS as i64 + 1).await.is_err(), "a lesson more than keys");
    eventually("the last lesson ends", || async {
        let job = maps.job(KILLS as i64).await.expect("job");
        (job.progress >= 1.0).then_some(())
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_client_sends_a_key_where_the_document_says_so() {
    let inside = Inside::start(Limits::default()).await;
    let (_, document) = call(&inside, Method::GET, "/openapi.json", None).await;
    let takes_key = |path: &str, method: &str| {
        let parameters = document["paths"][format!("/api/v1{path}")][method]["parameters"].as_array();
        parameters
            .into_iter()
            .flatten()
            .any(|p| p["$ref"] == "#/components/parameters/header.Idempotency-Key")
    };
    for operation in operations() {
        let described = takes_key(operation.path, &operation.method.as_str().to_lowercase());
        assert_eq!(operation.takes_key(), described, "{} {}", operation.method, operation.path);
    }
    assert!(operations().filter(|operation| operation.takes_key()).count() >= 8);

    // A program's own key, for its own repeats.
    let maps = inside.maps().with_idempotency_key("mine");
    for _ in 0..2 {
        assert_eq!(maps.create_map(&NewMap::new("hall")).await.expect("the same map").name, "hall");
    }
    match maps.create_map(&NewMap::new("attic")).await {
        Err(ClientError::Refused { status: 422, code, .. }) => assert_eq!(code, "idempotency_key_reused"),
        other => panic!("{other:?}"),
    }
    inside.server.stop().await;
}
