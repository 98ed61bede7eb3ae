//! The Markdown documents of the project, and the check of the commands that they name.

use crate::command::helps;
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

/// The root folder of the project.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The Markdown files of a folder of the project, by name.
pub fn markdown(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(root().join(folder)).expect("a folder of documents");
    let mut found: Vec<PathBuf> = entries.map(|e| e.expect("an entry of a folder").path()).collect();
    found.retain(|path| path.extension().is_some_and(|e| e == "md"));
    found.sort();
    found
}

/// README.md, CONTRIBUTING.md, CHANGELOG.md, docs/*.md, docs/guides/*.md and docs/method/*.md.
pub fn documents() -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root().join(name)).into();
    found.extend(["docs", "docs/guides", "docs/method"].into_iter().flat_map(markdown));
    found
}

/// Checks that every command line of `program`, called `name` in the documents, has a command and
/// options that the program's help lists. `least` is the smallest number of command lines expected.
pub fn check_command_lines(program: &Path, name: &str, least: usize, longest: Duration) {
    let helps = helps(program, longest);
    let (mut wrong, mut count) = (Vec::new(), 0);
    for document in documents() {
        let text = fs::read_to_string(&document).expect("a document in UTF-8");
        for line in command_lines(&text, name) {
            count += 1;
            let reason = unknown_part(&line, &helps)
                .map(|part| format!("{}: `{name} {line}`: {part}", document.display()));
            wrong.extend(reason);
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert!(count >= least, "only {count} command lines of {name} found: the documents are no longer read");
}

/// Command lines of the program called `name`, without that name: between backticks, and lines of
/// code blocks, with their continuation lines and without comments.
fn command_lines(text: &str, name: &str) -> Vec<String> {
    let text = text.replace("\\\n", " ");
    let of_name = |line: &str| line.trim().strip_prefix(name)?.strip_prefix(' ').map(str::to_owned);
    let (mut found, mut is_code) = (Vec::new(), false);
    let mut prose = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if is_code {
            let line = line.split(" #").next().unwrap_or(line);
            found.extend(line.split("&&").filter_map(of_name));
        } else {
            prose.push_str(line.trim());
            prose.push(' ');
        }
    }
    found.extend(prose.split('`').skip(1).step_by(2).filter_map(of_name));
    found
}

/// The first word of a command line that is neither a command nor an option in the help texts.
fn unknown_part(line: &str, helps: &BTreeMap<String, String>) -> Option<String> {
    let mut command = String::new();
    let mut words = line.split_whitespace().peekable();
    while let Some(word) = words.peek() {
        let longer = format!("{command} {word}").trim().to_owned();
        if !helps.contains_key(&longer) {
            break;
        }
        command = longer;
        words.next();
    }
    let help = &helps[&command];
    let is_name =
        |word: &&str| word.chars().all(|c| c.is_ascii_lowercase() || c == '-') && !word.starts_with('-');
    if help.contains("\nCommands:\n")
        && let Some(word) = words.peek().filter(|word| is_name(word))
    {
        return Some((*word).to_owned());
    }
    let options = words.filter(|word| word.starts_with("--") && word.len() > 2);
    let is_listed =
        |option: &str| help.split(|c: char| !(c.is_ascii_alphanumeric() || c == '-')).any(|w| w == option);
    options
        .map(|word| word.split('=').next().unwrap_or(word).trim_end_matches([',', '.', ')', ']']))
        .find(|option| !is_listed(option))
        .map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_lines_are_read_from_prose_and_code() {
        let text = "Run `waymark map\nlist` or `waymark`.\n```sh\nwaymark serve --data x  # start\ncd a && waymark b \\\n  --c\n```";
        let found: Vec<String> = command_lines(text, "waymark")
            .iter()
            .map(|l| l.split_whitespace().collect::<Vec<_>>().join(" "))
            .collect();
        assert_eq!(found, ["serve --data x", "b --c", "map list"]);
    }

    #[test]
    fn unknown_commands_and_options_are_named() {
        let helps: BTreeMap<String, String> = [
            ("", "\nCommands:\n  map  x\n"),
            ("map", "\nCommands:\n  list  x\n"),
            ("map list", "\nOptions:\n      --json\n"),
        ]
        .map(|(command, help)| (command.to_owned(), help.to_owned()))
        .into();
        assert_eq!(unknown_part("map list --json", &helps), None);
        assert_eq!(unknown_part("map list --jso", &helps).as_deref(), Some("--jso"));
        assert_eq!(unknown_part("map show", &helps).as_deref(), Some("show"));
        assert_eq!(unknown_part("fly", &helps).as_deref(), Some("fly"));
    }
}
