//! Walls from and to a GeoJSON file in map metres, or in degrees (RFC 7946), which are projected to
//! metres: lines are walls as drawn, polygons are rooms, whose walls face inwards, and their holes
//! (columns, blocks), whose walls face outwards. Points, and properties of any kind, are passed
//! over, but for the covariance of a wall.

mod degrees;

use super::map_file::{MAX_WALLS, Wall};
use degrees::{Projection, is_degrees};
use geojson::{Feature, FeatureCollection, GeoJson, Geometry, GeometryValue, JsonObject, Position};
use serde::Deserialize as _;
use serde_json::Value;

/// Largest file.
pub(super) const MAX_BYTES: u64 = 64 << 20;
/// Deepest collection of geometries in one another.
const MAX_DEPTH: usize = 8;
/// The member that says in which frame the coordinates of a written file are.
const FRAME: (&str, &str) = ("waymark:frame", "map metres");
/// The property of a wall with the covariance of its direction and offset about its middle: rad^2,
/// rad m, m^2.
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
    /// Neither map metres nor longitude and latitude.
    #[error(
        "its coordinate reference system (`crs`) is neither map metres nor longitude and latitude: save it as RFC 7946 \
         (QGIS: CRS EPSG:4326)"
    )]
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

/// The walls of a file's text, and what a person should know of them.
pub(super) fn walls(text: &str) -> Result<(Vec<Wall>, Option<String>), GeoJsonError> {
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
    let members = members.unwrap_or_default();
    let is_stated = match members.get("crs").filter(|crs| !crs.is_null()) {
        Some(crs) if !is_degrees(crs) => return Err(GeoJsonError::Crs),
        crs => crs.is_some(),
    };
    let mut lines = vec![];
    for (geometry, covariance) in geometries {
        let first = lines.len();
        add_lines(&mut lines, geometry.value, 0)?;
        for line in lines.iter_mut().skip(first) {
            line.covariance.clone_from(&covariance);
        }
    }
    let is_metres = members.contains_key(FRAME.0);
    let position = |p: &Position| match p.as_slice() {
        [x, y, ..] => Some([*x, *y]),
        _ => None,
    };
    let positions = lines.iter().flat_map(|line| &line.points).filter_map(position);
    let projection = if is_metres { None } else { Projection::of(positions, is_stated) };
    let mut walls = vec![];
    for (number, line) in lines.iter().enumerate() {
        add(&mut walls, number, line, projection.as_ref())?;
    }
    Ok((walls, projection.map(|projection| projection.to_string())))
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

fn add(
    walls: &mut Vec<Wall>,
    number: usize,
    line: &Line,
    projection: Option<&Projection>,
) -> Result<(), GeoJsonError> {
    let point = |(position, p): (usize, &Position)| match p.as_slice() {
        // A height may follow.
        [x, y, ..] if x.is_finite() && y.is_finite() => {
            Ok(projection.map_or([*x, *y], |projection| projection.metres([*x, *y])))
        }
        _ => Err(GeoJsonError::Position { line: number, position }),
    };
    let mut points = line.points.iter().enumerate().map(point).collect::<Result<Vec<[f64; 2]>, _>>()?;
    if let Some(free_inside) = line.free_inside {
        // Coordinates that were rounded or computed need not meet to the last bit.
        if let (Some(first), Some(last)) = (points.first().copied(), points.last_mut())
            && (last[0] - first[0]).hypot(last[1] - first[1]) < map::segments::MIN_SEGMENT_M
        {
            *last = first;
        }
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
mod tests;
