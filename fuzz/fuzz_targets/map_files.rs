//! Any bytes as a map or a scan log of another program: reading must not panic, hang or grow, and
//! walls that are read are finite and within the bound.
//!
//! The first byte chooses the kind of file. A grid's picture is given by the bytes after the first
//! zero byte, or is a small one. Files lie in memory where there is `/dev/shm`.

#![no_main]

use formats::{
    scan_log::{self, LaserDefaults},
    walls::{self, ImportOptions, MAX_WALLS},
};
use libfuzzer_sys::fuzz_target;
use std::{
    fs,
    path::{Path, PathBuf},
    sync::LazyLock,
};

/// Of this process.
static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let memory = Path::new("/dev/shm");
    let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    let folder = parent.join(format!("waymark-fuzz-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("a folder");
    folder
});

fuzz_target!(|data: &[u8]| {
    let Some((choice, text)) = data.split_first() else { return };
    match choice % 6 {
        0 => {
            let (yaml, picture) = match text.iter().position(|b| *b == 0) {
                Some(at) => (&text[..at], &text[at + 1..]),
                None => (text, &b"P5 4 3 255 \x00\x00\x00\x00\xfe\xcd\xcd\xfe\xfe\xfe\xfe\xfe"[..]),
            };
            fs::write(FOLDER.join("map.pgm"), picture).expect("written");
            import("map.yaml", yaml);
        }
        1 => import("map.geojson", text),
        2 => import("map.json", text),
        3 => import("map.svg", text),
        4 => import("map.txt", text),
        _ => {
            let path = FOLDER.join("scans.log");
            fs::write(&path, text).expect("written");
            if let Ok(log) = scan_log::read(&path, &LaserDefaults::default()) {
                assert!(!log.records.is_empty());
                for record in &log.records {
                    assert!(record.odom.position().iter().all(|x| x.is_finite()));
                }
            }
        }
    }
});

fn import(name: &str, bytes: &[u8]) {
    let path = FOLDER.join(name);
    fs::write(&path, bytes).expect("written");
    match walls::import(&path, &ImportOptions { metres_per_unit: Some(0.01), ..ImportOptions::default() }) {
        Ok(imported) => {
            let segments = &imported.map.segments;
            assert!(segments.len() <= MAX_WALLS && imported.report.length_m.is_finite());
            assert!(segments.iter().all(|wall| wall.segment().is_ok()));
        }
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}
