//! The camera that looks for a map's landmarks, and what counts as seen: the setting of each map, and others for one
//! question.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, Body},
};
use crate::store::{maps, sights};
use ::map::{
    check::OutOfRange,
    place::LandmarkPlace,
    visibility::{Obstacle, PanTiltCamera, VisibilityMap, VisibilityParams, VisibilitySettings, visibility},
};
use axum::{Json, extract::State, http::StatusCode};
use engine::snapshot::MapSnapshot;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, sync::Arc};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::model::LandmarkId;

/// Landmarks in reach whose areas are made for one question.
pub(super) const MAX_MADE: usize = 500;

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(get, put))
}

/// A camera, and what counts as seen by it. Every number may be absent.
#[derive(Debug, Clone, Default, Serialize, Deserialize, ToSchema, IntoParams)]
#[serde(default, deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct Fields {
    /// Focal length, pixels: 10 to 20 000; usually 512.
    focal_px: Option<f64>,
    /// Width of the image, pixels: 16 to 20 000; usually 640.
    width_px: Option<f64>,
    /// Height of the image, pixels: 16 to 20 000; usually 480.
    height_px: Option<f64>,
    /// Height of the camera above the floor: 0 to 10 m; usually 1.2.
    camera_height_m: Option<f64>,
    /// Lowest tilt of the camera, up positive, within 1.55; usually -0.35. The same as the highest for one that is fixed.
    tilt_low_rad: Option<f64>,
    /// Highest tilt; usually 0.35. Signs under ceilings are seen only by cameras that look up.
    tilt_high_rad: Option<f64>,
    /// Rightmost pan, left positive, from -pi; usually -1.7.
    pan_low_rad: Option<f64>,
    /// Leftmost pan, to pi; usually 1.7.
    pan_high_rad: Option<f64>,
    /// Most oblique view against a landmark's normal: 0.01 to 1.48; usually 1.309, 75 degrees.
    max_incidence_rad: Option<f64>,
    /// Shortest side of a landmark in the image, pixels: 1 to 20 000; usually 75.
    min_side_px: Option<f64>,
    /// Largest share of the image that a landmark may take: 0.01 to 1; usually 0.9.
    max_fill: Option<f64>,
    /// How far before its wall a landmark is taken to hang, so that its own wall does not hide it: 0.001 to 0.5 m; usually
    /// 0.05.
    standoff_m: Option<f64>,
}

impl From<&VisibilitySettings> for Fields {
    fn from(VisibilitySettings { viewer, seen }: &VisibilitySettings) -> Self {
        Self {
            focal_px: Some(viewer.focal_px),
            width_px: Some(viewer.width_px),
            height_px: Some(viewer.height_px),
            camera_height_m: Some(viewer.camera_height_m),
            tilt_low_rad: Some(viewer.tilt_rad[0]),
            tilt_high_rad: Some(viewer.tilt_rad[1]),
            pan_low_rad: Some(viewer.pan_rad[0]),
            pan_high_rad: Some(viewer.pan_rad[1]),
            max_incidence_rad: Some(seen.max_incidence_rad),
            min_side_px: Some(seen.min_side_px),
            max_fill: Some(seen.max_fill),
            standoff_m: Some(seen.standoff_m),
        }
    }
}

impl Fields {
    /// What is absent is as in `usual`.
    fn over(&self, usual: &VisibilitySettings) -> Result<VisibilitySettings, OutOfRange> {
        let VisibilitySettings { viewer, seen } = usual;
        let or = |given: Option<f64>, usual: f64| given.unwrap_or(usual);
        let made = VisibilitySettings {
            viewer: PanTiltCamera {
                focal_px: or(self.focal_px, viewer.focal_px),
                width_px: or(self.width_px, viewer.width_px),
                height_px: or(self.height_px, viewer.height_px),
                camera_height_m: or(self.camera_height_m, viewer.camera_height_m),
                tilt_rad: [
                    or(self.tilt_low_rad, viewer.tilt_rad[0]),
                    or(self.tilt_high_rad, viewer.tilt_rad[1]),
                ],
                pan_rad: [or(self.pan_low_rad, viewer.pan_rad[0]), or(self.pan_high_rad, viewer.pan_rad[1])],
            },
            seen: VisibilityParams {
                max_incidence_rad: or(self.max_incidence_rad, seen.max_incidence_rad),
                min_side_px: or(self.min_side_px, seen.min_side_px),
                max_fill: or(self.max_fill, seen.max_fill),
                standoff_m: or(self.standoff_m, seen.standoff_m),
            },
        };
        made.check()?;
        Ok(made)
    }

    /// The camera of one question, if it names any: the map's with these numbers.
    pub(super) fn other(
        &self,
        map: &MapSnapshot,
        outer: &str,
    ) -> Result<Option<VisibilitySettings>, ApiError> {
        let made = self.over(&map.sight).map_err(|e| refused(&e, outer))?;
        Ok((made != map.sight).then_some(made))
    }
}

/// The field as it is called here.
fn refused(error: &OutOfRange, outer: &str) -> ApiError {
    let field = match error.field {
        "tilt_rad[0]" => "tilt_low_rad",
        "tilt_rad[1]" => "tilt_high_rad",
        "pan_rad[0]" => "pan_low_rad",
        "pan_rad[1]" => "pan_high_rad",
        same => same,
    };
    let detail = match field {
        "tilt_high_rad" => "from tilt_low_rad to 1.55".to_owned(),
        "pan_high_rad" => "from pan_low_rad to pi".to_owned(),
        _ => OutOfRange { field, value: error.value }.to_string(),
    };
    let field = if outer.is_empty() { field.to_owned() } else { format!("{outer}.{field}") };
    ApiError::invalid("out_of_range", field, detail)
}

/// The camera for which the areas of a map's landmarks are made, and what counts as seen.
#[utoipa::path(get, path = "/maps/{map}/sight", tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, body = Fields), (status = 404, body = Problem)))]
async fn get(State(app): State<Shared>, At(map): At<String>) -> Result<Json<Fields>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let gone = || ApiError::new(StatusCode::NOT_FOUND, "unknown_map", "no such map").field("map");
    let snapshot = app.store.snapshots().get(&map).ok_or_else(gone)?;
    Ok(Json(Fields::from(&snapshot.sight)))
}

/// Says which camera looks for a map's landmarks; what is absent is that of a usual robot. The areas of all landmarks are
/// made anew and are those of the map's next version.
#[utoipa::path(put, path = "/maps/{map}/sight", tag = "maps", params(("map" = String, Path)), request_body = Fields,
    responses((status = 200, body = Fields), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, bad_value")))]
async fn put(
    State(app): State<Shared>,
    At(map): At<String>,
    Body(fields): Body<Fields>,
) -> Result<Json<Fields>, ApiError> {
    let sight = fields.over(&VisibilitySettings::default()).map_err(|e| refused(&e, ""))?;
    let stored = Fields::from(&sight);
    app.store.write(move |tx| Box::pin(async move { sights::set(tx, &map, &sight).await })).await?;
    Ok(Json(stored))
}

/// Areas by landmark.
pub(super) type Areas = BTreeMap<LandmarkId, Arc<VisibilityMap>>;

/// The areas that a question asks for: the map's own, or those for another camera of the landmarks that `near` (the place,
/// and how far it could be seen) says may matter.
pub(super) fn areas(
    map: &MapSnapshot,
    other: Option<&VisibilitySettings>,
    near: impl Fn(&LandmarkPlace, f64) -> bool,
) -> Result<Areas, ApiError> {
    let Some(sight) = other else { return Ok(map.visibility.clone()) };
    let places = map.landmarks.iter().filter_map(|(id, l)| Some((*id, l.place?)));
    let asked: Vec<_> = places.filter(|(_, place)| near(place, sight.reach_m(&place.size))).collect();
    if asked.len() > MAX_MADE {
        let detail =
            format!("{} landmarks are in reach, {MAX_MADE} are looked at for another camera", asked.len());
        return Err(ApiError::invalid("too_many", "sight", detail));
    }
    let obstacles: Vec<Obstacle> = map.walls.iter().map(Obstacle::from).collect();
    let one = |(id, place): &(LandmarkId, LandmarkPlace)| {
        let made = visibility(place, &obstacles, &sight.viewer, &sight.seen);
        Ok((*id, Arc::new(made.map_err(|e| refused(&e, "sight"))?)))
    };
    asked.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::map::place::PlaceSigmas;
    use engine::snapshot::LandmarkInfo;
    use nalgebra::Vector3;
    use vision::pose::LandmarkSize;

    #[test]
    fn absent_numbers_are_those_of_the_map_and_wrong_ones_are_named() {
        let map = MapSnapshot::empty("hall", 1);
        assert_eq!(Fields::default().other(&map, "sight").unwrap(), None);
        let wide = Fields { focal_px: Some(900.0), tilt_high_rad: Some(1.2), ..Fields::default() };
        let made = wide.other(&map, "sight").unwrap().unwrap();
        assert!((made.viewer.focal_px - 900.0).abs() < 1e-9 && (made.viewer.tilt_rad[1] - 1.2).abs() < 1e-9);
        assert_eq!(made.viewer.width_px.to_bits(), map.sight.viewer.width_px.to_bits());
        let wrong = Fields { tilt_low_rad: Some(0.4), ..Fields::default() };
        assert_eq!(wrong.other(&map, "sight").unwrap_err().field.as_deref(), Some("sight.tilt_high_rad"));
        assert_eq!(Fields::from(&made).over(&VisibilitySettings::default()).unwrap(), made, "there and back");
    }

    #[test]
    fn of_more_than_are_made_for_a_question_it_says_so() {
        let size = LandmarkSize { width_m: 0.6, height_m: 0.8 };
        let place =
            LandmarkPlace::by_hand(Vector3::new(0.0, 0.0, 1.5), 0.0, size, PlaceSigmas::default()).unwrap();
        let info = || LandmarkInfo { size: Some(size), place: Some(place), ..LandmarkInfo::default() };
        let map = |count: u64| MapSnapshot {
            landmarks: (0..count).map(|i| (LandmarkId(i), info())).collect(),
            ..MapSnapshot::empty("hall", 1)
        };
        let sight = VisibilitySettings {
            viewer: PanTiltCamera { focal_px: 300.0, ..PanTiltCamera::default() },
            ..VisibilitySettings::default()
        };
        let near = |_: &LandmarkPlace, reach: f64| reach > 2.3;
        let made = areas(&map(MAX_MADE as u64), Some(&sight), near).unwrap();
        assert!(made.len() == MAX_MADE && made[&LandmarkId(0)].area_m2() > 1.0);
        let refused = areas(&map(MAX_MADE as u64 + 1), Some(&sight), near).unwrap_err();
        assert_eq!(refused.code, "too_many");
        assert!(areas(&map(MAX_MADE as u64 + 1), Some(&sight), |_, reach| reach > 2.5).unwrap().is_empty());
    }
}
