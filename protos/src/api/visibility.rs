//! From where landmarks are seen, what is seen from a pose and along a path, and where to look.

use super::visibility_settings::VisibilitySettingsBody;
use map::{
    gaze::{Criterion, PanTiltUnit},
    visibility::{PanTiltCamera, Polygon, VisibilityMap},
};
use nalgebra::Point2;
use serde::{Deserialize, Serialize};

/// The floor area from which a landmark is seen: a GeoJSON `Feature` in metres of the map, not
/// degrees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct VisibilityAreaBody {
    /// `Feature`.
    #[serde(rename = "type")]
    pub kind: String,
    /// The polygons.
    pub geometry: MultiPolygon,
    /// The landmark, and figures of the area.
    pub properties: VisibilityAreaProperties,
}

/// A GeoJSON `MultiPolygon`: polygons of rings of points, m in the map; the outer ring
/// counter-clockwise, that of a hole clockwise, the first point repeated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct MultiPolygon {
    /// `MultiPolygon`.
    #[serde(rename = "type")]
    pub kind: String,
    /// By polygon, ring and point: x, y in metres.
    #[cfg_attr(feature = "openapi", schema(value_type = Vec<Vec<Vec<super::arrays::Pair>>>))]
    pub coordinates: Vec<Vec<Vec<[f64; 2]>>>,
}

/// Figures of a visibility area.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct VisibilityAreaProperties {
    /// Name of the landmark.
    pub landmark: String,
    /// Square metres.
    pub area_m2: f64,
    /// Centre of gravity, where there is an area.
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::Pair>))]
    pub centroid_m: Option<[f64; 2]>,
    /// Furthest possible distance from the landmark.
    pub reach_m: f64,
}

/// Coordinates of areas are written to a tenth of a millimetre.
const STEPS_PER_M: f64 = 1e4;

impl VisibilityAreaBody {
    /// The area of the landmark of this name.
    pub fn new(area: &VisibilityMap, landmark: &str) -> Self {
        let rounded = |value: f64| (value * STEPS_PER_M).round() / STEPS_PER_M;
        let point = |p: &Point2<f64>| [rounded(p.x), rounded(p.y)];
        let ring =
            |corners: &[Point2<f64>]| corners.iter().chain(corners.first()).map(point).collect::<Vec<_>>();
        let rings = |p: &Polygon| {
            let hole = (!p.hole.is_empty()).then(|| ring(&p.hole));
            std::iter::once(ring(&p.corners)).chain(hole).collect()
        };
        let coordinates = area.polygons().iter().map(rings).collect();
        Self {
            kind: "Feature".to_owned(),
            geometry: MultiPolygon { kind: "MultiPolygon".to_owned(), coordinates },
            properties: VisibilityAreaProperties {
                landmark: landmark.to_owned(),
                area_m2: rounded(area.area_m2()),
                centroid_m: area.centroid().map(|c| point(&c)),
                reach_m: rounded(area.reach_m()),
            },
        }
    }
}

/// A pose in the map.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct PoseBody {
    /// Metres, in the map.
    pub x_m: f64,
    /// Metres, in the map.
    pub y_m: f64,
    /// Heading in the map.
    pub theta_rad: f64,
    /// Over (x, y, theta), row-major; absent for a pose that is exactly known.
    #[cfg_attr(feature = "openapi", schema(value_type = Option<super::arrays::Covariance>))]
    pub covariance: Option<[f64; 9]>,
}

/// Where the robot is.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct VisibleRequest {
    /// Pose of the robot.
    pub pose: PoseBody,
    /// Another camera than the map's.
    #[serde(default)]
    pub visibility_settings: VisibilitySettingsBody,
}

/// A landmark that may be seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct VisibleLandmark {
    /// Name of the landmark.
    pub landmark: String,
    /// Probability that it is seen when the camera is turned to it.
    pub probability: f64,
    /// Distance to the boundary of its area, positive inside.
    pub margin_m: f64,
}

/// What may be seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct VisibleResponse {
    /// Of this version of the map.
    pub map_version: u64,
    /// Most probable first.
    pub landmarks: Vec<VisibleLandmark>,
}

/// A path to look at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct CoverageRequest {
    /// Its points: x, y in metres.
    #[cfg_attr(feature = "openapi", schema(value_type = Vec<super::arrays::Pair>))]
    pub path: Vec<[f64; 2]>,
    /// How often to look: 0.01 to 10 m.
    #[serde(default = "step_m")]
    pub step_m: f64,
    /// Another camera than the map's.
    #[serde(default)]
    pub visibility_settings: VisibilitySettingsBody,
}

fn step_m() -> f64 {
    0.1
}

impl CoverageRequest {
    /// Along these points (x, y in metres), every 0.1 m, with the map's camera.
    pub fn new(path: Vec<[f64; 2]>) -> Self {
        Self { path, step_m: step_m(), visibility_settings: VisibilitySettingsBody::default() }
    }
}

/// One place of the path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CoverageSampleBody {
    /// Metres from the beginning of the path.
    pub along_m: f64,
    /// Metres, in the map.
    pub x_m: f64,
    /// Metres, in the map.
    pub y_m: f64,
    /// Names of the landmarks that are seen.
    pub landmarks: Vec<String>,
}

/// A piece of the path from which no landmark is seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CoverageGapBody {
    /// Its beginning, metres along the path.
    pub from_m: f64,
    /// Its end, metres along the path.
    pub to_m: f64,
}

/// What is seen along a path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct CoverageResponse {
    /// Of this version of the map.
    pub map_version: u64,
    /// Length of the path.
    pub length_m: f64,
    /// Share of the path from which some landmark is seen.
    pub share: f64,
    /// Pieces without a landmark, in order.
    pub gaps: Vec<CoverageGapBody>,
    /// Places along the path, `step_m` apart.
    pub steps: Vec<CoverageSampleBody>,
}

/// A question where to look.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
#[serde(deny_unknown_fields)]
pub struct GazeQueryBody {
    /// Where the robot is.
    pub pose: PoseBody,
    /// `camera_m`, `pan_rad`, `tilt_rad`, `rate_radps`.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(value_type = Object))]
    pub head: PanTiltUnit,
    /// `focal_px`, `pan_rad`, `tilt_rad` and the rest of the camera; absent for the map's
    /// (`/maps/{map}/visibility-settings`).
    #[cfg_attr(feature = "openapi", schema(value_type = Option<Object>))]
    pub viewer: Option<PanTiltCamera>,
    /// `product` (the paper's) or `information`.
    #[serde(default)]
    #[cfg_attr(feature = "openapi", schema(value_type = String))]
    pub criterion: Criterion,
}

/// A landmark worth looking at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct GazeTargetBody {
    /// Name of the landmark.
    pub landmark: String,
    /// Pan that centres it, left positive.
    pub pan_rad: f64,
    /// Tilt that centres it, up positive.
    pub tilt_rad: f64,
    /// What it is ranked by; the criterion's number.
    pub utility: f64,
    /// Probability that it is seen.
    pub probability: f64,
    /// Distance to the boundary of its area, positive inside.
    pub margin_m: f64,
    /// Expected gain of information on the pose.
    pub gain_nats: f64,
    /// Distance of the camera from its centre.
    pub range_m: f64,
    /// Angle between its normal and the line of sight.
    pub incidence_rad: f64,
}

/// Where to look.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct GazeRankingBody {
    /// Of this version of the map.
    pub map_version: u64,
    /// Best first; empty when nothing is in sight.
    pub ranked: Vec<GazeTargetBody>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use map::{
        place::{LandmarkPlace, PlaceSigmas},
        visibility::{Obstacle, VisibilityParams, visibility},
    };
    use nalgebra::Vector3;
    use vision::pose::LandmarkSize;

    fn area(z_m: f64, obstacles: &[Obstacle], tilt: Option<f64>) -> VisibilityAreaBody {
        let size = LandmarkSize { width_m: 0.6, height_m: 0.84 };
        let mut place =
            LandmarkPlace::by_hand(Vector3::new(0.0, 0.0, z_m), 0.0, size, PlaceSigmas::default()).unwrap();
        place.tilt_rad = tilt.unwrap_or(place.tilt_rad);
        let viewer = PanTiltCamera { tilt_rad: [-0.35, 1.0], ..PanTiltCamera::default() };
        let area = visibility(&place, obstacles, &viewer, &VisibilityParams::default()).unwrap();
        VisibilityAreaBody::new(&area, "poster-1")
    }

    #[test]
    fn as_geojson() {
        let wall = Obstacle { a: Point2::new(3.0, -9.0), b: Point2::new(3.0, 9.0), height_m: None };
        let feature = area(1.5, &[wall], None);
        assert_eq!((feature.kind.as_str(), feature.geometry.kind.as_str()), ("Feature", "MultiPolygon"));
        let ring = &feature.geometry.coordinates[0][0];
        assert_eq!(ring.first(), ring.last());
        assert!(ring.len() > 10 && feature.properties.area_m2 > 5.0);
        let signed: f64 = ring.windows(2).map(|w| w[0][0] * w[1][1] - w[1][0] * w[0][1]).sum();
        assert!((0.5 * signed - feature.properties.area_m2).abs() < 0.01, "counter-clockwise");
    }

    #[test]
    fn a_sign_under_the_ceiling_has_a_hole() {
        let rings = &area(2.5, &[], Some(std::f64::consts::FRAC_PI_2)).geometry.coordinates[0];
        assert_eq!(rings.len(), 2, "the outer one and the hole");
        assert_eq!(rings[1].first(), rings[1].last());
    }
}
