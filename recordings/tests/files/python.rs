//! Claim: the Python packages `mcap` and `mcap-protobuf-support`, which share nothing with this
//! crate, decode every message of a recording by the schemas in it. Skipped, with the reason
//! printed, where they cannot be installed.

use crate::drive::{file, messages};
use std::{io::Write as _, path::Path, process::Command};

const PACKAGES: [&str; 2] = ["mcap==1.6.0", "mcap-protobuf-support==0.6.0"];

/// A Python with the packages: that of `WAYMARK_PYTHON`, or a fresh environment in `folder`.
fn python(folder: &Path) -> Result<std::path::PathBuf, String> {
    if let Some(python) = std::env::var_os("WAYMARK_PYTHON") {
        return Ok(python.into());
    }
    let run = |program: &Path, args: &[&str]| {
        let done = Command::new(program).args(args).output().map_err(|e| e.to_string())?;
        done.status.success().then_some(()).ok_or_else(|| String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let environment = folder.join("venv");
    run(Path::new("python3"), &["-m", "venv", &environment.to_string_lossy()])?;
    let python = environment.join("bin/python");
    run(&python, &[&["-m", "pip", "install", "--quiet"][..], &PACKAGES].concat())?;
    Ok(python)
}

#[test]
fn python_decodes_every_message() {
    let folder = tempfile::tempdir().unwrap();
    let python = match python(folder.path()) {
        Ok(python) => python,
        Err(reason) => {
            // Past the capture of output: whoever runs the tests must know what was not tested.
            let why =
                format!("skipped: python_decodes_every_message: {PACKAGES:?} cannot be installed: {reason}");
            return writeln!(std::io::stderr(), "{why}").unwrap();
        }
    };
    let recording = folder.path().join("drive.mcap");
    std::fs::write(&recording, file(&messages(12))).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/decode.py");
    let done = Command::new(python).arg(script).arg(&recording).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let text = String::from_utf8(done.stdout).unwrap();
    for line in [
        "waymark.v1.Frame 15 seq=43 width_px=4",
        "waymark.v1.RobotPose 15 map=office",
        "waymark.v1.MapChanged 1 version=5",
        "foxglove.RawImage 5 encoding=mono8 step=4",
        "foxglove.SceneUpdate 1 entities=2",
        "foxglove.ImageAnnotations 15 text=poster",
    ] {
        assert!(text.lines().any(|l| l == line), "{line} is not in\n{text}");
    }
    assert_eq!(text.lines().count(), 14, "{text}");
}
