//! Claim: every planted fault (`tests/planted`) still applies to the code, and names the test that
//! must find it. That it is found is shown by `tests/planted/run.sh`, which builds each of them.

use std::{fs, process::Command};
use tests::{documents::root, skipped};

#[test]
fn every_planted_fault_still_applies() {
    let has_git = Command::new("git").current_dir(root()).arg("rev-parse").output();
    if !has_git.is_ok_and(|done| done.status.success()) {
        skipped("there is no git here, or this is no repository");
        return;
    }
    let mut count = 0;
    for entry in fs::read_dir(root().join("tests/planted")).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|kind| kind != "patch") {
            continue;
        }
        count += 1;
        let text = fs::read_to_string(&path).expect("UTF-8");
        let first = text.lines().next().unwrap_or_default();
        assert!(first.starts_with("# test: "), "{}: the first line is `# test: COMMAND`", path.display());
        let applied = Command::new("git").current_dir(root()).args(["apply", "--check"]).arg(&path).output();
        let applied = applied.expect("git");
        assert!(
            applied.status.success(),
            "{} does not apply any more: {}",
            path.display(),
            String::from_utf8_lossy(&applied.stderr)
        );
    }
    assert!(count >= 9, "{count} planted faults");
}
