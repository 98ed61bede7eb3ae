//! Claim: every command explains its options and has a completion and a manual page; an option that
//! does not exist is refused; commands in documents exist.

use std::{collections::BTreeSet, fs, time::Duration};
use tempfile::TempDir;
use tests::{
    command::{check_help, check_refused, helps, program, waymark},
    documents::check_command_lines,
};

const LONGEST: Duration = Duration::from_mins(2);
/// Options of every command against a server, and of every command for one map.
const SERVER: &[&str] = &["--server", "--token", "--json"];
const MAP: &[&str] = &["--map", "--server", "--token", "--json"];

/// Options that each command must name in its help, beside those of its group.
const OPTIONS: [(&str, &[&str], &[&str]); 68] = [
    ("", &[], &["--log", "--version", "Exit status"]),
    (
        "demo",
        &[],
        &["--robots", "--rate-hz", "--legs", "--seed", "--survey", "--http", "--data", "--stay", "--json"],
    ),
    ("sample", &[], &["<FOLDER>"]),
    (
        "serve",
        &[],
        &["--config", "--data", "--store", "--http", "--zenoh", "--fleet", "--workers", "--insecure"],
    ),
    (
        "detect",
        &[],
        &[
            "--json",
            "--draw",
            "--show-params",
            "--params",
            "--grouping",
            "--working-side",
            "--scales",
            "--min-segment",
            "--edge-steps",
            "--min-support",
            "--min-score",
            "--nested",
            "--no-three-sided",
            "--remove-tiling",
            "--set",
            "[IMAGES]",
        ],
    ),
    (
        "survey",
        SERVER,
        &["<RECORDING>...", "--into", "--origin", "--camera", "--recorded", "--image", "--scan"],
    ),
    ("record", SERVER, &["<FILE>", "--robot", "--seconds", "--zenoh", "--fleet"]),
    (
        "replay",
        SERVER,
        &[
            "<FILE>",
            "--robot",
            "--recorded",
            "--map",
            "--speed",
            "--answers",
            "--compare",
            "--zenoh",
            "--fleet",
        ],
    ),
    ("recognise", MAP, &["--camera", "--preset", "<PHOTO>"]),
    ("completions", &[], &["<SHELL>", "bash", "fish"]),
    ("man", &[], &["<FOLDER>"]),
    ("server status", SERVER, &[]),
    ("server list", SERVER, &[]),
    ("token create", SERVER, &["<NAME>", "--role", "--for-map", "--valid"]),
    ("token list", SERVER, &[]),
    ("token revoke", SERVER, &["<NUMBER>", "--yes"]),
    ("login", SERVER, &[]),
    ("logout", SERVER, &[]),
    ("open", SERVER, &[]),
    ("backup", SERVER, &["[FILE]"]),
    ("restore", &[], &["<FILE>", "--data", "--store", "--dry-run", "--yes", "--json"]),
    ("map create", SERVER, &["--preset", "--distance", "--site", "--building", "--floor", "<MAP>"]),
    ("map pipeline", SERVER, &["--preset", "--distance", "<MAP>"]),
    ("map list", SERVER, &[]),
    ("map show", SERVER, &["<MAP>"]),
    ("map locate", SERVER, &["--site", "--building", "--floor", "--in", "--at", "--level-m", "<MAP>"]),
    (
        "map visibility",
        SERVER,
        &["--image", "--focal-px", "--camera-height-m", "--tilt-deg", "--pan-deg", "--defaults", "<MAP>"],
    ),
    ("map learning", SERVER, &["<MAP>", "--weights", "--use-despite-gates", "--defaults", "--why"]),
    ("map fusion", SERVER, &["<MAP>", "[MODE]", "near_best"]),
    ("map delete", SERVER, &["<MAP>", "--yes"]),
    (
        "map import",
        SERVER,
        &[
            "<MAP>",
            "<FILE>",
            "--dry-run",
            "--no-underlay",
            "--yes",
            "--min-length-m",
            "--metres-per-unit",
            "--draw",
            "--picture",
        ],
    ),
    ("map save", SERVER, &["<MAP>", "<FILE>"]),
    ("map load", SERVER, &["<FILE>", "--name", "--no-map-link"]),
    ("map walls", SERVER, &["<MAP>", "--draw"]),
    ("site places", SERVER, &["<SITE>"]),
    ("site route", SERVER, &["<SITE>", "<FROM>", "<TO>"]),
    ("map export", SERVER, &["<MAP>", "--out", "--resolution-m"]),
    ("map convert", &[], &["<FILE>", "--out", "--metres-per-unit", "--picture", "--json"]),
    (
        "map build",
        SERVER,
        &["--max-range-m", "--field-deg", "--out", "--draw", "--params", "--into", "--yes", "<LOG>"],
    ),
    ("landmark list", MAP, &[]),
    ("landmark show", MAP, &["<LANDMARK>"]),
    (
        "landmark teach",
        MAP,
        &[
            "<LANDMARK>",
            "<PHOTO>",
            "--size",
            "--whole-image",
            "--pick",
            "--corners",
            "--generated-views",
            "--yes",
        ],
    ),
    (
        "landmark place",
        MAP,
        &[
            "<LANDMARK>",
            "--wall",
            "--at",
            "--height",
            "--lower-edge",
            "--xy",
            "--facing",
            "--photo",
            "--nowhere",
        ],
    ),
    ("landmark size", MAP, &["<LANDMARK>", "<SIZE>", "--yes"]),
    ("landmark rename", MAP, &["<LANDMARK>", "<NEW_NAME>"]),
    ("landmark health", MAP, &["<LANDMARK>", "quarantined"]),
    (
        "landmark learning",
        MAP,
        &[
            "<LANDMARK>",
            "--weights",
            "--min-views",
            "--min-saliency-f",
            "--min-stable-points",
            "--min-visibility-confidence",
            "--refuse-one-side",
            "--use-despite-gates",
            "--defaults",
            "--why",
        ],
    ),
    ("landmark delete", MAP, &["<LANDMARKS>", "--yes"]),
    ("landmark accept", MAP, &["<GATHERING>", "<NUMBER[=NAME]>"]),
    ("view list", MAP, &["<LANDMARK>"]),
    ("view show", MAP, &["<LANDMARK>", "<VIEW>", "--out"]),
    ("view image", MAP, &["<LANDMARK>", "<VIEW>", "--out"]),
    ("view delete", MAP, &["<LANDMARK>", "<VIEWS>", "--yes"]),
    ("robot add", SERVER, &["<ROBOT>", "--map"]),
    ("robot list", SERVER, &[]),
    ("robot show", SERVER, &["<ROBOT>"]),
    ("robot send", SERVER, &["<ROBOT>", "<PHOTO>", "--camera", "--robot-file", "--zenoh", "--fleet"]),
    ("robot access-control", SERVER, &["--server-certificate", "--robot", "--also-map", "--fleet"]),
    ("robot remove", SERVER, &["<ROBOT>", "--yes"]),
    (
        "camera calibrate",
        &[],
        &["--size", "--corners", "--radial", "--zero-roll", "--height-m", "--unknown-aspect", "[IMAGES]..."],
    ),
    ("camera list", SERVER, &["<ROBOT>"]),
    ("camera frame", SERVER, &["<ROBOT>", "[CAMERA]", "--out"]),
    ("gathering start", MAP, &["<ROBOT>", "--landmark", "--include-known"]),
    ("gathering show", MAP, &["<GATHERING>", "--pictures"]),
    ("gathering discard", MAP, &["<GATHERING>", "<TRACKS>", "--yes"]),
    ("run learn", MAP, &["<ROBOT>", "<TRAJECTORY>", "--sigma-m", "--sigma-rad"]),
    ("run delete", MAP, &["<RUN>", "--yes"]),
    ("job wait", SERVER, &["<JOB>"]),
];

#[test]
fn every_command_explains_its_options() {
    let all = OPTIONS.map(|(command, group, own)| (command, [group, own].concat()));
    check_help(program(), &all.each_ref().map(|(command, options)| (*command, options.as_slice())), LONGEST);
}

#[test]
fn every_group_of_commands_has_a_line_for_each_verb() {
    for (command, help) in helps(program(), LONGEST) {
        let section = help.split("\nCommands:\n").nth(1).unwrap_or("");
        for line in section.lines().take_while(|line| !line.is_empty()) {
            let words = line.split_whitespace().count();
            assert!(words > 2, "`waymark {command} --help` explains `{line}` not at all");
            assert!(line.len() <= 120, "`waymark {command} --help`: `{line}` is more than a line");
        }
    }
}

#[test]
fn commands_in_the_documents_exist() {
    check_command_lines(program(), "waymark", 20, LONGEST);
}

#[test]
fn unknown_commands_and_options_are_refused() {
    let wrong = [
        "detect --jason a.png",
        "detect",
        "demo --robots 0",
        "demo --rate-hz fast",
        "evaluate",
        "landmark teach l --size 0x1 a.png",
        "landmark teach l --pick 1 --whole-image a.png",
        "landmark place l --at 1",
        "landmark place l --wall 1 --at 1 --height 12",
        "map create Office",
        "recognise --map m --camera 1,2,3 a.png",
        "learn --map m --landmark l a.png",
        "fly",
    ];
    for line in wrong {
        check_refused(program(), line, LONGEST);
    }
}

#[test]
fn a_wrong_command_line_is_json_where_results_are() {
    let run = waymark(["landmark", "list", "--jason", "--json"], LONGEST);
    let error: serde_json::Value = serde_json::from_str(&run.stderr).expect("JSON");
    assert_eq!((run.status, &error["error"]["code"]), (2, &"usage".into()), "{run:?}");
    assert!(error["error"]["detail"].as_str().is_some_and(|d| d.contains("--jason")), "{error}");
}

/// The words of every command: `map list` gives both.
fn command_words() -> BTreeSet<String> {
    helps(program(), LONGEST)
        .keys()
        .flat_map(|c| c.split(' ').map(str::to_owned))
        .filter(|w| !w.is_empty())
        .collect()
}

#[test]
fn completions_of_every_shell_name_every_command() {
    let words = command_words();
    assert!(words.len() > 40, "{words:?}");
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let run = waymark(["completions", shell], LONGEST);
        assert_eq!((run.status, run.stderr.as_str()), (0, ""), "{shell}");
        let named: BTreeSet<&str> = run.stdout.split(|c: char| !c.is_alphanumeric() && c != '-').collect();
        let missing: Vec<_> = words.iter().filter(|word| !named.contains(word.as_str())).collect();
        assert!(missing.is_empty(), "{shell}: {missing:?}");
    }
}

#[test]
fn every_command_has_a_manual_page_with_its_options() {
    let folder = TempDir::new().expect("a temporary directory");
    let pages = folder.path().join("man1");
    let run = waymark(["man", pages.to_str().expect("text")], LONGEST);
    assert_eq!(run.status, 0, "{run:?}");
    let helps = helps(program(), LONGEST);
    assert_eq!(fs::read_dir(&pages).expect("pages").count(), helps.len());
    for (command, help) in helps {
        let name = format!("waymark {command}").trim().replace(' ', "-");
        let page =
            fs::read_to_string(pages.join(format!("{name}.1"))).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(page.len() > 200, "{name}: {page}");
        for verb in help.split("\nCommands:\n").nth(1).unwrap_or("").lines().take_while(|l| !l.is_empty()) {
            let verb = verb.split_whitespace().next().unwrap_or("");
            let is_named = verb == "help" || page.contains(&format!("{name}-{verb}").replace('-', "\\-"));
            assert!(is_named, "{name}.1 does not name {verb}");
        }
    }
}

#[test]
fn the_page_of_the_command_line_names_every_verb() {
    let page = std::fs::read_to_string(tests::documents::root().join("docs/guides/command-line.md"));
    let page = page.expect("the page");
    let helps = tests::command::helps(program(), LONGEST);
    let row = |noun: &str| page.lines().find(|line| line.starts_with(&format!("| `{noun}` |")));
    let mut missing = Vec::new();
    for command in helps.keys().filter(|command| !command.is_empty()) {
        let named = match command.split_once(' ') {
            Some((noun, verb)) => row(noun).is_some_and(|row| row.contains(&format!("`{verb}`"))),
            None => page.contains(&format!("`{command}`")),
        };
        missing.extend((!named).then_some(command));
    }
    assert!(helps.len() > 60 && missing.is_empty(), "docs/guides/command-line.md lacks {missing:?}");
}
