use super::{
    file::Wall,
    grid::{Cell, Grid},
    *,
};
use std::io::Write as _;

const LASER: LaserArgs = LaserArgs { max_range_m: 50.0, field_deg: 180.0 };

fn reading(name: &str, text: &str) -> Result<Recording, ReadError> {
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
fn times_by_which_a_robot_would_have_flown_are_none() {
    let recording = |way_m: f64, time_s: f64| {
        let line = |x: f64, t: f64| format!("FLASER 3 1.0 2.0 3.0 {x} 0 0 {x} 0 0 {t} host {t}\n");
        reading("a.log", &(line(0.0, 10.0) + &line(way_m, 10.0 + time_s))).unwrap()
    };
    assert_eq!(recording(4.0, 1.0).duration_s(), Some(1.0));
    assert_eq!(recording(6.0, 1.0).duration_s(), None);
    assert_eq!(recording(0.0, 0.0).duration_s(), None);
    assert_eq!(Recording::default().duration_s(), None);
}

#[test]
fn a_carmen_log_is_read_packed_or_not() {
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
    assert_eq!(bad("FLASER 1 nan 0 0 0 0 0 0 1 h 1"), (1, "range 0".into()));
    assert_eq!(bad("FLASER 1 1 9e9 0 0 0 0 0 1 h 1\n"), (1, "laser pose".into()));
    assert_eq!(bad("FLASER 0 0 0 0 0 0 0 1 h 1"), (1, "scan".into()));
    assert_eq!(bad("0 0 0 0 1 1 1\n2 0 0 0 1 1 1"), (2, "scan number".into()));
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
fn the_own_format_and_numbered_scans() {
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

#[test]
fn a_grid_becomes_its_walls_and_back() {
    // A room 4 m x 3 m, walls drawn by hand, free side inside (left of counter-clockwise).
    let corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]];
    let room: Vec<Wall> = (0..4).map(|i| Wall::between(corners[i], corners[(i + 1) % 4])).collect();
    let grid = Grid::of_walls(&room, 0.05).unwrap();
    assert_eq!(grid.at(60, 50), Cell::Free);
    assert_eq!(grid.at(2, 2), Cell::Unknown, "outside");
    let folder = tempfile::tempdir().unwrap();
    let yaml = folder.path().join("room.yaml");
    grid.write(&yaml).unwrap();
    let again = Grid::read(&yaml).unwrap();
    assert_eq!(again, grid);
    let walls = again.walls(0.3);
    assert_eq!(walls.len(), 4, "{walls:?}");
    for w in &walls {
        let s = w.segment().unwrap();
        // The free side is inside, and the wall where it was, to a cell.
        assert!(s.facing().dot(&(nalgebra::Point2::new(2.0, 1.5) - s.a)) > 0.0, "{w:?}");
        let near = |v: f64, to: &[f64]| to.iter().any(|t| (v - t).abs() < 0.06);
        assert!([w.a, w.b].iter().all(|p| near(p[0], &[0.0, 4.0]) && near(p[1], &[0.0, 3.0])), "{w:?}");
    }
}

#[test]
fn a_smoothed_grid_has_its_walls_too() {
    // Free, a cell in between, a wall two cells thick, unknown behind.
    let row = [Cell::Free, Cell::Free, Cell::Unknown, Cell::Occupied, Cell::Occupied, Cell::Unknown];
    let cells: Vec<Cell> = (0..40).flat_map(|_| row).collect();
    let grid = Grid { width: 6, height: 40, resolution_m: 0.05, origin: Pose2::default(), cells };
    let walls = grid.walls(0.3);
    assert_eq!(walls.len(), 1, "{walls:?}");
    assert!([walls[0].a, walls[0].b].iter().all(|p| (p[0] - 0.15).abs() < 1e-9), "{walls:?}");
}

#[test]
fn a_slanted_wall_of_a_grid_is_one_wall() {
    let slanted = [Wall::between([0.0, 0.0], [6.0, 2.0]), Wall::between([6.0, 4.0], [0.0, 4.0])];
    let grid = Grid::of_walls(&slanted, 0.05).unwrap();
    let walls = grid.walls(1.0);
    let along = |w: &&Wall| {
        let d = [w.b[0] - w.a[0], w.b[1] - w.a[1]];
        (d[1] / d[0] - 1.0 / 3.0).abs() < 0.05 && d[0] > 0.0
    };
    let upper: f64 = walls.iter().filter(along).map(|w| w.b[0] - w.a[0]).sum();
    assert!(upper > 5.5, "{walls:?}");
}

#[test]
fn what_is_no_grid_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let yaml = folder.path().join("m.yaml");
    std::fs::write(folder.path().join("m.pgm"), b"P5\n# made by hand\n2 2\n255\n\x00\xfe\xcd\x00").unwrap();
    std::fs::write(folder.path().join("short.pgm"), b"P5\n9 9\n255\n\x00").unwrap();
    let good = "image: m.pgm\nresolution: 0.05\norigin: [1, 2, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    std::fs::write(&yaml, good).unwrap();
    let grid = Grid::read(&yaml).unwrap();
    // The top row of the picture is the upper row of the map.
    assert_eq!(grid.cells, [Cell::Unknown, Cell::Occupied, Cell::Occupied, Cell::Free]);
    assert_eq!(grid.origin, Pose2::new(1.0, 2.0, 0.5));
    for (from, to, field) in [
        ("resolution: 0.05", "resolution: 0", "resolution"),
        ("origin: [1, 2, 0.5]", "origin: [1, 2]", "origin"),
        ("negate: 0\n", "", "negate"),
        ("free_thresh: 0.196", "free_thresh: low", "free_thresh"),
        ("m.pgm", "m.pgm\nmode: raw", "mode"),
        ("m.pgm", "short.pgm", "fewer pixels"),
        ("m.pgm", "none.pgm", "none.pgm"),
    ] {
        std::fs::write(&yaml, good.replace(from, to)).unwrap();
        let error = Grid::read(&yaml).unwrap_err().to_string();
        assert!(error.contains(field), "{error}");
    }
}
