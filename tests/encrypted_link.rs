//! Claim: encrypted links of robots that carry much in both directions at once lose and change
//! nothing, and a thousand handshakes that do not come keep nobody out. All of it passes the front
//! and the gate twice: two programs of one robot of ROS 2 speak below their prefix, each over a
//! link of its own. A process of its own: a fault of memory ends it.

use client::{RobotOptions, RobotTls, api::NewMap};
use link::{Credentials, EncryptedLink};
use serde_json::json;
use server::config::{RawConfig, RawRos2, RawRos2Robot, RawTls};
use std::{
    fs,
    path::Path,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};
use tempfile::TempDir;
use tests::{Inside, SOON, command::waymark, eventually};
use tokio::net::TcpStream;
use zenoh::{Session, qos::CongestionControl, sample::Sample};

/// Rounds, the messages of each direction in one, and their length: several TLS records each.
const ROUNDS: usize = 5;
const MESSAGES: u64 = 1_000;
const BYTES: usize = 40_000;
/// Longest time for a round.
const LONGEST: Duration = Duration::from_mins(2);
/// Rounds that are repeated at most: a router ends a link that takes nothing for a second, and a
/// machine may stand still for longer.
const REPEATED: usize = 3;
/// Longest time until the end of a link is known at both ends, with some to spare.
const LEASE: Duration = Duration::from_secs(10);
/// Connections that say nothing.
const HALF_OPEN: usize = 1_000;

/// A server, and the file of the robot `r1`, which has a prefix of its own.
async fn served(folder: &Path) -> (Inside, RobotOptions) {
    let tls = RawTls { enabled: true, ..RawTls::default() };
    let robot = RawRos2Robot { robot: "r1".into(), key_prefix: "own".into(), ..RawRos2Robot::default() };
    let settings = RawConfig { tls, ros2: RawRos2 { robot: vec![robot] }, ..RawConfig::default() };
    let inside = Inside::start_with(settings).await;
    inside.maps().create_map(&NewMap::new("hall")).await.expect("a map");
    inside.maps().put_robot("r1", "hall").await.expect("a robot");
    let out = folder.join("r1");
    let run = waymark(
        ["robot", "enrol", "r1", "--out", out.to_str().expect("a path"), "--server", &inside.url()],
        SOON,
    );
    assert_eq!(run.status, 0, "{run:?}");
    (inside, RobotOptions::from_file(out.join("robot.json")).expect("the robot's file"))
}

/// A session of zenoh over a link of its own.
async fn session(options: &RobotOptions) -> (Session, EncryptedLink) {
    let RobotTls { certificate, key, authority, .. } = options.tls.clone().expect("certificates");
    let read = |path: &Path| fs::read(path).expect("a file");
    let credentials = Credentials {
        certificate: read(&certificate),
        key: read(&key),
        authority: read(&authority.expect("an authority")),
    };
    let address = options.endpoint.strip_prefix("tls/").expect("an encrypted endpoint");
    let link = EncryptedLink::open(address, &credentials).expect("a link");
    let config = json!({
        "mode": "client",
        "connect": { "endpoints": [link.endpoint()], "timeout_ms": 10_000 },
        "scouting": { "delay": 0, "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "transport": { "shared_memory": { "enabled": false } },
    });
    let config = zenoh::Config::from_json5(&config.to_string()).expect("settings");
    (zenoh::open(config).await.expect("a session"), link)
}

/// Message number `i`: the number at both ends, and bytes that follow from it.
fn message(i: u64) -> Vec<u8> {
    let mut bytes: Vec<u8> = (0..BYTES as u64).map(|at| (i.wrapping_mul(31) + at) as u8).collect();
    bytes[..8].copy_from_slice(&i.to_le_bytes());
    bytes
}

/// What arrived.
#[derive(Default)]
struct Heard {
    /// The message after the last one that came in its turn.
    next: AtomicU64,
    out_of_turn: AtomicU64,
    /// The last one that is not as it was sent.
    changed: Mutex<Option<String>>,
}

/// Counts what arrives at `key`.
async fn counted(session: &Session, key: &str) -> (zenoh::pubsub::Subscriber<()>, Arc<Heard>) {
    let counts = Arc::new(Heard::default());
    let heard = counts.clone();
    let hear = move |sample: Sample| {
        let bytes = sample.payload().to_bytes();
        let number = bytes.first_chunk().map_or(u64::MAX, |first| u64::from_le_bytes(*first));
        let turn = heard.next.load(Ordering::Relaxed);
        let sent = message(number);
        if *bytes != sent {
            let at = bytes.iter().zip(&sent).position(|(got, sent)| got != sent);
            let what = format!("{} bytes, number {number} in place of {turn}, from byte {at:?}", bytes.len());
            *heard.changed.lock().expect("no panic") = Some(what);
            return;
        }
        let count = if number == turn { &heard.next } else { &heard.out_of_turn };
        count.fetch_add(1, Ordering::Relaxed);
    };
    (session.declare_subscriber(key.to_owned()).callback(hear).await.expect("a subscriber"), counts)
}

/// Whether a subscriber for `key` is known at this end.
async fn is_wanted(session: &Session, key: &str) -> bool {
    let publisher = session.declare_publisher(key.to_owned()).await.expect("a publisher");
    publisher.matching_status().await.expect("known").matching()
}

async fn publish(session: &Session, key: &str) {
    let publisher = session.declare_publisher(key.to_owned()).congestion_control(CongestionControl::Block);
    let publisher = publisher.await.expect("a publisher");
    for i in 0..MESSAGES {
        publisher.put(message(i)).await.expect("sent");
    }
}

/// One round over two new links. False: a link ended on the way, and nothing that came before was
/// changed.
async fn round(options: &RobotOptions) -> bool {
    let ((one, one_link), (other, other_link)) = (session(options).await, session(options).await);
    let (_outward, out) = counted(&other, "own/out").await;
    let (_homeward, home) = counted(&one, "own/home").await;
    eventually("both ends know of the subscribers", || async {
        (is_wanted(&one, "own/out").await && is_wanted(&other, "own/home").await).then_some(())
    })
    .await;
    let is_done = || [&out, &home].iter().all(|heard| heard.next.load(Ordering::Relaxed) == MESSAGES);
    let has_ended = || one_link.last_end().is_some() || other_link.last_end().is_some();
    let heard = async {
        while !is_done() && !has_ended() {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    let all = async {
        let sent = async { tokio::join!(publish(&one, "own/out"), publish(&other, "own/home")) };
        tokio::select! {
            () = heard => {}
            // It never ends before what it sent is heard, or a link has ended.
            () = async { sent.await; std::future::pending().await } => {}
        }
    };
    let in_time = tokio::time::timeout(LONGEST, all).await.is_ok();
    let of =
        |count: fn(&Heard) -> &AtomicU64| [&out, &home].map(|heard| count(heard).load(Ordering::Relaxed));
    let changed = [&out, &home].map(|heard| heard.changed.lock().expect("no panic").clone());
    assert_eq!(changed, [None, None], "changed on the way");
    // A machine that stood still finds all its times over at once, before a link is seen to end.
    let until = Instant::now() + LEASE;
    while !is_done() && !has_ended() && Instant::now() < until {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let is_whole = !has_ended();
    if is_whole {
        assert_eq!(of(|heard| &heard.out_of_turn), [0; 2], "a message before these is lost");
        assert!(in_time, "{:?} of {MESSAGES} arrived", of(|heard| &heard.next));
    }
    one.close().await.expect("closed");
    other.close().await.expect("closed");
    is_whole
}

#[tokio::test(flavor = "multi_thread")]
async fn encrypted_links_that_are_busy_in_both_directions_lose_nothing() {
    let folder = TempDir::new().expect("a temporary directory");
    let (inside, options) = served(folder.path()).await;
    let address = options.endpoint.strip_prefix("tls/").expect("an encrypted endpoint").to_owned();
    let mut silent = Vec::new();
    for _ in 0..HALF_OPEN {
        silent.push(TcpStream::connect(&address).await.expect("connected"));
    }
    let started = Instant::now();
    let (first, _link) = session(&options).await;
    println!("connected beside {HALF_OPEN} silent connections in {:?}", started.elapsed());
    drop(silent);
    let (mut rounds, mut ended) = (0, 0);
    while rounds < ROUNDS {
        let started = Instant::now();
        if round(&options).await {
            rounds += 1;
            println!("{MESSAGES} messages of {BYTES} bytes both ways in {:?}", started.elapsed());
        } else {
            ended += 1;
            assert!(ended <= REPEATED, "links end in every round");
        }
    }
    first.close().await.expect("closed");
    inside.server.stop().await;
}
