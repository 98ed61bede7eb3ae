//! Longitude and latitude as metres about a place. In: positions in degrees (WGS 84, east and north
//! positive). Out: metres east and north of the south-west corner of all.

use serde_json::Value;
use std::fmt;

/// A plan within half a degree each way is in degrees: half a metre is no plan, and 55 km are no
/// site.
const MAX_SITE_DEG: f64 = 0.5;
/// WGS 84: half the equator's diameter, metres, and the square of the eccentricity.
const EQUATOR_M: f64 = 6_378_137.0;
const ECCENTRICITY2: f64 = 6.694_379_990_14e-3;
/// Names of the systems of longitude and latitude, at the end of the name.
const SYSTEMS: [&str; 3] = ["CRS84", "EPSG::4326", "EPSG:4326"];

/// How degrees become metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Projection {
    /// Longitude and latitude of the origin, degrees.
    origin_deg: [f64; 2],
    /// Metres of a degree to the east and to the north in the middle of the plan.
    metres_per_deg: [f64; 2],
}

impl Projection {
    /// That of a plan in degrees: `is_stated`, or by its extent. `None` for metres.
    pub(super) fn of(positions: impl Iterator<Item = [f64; 2]>, is_stated: bool) -> Option<Self> {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in positions {
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
            }
        }
        let is_on_earth = low[0] >= -180.0 && high[0] <= 180.0 && low[1] >= -90.0 && high[1] <= 90.0;
        let is_site = (0..2).all(|k| high[k] - low[k] < MAX_SITE_DEG);
        if !(is_on_earth && (is_stated || is_site)) {
            return None;
        }
        let (sin, cos) = (0.5 * (low[1] + high[1])).to_radians().sin_cos();
        let shrink = 1.0 - ECCENTRICITY2 * sin * sin;
        let east = EQUATOR_M / shrink.sqrt() * cos;
        let north = EQUATOR_M * (1.0 - ECCENTRICITY2) / shrink.powf(1.5);
        Some(Self { origin_deg: low, metres_per_deg: [east, north].map(f64::to_radians) })
    }

    pub(super) fn metres(&self, degrees: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| (degrees[k] - self.origin_deg[k]) * self.metres_per_deg[k])
    }
}

impl fmt::Display for Projection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [longitude, latitude] = self.origin_deg;
        write!(
            f,
            "its coordinates are degrees: x is metres to the east and y to the north of longitude {longitude}, latitude \
             {latitude}"
        )
    }
}

/// Whether the member `crs` of older GeoJSON says longitude and latitude.
pub(super) fn is_degrees(crs: &Value) -> bool {
    let name = crs.pointer("/properties/name").and_then(Value::as_str).unwrap_or_default();
    SYSTEMS.iter().any(|system| name.ends_with(system))
}
