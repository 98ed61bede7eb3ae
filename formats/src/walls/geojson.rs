//! Walls from and to a GeoJSON file in map metres: lines are walls as drawn, polygons are rooms, whose walls face
//! inwards, and their holes (columns, blocks), whose walls face outwards. Points, and properties of any kind, are
//! passed over, but for the covariance of a wall.

use super::map_file::{MAX_WALLS, Wall};
use geojson::{Feature, FeatureCollection, GeoJson, Geometry, GeometryValue, JsonObject, Position};
use serde::Deserialize as _;
use serde_json::Value;

/// Largest file.
pub(super) const MAX_BYTES: u64 = 64 << 20;
/// Deepest collection of geometries in one another.
const MAX_DEPTH: usize = 8;
/// The member that says in which frame the coordinates of a written file are.
const FRAME: (&str, &str) = ("waymark:frame", "map metres");
/// The property of a wall with the covariance of its direction and offset about its middle: rad^2, rad m, m^2.
const COVARIANCE: &str = "waymark:covariance";

/// Why a file has no walls.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum GeoJsonError {
    /// Not JSON, or not GeoJSON.
    #[error("not GeoJSON: {0}")]
    Format(String),
    /// A coordinate.
    #[error("line {line}, position {position}: not two finite numbers")]
    Position {
        /// Which line or ring, from 0.
        line: usize,
        /// Which of its points, from 0.
        position: usize,
    },
    /// A ring that does not end where it begins, or has no area.
    #[error("line {line}: a ring must end where it begins and enclose something")]
    Ring {
        /// Which, from 0.
        line: usize,
    },
    /// The covariance of a wall.
    #[error("line {line}: `{COVARIANCE}` is a covariance of a line of two points, as three numbers")]
    Covariance {
        /// Which line, from 0.
        line: usize,
    },
    /// Longitudes and latitudes are no metres.
    #[error("a coordinate reference system other than map metres (`crs`) is not understood")]
    Crs,
    /// Collections in collections.
    #[error("geometry collections more than {MAX_DEPTH} deep")]
    TooDeep,
    /// Too many.
    #[error("more than {MAX_WALLS} segments")]
    TooMany,
}

/// One line and what it bounds.
struct Line {
    points: Vec<Position>,
    /// Ring: with the free side inside, or outside.
    free_inside: Option<bool>,
    /// The property of its feature.
    covariance: Option<Value>,
}

/// The walls of a file's text.
pub(super) fn walls(text: &str) -> Result<Vec<Wall>, GeoJsonError> {
    let file: GeoJson = text.parse().map_err(|e: geojson::Error| GeoJsonError::Format(e.to_string()))?;
    let own = |f: Feature| {
        let mut properties = f.properties.unwrap_or_default();
        Some((f.geometry?, properties.remove(COVARIANCE)))
    };
    let (geometries, members): (Vec<(Geometry, Option<Value>)>, Option<JsonObject>) = match file {
        GeoJson::FeatureCollection(all) => {
            (all.features.into_iter().filter_map(own).collect(), all.foreign_members)
        }
        GeoJson::Feature(mut one) => {
            let members = one.foreign_members.take();
            (own(one).into_iter().collect(), members)
        }
        GeoJson::Geometry(geometry) => {
            let members = geometry.foreign_members.clone();
            (vec![(geometry, None)], members)
        }
    };
    if members.is_some_and(|m| m.get("crs").is_some_and(|crs| !crs.is_null())) {
        return Err(GeoJsonError::Crs);
    }
    let mut lines = vec![];
    for (geometry, covariance) in geometries {
        let first = lines.len();
        add_lines(&mut lines, geometry.value, 0)?;
        for line in lines.iter_mut().skip(first) {
            line.covariance.clone_from(&covariance);
        }
    }
    let mut walls = vec![];
    for (number, line) in lines.iter().enumerate() {
        add(&mut walls, number, line)?;
    }
    Ok(walls)
}

/// A file of the walls, one line each, free side on the left.
pub(super) fn text(walls: &[Wall]) -> String {
    let feature = |wall: &Wall| Feature {
        geometry: Some(GeometryValue::new_line_string([wall.a, wall.b]).into()),
        properties: wall
            .covariance_about_middle()
            .map(|known| [(COVARIANCE.to_owned(), known.to_vec().into())].into_iter().collect()),
        ..Feature::default()
    };
    let members = [(FRAME.0.to_owned(), FRAME.1.into())].into_iter().collect();
    let features = walls.iter().map(feature).collect();
    FeatureCollection { bbox: None, features, foreign_members: Some(members) }.to_string()
}

fn add_lines(lines: &mut Vec<Line>, geometry: GeometryValue, depth: usize) -> Result<(), GeoJsonError> {
    let open = |points| Line { points, free_inside: None, covariance: None };
    let room = |rings: Vec<Vec<Position>>| {
        rings.into_iter().enumerate().map(|(i, points)| Line {
            points,
            free_inside: Some(i == 0),
            covariance: None,
        })
    };
    match geometry {
        GeometryValue::Point { .. } | GeometryValue::MultiPoint { .. } => {}
        GeometryValue::LineString { coordinates } => lines.push(open(coordinates)),
        GeometryValue::MultiLineString { coordinates } => lines.extend(coordinates.into_iter().map(open)),
        GeometryValue::Polygon { coordinates } => lines.extend(room(coordinates)),
        GeometryValue::MultiPolygon { coordinates } => lines.extend(coordinates.into_iter().flat_map(room)),
        GeometryValue::GeometryCollection { .. } if depth >= MAX_DEPTH => return Err(GeoJsonError::TooDeep),
        GeometryValue::GeometryCollection { geometries } => {
            for geometry in geometries {
                add_lines(lines, geometry.value, depth + 1)?;
            }
        }
    }
    Ok(())
}

fn add(walls: &mut Vec<Wall>, number: usize, line: &Line) -> Result<(), GeoJsonError> {
    let point = |(position, p): (usize, &Position)| match p.as_slice() {
        // A height may follow.
        [x, y, ..] if x.is_finite() && y.is_finite() => Ok([*x, *y]),
        _ => Err(GeoJsonError::Position { line: number, position }),
    };
    let mut points = line.points.iter().enumerate().map(point).collect::<Result<Vec<[f64; 2]>, _>>()?;
    if let Some(free_inside) = line.free_inside {
        let area: f64 = points.windows(2).map(|p| p[0][0] * p[1][1] - p[1][0] * p[0][1]).sum();
        let (first, last) = (points.first(), points.last());
        if points.len() < 4 || first != last || !(area.abs() > 0.0 && area.is_finite()) {
            return Err(GeoJsonError::Ring { line: number });
        }
        // The free side is left of a to b, whichever way round the file has the ring.
        if (area > 0.0) != free_inside {
            points.reverse();
        }
    }
    if let Some(covariance) = &line.covariance {
        let bad = || GeoJsonError::Covariance { line: number };
        let &[a, b] = points.as_slice() else { return Err(bad()) };
        let known = <[f64; 3]>::deserialize(covariance).map_err(|_unnamed| bad())?;
        if walls.len() >= MAX_WALLS {
            return Err(GeoJsonError::TooMany);
        }
        walls.push(Wall::about_middle(a, b, Some(known)).map_err(|_unnamed| bad())?);
        return Ok(());
    }
    for pair in points.windows(2) {
        let (a, b) = (pair[0], pair[1]);
        if (b[0] - a[0]).hypot(b[1] - a[1]) < map::segments::MIN_SEGMENT_M {
            continue;
        }
        if walls.len() >= MAX_WALLS {
            return Err(GeoJsonError::TooMany);
        }
        walls.push(Wall::between(a, b));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(text: &str) -> Vec<[[f64; 2]; 2]> {
        walls(text).unwrap().iter().map(|w| [w.a, w.b]).collect()
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
        assert_eq!(
            ends(text),
            [[[0.0, 0.0], [5.0, 0.0]], [[5.0, 0.0], [5.0, 1.0]], [[0.0, 2.0], [1.0, 2.0]]]
        );
        let feature = r#"{"type":"Feature","geometry":{"type":"LineString","coordinates":[[0,0],[1,0]]}}"#;
        assert_eq!(ends(feature).len(), 1);
    }

    #[test]
    fn walls_come_back_as_they_were_written() {
        let all = [Wall::between([0.1, -2.0], [1.0 / 3.0, 7e-3]), Wall::between([5.0, 1.0], [4.0, 1.0])];
        let text = text(&all);
        assert!(text.contains(r#""waymark:frame":"map metres""#), "{text}");
        assert_eq!(walls(&text).unwrap(), all);
        assert_eq!(walls(&super::text(&[])).unwrap(), []);
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
        let again = walls(&text(&[known, by_hand])).unwrap();
        let (was, is) = (known.covariance.unwrap(), again[0].covariance.unwrap());
        assert!(was.iter().zip(is).all(|(a, b)| (a - b).abs() < 1e-12 + 1e-9 * a.abs()), "{was:?} {is:?}");
        assert_eq!((again[0].a, again[1]), (known.a, by_hand));
        let with = |points: &str, covariance: &str| {
            let line = format!(r#"{{"type":"LineString","coordinates":[{points}]}}"#);
            let properties = format!(r#"{{"{COVARIANCE}":{covariance}}}"#);
            walls(&format!(r#"{{"type":"Feature","geometry":{line},"properties":{properties}}}"#))
        };
        assert_eq!(with("[0,0],[1,0]", "[1e-6,0,1e-4]").unwrap().len(), 1);
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
        assert_eq!(walls(&long(MAX_WALLS + 1)).unwrap().len(), MAX_WALLS);
        assert_eq!(bad(&long(MAX_WALLS + 2)), GeoJsonError::TooMany);
    }
}
