//! The camera that looks for a map's landmarks, and what counts as seen: the setting of each map,
//! and others for one question.

use super::{
    AppState,
    error::ApiError,
    extract::{Body, PathParams},
    revision::{IfMatch, Revised},
};
use crate::store::{
    maps,
    revisions::{self, Subject},
    visibility_settings,
};
use axum::{extract::State, http::StatusCode};
use engine::snapshot::MapSnapshot;
use map::{
    check::OutOfRange,
    place::LandmarkPlace,
    visibility::{Obstacle, PanTiltCamera, VisibilityMap, VisibilityParams, VisibilitySettings, visibility},
};
use protos::api::{Problem, VisibilitySettingsBody};
use std::{collections::BTreeMap, sync::Arc};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::model::LandmarkId;

/// Landmarks in reach whose areas are made for one question.
pub(super) const MAX_MADE: usize = 500;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(get, put))
}

fn shown(VisibilitySettings { viewer, seen }: &VisibilitySettings) -> VisibilitySettingsBody {
    VisibilitySettingsBody {
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

/// Settings with the numbers of `usual` where `body` has none, checked.
fn over(body: &VisibilitySettingsBody, usual: &VisibilitySettings) -> Result<VisibilitySettings, OutOfRange> {
    let VisibilitySettings { viewer, seen } = usual;
    let or = |given: Option<f64>, usual: f64| given.unwrap_or(usual);
    let made = VisibilitySettings {
        viewer: PanTiltCamera {
            focal_px: or(body.focal_px, viewer.focal_px),
            width_px: or(body.width_px, viewer.width_px),
            height_px: or(body.height_px, viewer.height_px),
            camera_height_m: or(body.camera_height_m, viewer.camera_height_m),
            tilt_rad: [or(body.tilt_low_rad, viewer.tilt_rad[0]), or(body.tilt_high_rad, viewer.tilt_rad[1])],
            pan_rad: [or(body.pan_low_rad, viewer.pan_rad[0]), or(body.pan_high_rad, viewer.pan_rad[1])],
        },
        seen: VisibilityParams {
            max_incidence_rad: or(body.max_incidence_rad, seen.max_incidence_rad),
            min_side_px: or(body.min_side_px, seen.min_side_px),
            max_fill: or(body.max_fill, seen.max_fill),
            standoff_m: or(body.standoff_m, seen.standoff_m),
        },
    };
    made.check()?;
    Ok(made)
}

/// The settings of one question, if they are others than the map's: the map's with these numbers.
pub(super) fn other(
    body: &VisibilitySettingsBody,
    map: &MapSnapshot,
    outer: &str,
) -> Result<Option<VisibilitySettings>, ApiError> {
    let made = over(body, &map.visibility_settings).map_err(|e| refused(&e, outer))?;
    Ok((made != map.visibility_settings).then_some(made))
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
#[utoipa::path(get, path = "/maps/{map}/visibility-settings", operation_id = "getVisibilitySettings",
    tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, body = VisibilitySettingsBody), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
) -> Result<Revised<VisibilitySettingsBody>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let gone = || ApiError::new(StatusCode::NOT_FOUND, "unknown_map", "no such map").field("map");
    let snapshot = app.store.snapshots().get(&map).ok_or_else(gone)?;
    let settings = &snapshot.visibility_settings;
    Ok(Revised(visibility_settings::revision(settings), shown(settings)))
}

/// Says which camera looks for a map's landmarks; what is absent is that of a usual robot. The
/// areas of all landmarks are made anew and are those of the map's next version.
#[utoipa::path(put, path = "/maps/{map}/visibility-settings", operation_id = "setVisibilitySettings",
    tag = "maps", params(("map" = String, Path)), request_body = VisibilitySettingsBody,
    responses((status = 200, body = VisibilitySettingsBody), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn put(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    IfMatch(is): IfMatch,
    Body(fields): Body<VisibilitySettingsBody>,
) -> Result<Revised<VisibilitySettingsBody>, ApiError> {
    let sight = over(&fields, &VisibilitySettings::default()).map_err(|e| refused(&e, ""))?;
    let stored = Revised(visibility_settings::revision(&sight), shown(&sight));
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::VisibilitySettings, &is).await?;
            visibility_settings::set(tx, &map, &sight).await
        })
    });
    write.await?;
    Ok(stored)
}

pub(super) type Areas = BTreeMap<LandmarkId, Arc<VisibilityMap>>;

/// The areas that a question asks for: the map's own, or those for another camera of the landmarks
/// that `near` (the place, and how far it could be seen) says may matter.
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
        return Err(ApiError::invalid("too_many", "visibility_settings", detail));
    }
    let obstacles: Vec<Obstacle> = map.walls.iter().map(Obstacle::from).collect();
    let one = |(id, place): &(LandmarkId, LandmarkPlace)| {
        let made = visibility(place, &obstacles, &sight.viewer, &sight.seen);
        Ok((*id, Arc::new(made.map_err(|e| refused(&e, "visibility_settings"))?)))
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
        assert_eq!(other(&VisibilitySettingsBody::default(), &map, "visibility_settings").unwrap(), None);
        let wide = VisibilitySettingsBody {
            focal_px: Some(900.0),
            tilt_high_rad: Some(1.2),
            ..VisibilitySettingsBody::default()
        };
        let made = other(&wide, &map, "visibility_settings").unwrap().unwrap();
        assert!((made.viewer.focal_px - 900.0).abs() < 1e-9 && (made.viewer.tilt_rad[1] - 1.2).abs() < 1e-9);
        assert_eq!(made.viewer.width_px.to_bits(), map.visibility_settings.viewer.width_px.to_bits());
        let wrong = VisibilitySettingsBody { tilt_low_rad: Some(0.4), ..VisibilitySettingsBody::default() };
        assert_eq!(
            other(&wrong, &map, "visibility_settings").unwrap_err().field.as_deref(),
            Some("visibility_settings.tilt_high_rad")
        );
        assert_eq!(over(&shown(&made), &VisibilitySettings::default()).unwrap(), made, "there and back");
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
