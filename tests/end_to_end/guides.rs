//! Every command of every guide is run, in order, with the files that the guide names.

use serde_json::Value;
use std::{path::Path, process::Command};
use tests::{documents::markdown, guide_files, guides, machines, phone, skipped};

/// Guides that are run by tests of another part.
const ELSEWHERE: [(&str, &str); 3] = [
    ("python", "client/python/tests/test_guide.py"),
    // It names what is on the pages; journeys in a browser use it.
    ("administrator", "web/tests/unit/guide.test.ts"),
    // It has no commands; it is compared with the code.
    ("log-events", "tests/end_to_end/log_events.rs"),
];

fn run(name: &str) {
    let guide = markdown("docs/guides").into_iter().find(|g| g.file_stem().is_some_and(|s| s == name));
    let folder = tempfile::tempdir().expect("a folder");
    guide_files::write(folder.path());
    guides::run(&guide.expect("a guide"), folder.path(), &mut |_, _| ());
}

/// The same, and what the guide says that commands print is what they print.
fn run_compared(name: &str) {
    let guide = markdown("docs/guides").into_iter().find(|g| g.file_stem().is_some_and(|s| s == name));
    let folder = tempfile::tempdir().expect("a folder");
    guide_files::write(folder.path());
    guides::run_compared(&guide.expect("a guide"), folder.path(), &mut |_, _| ());
}

/// Runs the program in the folder of a guide against its server, with `--json`: exit status, and
/// what it said.
type Waymark<'a> = &'a dyn Fn(&[&str]) -> (Option<i32>, String);

/// How a guide is run.
type Run = fn(&Path, &Path, &mut dyn FnMut(&str, &guides::Guide));

/// Runs `first-pose.md` with photographs in a folder; `also` does more after each command. Gives
/// the focal length that it found, px, and the answer to the photograph `here.jpg`.
fn first_pose(folder: &Path, run: Run, also: &mut dyn FnMut(&str, Waymark<'_>)) -> (f64, Value) {
    let guide = markdown("docs/guides").into_iter().find(|g| g.ends_with("first-pose.md")).expect("a guide");
    let mut answer = None;
    run(&guide, folder, &mut |command, guide| {
        let waymark = |arguments: &[&str]| {
            let done = Command::new(tests::command::program())
                .args(arguments)
                .args(["--json", "--server", guide.url().expect("the guide's server")])
                .env("WAYMARK_ZENOH", guide.endpoint().expect("the guide's server"))
                .current_dir(folder)
                .output()
                .expect("the program");
            let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
            (done.status.code(), text(&done.stdout) + &text(&done.stderr))
        };
        if command.starts_with("waymark recognise") {
            let (_, said) = waymark(&["recognise", "here.jpg", "--camera", "camera.json"]);
            answer =
                Some(serde_json::from_str::<Value>(said.trim()).unwrap_or_else(|e| panic!("{e}: {said}")));
        }
        also(command, &waymark);
    });
    let camera = std::fs::read(folder.join("camera.json")).expect("the guide's camera");
    let camera: Value = serde_json::from_slice(&camera).expect("JSON");
    let focal_px =
        camera["intrinsics"]["fx_px"].as_f64().unwrap_or_else(|| panic!("no focal length: {camera}"));
    (focal_px, answer.expect("the guide asks where a photograph was taken"))
}

/// How far the answer's pose is from the truth of `here.jpg`, in metres, and at most in standard
/// deviations of an axis.
fn error_of(answer: &Value) -> (f64, f64) {
    let pose = &answer["camera_pose"]["map_from_camera"];
    let truth = guide_files::map_from_camera("here.jpg").translation;
    let found =
        ["x_m", "y_m", "z_m"].map(|k| pose[k].as_f64().unwrap_or_else(|| panic!("no pose: {answer}")));
    let variance = |k: usize| answer["camera_pose"]["covariance"][7 * (k + 3)].as_f64().expect("a variance");
    let off: Vec<f64> = (0..3).map(|k| found[k] - truth.vector[k]).collect();
    let metres = off.iter().map(|d| d * d).sum::<f64>().sqrt();
    (metres, (0..3).map(|k| off[k].abs() / variance(k).sqrt()).fold(0.0, f64::max))
}

#[test]
fn first_pose_leads_to_the_pose_of_a_photograph() {
    let folder = tempfile::tempdir().expect("a folder");
    guide_files::write(folder.path());
    let (_, answer) = first_pose(folder.path(), guides::run_compared, &mut |_, _| ());
    let (metres, sigmas) = error_of(&answer);
    assert!(metres < 0.1 && sigmas < 4.0, "off by {metres} m, {sigmas} sigma: {answer}");
}

#[test]
fn first_pose_works_with_the_photographs_of_a_phone_held_upright() {
    let folder = tempfile::tempdir().expect("a folder");
    phone::write(folder.path());
    let (focal_px, answer) = first_pose(folder.path(), guides::run, &mut |command, waymark| {
        let photographs = ["poster1.jpg", "poster2.jpg", "poster3.jpg"];
        if command.starts_with("waymark camera calibrate") {
            // Width and height swapped: told with the first photograph, and nothing is made.
            let teach = ["landmark", "teach", "swapped", "--size", "0.84x0.60"];
            let (status, said) = waymark(&[&teach[..], &photographs].concat());
            assert!(
                status == Some(4) && said.contains("aspect_differs") && said.contains("swapped"),
                "{said}"
            );
            let (status, said) = waymark(&["landmark", "show", "swapped"]);
            assert_eq!(status, Some(3), "{said}");
        } else if command.starts_with("waymark landmark teach") {
            let (status, said) = waymark(&["landmark", "size", "poster", "0.84x0.60"]);
            assert!(status == Some(4) && said.contains("aspect_differs"), "{said}");
        } else if command.starts_with("waymark recognise") {
            // The same as a robot: smaller, upright, and with the intrinsics of that size.
            waymark(&["robot", "add", "r1", "--map", "office"]);
            let (status, said) = waymark(&["robot", "send", "r1", "here.jpg", "--camera", "camera.json"]);
            assert_eq!(status, Some(0), "{said}");
            let line = said.lines().find(|line| line.starts_with('{')).unwrap_or_else(|| panic!("{said}"));
            let answer: Value = serde_json::from_str(line).expect("JSON");
            let quads = answer["quads"].as_array().expect("quads");
            let named =
                quads.iter().find(|q| q["landmark"] == "poster").unwrap_or_else(|| panic!("{answer}"));
            let at = ["x_m", "y_m", "z_m"]
                .map(|k| named["pose"]["camera_from_landmark"][k].as_f64().expect("a pose"));
            let away = at.iter().map(|d| d * d).sum::<f64>().sqrt();
            assert!((away - 2.2).abs() < 0.05, "{away} m away");
        }
    });
    let off = (focal_px / phone::FOCAL_PX - 1.0).abs();
    let (metres, sigmas) = error_of(&answer);
    println!(
        "focal length {focal_px} px, {:.2} % off; pose {metres:.3} m off, {sigmas:.1} sigma",
        100.0 * off
    );
    assert!(off < 0.02, "focal length {focal_px} px, truth {}", phone::FOCAL_PX);
    assert!(metres < 0.05 && sigmas < 4.0, "off by {metres} m, {sigmas} sigma: {answer}");
}

#[test]
fn the_commands_of_teach_a_map_work() {
    run_compared("teach-a-map");
}

#[test]
fn the_commands_of_import_a_map_work() {
    run("import-a-map");
}

#[test]
fn the_commands_of_troubleshooting_work() {
    run("troubleshooting");
}

#[test]
fn the_commands_of_calibrate_a_camera_work() {
    run_compared("calibrate-a-camera");
}

#[test]
fn the_commands_of_connect_a_robot_work() {
    run_compared("connect-a-robot");
}

#[test]
fn the_commands_of_ros2_work() {
    run("ros2");
}

#[test]
fn the_commands_of_the_audit_log_work() {
    run("audit-log");
}

#[test]
fn the_commands_of_back_up_and_restore_work() {
    run_compared("backup");
}

#[test]
fn the_commands_of_move_a_map_work() {
    run("move-a-map");
}

#[test]
fn the_commands_of_several_servers_work() {
    run("several-servers");
}

#[test]
fn the_commands_of_take_a_change_back_work() {
    run("history");
}

#[test]
fn the_commands_of_deploy_work() {
    run("deploy");
}

#[test]
fn the_commands_of_monitor_work() {
    run("monitor");
}

#[test]
fn deploy_secures_a_server_and_connects_the_robot_of_a_second_machine() {
    let folder = tempfile::tempdir().expect("a folder");
    let [mut server, mut robot] = match machines::pair(folder.path(), ["192.168.1.4", "192.168.1.20"]) {
        Ok(pair) => pair,
        Err(reason) => return skipped(&format!("no network namespaces: {reason}")),
    };
    guide_files::write(robot.folder());
    let guide = markdown("docs/guides").into_iter().find(|g| g.ends_with("deploy.md")).expect("a guide");
    let text = std::fs::read_to_string(guide).expect("UTF-8");
    let mut answers = Vec::new();
    for (machine, commands, status) in machines::blocks_for(&text, ["server", "robot"]) {
        let last = commands.len().saturating_sub(1);
        for (i, command) in commands.iter().enumerate() {
            let (ended, said) = [&mut server, &mut robot][machine].run(command);
            let wanted = if i == last { status } else { 0 };
            assert_eq!(ended, wanted, "`{command}` said\n{said}");
            if command.starts_with("cargo run") {
                answers.push(said);
            }
        }
    }
    assert!(answers.len() == 2 && answers[0].contains("poster with confidence"), "{answers:?}");
    assert!(answers[1].contains("certificate"), "{answers:?}");
    // What the page forbids: plain text, and no certificate.
    let asks =
        r"exec 3<>/dev/tcp/192.168.1.4/8080; printf 'GET / HTTP/1.1\r\nHost: x\r\n\r\n' >&3; head -n1 <&3";
    let (_, plain) = robot.run(&format!("bash -c \"{asks}\""));
    assert!(plain.contains(" 426 "), "{plain}");
    let program = "\"$TESTED_PROGRAMS\"/examples/01_recognise --endpoint tcp/192.168.1.4:7447 here.jpg";
    let (status, said) = robot.run(program);
    assert!(status == 1 && said.contains("no server reachable"), "{status} {said}");
}

#[test]
fn the_commands_of_the_command_line_work() {
    run("command-line");
}

#[test]
fn the_commands_of_record_and_replay_work() {
    let guide =
        markdown("docs/guides").into_iter().find(|g| g.ends_with("record-replay.md")).expect("a guide");
    let folder = tempfile::tempdir().expect("a folder");
    guide_files::write(folder.path());
    let mut bags = 0;
    guides::run(&guide, folder.path(), &mut |command, guide| {
        let is_success = command == "waymark replay drive.mcap";
        if is_success || command.contains("bag_0.mcap") {
            let json = Command::new(tests::command::program())
                .args(command.split_whitespace().skip(1))
                .args(["--json", "--server", guide.url().expect("the guide's server")])
                .args(["--zenoh", guide.endpoint().expect("the guide's server")])
                .current_dir(folder.path())
                .output()
                .expect("the program");
            let counts: Value = serde_json::from_slice(&json.stdout).expect("JSON");
            if is_success {
                let recognised = counts["recognised"].as_u64();
                assert!(recognised > Some(20), "the drive is recognised in its own map: {counts}");
                return;
            }
            let scans = if command.contains("--scan /lidar") { 3 } else { 0 };
            let counted = ["recognised", "odometry", "scans"].map(|name| counts[name].as_u64());
            assert_eq!(counted, [Some(3), Some(3), Some(scans)], "{command}: {counts}");
            bags += 1;
        }
    });
    assert_eq!(bags, 2, "bags are played");
}

#[test]
fn the_commands_of_survey_a_building_work() {
    run("survey-a-building");
}

#[test]
fn the_commands_of_evaluate_on_your_photographs_work() {
    run("evaluate-on-your-photographs");
}

/// The words that a file of code gives on the wire: the codes of errors of HTTP and, `with_arms`,
/// those of `=> "word"`.
fn words(file: &str, with_arms: bool) -> Vec<String> {
    let text = std::fs::read_to_string(tests::documents::root().join(file)).expect("a file of code");
    let text: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let text = text.split("#[cfg(test)]").next().unwrap_or_default();
    let is_code = |before: &str| {
        let before = before.trim_end();
        let of_status = before.rsplit_once("StatusCode::").is_some_and(|(_, rest)| {
            rest.strip_suffix(',')
                .is_some_and(|name| name.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
        });
        (with_arms && before.ends_with("=>")) || before.ends_with("invalid(") || of_status
    };
    let mut found = Vec::new();
    let mut parts = text.split('"');
    let mut before = parts.next().unwrap_or_default();
    while let (Some(word), Some(after)) = (parts.next(), parts.next()) {
        if is_code(before) && word.len() > 3 && word.chars().all(|c| c.is_ascii_lowercase() || c == '_') {
            found.push(word.to_owned());
        }
        before = after;
    }
    found
}

#[test]
fn troubleshooting_has_every_word_of_refusal() {
    let mut all = Vec::new();
    for file in ["engine/src/frame/fixes.rs", "protos/src/rejection.rs", "protos/src/convert/result.rs"] {
        let found = words(file, true);
        assert!(found.len() >= 8, "{file}: only {found:?}: it is no longer read");
        all.extend(found);
    }
    let http: Vec<String> = std::fs::read_dir(tests::documents::root().join("server/src/http"))
        .expect("a folder")
        .map(|entry| format!("server/src/http/{}", entry.expect("an entry").file_name().to_string_lossy()))
        .filter(|file| Path::new(file).extension().is_some_and(|e| e == "rs") && !file.ends_with("tests.rs"))
        .flat_map(|file| words(&file, false))
        .collect();
    assert!(http.len() >= 30, "only {http:?}: the codes are no longer read");
    all.extend(http);
    let guide = std::fs::read_to_string(tests::documents::root().join("docs/guides/troubleshooting.md"));
    let guide = guide.expect("the guide");
    let missing: Vec<_> = all.iter().filter(|word| !guide.contains(&format!("`{word}`"))).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn the_commands_of_the_readme_work() {
    let folder = tempfile::tempdir().expect("a folder");
    guide_files::write(folder.path());
    guides::run_compared(&tests::documents::root().join("README.md"), folder.path(), &mut |_, _| ());
}

#[test]
fn every_guide_is_run_by_a_test() {
    let source = include_str!("guides.rs");
    for guide in markdown("docs/guides") {
        let name = guide.file_stem().expect("a name").to_string_lossy().into_owned();
        let here = [format!("run(\"{name}\")"), format!("run_compared(\"{name}\")")]
            .iter()
            .any(|call| source.contains(call))
            || source.contains(&format!("\"{name}.md\""));
        let elsewhere = ELSEWHERE.iter().find(|(guide, _)| *guide == name).is_some_and(|(_, test)| {
            let test = std::fs::read_to_string(tests::documents::root().join(test)).expect("a test");
            test.contains(&format!("{name}.md"))
        });
        assert!(here || elsewhere, "no test runs the commands of docs/guides/{name}.md");
    }
}
