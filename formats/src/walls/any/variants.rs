//! Claim: the maps and plans of other people's programs are read, or refused with what to do; none
//! is silently nothing.

use super::*;

/// Name, text, walls.
const READ: &[(&str, &str, usize)] = &[
    ("a.txt", "0, 0, 5, 0\n5 0 5 3\n", 2),
    ("a.csv", "0,0,5,0\r\n", 1),
    ("a.txt", "\u{feff}0, 0, 5, 0\n", 1),
    ("a.map", "# walls of the office, B\u{fc}ro\n0 0 5 0\n", 1),
    ("a.geojson", r#"{"type":"LineString","coordinates":[[0,0],[5,0]]}"#, 1),
    ("a.geojson", "\u{feff}{\"type\":\"LineString\",\"coordinates\":[[0,0],[5,0]]}", 1),
    ("a.json", r#"{"type":"LineString","coordinates":[[0,0],[5,0]]}"#, 1),
    // Doubled points.
    ("a.json", r#"{"type":"Polygon","coordinates":[[[0,0],[0,0],[8,0],[8,6],[8,6],[0,6],[0,0]]]}"#, 4),
    ("A.GEOJSON", r#"{"type":"LineString","coordinates":[[8.55,47.37],[8.5503,47.37]]}"#, 1),
    (
        "a.svg",
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="100mm" viewBox="0 0 100 80"><path stroke="red" d="M0 1H80"/></svg>"#,
        2,
    ),
    (
        "a.svg",
        "\u{feff}<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9cm\" height=\"9cm\"><path stroke=\"red\" d=\"M0 1H80\"/></svg>",
        2,
    ),
];

/// Name, text, words of the refusal.
const REFUSED: &[(&str, &str, &str)] = &[
    ("a.txt", "", "no walls in it"),
    ("a.txt", "# nothing\n\n", "no walls in it"),
    ("a.txt", "1 1 1 1\n", "no walls in it"),
    ("a.txt", "1 1 1\n", "line 1: y2: missing"),
    ("a.txt", "x1,y1,x2,y2\n1,1,2,2\n", "line 1: x1: `x1` is no finite number"),
    ("a.geojson", r#"{"type":"FeatureCollection","features":[]}"#, "no walls in it"),
    (
        "a.geojson",
        r#"{"type":"Feature","properties":{},"geometry":{"type":"Point","coordinates":[8.5,47.3]}}"#,
        "no walls in it",
    ),
    ("a.geojson", r#"{"type":"LineString","coordinates":[[0,0],[0,0]]}"#, "no walls in it"),
    ("a.geojson", "", "not GeoJSON"),
    ("a.json", r#"{"type":"MultiPoint","coordinates":[[1,2]]}"#, "no walls in it"),
    ("a.json", r#"{"type":"Walls"}"#, "not GeoJSON"),
    ("a.json", "{}", "no walls in it"),
    ("a.json", "", "EOF"),
    ("a.svg", "", "not SVG"),
    (
        "a.svg",
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="9cm" height="9cm"><rect width="100%" height="100%" fill="white"/></svg>"#,
        "no lines",
    ),
    (
        "a.svg",
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path stroke="red" d="M0 1H80"/></svg>"#,
        "no scale",
    ),
    ("a.yaml", "name: office\nlevels: {L1: {walls: [[0, 1, {}]]}}\n", "Open-RMF"),
    ("office.building.yaml", "name: office\nlevels: {L1: {walls: [[0, 1, {}]]}}\n", "Open-RMF"),
    ("a.yaml", "image: m.pgm\n", "resolution: missing"),
    ("a.pgm", "P5 1 1 255\n\0", "give its .yaml"),
    ("a.bmp", "BM", "give its .yaml"),
    ("a.jpg", "\u{ff}", "give its .yaml"),
    ("a.webp", "RIFF", "give its .yaml"),
    ("a.dxf", "0\nSECTION\n", "a CAD drawing"),
    ("a.dwg", "AC1032", "a CAD drawing"),
    ("a.pdf", "%PDF-1.7", "pdftocairo"),
    ("a.pbstream", "x", "Cartographer"),
    ("a.posegraph", "x", "slam_toolbox"),
    ("a.bt", "# Octomap", "three dimensions"),
    ("a.pcd", "# .PCD", "three dimensions"),
    ("a.ifc", "ISO-10303-21;", "a building model"),
    ("a.shp", "x", "save it as GeoJSON"),
    ("a.world", "<sdf/>", "a simulation's world"),
    ("a.tif", "II*", "save it as PNG"),
];

#[test]
fn each_variant_is_read_or_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        let imported = import(&path, &ImportOptions::default());
        std::fs::remove_file(&path).unwrap();
        imported.map(|imported| (imported.map.segments.len(), imported.report.length_m))
    };
    for (name, text, walls) in READ {
        let (count, length_m) = read(name, text).unwrap_or_else(|e| panic!("{name} {text}: {e}"));
        assert!(count == *walls && length_m > 0.01, "{name} {text}: {count} walls, {length_m} m");
    }
    for (name, text, words) in REFUSED {
        let refusal = read(name, text).expect_err(name).to_string();
        assert!(refusal.contains(words), "{name} {text}: {refusal}");
    }
}

/// All cells free: `map_server` reads it, and there is no wall in it.
#[test]
fn a_grid_without_walls_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let yaml = folder.path().join("m.yaml");
    let text = "image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    std::fs::write(&yaml, text).unwrap();
    std::fs::write(
        folder.path().join("m.pgm"),
        b"P5 4 4 255\n\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe\xfe",
    )
    .unwrap();
    assert!(matches!(import(&yaml, &ImportOptions::default()), Err(WallFileError::NoWalls)));
}
