//! Files as other programs write them.

use super::*;

fn ends(text: &str) -> Vec<[[f64; 2]; 2]> {
    walls(text).unwrap().0.iter().map(|w| [w.a, w.b]).collect()
}

#[test]
fn rooms_face_inwards_and_columns_outwards_whichever_way_round() {
    let room = "[[0,0],[4,0],[4,3],[0,3],[0,0]]";
    let turned = "[[0,0],[0,3],[4,3],[4,0],[0,0]]";
    let column = "[[1,1],[2,1],[2,2],[1,1]]";
    let free_side = |text: &str, inside: [f64; 2], free: bool| {
        for [a, b] in ends(text) {
            let left = (b[0] - a[0]) * (inside[1] - a[1]) - (b[1] - a[1]) * (inside[0] - a[0]);
            assert_eq!(left > 0.0, free, "{a:?} {b:?}");
        }
    };
    for ring in [room, turned] {
        let text = format!(r#"{{"type":"Polygon","coordinates":[{ring}]}}"#);
        assert_eq!(ends(&text).len(), 4);
        free_side(&text, [2.0, 1.5], true);
        let holed = format!(r#"{{"type":"Polygon","coordinates":[{ring},{column}]}}"#);
        let alone = ends(&holed).split_off(4);
        for [a, b] in alone {
            let left = (b[0] - a[0]) * (1.25 - a[1]) - (b[1] - a[1]) * (1.75 - a[0]);
            assert!(left < 0.0, "the column's inside is not free");
        }
    }
}

#[test]
fn lines_and_collections_are_read_and_the_rest_is_ignored() {
    let text = r#"{"type":"FeatureCollection","name":"plan","features":[
        {"type":"Feature","properties":{"kind":"wall"},"geometry":{"type":"LineString","coordinates":[[0,0],[5,0,2.5],[5,1]]}},
        {"type":"Feature","properties":null,"geometry":null},
        {"type":"Feature","geometry":{"type":"Point","coordinates":[1,1]}},
        {"type":"Feature","geometry":{"type":"MultiLineString","coordinates":[[[0,2],[1,2]],[[3,3],[3,3]]]}}]}"#;
    assert_eq!(ends(text), [[[0.0, 0.0], [5.0, 0.0]], [[5.0, 0.0], [5.0, 1.0]], [[0.0, 2.0], [1.0, 2.0]]]);
    let feature = r#"{"type":"Feature","geometry":{"type":"LineString","coordinates":[[0,0],[1,0]]}}"#;
    assert_eq!(ends(feature).len(), 1);
}

#[test]
fn walls_come_back_as_they_were_written() {
    let all = [Wall::between([0.1, -2.0], [1.0 / 3.0, 7e-3]), Wall::between([5.0, 1.0], [4.0, 1.0])];
    let text = text(&all);
    assert!(text.contains(r#""waymark:frame":"map metres""#), "{text}");
    assert_eq!(walls(&text).unwrap(), (all.to_vec(), None));
    assert_eq!(walls(&super::text(&[])).unwrap().0, []);
}

#[test]
fn collections_are_read_to_a_depth() {
    let nested = |depth: usize| {
        let line = r#"{"type":"LineString","coordinates":[[0,0],[1,0]]}"#.to_owned();
        (0..depth).fold(line, |g, _| format!(r#"{{"type":"GeometryCollection","geometries":[{g}]}}"#))
    };
    assert_eq!(ends(&nested(MAX_DEPTH)), [[[0.0, 0.0], [1.0, 0.0]]]);
    assert_eq!(walls(&nested(MAX_DEPTH + 1)).unwrap_err(), GeoJsonError::TooDeep);
}

proptest::proptest! {
    #[test]
    fn no_text_is_a_panic(at in 0..200_usize, byte in 0_u8..128, cut in 0..200_usize) {
        let mut bytes = text(&[Wall::between([0.0, 0.0], [1.0, 2.0])]).into_bytes();
        let at = at % bytes.len();
        bytes[at] = byte;
        bytes.truncate(bytes.len() - cut % bytes.len());
        // An answer, whichever.
        walls(std::str::from_utf8(&bytes).expect("ASCII")).ok();
    }
}

#[test]
fn a_wall_keeps_its_covariance() {
    let known = Wall::about_middle([40.0, 1.0], [44.0, 1.5], Some([4e-6, 1e-6, 1e-4])).unwrap();
    let by_hand = Wall::between([0.0, 0.0], [1.0, 2.0]);
    let (again, _) = walls(&text(&[known, by_hand])).unwrap();
    let (was, is) = (known.covariance.unwrap(), again[0].covariance.unwrap());
    assert!(was.iter().zip(is).all(|(a, b)| (a - b).abs() < 1e-12 + 1e-9 * a.abs()), "{was:?} {is:?}");
    assert_eq!((again[0].a, again[1]), (known.a, by_hand));
    let with = |points: &str, covariance: &str| {
        let line = format!(r#"{{"type":"LineString","coordinates":[{points}]}}"#);
        let properties = format!(r#"{{"{COVARIANCE}":{covariance}}}"#);
        walls(&format!(r#"{{"type":"Feature","geometry":{line},"properties":{properties}}}"#))
    };
    assert_eq!(with("[0,0],[1,0]", "[1e-6,0,1e-4]").unwrap().0.len(), 1);
    let bad = Err(GeoJsonError::Covariance { line: 0 });
    for covariance in ["[1e-6,0]", "[1e-6,1,1e-6]", "[-1,0,1]", "7", "null"] {
        assert_eq!(with("[0,0],[1,0]", covariance), bad, "{covariance}");
    }
    assert_eq!(with("[0,0],[1,0],[2,0]", "[1e-6,0,1e-4]"), bad);
}

#[test]
fn errors_name_line_and_position() {
    let bad = |text: &str| walls(text).unwrap_err();
    assert!(matches!(bad("{"), GeoJsonError::Format(_)));
    assert!(matches!(bad(r#"{"type":"Walls"}"#), GeoJsonError::Format(_)));
    assert!(matches!(bad("[]"), GeoJsonError::Format(_)));
    assert_eq!(
        bad(r#"{"type":"LineString","coordinates":[[0,0],[1]]}"#),
        GeoJsonError::Position { line: 0, position: 1 }
    );
    for ring in ["[[0,0],[1,0],[1,1]]", "[[0,0],[1,0],[1,1],[0,1]]", "[[0,0],[1,0],[2,0],[0,0]]"] {
        assert_eq!(
            bad(&format!(r#"{{"type":"Polygon","coordinates":[{ring}]}}"#)),
            GeoJsonError::Ring { line: 0 }
        );
    }
    assert_eq!(bad(r#"{"type":"Point","coordinates":[0,0],"crs":{"type":"name"}}"#), GeoJsonError::Crs);
    let long = |n: usize| {
        let points: Vec<[usize; 2]> = (0..n).map(|i| [i, 0]).collect();
        serde_json::json!({ "type": "LineString", "coordinates": points }).to_string()
    };
    assert_eq!(walls(&long(MAX_WALLS + 1)).unwrap().0.len(), MAX_WALLS);
    assert_eq!(bad(&long(MAX_WALLS + 2)), GeoJsonError::TooMany);
}

/// A block of 40 m x 25 m in Zurich, and one on another side of both zeros.
#[test]
fn degrees_are_projected_to_metres() {
    for (lon, lat) in [(8.55, 47.37), (-70.0, -33.0)] {
        let (east, north) = (40.0 / (111_320.0 * f64::cos(f64::to_radians(lat))), 25.0 / 111_000.0);
        let ring = [[lon, lat], [lon + east, lat], [lon + east, lat + north], [lon, lat + north], [lon, lat]];
        let text = serde_json::json!({ "type": "Polygon", "coordinates": [ring] }).to_string();
        let (walls, note) = walls(&text).unwrap();
        let lengths: Vec<f64> = walls.iter().map(Wall::length_m).collect();
        for (length, wanted) in lengths.iter().zip([40.0, 25.0, 40.0, 25.0]) {
            assert!((length - wanted).abs() < 0.01 * wanted, "{lengths:?}");
        }
        assert!(walls.iter().all(|wall| wall.a.iter().chain(&wall.b).all(|v| (-1e-6..=40.3).contains(v))));
        let note = note.unwrap();
        assert!(note.contains("longitude") && note.contains(&lon.to_string()), "{note}");
    }
}

#[test]
fn metres_stay_metres_and_a_stated_system_counts() {
    let text = |coordinates: &str, member: &str| {
        format!(r#"{{"type":"LineString","coordinates":{coordinates}{member}}}"#)
    };
    let small = "[[0,0],[0.3,0]]";
    assert!((walls(&text("[[0,0],[40,0]]", "")).unwrap().0[0].length_m() - 40.0).abs() < 1e-9);
    assert!(
        (walls(&text(small, r#","waymark:frame":"map metres""#)).unwrap().0[0].length_m() - 0.3).abs() < 1e-9
    );
    assert!(walls(&text(small, "")).unwrap().0[0].length_m() > 30_000.0);
    for name in ["urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:EPSG::4326", "EPSG:4326"] {
        let crs = format!(r#","crs":{{"type":"name","properties":{{"name":"{name}"}}}}"#);
        assert!(walls(&text("[[0,0],[0.9,0]]", &crs)).unwrap().1.is_some(), "{name}");
    }
    let utm = r#","crs":{"type":"name","properties":{"name":"urn:ogc:def:crs:EPSG::32632"}}"#;
    assert_eq!(walls(&text(small, utm)).unwrap_err(), GeoJsonError::Crs);
}

#[test]
fn a_ring_may_miss_its_beginning_by_rounding() {
    let ring =
        |last: &str| format!(r#"{{"type":"Polygon","coordinates":[[[0,0],[8,0],[8,6],[0,6],{last}]]}}"#);
    assert_eq!(ends(&ring("[0.000001,0]")).len(), 4);
    assert_eq!(walls(&ring("[0.2,0]")).unwrap_err(), GeoJsonError::Ring { line: 0 });
}
