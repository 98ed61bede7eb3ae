use super::*;
use map::pose2::Pose2;
use std::{fs::File, io::Write as _};

const LASER: LaserDefaults = LaserDefaults { max_range_m: 50.0, field_deg: 180.0 };

fn reading(name: &str, text: &str) -> Result<ScanLog, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    if path.extension().is_some_and(|e| e == "gz") {
        let file = File::create(&path).unwrap();
        let mut packed = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
        packed.write_all(text.as_bytes()).unwrap();
        packed.finish().unwrap();
    } else {
        std::fs::write(&path, text).unwrap();
    }
    read(&path, &LASER)
}

fn bad(text: &str) -> (usize, String) {
    match reading("a.log", text) {
        Err(ReadError::Line(e)) => (e.line, e.field),
        other => panic!("{other:?}"),
    }
}

#[test]
fn times_with_impossible_speeds_are_ignored() {
    let recording = |way_m: f64, time_s: f64| {
        let line = |x: f64, t: f64| format!("FLASER 3 1.0 2.0 3.0 {x} 0 0 {x} 0 0 {t} host {t}\n");
        reading("a.log", &(line(0.0, 10.0) + &line(way_m, 10.0 + time_s))).unwrap()
    };
    assert_eq!(recording(4.0, 1.0).duration_s(), Some(1.0));
    assert_eq!(recording(6.0, 1.0).duration_s(), None);
    assert_eq!(recording(0.0, 0.0).duration_s(), None);
    assert_eq!(ScanLog::default().duration_s(), None);
}

#[test]
fn a_carmen_log_is_read_plain_and_compressed() {
    let text = "# a comment\nPARAM x 1\nODOM 0 0 0 0 0 0 1.0 host 1.0\nFLASER 3 1.0 2.0 81.8 1 2 0.5 1 2 0.5 10.0 host 10.0\nFLASER 2 1 2 1.5 2 0.5 1 2 0.5 12.5 host 12.5\n";
    for name in ["a.log", "a.log.gz"] {
        let recording = reading(name, text).unwrap();
        assert_eq!(recording.records.len(), 2);
        let first = &recording.records[0];
        assert_eq!((first.odom, first.time_s), (Pose2::new(1.0, 2.0, 0.5), Some(10.0)));
        assert_eq!(first.scan.range_m(2), None, "beyond the limit there is no return");
        assert!((first.scan.bearing_step_rad() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        // An even number leaves the last step out.
        assert!((recording.records[1].scan.bearing_step_rad() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!((recording.duration_s().unwrap() - 2.5).abs() < 1e-9);
    }
    let new = "ROBOTLASER1 0 -1.57 3.14 0.0174 40 0.01 0 2 3.5 4.5 0 1 2 3 1 2 3 0 0 0 0 0 77.5 host 77.5\n";
    let record = reading("b.log", new).unwrap().records[0].clone();
    assert_eq!((record.odom, record.time_s), (Pose2::new(1.0, 2.0, 3.0), Some(77.5)));
    assert!((record.scan.max_range_m() - 40.0).abs() < 1e-12);
}

#[test]
fn errors_name_line_and_field() {
    assert_eq!(bad("PARAM a\nFLASER 3 1.0 2.0"), (2, "range 2".into()));
    assert_eq!(bad("FLASER x"), (1, "number of readings".into()));
    assert_eq!(bad("FLASER 99999 1"), (1, "number of readings".into()));
    assert_eq!(bad("FLASER 1 x 0 0 0 0 0 0 1 h 1"), (1, "range 0".into()));
    assert_eq!(bad("FLASER 1 1 9e9 0 0 0 0 0 1 h 1\n"), (1, "laser pose".into()));
    assert_eq!(bad("0 0 0 0 1 1 1\n2 0 0 0 1 1 1\n3 0 0 0 1 1 1"), (2, "scan number".into()));
    assert_eq!(bad("0 0 0 0"), (1, "ranges".into()));
    let head = r#"{"waymark_recording":1,"first_bearing_rad":-1,"bearing_step_rad":1,"max_range_m":9}"#;
    assert_eq!(bad(&format!("{head}\n{{\"odom\":[0,0],\"ranges_m\":[1]}}")), (2, "odom".into()));
    assert_eq!(bad(&format!("{head}\n{{\"odom\":[0,0,0],\"ranges_m\":[]}}")), (2, "ranges_m".into()));
    assert_eq!(
        bad(r#"{"waymark_recording":2,"first_bearing_rad":-1,"bearing_step_rad":1,"max_range_m":9}"#).1,
        "waymark_recording"
    );
    assert!(matches!(reading("a.log", "ODOM 0 0 0\n"), Err(ReadError::Unknown)));
    let long = format!("FLASER {}", "1 ".repeat(MAX_LINE_BYTES as usize));
    assert_eq!(bad(&long), (1, "text".into()));
}

#[test]
fn the_own_format_and_numbered_scans_are_read() {
    let head = r#"{"waymark_recording":1,"robot_from_laser":[0.2,0,0],"first_bearing_rad":-1,"bearing_step_rad":1,"max_range_m":9}"#;
    let line = r#"{"t_s":3.5,"odom":[1,2,0.1],"ranges_m":[1,null,2],"truth":[4,5,0.2]}"#;
    let record = reading("a.jsonl", &format!("{head}\n{line}\n")).unwrap().records[0].clone();
    assert_eq!(record.truth, Some(Pose2::new(4.0, 5.0, 0.2)));
    assert!(record.scan.range_m(1).is_none() && record.scan.range_m(2).is_some());
    // The increment of a line belongs to the next scan.
    let numbered = reading("b.txt", "0 1 0 1.5707963 2 2\n1 1 0 0 2 2\n2 0 0 0 2 2\n").unwrap();
    assert_eq!(numbered.records[0].odom, Pose2::default());
    let last = numbered.records[2].odom;
    assert!((last.x_m - 1.0).abs() < 1e-6 && (last.y_m - 1.0).abs() < 1e-6, "{last:?}");
}

const FLASER: &str = "FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\n";

/// `(name, log, scans, the line that was cut)`.
const USED: &[(&str, &[u8], usize, Option<usize>)] = &[
    ("whole", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\n", 1, None),
    ("without a last line break", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1", 1, None),
    ("cut within ranges", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\nFLASER 3 1 2", 1, Some(2)),
    ("cut within the pose", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\nFLASER 3 1 2 3 0 0", 1, Some(2)),
    ("cut within the count", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\nFLASER", 1, Some(2)),
    ("cut within a number", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\nFLASER 3 1 2 3 0 0 0 0 -", 1, Some(2)),
    ("cut before a comment", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\nFLASER 3 1\n# end\n\n", 1, Some(2)),
    ("no return as infinity", b"FLASER 3 1 inf 3 0 0 0 0 0 0 1 h 1\n", 1, None),
    ("no return as NaN", b"FLASER 3 1 nan 3 0 0 0 0 0 0 1 h 1\n", 1, None),
    ("Latin-1 in a comment", b"# B\xfcro\nFLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\n", 1, None),
    ("Latin-1 as a host", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 B\xfcro 1\n", 1, None),
    ("a byte order mark", b"\xef\xbb\xbfFLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\n", 1, None),
    ("lines of Windows", b"FLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\r\n", 1, None),
    ("a scan of no beam", b"FLASER 0 0 0 0 0 0 0 1 h 1\nFLASER 3 1 2 3 0 0 0 0 0 0 1 h 1\n", 1, None),
    ("numbered, cut", b"0 0 0 0 1 1 1\n1 0 0 0 1 1\n", 1, Some(2)),
    (
        "the own format, cut",
        b"{\"waymark_recording\":1,\"first_bearing_rad\":-1,\"bearing_step_rad\":1,\"max_range_m\":9}\n\
        {\"odom\":[0,0,0],\"ranges_m\":[1,2]}\n{\"odom\":[0,0",
        1,
        Some(3),
    ),
];

#[test]
fn logs_are_used_up_to_where_they_end() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes, scans, cut) in USED {
        let path = folder.path().join("a.log");
        std::fs::write(&path, bytes).unwrap();
        let log = read(&path, &LaserDefaults::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((log.records.len(), log.cut.as_ref().map(|bad| bad.line)), (*scans, *cut), "{name}");
    }
    // In the middle a line that cannot be used is no end.
    assert_eq!(bad(&format!("{FLASER}FLASER 3 1 2\n{FLASER}")), (2, "range 2".into()));
    assert!(matches!(reading("none.log", "FLASER 0 0 0 0 0 0 0 1 h 1\n"), Err(ReadError::Unknown)));
}
