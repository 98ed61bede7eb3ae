//! Claim: a server whose zenoh threads are held is not ready within seconds, names the part, and
//! ends with an error. A process of its own: the threads that are held are those of every session
//! in it.

use server::config::{Limits, RawConfig};
use std::{
    sync::{Arc, Condvar, Mutex, PoisonError},
    time::{Duration, Instant},
};
use tests::{Inside, SOON, eventually, http};

/// More clients than zenoh has threads that receive.
const CLIENTS: usize = 16;
/// The server's bound: longer than it takes to become not ready.
const STALLED_S: u64 = 8;

/// Holds whoever comes until it is opened.
#[derive(Default)]
struct Barrier(Mutex<bool>, Condvar);

impl Barrier {
    fn wait(&self) {
        let mut is_open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        while !*is_open {
            is_open = self.1.wait(is_open).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn open(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.1.notify_all();
    }
}

fn settings(mode: &str, place: &str, endpoint: &str) -> zenoh::Config {
    let text = format!(
        r#"{{ mode: "{mode}", {place}: {{ endpoints: ["{endpoint}"] }},
             scouting: {{ multicast: {{ enabled: false }}, gossip: {{ enabled: false }} }} }}"#
    );
    zenoh::Config::from_json5(&text).expect("settings of zenoh")
}

#[tokio::test(flavor = "multi_thread")]
async fn held_threads_of_zenoh_make_the_server_not_ready_and_end_it() {
    let limits = Limits { stalled_s: STALLED_S, ..Limits::default() };
    let inside = Inside::start_with(RawConfig { limits, ..RawConfig::default() }).await;
    // Parts and their reasons are for tokens of all maps.
    let (http, ready) = (http(&inside.url()).await, format!("{}/readyz", inside.url()));
    let asked = || async {
        let answer = http.get(&ready).send().await.ok()?;
        let status = answer.status().as_u16();
        Some((status, answer.json::<serde_json::Value>().await.ok()?))
    };
    eventually("ready, with the router probed", || async {
        let (status, body) = asked().await?;
        (status == 200 && body["parts_still_s"]["the zenoh router"] == 0).then_some(())
    })
    .await;

    // A fault as a callback that never returns, on as many links as zenoh has threads.
    let port =
        std::net::TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("its number").port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let planted = zenoh::open(settings("router", "listen", &endpoint)).await.expect("a router");
    let (barrier, held) = (Arc::new(Barrier::default()), Arc::new(Mutex::new(0)));
    let (waits, counts) = (barrier.clone(), held.clone());
    let callback = move |_| {
        *counts.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        waits.wait();
    };
    let subscriber = planted.declare_subscriber("planted/**").callback(callback).await.expect("a subscriber");
    let mut clients = Vec::new();
    for _ in 0..CLIENTS {
        clients.push(zenoh::open(settings("client", "connect", &endpoint)).await.expect("a client"));
    }
    for (i, client) in clients.iter().enumerate() {
        client.put(format!("planted/{i}"), "hold").await.expect("sent");
    }
    let began = Instant::now();
    eventually("a thread is held", || async {
        (*held.lock().unwrap_or_else(PoisonError::into_inner) > 0).then_some(())
    })
    .await;

    let problem = eventually("the server is not ready", || async {
        let (status, body) = asked().await?;
        (status == 503).then_some(body)
    })
    .await;
    assert_eq!((&problem["code"], &problem["part"]), (&"part_stalled".into(), &"the zenoh router".into()));
    let failure = tokio::time::timeout(SOON, inside.server.failed()).await.expect("the server fails");
    assert_eq!(failure.part, "the zenoh router");
    assert!(began.elapsed() >= Duration::from_secs(STALLED_S) / 2, "it did not wait for its bound");

    barrier.open();
    drop(subscriber);
    inside.server.stop().await;
}
