//! Claim: encrypted links of robots that carry much in both directions at once lose and change nothing, and a thousand
//! handshakes that do not come keep nobody out. All of it passes the front and the gate twice: two programs of one robot of
//! ROS 2 speak below their prefix, each over a link of its own. A process of its own: a fault of memory ends it.

use client::{RobotOptions, RobotTls, api::NewMap};
use link::{Credentials, EncryptedLink};
use serde_json::json;
use server::config::{RawConfig, RawRos2, RawRos2Robot, RawTls};
use std::{
    fs,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};
use tempfile::TempDir;
use tests::{Inside, SOON, command::waymark, eventually};
use tokio::net::TcpStream;
use zenoh::{Session, qos::CongestionControl, sample::Sample};

/// Messages of each direction, and their length: several TLS records each.
const MESSAGES: u64 = 20_000;
const BYTES: usize = 40_000;
/// Longest time for all of them.
const LONGEST: Duration = Duration::from_mins(5);
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

/// Counts what arrives at `key` in order and unchanged.
async fn counted(session: &Session, key: &str) -> (zenoh::pubsub::Subscriber<()>, Arc<AtomicU64>) {
    let count = Arc::new(AtomicU64::new(0));
    let next = count.clone();
    let heard = move |sample: Sample| {
        let wanted = message(next.load(Ordering::Relaxed));
        if sample.payload().to_bytes() == wanted {
            next.fetch_add(1, Ordering::Relaxed);
        }
    };
    (session.declare_subscriber(key.to_owned()).callback(heard).await.expect("a subscriber"), count)
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
    let (one, _one) = session(&options).await;
    println!("connected beside {HALF_OPEN} silent connections in {:?}", started.elapsed());
    let (other, _other) = session(&options).await;
    drop(silent);
    let (_outward, out) = counted(&other, "own/out").await;
    let (_homeward, home) = counted(&one, "own/home").await;
    eventually("both ends know of the subscribers", || async {
        (is_wanted(&one, "own/out").await && is_wanted(&other, "own/home").await).then_some(())
    })
    .await;
    let started = Instant::now();
    let all = async {
        tokio::join!(publish(&one, "own/out"), publish(&other, "own/home"));
        while out.load(Ordering::Relaxed) < MESSAGES || home.load(Ordering::Relaxed) < MESSAGES {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    let in_time = tokio::time::timeout(LONGEST, all).await.is_ok();
    let arrived = (out.load(Ordering::Relaxed), home.load(Ordering::Relaxed));
    assert!(in_time, "{arrived:?} of {MESSAGES} arrived");
    println!("{MESSAGES} messages of {BYTES} bytes both ways in {:?}", started.elapsed());
    one.close().await.expect("closed");
    other.close().await.expect("closed");
    inside.server.stop().await;
}
