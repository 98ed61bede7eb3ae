//! An echo of zenoh over TLS: a router that answers each frame at once with as many bytes as an
//! answer has.

use super::{Served, WAIT};
use anyhow::anyhow;
use client::RobotTls;
use serde_json::{Value, json};
use std::{sync::Arc, time::Instant};
use tokio::sync::Notify;
use zenoh::{Session, pubsub::Subscriber, sample::Sample};

const FRAME: &str = "echo/frame";
const ANSWER: &str = "echo/answer";

/// Both ends.
pub(super) struct Echo {
    robot: Session,
    answered: Arc<Notify>,
    _router: Session,
    _subscribers: [Subscriber<()>; 2],
}

impl Echo {
    /// Opens both ends, each with its certificate.
    pub(super) async fn open(tls: &RobotTls, served: &Served, answer_bytes: usize) -> anyhow::Result<Self> {
        let free = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?;
        let endpoint = format!("tls/{free}");
        let router = session(&json!({
            "mode": "router",
            "listen": { "endpoints": [&endpoint] },
            "transport": { "link": { "tls": {
                "enable_mtls": true,
                "listen_certificate": served.certificate,
                "listen_private_key": served.key,
                "root_ca_certificate": served.authority,
            } } },
        }))
        .await?;
        let robot = session(&json!({
            "mode": "client",
            "connect": { "endpoints": [&endpoint], "timeout_ms": 5000 },
            "transport": { "link": { "tls": {
                "enable_mtls": true,
                "connect_certificate": tls.certificate,
                "connect_private_key": tls.key,
                "root_ca_certificate": served.authority,
            } } },
        }))
        .await?;
        let (back, answer) = (router.clone(), vec![7_u8; answer_bytes]);
        let asked = Arc::new(Notify::new());
        let frames = asked.clone();
        let echo = router.declare_subscriber(FRAME).callback(move |_: Sample| asked.notify_one());
        let echo = echo.await.map_err(|e| anyhow!(e))?;
        tokio::spawn(async move {
            loop {
                frames.notified().await;
                if back.put(ANSWER, answer.clone()).express(true).await.is_err() {
                    break;
                }
            }
        });
        let answered = Arc::new(Notify::new());
        let arrived = answered.clone();
        let heard = robot.declare_subscriber(ANSWER).callback(move |_: Sample| arrived.notify_one());
        let heard = heard.await.map_err(|e| anyhow!(e))?;
        let echo = Self { robot, answered, _router: router, _subscribers: [echo, heard] };
        // Until both ends know of each other's subscription.
        for _ in 0..50 {
            if echo.round_trip_ms(&[0]).await.is_ok() {
                return Ok(echo);
            }
        }
        Err(anyhow!("the echo does not answer"))
    }

    /// Sends the bytes, and waits for the answer.
    pub(super) async fn round_trip_ms(&self, frame: &[u8]) -> anyhow::Result<f64> {
        let wait = if frame.len() > 1 { WAIT } else { WAIT / 50 };
        let started = Instant::now();
        self.robot.put(FRAME, frame.to_vec()).express(true).await.map_err(|e| anyhow!(e))?;
        tokio::time::timeout(wait, self.answered.notified()).await?;
        Ok(1e3 * started.elapsed().as_secs_f64())
    }
}

async fn session(settings: &Value) -> anyhow::Result<Session> {
    let mut settings = settings.clone();
    settings["scouting"] = json!({ "multicast": { "enabled": false }, "gossip": { "enabled": false } });
    let config = zenoh::Config::from_json5(&settings.to_string()).map_err(|e| anyhow!(e))?;
    zenoh::open(config).await.map_err(|e| anyhow!(e))
}
