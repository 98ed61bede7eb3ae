//! Claim: on an encrypted endpoint a robot reaches its own keys alone, key by key; without a valid
//! certificate nobody reaches anything; a revoked certificate gives nothing any more, at once; and
//! private keys are nobody else's.

mod keys;
mod lifetimes;
mod refusals;
mod revocation;

use client::{RobotOptions, RobotTls};
use serde_json::{Value, json};
use server::config::{RawConfig, RawTls};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use tests::{Inside, SOON, command::waymark};

/// A server with an encrypted endpoint, robots `r1` on map `hall` and `r2` on `yard`, and their
/// folders.
struct Fleet {
    inside: Inside,
    /// A plain endpoint of the server's own router: who speaks there hears and says everything.
    local: String,
    folders: TempDir,
}

impl Fleet {
    async fn start() -> Self {
        let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("a port");
        let local = format!("tcp/{free}");
        let tls = RawTls { enabled: true, local_zenoh: local.clone(), ..RawTls::default() };
        let inside = Inside::start_with(RawConfig { tls, ..RawConfig::default() }).await;
        let fleet = Self { inside, local, folders: TempDir::new().expect("a folder") };
        for (robot, map) in [("r1", "hall"), ("r2", "yard")] {
            fleet.add(robot, map).await;
        }
        fleet
    }

    /// Makes a robot and its map known, and enrols it.
    async fn add(&self, robot: &str, map: &str) {
        let maps = self.inside.maps();
        maps.create_map(&client::api::NewMap::new(map)).await.expect("a map");
        maps.put_robot(robot, map).await.expect("a robot");
        self.enrol(robot, robot);
    }

    /// Enrols a robot, as a person does.
    fn enrol(&self, robot: &str, folder: &str) {
        let out = self.folder(folder);
        let out = out.to_str().expect("a path");
        let url = self.inside.url();
        let run = waymark(["robot", "enrol", robot, "--out", out, "--server", &url], SOON);
        assert_eq!(run.status, 0, "{run:?}");
    }

    fn folder(&self, robot: &str) -> PathBuf {
        self.folders.path().join(robot)
    }

    /// For a robot that is to be admitted, however busy the machine is.
    fn options(&self, robot: &str) -> RobotOptions {
        let options = RobotOptions::from_file(self.folder(robot).join("robot.json"));
        RobotOptions { timeout: SOON, ..options.expect("the robot's file") }
    }

    /// A session that shows the certificate of a robot, without the SDK.
    async fn raw(&self, robot: &str) -> zenoh::Session {
        let RobotOptions { endpoint, tls, .. } = self.options(robot);
        session(&endpoint, tls.as_ref()).await.expect("a session")
    }

    /// A session of the server's own machine, that hears and says everything.
    async fn everything(&self) -> zenoh::Session {
        session(&self.local, None).await.expect("a session")
    }
}

/// A session of zenoh, with a certificate or none.
async fn session(endpoint: &str, tls: Option<&RobotTls>) -> zenoh::Result<zenoh::Session> {
    let mut config = json!({
        "mode": "client",
        "connect": { "endpoints": [endpoint], "timeout_ms": 3000 },
        "scouting": { "multicast": { "enabled": false } },
    });
    if let Some(RobotTls { certificate, key, authority, .. }) = tls {
        config["transport"] = json!({ "link": { "tls": {
            "enable_mtls": true,
            "connect_certificate": certificate,
            "connect_private_key": key,
            "root_ca_certificate": authority.as_ref().map_or(Value::Null, |path| json!(path)),
        } } });
    }
    zenoh::open(zenoh::Config::from_json5(&config.to_string()).expect("settings")).await
}

fn read(path: impl AsRef<Path>) -> String {
    std::fs::read_to_string(path).expect("a file")
}
