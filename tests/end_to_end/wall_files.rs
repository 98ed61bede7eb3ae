//! Claim: walls are read of files of other programs and stored nowhere; a file that is refused says
//! why, whatever is in it.

use client::{
    ClientError, MapClient,
    api::{FileWalls, NewMap, WallFileQuery},
};
use server::config::Limits;
use tests::Inside;

/// Walls of a room that is open to the east, m.
const GEOJSON: &str = r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}, "geometry":
    {"type": "LineString", "coordinates": [[4, 0], [0, 0], [0, 3], [4, 3]]}}]}"#;
const SVG: &str =
    r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 8 2"><path stroke="red" d="M0 1H8"/></svg>"#;

async fn read(
    maps: &MapClient,
    kind: &str,
    metres_per_unit: Option<f64>,
    file: &str,
) -> Result<FileWalls, (String, String)> {
    let query = WallFileQuery { kind: kind.to_owned(), metres_per_unit };
    maps.read_wall_file("hall", file.into(), &query).await.map_err(|error| match error {
        ClientError::Refused { code, detail, .. } => (code, detail),
        other => panic!("not refused: {other:?}"),
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn walls_of_a_file_are_shown_and_stored_nowhere() {
    let limits = Limits { laser_segments: 100, ..Limits::default() };
    let inside = Inside::start(limits).await;
    let maps = inside.maps();
    maps.create_map(&NewMap::new("hall")).await.expect("map");
    let room = read(&maps, "geojson", None, GEOJSON).await.expect("walls");
    let ends = |walls: &FileWalls| walls.segments.iter().map(|w| (w.a, w.b)).collect::<Vec<_>>();
    let wanted = [([4.0, 0.0], [0.0, 0.0]), ([0.0, 0.0], [0.0, 3.0]), ([0.0, 3.0], [4.0, 3.0])];
    assert_eq!(ends(&room), wanted);
    assert!((room.length_m - 11.0).abs() < 1e-9, "{}", room.length_m);
    assert_eq!(ends(&read(&maps, "JSON", None, GEOJSON).await.expect("GeoJSON, too")), wanted);
    let plan = read(&maps, "svg", Some(0.5), SVG).await.expect("plan");
    assert_eq!((ends(&plan)[0], plan.segments.len()), (([0.0, 0.5], [4.0, 0.5]), 2), "both sides are free");
    let listed = read(&maps, "txt", None, "# a list\n0, 0, 2, 0\n").await.expect("list");
    assert_eq!(ends(&listed), [([0.0, 0.0], [2.0, 0.0])]);

    let many = "0 0 1 0\n".repeat(101);
    let deep = format!("<svg xmlns=\"http://www.w3.org/2000/svg\">{}", "<g>".repeat(200_000));
    let nested = format!("{}1{}", "[".repeat(200_000), "]".repeat(200_000));
    for (kind, scale, file, wanted_code, says) in [
        ("svg", None, SVG, "bad_walls", "the plan has no scale"),
        ("svg", Some(-1.0), SVG, "out_of_range", "above 0"),
        ("svg", None, deep.as_str(), "bad_walls", ""),
        ("geojson", None, nested.as_str(), "bad_walls", ""),
        ("geojson", None, "{}", "bad_walls", ""),
        ("txt", None, "0 0 1 x", "bad_walls", "line 1"),
        ("txt", None, "# none", "bad_walls", "no walls in it"),
        ("txt", None, many.as_str(), "too_many", "101 walls"),
        ("dxf", None, "0\nSECTION", "bad_walls", "save it as SVG"),
        // What it names beside it, on the server, is not read.
        ("yaml", None, "image: /etc/passwd\nresolution: 0.05\norigin: [0, 0, 0]", "bad_walls", "two files"),
        ("../../etc/passwd", None, "", "bad_walls", "no walls in it"),
    ] {
        let (code, detail) = read(&maps, kind, scale, file).await.expect_err(kind);
        assert!(code == wanted_code && detail.contains(says), "{kind}: {code}: {detail}");
    }
    assert_eq!(maps.walls("hall").await.expect("walls").segments, [], "nothing is stored");
    inside.server.stop().await;
}
