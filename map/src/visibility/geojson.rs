//! A visibility map as a GeoJSON feature (RFC 7946), in map metres instead of degrees.

use super::{Polygon, VisibilityMap};
use serde::Serialize;

/// Coordinates are written to a tenth of a millimetre.
const STEPS_PER_M: f64 = 1e4;

/// A GeoJSON feature with a multipolygon.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Feature {
    /// `Feature`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// The visibility area.
    pub geometry: Geometry,
    /// Figures of the area.
    pub properties: Properties,
}

/// A multipolygon: polygons of rings of points; the outer ring counter-clockwise, that of a hole
/// clockwise, the first point repeated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Geometry {
    /// `MultiPolygon`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// Metres in the map frame, not degrees.
    pub coordinates: Vec<Vec<Vec<[f64; 2]>>>,
}

/// The properties of the feature.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Properties {
    /// Name of the landmark.
    pub landmark: String,
    /// Size of the area, square metres.
    pub area_m2: f64,
    /// Centroid of the area, metres; absent without an area.
    pub centroid_m: Option<[f64; 2]>,
    /// Largest possible distance from the landmark, metres.
    pub reach_m: f64,
}

fn rounded(value: f64) -> f64 {
    (value * STEPS_PER_M).round() / STEPS_PER_M
}

impl VisibilityMap {
    /// As a GeoJSON feature of the landmark of this name.
    pub fn feature(&self, landmark: &str) -> Feature {
        let point = |p: &nalgebra::Point2<f64>| [rounded(p.x), rounded(p.y)];
        let ring = |corners: &[nalgebra::Point2<f64>]| {
            corners.iter().chain(corners.first()).map(point).collect::<Vec<_>>()
        };
        let rings = |p: &Polygon| {
            let hole = (!p.hole.is_empty()).then(|| ring(&p.hole));
            std::iter::once(ring(&p.corners)).chain(hole).collect()
        };
        Feature {
            kind: "Feature",
            geometry: Geometry {
                kind: "MultiPolygon",
                coordinates: self.polygons().iter().map(rings).collect(),
            },
            properties: Properties {
                landmark: landmark.to_owned(),
                area_m2: rounded(self.area_m2()),
                centroid_m: self.centroid().map(|c| point(&c)),
                reach_m: rounded(self.reach_m()),
            },
        }
    }
}
