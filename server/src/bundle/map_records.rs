//! Files of a bundle about the map itself: `map.json`, `walls.geojson`, `modalities.json`,
//! `visibility.json`, `underlay.json`.

use super::{BundleError, MAP, MODALITIES, UNDERLAY, VISIBILITY, WALLS, invalid};
use crate::{
    label::check_label,
    learning_rules,
    store::{
        contents::{MapSettings, RunContents},
        map_locations::MapLocation,
        maps::MapPipeline,
        pictures::hex,
        underlays::UnderlayRow,
        walls::StoredWall,
    },
};
use map::{
    check::MAX_COORDINATE_M,
    map_links::MapLink,
    modality_stats::{FusionMode, MAX_AREAS, MAX_NAME_BYTES, NamedArea, PoseCell, StatsByModality},
    pose2::{Pose2, Pose2Covariance},
    visibility::VisibilitySettings,
};
use nalgebra::Matrix3;
use protos::{
    Name,
    api::{LearningSettings, Parent},
};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::f64::consts::TAU;
use vision::{params::preset::Preset, recognise::DistanceKind};

/// Longest word for a site, a building or a floor.
const MAX_WORD: usize = 64;
/// Longest text of the statistics of a run, as the schema says.
const MAX_CELLS_BYTES: usize = 16 << 20;
/// Side of a pixel of an underlay, metres.
const METRES_PER_PIXEL: [f64; 2] = [1e-4, 10.0];

/// `map.json`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MapRecord {
    /// Absent: as the server's settings say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    preset: Option<Preset>,
    distance: DistanceKind,
    /// Absent: none of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    learning: Option<LearningSettings>,
    site: Option<String>,
    building: Option<String>,
    floor: Option<String>,
    parent: Option<Parent>,
}

/// `modalities.json`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ModalitiesRecord {
    fusion_mode: FusionMode,
    areas: Vec<NamedArea>,
    reference_runs: Vec<RunRecord>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RunRecord {
    robot: String,
    created_ms: i64,
    way_m: f64,
    cells: Vec<(PoseCell, StatsByModality)>,
}

/// `underlay.json`, which may be `null`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct UnderlayRecord {
    /// File with the picture.
    picture: String,
    width_px: u32,
    height_px: u32,
    metres_per_pixel: f64,
    x_m: f64,
    y_m: f64,
    theta_rad: f64,
    created_ms: i64,
}

/// `walls.geojson`.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct WallsRecord {
    r#type: String,
    features: Vec<WallFeature>,
}

#[derive(Debug, Serialize, Deserialize)]
struct WallFeature {
    r#type: String,
    geometry: WallGeometry,
    properties: WallProperties,
}

#[derive(Debug, Serialize, Deserialize)]
struct WallGeometry {
    r#type: String,
    coordinates: [[f64; 2]; 2],
}

#[derive(Debug, Serialize, Deserialize)]
struct WallProperties {
    covariance: Option<[f64; 3]>,
}

/// Name of the file of a picture.
pub(super) fn picture_file(sha256: &[u8], kind: &str) -> String {
    format!("pictures/{}.{kind}", hex(sha256))
}

impl MapRecord {
    pub(super) fn of(settings: &MapSettings) -> Result<Self, serde_json::Error> {
        let MapLocation { site, building, floor, link } = settings.location.clone();
        let parent = link.map(|link| Parent {
            map: link.parent,
            x_m: link.parent_from_map.pose.x_m,
            y_m: link.parent_from_map.pose.y_m,
            theta_rad: link.parent_from_map.pose.theta_rad,
            level_m: link.level_m,
            covariance: Some(std::array::from_fn(|i| link.parent_from_map.covariance[(i / 3, i % 3)])),
        });
        let MapPipeline { preset, distance } = settings.pipeline;
        let learning = settings.learning.as_deref().map(parsed).transpose()?;
        Ok(Self { preset, distance, learning, site, building, floor, parent })
    }

    /// Pipeline, weights and gates as text, and location, checked.
    pub(super) fn checked(self) -> Result<(MapPipeline, Option<String>, MapLocation), BundleError> {
        for (field, word) in [("site", &self.site), ("building", &self.building), ("floor", &self.floor)] {
            let Some(text) = word else { continue };
            check_label(text, MAX_WORD).map_err(|e| invalid(MAP, field, e))?;
        }
        let link = self.parent.map(link_of).transpose()?;
        let learning = self.learning.map(|own| learning_rules::text(&own)).transpose();
        let learning = learning.map_err(|(field, why)| invalid(MAP, format!("learning.{field}"), why))?;
        let Self { preset, distance, site, building, floor, .. } = self;
        Ok((MapPipeline { preset, distance }, learning, MapLocation { site, building, floor, link }))
    }
}

fn link_of(parent: Parent) -> Result<MapLink<String>, BundleError> {
    let missing = || invalid(MAP, "parent.covariance", "it is missing");
    let covariance = Matrix3::from_row_slice(&parent.covariance.ok_or_else(missing)?);
    let pose = Pose2 { x_m: parent.x_m, y_m: parent.y_m, theta_rad: parent.theta_rad };
    let parent_from_map = Pose2Covariance { pose, covariance };
    Name::new(parent.map.as_str()).map_err(|e| invalid(MAP, "parent.map", e))?;
    let link = MapLink { parent: parent.map, parent_from_map, level_m: parent.level_m };
    link.check().map_err(|e| invalid(MAP, "parent", e))?;
    Ok(link)
}

/// A stored text of JSON as a value. Errors: it is none.
pub(super) fn parsed<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, serde_json::Error> {
    serde_json::from_str(text)
}

impl ModalitiesRecord {
    pub(super) fn of(settings: &MapSettings, runs: &[RunContents]) -> Result<Self, serde_json::Error> {
        let run = |run: &RunContents| {
            Ok(RunRecord {
                robot: run.robot.clone(),
                created_ms: run.created_ms,
                way_m: run.way_m,
                cells: parsed(&run.cells)?,
            })
        };
        Ok(Self {
            fusion_mode: settings.fusion_mode,
            areas: parsed(&settings.areas)?,
            reference_runs: runs.iter().map(run).collect::<Result<_, serde_json::Error>>()?,
        })
    }

    /// Fusion mode, areas as text, and runs, checked.
    pub(super) fn checked(self) -> Result<(FusionMode, String, Vec<RunContents>), BundleError> {
        if self.areas.len() > MAX_AREAS {
            return Err(invalid(MODALITIES, "areas", format!("at most {MAX_AREAS}")));
        }
        for (index, area) in self.areas.iter().enumerate() {
            area.check().map_err(|e| invalid(MODALITIES, format!("areas[{index}]"), e))?;
            check_label(&area.name, MAX_NAME_BYTES)
                .map_err(|e| invalid(MODALITIES, format!("areas[{index}].name"), e))?;
        }
        let areas = serde_json::to_string(&self.areas).map_err(|e| invalid(MODALITIES, "areas", e))?;
        let run = |(index, run): (usize, RunRecord)| {
            run.checked()
                .map_err(|(field, why)| invalid(MODALITIES, format!("reference_runs[{index}].{field}"), why))
        };
        let runs = self.reference_runs.into_iter().enumerate().map(run).collect::<Result<_, _>>()?;
        Ok((self.fusion_mode, areas, runs))
    }
}

impl RunRecord {
    fn checked(self) -> Result<RunContents, (&'static str, String)> {
        Name::new(self.robot.as_str()).map_err(|e| ("robot", e.to_string()))?;
        if !(0.0..f64::INFINITY).contains(&self.way_m) {
            return Err(("way_m", "at least 0".to_owned()));
        }
        for stats in self.cells.iter().flat_map(|(_, by_modality)| by_modality) {
            stats.check().map_err(|e| ("cells", e.to_string()))?;
        }
        let cells = serde_json::to_string(&self.cells).map_err(|e| ("cells", e.to_string()))?;
        if cells.len() > MAX_CELLS_BYTES {
            return Err(("cells", format!("at most {MAX_CELLS_BYTES} bytes")));
        }
        Ok(RunContents { robot: self.robot, created_ms: self.created_ms, way_m: self.way_m, cells })
    }
}

/// The visibility settings as text, checked.
pub(super) fn visibility_text(settings: Option<VisibilitySettings>) -> Result<Option<String>, BundleError> {
    let Some(settings) = settings else { return Ok(None) };
    settings.check().map_err(|e| invalid(VISIBILITY, e.field, e))?;
    serde_json::to_string(&settings).map(Some).map_err(|e| invalid(VISIBILITY, "", e))
}

impl UnderlayRecord {
    pub(super) fn of(row: &UnderlayRow) -> Self {
        let ([width_px, height_px], [x_m, y_m, theta_rad]) = (row.size_px, row.map_from_picture);
        Self {
            picture: picture_file(&row.image_sha256, &row.image_kind),
            width_px,
            height_px,
            metres_per_pixel: row.metres_per_pixel,
            x_m,
            y_m,
            theta_rad,
            created_ms: row.created_ms,
        }
    }

    /// The row, checked; `picture` gives digest and kind of a file with a picture of this size.
    pub(super) fn checked(
        self,
        picture: impl FnOnce(&str, [u32; 2]) -> Result<([u8; 32], String), BundleError>,
    ) -> Result<UnderlayRow, BundleError> {
        let size_px = [self.width_px, self.height_px];
        let (image_sha256, image_kind) = picture(&self.picture, size_px)?;
        for (field, value, [low, high]) in [
            ("metres_per_pixel", self.metres_per_pixel, METRES_PER_PIXEL),
            ("x_m", self.x_m, [-MAX_COORDINATE_M, MAX_COORDINATE_M]),
            ("y_m", self.y_m, [-MAX_COORDINATE_M, MAX_COORDINATE_M]),
            ("theta_rad", self.theta_rad, [-TAU, TAU]),
        ] {
            if !(low..=high).contains(&value) {
                return Err(invalid(UNDERLAY, field, format!("{value} is not within {low} to {high}")));
            }
        }
        Ok(UnderlayRow {
            image_sha256,
            image_kind,
            size_px,
            metres_per_pixel: self.metres_per_pixel,
            map_from_picture: [self.x_m, self.y_m, self.theta_rad],
            created_ms: self.created_ms,
        })
    }
}

impl WallsRecord {
    pub(super) fn of(walls: &[StoredWall]) -> Self {
        let feature = |wall: &StoredWall| {
            let [ax, ay, bx, by] = wall.ends;
            WallFeature {
                r#type: "Feature".to_owned(),
                geometry: WallGeometry { r#type: "LineString".to_owned(), coordinates: [[ax, ay], [bx, by]] },
                properties: WallProperties { covariance: wall.covariance },
            }
        };
        Self { r#type: "FeatureCollection".to_owned(), features: walls.iter().map(feature).collect() }
    }

    /// The walls in their order, checked.
    pub(super) fn checked(self) -> Result<Vec<StoredWall>, BundleError> {
        let wall = |(index, feature): (usize, WallFeature)| {
            let at = |why: String| invalid(WALLS, format!("features[{index}]"), why);
            let [[ax, ay], [bx, by]] = feature.geometry.coordinates;
            let wall = StoredWall { ends: [ax, ay, bx, by], covariance: feature.properties.covariance };
            if feature.geometry.r#type != "LineString" {
                return Err(at("a wall is a `LineString` of two points".to_owned()));
            }
            wall.segment().map_err(|e| at(e.to_string()))?;
            Ok(wall)
        };
        self.features.into_iter().enumerate().map(wall).collect()
    }
}

/// `landmarks.geojson`, for programs of geography: a point for each landmark with a place. Nothing
/// is read of it.
pub(super) fn landmark_points<'a>(
    landmarks: impl Iterator<Item = (&'a str, [f64; 4], Option<[f64; 2]>)>,
) -> Value {
    let feature = |(name, [x_m, y_m, z_m, theta_rad], size): (&str, [f64; 4], Option<[f64; 2]>)| {
        json!({
            "type": "Feature",
            "geometry": { "type": "Point", "coordinates": [x_m, y_m, z_m] },
            "properties": {
                "name": name,
                "theta_rad": theta_rad,
                "width_m": size.map(|[width, _]| width),
                "height_m": size.map(|[_, height]| height),
            },
        })
    };
    json!({ "type": "FeatureCollection", "features": landmarks.map(feature).collect::<Vec<_>>() })
}
