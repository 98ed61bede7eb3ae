//! Claim: hostile images, sent as photographs and as frames, are refused with the right code and
//! cost the server little memory.

use client::{
    Delivery, RobotClient, RobotOptions,
    api::NewMap,
    protos::prost::Message,
    v1::{self, ImageEncoding, Status},
};
use reqwest::{
    StatusCode,
    multipart::{Form, Part},
};
use serde_json::Value;
use std::{fs, time::Instant};
use tempfile::TempDir;
use tests::{
    Child, SOON,
    bombs::{Bomb, CLAIMED, TAKEN, bombs},
    http,
};

const MAP: &str = "hall";
const CAMERA: &str = "front";
/// Most memory that an image may cost the server, MB.
const MAX_GROWTH_MB: f64 = 32.0;

/// A figure of `/proc/PID/status`, MB.
fn memory_mb(process: u32, label: &str) -> f64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).expect("the server runs");
    let line = status.lines().find_map(|line| line.strip_prefix(label)).expect("the figure");
    line.split_whitespace().next().and_then(|kb| kb.parse::<f64>().ok()).expect("a number") / 1024.0
}

/// How much the largest memory of the server during `work` exceeds that before.
async fn growth_mb<T>(process: u32, work: impl Future<Output = T>) -> (T, f64) {
    // `man 5 proc_pid_clear_refs`: 5 resets the largest resident size.
    fs::write(format!("/proc/{process}/clear_refs"), "5").expect("the largest size is reset");
    let before = memory_mb(process, "VmRSS:");
    let done = work.await;
    (done, memory_mb(process, "VmHWM:") - before)
}

fn is_one(of: &[&str], code: &str) -> bool {
    of.contains(&code)
}

async fn uploaded(http: &reqwest::Client, url: &str, bomb: &Bomb) -> String {
    let form = Form::new().part("image", Part::bytes(bomb.bytes.clone()));
    let answer = http.post(format!("{url}/api/v1/maps/{MAP}/recognise")).multipart(form).send().await;
    let answer = answer.expect("an answer");
    let status = answer.status();
    if status == StatusCode::OK {
        return TAKEN.to_owned();
    }
    let body: Value = answer.json().await.expect("a problem");
    assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{}: {body}", bomb.name);
    assert!(body["detail"].as_str().is_some_and(|detail| !detail.is_empty()), "{}: {body}", bomb.name);
    body["code"].as_str().expect("a code").to_owned()
}

async fn sent(robot: &RobotClient, seq: u64, bomb: &Bomb) -> String {
    let is_png = bomb.bytes.starts_with(b"\x89PNG");
    let frame = v1::Frame {
        epoch: robot.epoch(),
        seq,
        captured_ns: 1,
        encoding: if is_png { ImageEncoding::Png } else { ImageEncoding::Jpeg }.into(),
        width_px: CLAIMED.0,
        height_px: CLAIMED.1,
        image: bomb.bytes.clone().into(),
        deadline_ms: 60_000,
        ..v1::Frame::default()
    };
    let mut answers = robot.answers();
    robot.publish_raw_frame(CAMERA, frame.encode_to_vec()).await.expect("sent");
    loop {
        let received = tokio::time::timeout(SOON, answers.recv()).await.expect("an answer in time");
        let answer = received.expect("no answer missed").answer;
        if answer.seq != seq {
            continue;
        }
        let rejection = answer.rejection.as_ref().map(|rejection| rejection.code.clone());
        assert_eq!(rejection.is_some(), answer.status() == Status::Rejected, "{}", bomb.name);
        return rejection.unwrap_or_else(|| TAKEN.to_owned());
    }
}

#[cfg(target_os = "linux")]
#[tokio::test(flavor = "multi_thread")]
async fn hostile_images_are_refused_and_cost_little_memory() {
    let data = TempDir::new().expect("a folder");
    let child = Child::start(data.path());
    let maps = child.maps();
    maps.create_map(&NewMap::new(MAP)).await.expect("a map");
    maps.put_robot("r1", MAP).await.expect("a robot");
    let options =
        RobotOptions { delivery: Delivery::Every, ..RobotOptions::new(&child.zenoh, "default", "r1") };
    let robot = RobotClient::connect(&options).await.expect("connected");
    let (http, all) = (http(&child.url).await, bombs());
    assert!(all.len() >= 40, "{}", all.len());
    let harmless =
        Bomb { name: "a picture", bytes: tests::pictures::picture(1), upload: &[TAKEN], frame: &[] };
    assert_eq!(uploaded(&http, &child.url, &harmless).await, TAKEN, "the threads have their memory");
    let mut wrong = Vec::new();
    for (i, bomb) in all.iter().enumerate() {
        let began = Instant::now();
        let (code, grown) = growth_mb(child.id(), uploaded(&http, &child.url, bomb)).await;
        let uploaded_ms = began.elapsed().as_secs_f64() * 1e3;
        let began = Instant::now();
        let (frame_code, frame_grown) = growth_mb(child.id(), sent(&robot, i as u64 + 1, bomb)).await;
        let sent_ms = began.elapsed().as_secs_f64() * 1e3;
        let Bomb { name, bytes, upload, frame } = bomb;
        let text = format!(
            "{name} ({} bytes): photograph {code}, {grown:.1} MB, {uploaded_ms:.0} ms; frame {frame_code}, {frame_grown:.1} MB, \
             {sent_ms:.0} ms",
            bytes.len()
        );
        eprintln!("{text}");
        let is_right = is_one(upload, &code) && is_one(frame, &frame_code);
        if !is_right || grown.max(frame_grown) > MAX_GROWTH_MB {
            wrong.push(text);
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), all.len(), wrong.join("\n"));
    assert_eq!(uploaded(&http, &child.url, &harmless).await, TAKEN, "the server goes on");
}
