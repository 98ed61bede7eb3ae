//! `/sites/{site}/topology`: places and passages of a site's maps, and a route through them.

use serde::{Deserialize, Serialize};

/// The ends of a route, both or none.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::IntoParams))]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "openapi", into_params(parameter_in = Query))]
pub struct TopologyQuery {
    /// A place, `hall/3`, or a point of a map in metres, `hall/2.5,-1`.
    pub from: Option<String>,
    /// The place where the route ends, in the same form.
    pub to: Option<String>,
}

/// Places and passages of the maps of a site.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct SiteTopologyBody {
    /// The versions of the maps it rests on, by map.
    pub maps: Vec<TopologyMap>,
    /// By map, then by number.
    pub places: Vec<TopologyPlace>,
    /// Doorways by map, then links between maps.
    pub passages: Vec<TopologyPassage>,
    /// Where one was asked for.
    pub route: Option<TopologyRoute>,
}

/// A map of a site.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TopologyMap {
    /// Its name.
    pub map: String,
    /// Its version.
    pub version: u64,
}

/// Free floor that no doorway divides.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TopologyPlace {
    /// Map and number, `hall/3`. Numbers are those of this version of the map.
    pub place: String,
    /// The map.
    pub map: String,
    /// The point of it nearest to its centre of gravity, metres, in the map.
    pub x_m: f64,
    /// Of that point.
    pub y_m: f64,
    /// Free floor.
    pub area_m2: f64,
    /// What is seen from it, from most of it first; at most 32.
    pub landmarks: Vec<PlaceLandmark>,
}

/// A landmark seen from a place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PlaceLandmark {
    /// Name of the landmark.
    pub landmark: String,
    /// Share of the place from which it is seen, above 0 to 1.
    pub share: f64,
}

/// A doorway between two places, or a link between two maps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TopologyPassage {
    /// Its two ends.
    pub ends: Vec<PassageEnd>,
    /// Free width, at most 2 m; `null` for a link.
    pub width_m: Option<f64>,
    /// From centre to centre of its places.
    pub length_m: f64,
    /// What is seen from its first end, deepest inside its visibility area first; at most 32.
    pub landmarks: Vec<String>,
}

/// An end of a passage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct PassageEnd {
    /// The place there, `hall/3`.
    pub place: String,
    /// The middle of the passage, metres, in the map of the place.
    pub x_m: f64,
    /// Of the middle.
    pub y_m: f64,
}

/// A route from passage to passage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct TopologyRoute {
    /// Sum of its legs.
    pub length_m: f64,
    /// In order, at least one.
    pub legs: Vec<RouteLeg>,
}

/// A part of a route within one place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct RouteLeg {
    /// The place, `hall/3`.
    pub place: String,
    /// Index of the passage at its end; `null` for the last leg, which ends at the place's centre.
    pub passage: Option<usize>,
    /// With the passage after it.
    pub length_m: f64,
    /// Its corners: x, y in metres, in the map of the place.
    #[cfg_attr(feature = "openapi", schema(value_type = Vec<super::arrays::Pair>))]
    pub path: Vec<[f64; 2]>,
    /// The landmark to look for; `null` where none is seen from this leg.
    pub next_landmark: Option<NextLandmarkBody>,
}

/// A landmark to look for, and the pose from which the camera turns to it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(utoipa::ToSchema))]
pub struct NextLandmarkBody {
    /// Name of the landmark.
    pub landmark: String,
    /// How far along the leg the robot is.
    pub along_m: f64,
    /// The robot there, metres, in the map.
    pub x_m: f64,
    /// The robot there.
    pub y_m: f64,
    /// Its heading along the leg.
    pub theta_rad: f64,
    /// Turn of the camera from the heading, left positive.
    pub pan_rad: f64,
    /// Tilt of the camera, up positive.
    pub tilt_rad: f64,
    /// Distance on the floor.
    pub range_m: f64,
}
