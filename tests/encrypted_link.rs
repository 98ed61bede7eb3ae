//! Claim: an encrypted link of zenoh that carries much in both directions at once loses and changes nothing. The published
//! link reads and writes one TLS stream from two threads (third_party/zenoh-link-tls). A process of its own: a fault of
//! memory ends it.

use rcgen::{BasicConstraints, CertificateParams, IsCa, Issuer, KeyPair};
use serde_json::{Value, json};
use std::{
    fs,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};
use tempfile::TempDir;
use tests::{eventually, router::ExternalRouter};
use zenoh::{Session, qos::CongestionControl, sample::Sample};

/// Messages of each direction, and their length: several TLS records each.
const MESSAGES: u64 = 20_000;
const BYTES: usize = 40_000;
/// Longest time for all of them.
const LONGEST: Duration = Duration::from_mins(3);

/// Settings of both ends, in files of `folder`: an authority, and a certificate of it for 127.0.0.1.
fn tls(folder: &Path) -> Value {
    let authority_key = KeyPair::generate().expect("a key");
    let mut authority = CertificateParams::default();
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let authority_pem = authority.self_signed(&authority_key).expect("an authority").pem();
    let key = KeyPair::generate().expect("a key");
    let here = CertificateParams::new(vec!["127.0.0.1".to_owned()]).expect("a name");
    let issuer = Issuer::new(authority, authority_key);
    let certificate = here.signed_by(&key, &issuer).expect("a certificate");
    let written = |name: &str, pem: String| {
        let path = folder.join(name);
        fs::write(&path, pem).expect("written");
        path.display().to_string()
    };
    json!({
        "root_ca_certificate": written("authority.pem", authority_pem),
        "listen_certificate": written("listener.pem", certificate.pem()),
        "listen_private_key": written("listener.key", key.serialize_pem()),
    })
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
async fn an_encrypted_link_that_is_busy_in_both_directions_loses_nothing() {
    let folder = TempDir::new().expect("a temporary directory");
    let tls = tls(folder.path());
    let mut router = ExternalRouter::start(Some(tls.clone())).await;
    let config = json!({
        "mode": "client",
        "connect": { "endpoints": [router.endpoint], "timeout_ms": 10_000 },
        "scouting": { "delay": 0, "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "transport": { "shared_memory": { "enabled": false }, "link": { "tls": {
            "root_ca_certificate": tls["root_ca_certificate"],
        } } },
    });
    let config = zenoh::Config::from_json5(&config.to_string()).expect("settings");
    let client = zenoh::open(config).await.expect("a client");
    let (_outward, out) = counted(router.session(), "out").await;
    let (_homeward, home) = counted(&client, "home").await;
    eventually("both ends know of the subscribers", || async {
        (is_wanted(&client, "out").await && is_wanted(router.session(), "home").await).then_some(())
    })
    .await;
    let all = async {
        tokio::join!(publish(&client, "out"), publish(router.session(), "home"));
        while out.load(Ordering::Relaxed) < MESSAGES || home.load(Ordering::Relaxed) < MESSAGES {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    let in_time = tokio::time::timeout(LONGEST, all).await.is_ok();
    assert!(
        in_time,
        "{} and {} of {MESSAGES} arrived",
        out.load(Ordering::Relaxed),
        home.load(Ordering::Relaxed)
    );
    client.close().await.expect("closed");
    router.stop().await;
}
