//! Claim: `docs/guides/log-events.md` lists every event that a server logs, with its levels; and a
//! log in JSON is one object a line, in which requests and frames have their ids.

use client::{Capture, RobotClient, RobotOptions};
use serde_json::Value;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
};
use tests::{Child, SOON, documents::root, plain_http};
use vision::frame::GrayImage;

const LEVELS: [&str; 4] = ["debug", "info", "warn", "error"];

/// The literals of the macro call whose arguments begin here.
fn literals(arguments: &str) -> Vec<String> {
    let (mut found, mut depth, mut text) = (Vec::new(), 1, None::<String>);
    let mut characters = arguments.chars();
    while let Some(c) = characters.next() {
        match (&mut text, c) {
            (Some(_), '"') => found.extend(text.take()),
            (Some(text), '\\') => text.extend(characters.next()),
            (Some(text), c) => text.push(c),
            (None, '"') => text = Some(String::new()),
            (None, '(') => depth += 1,
            (None, ')') => depth -= 1,
            (None, _) => {}
        }
        if depth == 0 {
            break;
        }
    }
    found
}

/// Events in the code below a folder, with their levels.
fn events_in(folder: &Path, found: &mut BTreeMap<String, BTreeSet<&'static str>>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() && !path.ends_with("tests") {
            events_in(&path, found);
        } else if path.extension().is_some_and(|kind| kind == "rs") && !path.ends_with("tests.rs") {
            let text = fs::read_to_string(&path).expect("UTF-8");
            let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
            for level in LEVELS {
                for (at, call) in code.match_indices(&format!("tracing::{level}!(")) {
                    let event = literals(&code[at + call.len()..]).pop();
                    let event =
                        event.unwrap_or_else(|| panic!("{}: an event without a name", path.display()));
                    found.entry(event).or_default().insert(level);
                }
            }
        }
    }
}

#[test]
fn the_page_of_log_events_is_that_of_the_code() {
    let mut code = BTreeMap::new();
    for folder in ["engine/src", "server/src", "cli/src"] {
        events_in(&root().join(folder), &mut code);
    }
    assert!(code.len() > 80, "{}", code.len());
    let page = fs::read_to_string(root().join("docs/guides/log-events.md")).expect("the page");
    let mut listed: BTreeMap<String, BTreeSet<&str>> = BTreeMap::new();
    for row in page.lines().filter_map(|line| line.strip_prefix("- `")) {
        let (event, rest) = row.split_once("` (").expect("an event");
        let (levels, says) = rest.split_once("): ").expect("levels");
        assert!(says.len() > 4, "{event} is not explained");
        listed.insert(event.to_owned(), levels.split(", ").collect());
    }
    for (event, levels) in &code {
        assert_eq!(
            listed.get(event),
            Some(levels),
            "docs/guides/log-events.md lacks `{event}` or its levels"
        );
    }
    let gone: Vec<_> = listed.keys().filter(|event| !code.contains_key(*event)).collect();
    assert!(gone.is_empty(), "events that nothing logs: {gone:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_log_in_json_has_the_ids_of_requests_and_frames() {
    let data = tempfile::tempdir().expect("a folder");
    let log = data.path().join("log");
    let mut command = Child::command(data.path(), &[("WAYMARK_LOG_FORMAT", "json")]);
    command.env("WAYMARK_LOG", "info,engine=debug").stderr(fs::File::create(&log).expect("a file"));
    let child = Child::start_from(&mut command);
    let maps = child.maps();
    maps.create_map(&client::api::NewMap::new("hall")).await.expect("map");
    maps.put_robot("r1", "hall").await.expect("robot");
    let request = plain_http().build().expect("a client").put(format!("{}/api/v1/robots/r1", child.url));
    let token = tests::token(&child.url).await;
    let request = request.bearer_auth(token).header("x-request-id", "mine-7").header("if-match", "*");
    let answer = request.json(&serde_json::json!({ "map": "hall" })).send().await.expect("an answer");
    assert!(answer.status().is_success(), "{}", answer.status());
    let robot = RobotClient::connect(&RobotOptions::new(&child.zenoh, "default", "r1")).await.expect("robot");
    let picture = GrayImage::from_fn(64, 48, |u, v| (u * v) as u8);
    let answer = robot.recognise("front", Capture::gray(&picture), SOON).await.expect("an answer");
    robot.close().await.expect("closed");
    child.kill();
    let log = fs::read_to_string(&log).expect("the log");
    let lines: Vec<Value> = log
        .lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("{e}: {line}")))
        .collect();
    for line in &lines {
        let is_whole = ["timestamp", "level", "target"].iter().all(|key| line[*key].is_string());
        assert!(is_whole && line["fields"]["message"].is_string(), "{line}");
    }
    let event = |name: &'static str| lines.iter().filter(move |line| line["fields"]["message"] == name);
    assert!(event("changed").any(|line| line["fields"]["id"] == "mine-7"), "{log}");
    let answered = event("frame_answered").find(|line| line["span"]["seq"] == answer.seq);
    let span = &answered.unwrap_or_else(|| panic!("no frame {} in {log}", answer.seq))["span"];
    assert_eq!(
        (&span["name"], &span["robot"], &span["camera"]),
        (&"frame".into(), &"r1".into(), &"front".into())
    );
    assert_eq!(span["epoch"], answer.epoch);
}
