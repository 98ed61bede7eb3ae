//! Claim: metrics are well-formed, add up, and have every name that the alerts, the dashboard and
//! the guide use.

use client::{Capture, Delivery, RobotClient, RobotOptions};
use reqwest::StatusCode;
use serde_json::Value;
use server::config::RawConfig;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::Duration,
};
use tests::{Inside, SOON, plain_http, skipped};
use vision::frame::GrayImage;

/// Suffixes of the series of a histogram.
const OF_HISTOGRAMS: [&str; 3] = ["_bucket", "_sum", "_count"];

fn file(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A sample: name, labels as they are written, value.
fn sample(line: &str) -> (&str, &str, f64) {
    let (series, value) = line.rsplit_once(' ').expect("a value");
    let value = value.parse().unwrap_or_else(|_| panic!("no number: {line}"));
    match series.split_once('{') {
        Some((name, labels)) => (name, labels.strip_suffix('}').expect("closed"), value),
        None => (series, "", value),
    }
}

/// Kind by family; what `promtool check metrics` finds, and more.
fn lint(text: &str) -> BTreeMap<String, String> {
    let mut kinds: BTreeMap<String, String> = BTreeMap::new();
    let (mut helped, mut all, mut current) = (BTreeSet::new(), BTreeSet::new(), String::new());
    assert!(text.ends_with('\n'), "the last line has no end");
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("# HELP ") {
            let (name, help) = rest.split_once(' ').expect("a text of help");
            assert!(!help.is_empty() && helped.insert(name.to_owned()), "{name}: help twice or empty");
        } else if let Some(rest) = line.strip_prefix("# TYPE ") {
            let (name, kind) = rest.split_once(' ').expect("a type");
            assert!(helped.contains(name), "{name} has no help");
            assert_eq!(kind == "counter", name.ends_with("_total"), "{name} is a {kind}");
            assert!(kind != "histogram" || name.ends_with("_seconds"), "{name} has no unit");
            let known = name.starts_with("waymark_") || name.starts_with("process_");
            let plain = name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
            assert!(known && plain, "{name} is no name of ours");
            assert!(!name.ends_with("_ms") && !name.ends_with("_count"), "{name}: base units");
            assert!(kinds.insert(name.to_owned(), kind.to_owned()).is_none(), "{name} has two types");
            name.clone_into(&mut current);
        } else {
            let (name, labels, value) = sample(line);
            let family = match OF_HISTOGRAMS.iter().find_map(|suffix| name.strip_suffix(suffix)) {
                Some(family) if kinds.get(family).is_some_and(|kind| kind == "histogram") => family,
                _ => name,
            };
            assert_eq!(family, current, "series are not together: {line}");
            assert!(all.insert(line.rsplit_once(' ').expect("a value").0.to_owned()), "twice: {line}");
            assert!(value.is_finite() && (value >= 0.0), "{line}");
            assert!(labels.len() < 500, "{line}");
        }
    }
    kinds
}

/// Bytes of the database; what is not yet in its file is in the log beside it.
fn stored(text: &str) -> f64 {
    value(text, "waymark_database_bytes") + value(text, "waymark_write_ahead_log_bytes")
}

fn value(text: &str, series: &str) -> f64 {
    let found = text.lines().find_map(|line| line.strip_prefix(series)?.strip_prefix(' '));
    found.unwrap_or_else(|| panic!("no {series}")).parse().expect("a number")
}

/// Names of metrics in a text, without the suffixes of histograms.
fn named(text: &str, kinds: &BTreeMap<String, String>) -> BTreeSet<String> {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_');
    let ours = words.filter(|w| w.starts_with("waymark_") || w.starts_with("process_"));
    ours.map(|word| {
        let base = OF_HISTOGRAMS.iter().find_map(|suffix| word.strip_suffix(suffix));
        base.filter(|base| kinds.contains_key(*base)).unwrap_or(word).to_owned()
    })
    .collect()
}

/// Promtool, if the machine has it.
fn promtool() -> Option<PathBuf> {
    let named = std::env::var_os("PROMTOOL").map(PathBuf::from);
    let program = named.unwrap_or_else(|| "promtool".into());
    Command::new(&program).arg("--version").output().is_ok_and(|o| o.status.success()).then_some(program)
}

#[tokio::test(flavor = "multi_thread")]
async fn metrics_are_well_formed_add_up_and_have_every_name_that_is_used() {
    let inside =
        Inside::start_with(RawConfig { metrics: "127.0.0.1:0".into(), ..RawConfig::default() }).await;
    let maps = inside.maps();
    maps.create_map(&client::api::NewMap::new("hall")).await.expect("map");
    maps.put_robot("r1", "hall").await.expect("robot");
    let options = RobotOptions {
        delivery: Delivery::Every,
        ..RobotOptions::new(&inside.server.zenoh_endpoint, "default", "r1")
    };
    let robot = RobotClient::connect(&options).await.expect("the robot connects");
    let picture = GrayImage::from_fn(64, 48, |u, v| (u * v) as u8);
    for _ in 0..3 {
        robot.recognise("front", Capture::gray(&picture), SOON).await.expect("an answer");
    }
    let alone = format!("http://{}/metrics", inside.server.metrics_addr.expect("a listener for metrics"));
    let bare = plain_http().build().expect("a client");
    let text = tests::eventually("the last frame is counted", || async {
        let text = bare.get(&alone).send().await.ok()?.text().await.ok()?;
        (value(&text, "waymark_frames_total{outcome=\"processed\"}") as u64 == 3).then_some(text)
    })
    .await;
    let kinds = lint(&text);
    let ended: f64 =
        text.lines().filter(|l| l.starts_with("waymark_frames_total{")).map(|l| sample(l).2).sum();
    let open = value(&text, "waymark_frames_waiting") + value(&text, "waymark_frames_in_work");
    let received = value(&text, "waymark_frames_received_total");
    assert_eq!((received as u64, (ended + open) as u64), (3, 3), "{text}");
    assert_eq!(value(&text, "waymark_frame_stage_duration_seconds_count{stage=\"decode\"}") as u64, 3);
    assert_eq!(value(&text, "waymark_robot_connected{robot=\"r1\"}") as u64, 1);
    assert!(value(&text, "process_resident_memory_bytes") > 1e6 && stored(&text) > 1e4);

    // The listener gives nothing else; the main one asks for a token.
    let other = bare.get(alone.replace("/metrics", "/api/v1/robots")).send().await.expect("an answer");
    assert_eq!(other.status(), StatusCode::NOT_FOUND);
    let main = format!("{}/metrics", inside.url());
    assert_eq!(bare.get(&main).send().await.expect("an answer").status(), StatusCode::UNAUTHORIZED);
    assert!(maps.metrics().await.expect("metrics").contains("waymark_build_info{"));

    check_names(&kinds);
    check_by_promtool(&text, inside.data());
    robot.close().await.expect("closed");
    tokio::time::timeout(SOON + Duration::from_secs(1), inside.server.stop()).await.expect("it stops");
}

/// Guide, alerts and dashboard name metrics that there are, and the guide all of them.
fn check_names(kinds: &BTreeMap<String, String>) {
    let guide = file("docs/guides/monitor.md");
    let (alerts, dashboard) =
        (file("packaging/prometheus/alerts.yml"), file("packaging/grafana/waymark.json"));
    let dashboard: Value = serde_json::from_str(&dashboard).expect("JSON");
    for (what, text) in
        [("the guide", &guide), ("the alerts", &alerts), ("the dashboard", &dashboard.to_string())]
    {
        let used = named(text, kinds);
        assert!(used.len() > 10, "{what}: {used:?}");
        let unknown: Vec<_> = used.iter().filter(|name| !kinds.contains_key(*name)).collect();
        assert!(unknown.is_empty(), "{what} names metrics that there are not: {unknown:?}");
    }
    let documented = named(&guide, kinds);
    let missing: Vec<_> = kinds.keys().filter(|name| !documented.contains(*name)).collect();
    assert!(missing.is_empty(), "docs/guides/monitor.md lacks {missing:?}");
}

/// The same checks by Prometheus itself; `folder` is for what it reads.
fn check_by_promtool(text: &str, folder: &Path) {
    match promtool() {
        None => skipped("promtool (package prometheus, or PROMTOOL) checks metrics and alerts where it is"),
        Some(program) => {
            let rules = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packaging/prometheus/alerts.yml");
            let checked =
                Command::new(&program).args(["check", "rules"]).arg(rules).output().expect("it runs");
            assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
            let saved = folder.join("metrics");
            fs::write(&saved, text).expect("written");
            let input = Stdio::from(fs::File::open(&saved).expect("there"));
            let checked =
                Command::new(&program).args(["check", "metrics"]).stdin(input).output().expect("it runs");
            let said = String::from_utf8_lossy(&checked.stderr).into_owned();
            assert!(checked.status.success(), "{said}");
        }
    }
}
