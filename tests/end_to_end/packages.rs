//! Claim: what `packaging` holds fits the program: the container file's stages and paths, the unit,
//! the Debian package's files. No container is built here.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};
use tests::{documents::root, skipped};

/// An instruction of a container file, its line joined.
#[derive(Debug, PartialEq, Eq)]
struct Instruction {
    word: String,
    rest: String,
}

fn instructions(text: &str) -> Vec<Instruction> {
    let lines = text.lines().filter(|line| !line.trim_start().starts_with('#') && !line.trim().is_empty());
    let joined = lines.collect::<Vec<_>>().join("\n").replace("\\\n", " ");
    let instruction = |line: &str| {
        let (word, rest) = line.trim().split_once(' ').expect("an argument");
        Instruction { word: word.to_uppercase(), rest: rest.trim().to_owned() }
    };
    joined.lines().map(instruction).collect()
}

/// Every fault of a container file.
fn faults(text: &str, exists: impl Fn(&str) -> bool) -> Vec<String> {
    let (all, mut faults) = (instructions(text), Vec::new());
    let mut stages = Vec::new();
    for Instruction { word, rest } in &all {
        let words: Vec<_> = rest.split_whitespace().collect();
        match word.as_str() {
            "FROM" => {
                let tag = words[0].rsplit_once(':').map_or("", |(_, tag)| tag);
                if !words[0].contains('/') || tag.matches('.').count() < 1 {
                    faults.push(format!("{} is not pinned", words[0]));
                }
                stages.push(words.get(2).copied().unwrap_or_default());
            }
            "COPY" => {
                let of_stage = words[0].strip_prefix("--from=");
                if of_stage.is_some_and(|stage| !stages.contains(&stage)) {
                    faults.push(format!("no stage {}", words[0]));
                }
                let sources = &words[..words.len() - 1];
                let missing = sources.iter().filter(|_| of_stage.is_none()).filter(|source| !exists(source));
                faults.extend(missing.map(|source| format!("{source} is not there")));
            }
            "ADD" => faults.push("ADD fetches and unpacks: COPY".to_owned()),
            _ => {}
        }
    }
    let last = all.iter().rposition(|i| i.word == "FROM").map_or(&all[..], |at| &all[at..]);
    let has = |word: &str| last.iter().any(|i| i.word == word);
    let user = last.iter().rfind(|i| i.word == "USER").map_or("root", |i| i.rest.as_str());
    if ["root", "0"].contains(&user.split(':').next().unwrap_or_default()) {
        faults.push("it runs as root".to_owned());
    }
    faults.extend(
        ["HEALTHCHECK", "ENTRYPOINT"].into_iter().filter(|word| !has(word)).map(|w| format!("no {w}")),
    );
    faults
}

#[test]
fn the_container_file_has_pinned_bases_existing_sources_a_user_and_a_health_check() {
    let text = fs::read_to_string(root().join("packaging/Containerfile")).expect("the file");
    let exists = |source: &str| root().join(source).exists();
    assert_eq!(faults(&text, exists), Vec::<String>::new());
    // Every crate of the workspace is there, or cargo refuses its manifest.
    let manifest = fs::read_to_string(root().join("Cargo.toml")).expect("the manifest");
    let members = manifest.lines().find_map(|line| line.strip_prefix("members = ")).expect("members");
    for member in
        members.split('"').filter(|word| word.chars().all(char::is_alphanumeric) && !word.is_empty())
    {
        assert!(text.contains(&format!("\nCOPY {member} {member}\n")), "{member} is not copied");
    }
    // What is embedded in the server, too.
    let embedding = fs::read_to_string(root().join("server/build.rs")).expect("the build script");
    let embedded: Vec<&str> =
        embedding.split("root.join(\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert!(embedded.len() > 1, "{embedded:?}");
    for folder in embedded {
        assert!(text.contains(&format!("\nCOPY {folder} {folder}\n")), "{folder} is not copied");
    }
    let ignored = fs::read_to_string(root().join(".dockerignore")).expect("the file");
    for word in ["target", ".git", "node_modules"] {
        assert!(ignored.contains(word), "{word} is sent to the build");
    }
    // The check of the check.
    for (from, to) in [
        ("USER waymark", "USER root"),
        ("HEALTHCHECK", "LABEL"),
        ("debian:12.12-slim", "debian:latest"),
        ("COPY engine engine", "COPY gone gone"),
        ("--from=build", "--from=other"),
    ] {
        assert!(text.contains(from), "{from}");
        assert_eq!(faults(&text.replacen(from, to, 1), exists).len(), 1, "{to}");
    }
}

/// The commands of container file and unit are those of the program.
#[test]
fn the_commands_of_unit_and_container_are_understood() {
    let help = |words: &[&str]| {
        let out =
            Command::new(tests::command::program()).args(words).arg("--help").output().expect("it runs");
        assert!(out.status.success(), "{words:?}");
        String::from_utf8_lossy(&out.stdout).into_owned()
    };
    assert!(help(&["server", "health"]).contains("--server"));
    let serve = help(&["serve"]);
    for option in ["--tls", "--http", "--zenoh", "--config"] {
        assert!(serve.contains(option), "{option}");
    }
}

/// Copies the unit into a tree of its own with a program that exists.
fn staged_unit(folder: &Path) -> PathBuf {
    let unit = fs::read_to_string(root().join("packaging/systemd/waymark.service")).expect("the unit");
    let path = folder.join("waymark.service");
    fs::write(&path, unit.replace("/usr/bin/waymark", "/bin/true")).expect("written");
    path
}

#[test]
fn the_unit_is_verified_and_hardened() {
    let folder = tempfile::tempdir().expect("a folder");
    let unit = staged_unit(folder.path());
    let analyze = |arguments: &[&str]| Command::new("systemd-analyze").args(arguments).arg(&unit).output();
    let Ok(verified) = analyze(&["verify", "--man=no", "--recursive-errors=no"]) else {
        return skipped("systemd-analyze (package systemd) verifies the unit where it is");
    };
    let said = String::from_utf8_lossy(&verified.stderr).into_owned();
    assert!(verified.status.success() && !said.contains("waymark.service:"), "{said}");
    let graded = analyze(&["security", "--offline=true", "--threshold=20", "--no-pager"]).expect("it runs");
    let said = String::from_utf8_lossy(&graded.stdout).into_owned();
    assert!(graded.status.success(), "exposed more than 2.0 of 10: {said}");
}

#[test]
fn the_debian_package_names_files_that_exist() {
    let manifest = fs::read_to_string(root().join("cli/Cargo.toml")).expect("the manifest");
    let section = manifest.split("[package.metadata.deb]").nth(1).expect("a package for Debian");
    let sources: Vec<_> =
        section.lines().filter_map(|line| line.trim().strip_prefix("[\"")?.split('"').next()).collect();
    assert!(sources.len() >= 5, "{sources:?}");
    // Below the crate, but for `target/release`, which cargo-deb knows; `packaging/deb` makes
    // `target/packaging`.
    let is_made =
        |source: &&&str| **source == "target/release/waymark" || source.starts_with("../target/packaging/");
    for source in sources.iter().filter(|source| !is_made(source)) {
        assert!(root().join("cli").join(source).exists(), "{source}");
    }
    for script in ["postinst", "postrm"] {
        let path = root().join("packaging/debian").join(script);
        let checked = Command::new("sh").arg("-n").arg(&path).status().expect("sh");
        assert!(checked.success(), "{script}");
        assert!(fs::read_to_string(&path).expect("there").contains("#DEBHELPER#"), "{script}");
    }
    // The settings of the package are settings.
    let settings =
        server::config::RawConfig::read(Some(&root().join("packaging/waymark.toml"))).expect("read");
    server::config::Config::try_from(settings).expect("valid");
}
