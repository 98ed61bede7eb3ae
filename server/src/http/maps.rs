//! `/maps`: create, list, read, say where they are, delete; and how they lie to each other.

use super::{
    AppState,
    answers::{Listed, created, row_major, selected},
    authorise::check_map,
    error::{ApiError, out_of_range},
    extract::{Body, PathParams, QueryParams, label, name},
    landmarks::learning_text,
    revision::{IfMatch, Revised},
};
use crate::{
    identity::Principal,
    learning_rules,
    store::{
        contents::{self, Written},
        drafts::MAX_DRAFTS,
        map_locations::{self, MapLocation},
        maps::{self, MapPipeline, MapRow},
        revisions::{self, Subject},
    },
};
use axum::{Extension, Json, extract::State, http::StatusCode};
use map::{
    map_links::MapLink,
    map_links::relation,
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::{Matrix3, Vector3};
use protos::api::{
    Distance, ListQuery, Map, MapPatch, NewCopy, NewMap, Page, Parent, PipelinePreset, Problem,
    TransformQuery, TransformResponse, TransformedPose,
};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::params::preset::Preset;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(create, list))
        .routes(routes!(get, patch, delete))
        .routes(routes!(copy))
        .routes(routes!(transform))
}

/// Standard deviations of a link that says nothing of its own: x, y in metres, heading in radians.
const LINK_SIGMA: [f64; 3] = [0.05, 0.05, 0.0087];

/// Where a map lies in another, checked.
fn link(parent: Parent) -> Result<MapLink<String>, ApiError> {
    let usual = || Matrix3::from_diagonal(&Vector3::from(LINK_SIGMA.map(|sigma| sigma * sigma)));
    let covariance = parent.covariance.map_or_else(usual, |c| Matrix3::from_row_slice(&c));
    let pose = Pose2::new(parent.x_m, parent.y_m, parent.theta_rad);
    let parent_from_map = Pose2Covariance { pose, covariance };
    let link = MapLink { parent: parent.map, parent_from_map, level_m: parent.level_m };
    link.check().map_err(|e| out_of_range(&e, "parent"))?;
    Ok(link)
}

fn parent_shown(link: &MapLink<String>) -> Parent {
    let Pose2Covariance { pose, covariance } = &link.parent_from_map;
    Parent {
        map: link.parent.clone(),
        x_m: pose.x_m,
        y_m: pose.y_m,
        theta_rad: pose.theta_rad,
        level_m: link.level_m,
        covariance: Some(row_major(covariance)),
    }
}

/// A map and where it is. The map that it lies in is named only to those who may see that.
pub(super) fn map_shown(row: MapRow, found: MapLocation, principal: &Principal) -> Map {
    let link = found.link.filter(|link| principal.may_see(&link.parent));
    Map {
        name: row.name,
        version: row.version,
        revision: row.revision,
        landmarks: row.landmarks,
        has_underlay: row.has_underlay,
        preset: row.pipeline.preset.map(Into::into),
        distance: row.pipeline.distance.into(),
        learning: learning_rules::shown(row.learning.as_deref()),
        draft_of: row.draft_of,
        parent: link.as_ref().map(parent_shown),
        site: found.site,
        building: found.building,
        floor: found.floor,
    }
}

/// A pipeline of this preset; the distance is that of the preset, or where there is none of the
/// server's, unless it is given.
fn pipeline(preset: Option<PipelinePreset>, distance: Option<Distance>, server: Preset) -> MapPipeline {
    let preset = preset.map(Preset::from);
    let distance = distance.map_or_else(|| preset.unwrap_or(server).distance(), Into::into);
    MapPipeline { preset, distance }
}

/// Longest word for a site, a building or a floor.
const MAX_WORD: usize = 64;

/// A word for people: something to read, on one line.
fn word(field: &'static str, text: Option<String>) -> Result<Option<String>, ApiError> {
    let Some(text) = text else { return Ok(None) };
    label(field, &text, MAX_WORD)?;
    Ok(Some(text))
}

/// The field of a parent that does not exist is not the map of the path.
pub(super) fn unknown_parent(error: ApiError) -> ApiError {
    if error.code == "unknown_map" { error.field("parent.map") } else { error }
}

/// Creates an empty map.
#[utoipa::path(post, path = "/maps", operation_id = "createMap", tag = "maps", request_body = NewMap, responses(
    (status = 201, body = Map), (status = 404, body = Problem, description = "unknown_map: the parent"),
    (status = 409, body = Problem, description = "exists, too_many, too_deep"),
    (status = 422, body = Problem, description = "bad_name, invalid_value, out_of_range")))]
async fn create(
    State(app): State<AppState>,
    Extension(principal): Extension<Principal>,
    Body(new): Body<NewMap>,
) -> Result<(StatusCode, Json<Map>), ApiError> {
    let (name, max) = (name("name", new.name)?, app.config.limits.maps);
    let pipeline = pipeline(new.preset, new.distance, app.config.preset);
    let found = MapLocation {
        site: word("site", new.site)?,
        building: word("building", new.building)?,
        floor: word("floor", new.floor)?,
        link: new.parent.map(link).transpose()?,
    };
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            maps::create(tx, name.as_str(), pipeline, max).await?;
            let found = map_locations::set(tx, name.as_str(), |_| found).await?;
            Ok((maps::of(tx, name.as_str()).await?, found))
        })
    });
    let shown = move |(row, found): &(MapRow, MapLocation)| {
        (StatusCode::CREATED, map_shown(row.clone(), found.clone(), &principal))
    };
    created(shown, async { write.await.map_err(|e| unknown_parent(e.into())) }).await
}

impl Listed for MapRow {
    fn name(&self) -> &str {
        &self.name
    }

    fn changed_ms(&self) -> Option<i64> {
        Some(self.changed_ms)
    }
}

/// Lists maps, without their drafts.
#[utoipa::path(get, path = "/maps", operation_id = "listMaps",
    tag = "maps", params(ListQuery), responses((status = 200, body = Page<Map>),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn list(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<ListQuery>,
    Extension(principal): Extension<Principal>,
) -> Result<Json<Page<Map>>, ApiError> {
    let limits = &app.config.limits;
    let with_drafts = limits.maps.saturating_mul(1 + MAX_DRAFTS);
    let mut rows = maps::page(app.store.reads(), "", with_drafts).await?;
    rows.retain(|row| row.draft_of.is_none() && principal.may_see(&row.name));
    let mut known = map_locations::all(app.store.reads()).await?;
    let Page { items, next, total } = selected(rows, &query, limits.page)?;
    let shown = |row: MapRow| {
        let found = known.remove(&row.name).unwrap_or_default();
        map_shown(row, found, &principal)
    };
    Ok(Json(Page { items: items.into_iter().map(shown).collect(), next, total }))
}

/// One map.
#[utoipa::path(get, path = "/maps/{map}", operation_id = "getMap",
    tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, body = Map), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Extension(principal): Extension<Principal>,
) -> Result<Revised<Map>, ApiError> {
    let row = maps::get(app.store.reads(), &map).await?;
    let found = map_locations::all(app.store.reads()).await?.remove(&map).unwrap_or_default();
    Ok(Revised(row.revision.clone(), map_shown(row, found, &principal)))
}

/// Changes a map's name, preset, distance, weights and gates, site, building, floor or position.
#[utoipa::path(patch, path = "/maps/{map}", operation_id = "updateMap",
    tag = "maps", params(("map" = String, Path)), request_body = MapPatch,
    responses((status = 200, body = Map), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "cycle: it would lie in itself; too_deep; exists: the new name; \
     in_use: a robot, an open job or an open gathering has the present name"),
    (status = 422, body = Problem, description = "bad_name, out_of_range, invalid_value")))]
async fn patch(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Extension(principal): Extension<Principal>,
    IfMatch(is): IfMatch,
    Body(changes): Body<MapPatch>,
) -> Result<Revised<Map>, ApiError> {
    let new_name = changes.name.map(|new| name("name", new)).transpose()?;
    let changed = |field, given: Option<Option<String>>| given.map(|text| word(field, text)).transpose();
    let (site, building) = (changed("site", changes.site)?, changed("building", changes.building)?);
    let floor = changed("floor", changes.floor)?;
    let parent = changes.parent.map(|parent| parent.map(link).transpose()).transpose()?;
    let learning = changes.learning.map(|own| own.map(learning_text).transpose()).transpose()?;
    maps::get(app.store.reads(), &map).await?;
    let server = app.config.preset;
    let repiped = move |old: MapPipeline| match (changes.preset, changes.distance) {
        (Some(preset), distance) => pipeline(preset, distance, server),
        (None, Some(distance)) => MapPipeline { distance: distance.into(), ..old },
        (None, None) => old,
    };
    if let Some(Some(link)) = &parent {
        check_map(&principal, &link.parent).map_err(unknown_parent)?;
    }
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Map, &is).await?;
            let found = map_locations::set(tx, &map, |old| MapLocation {
                site: site.unwrap_or(old.site),
                building: building.unwrap_or(old.building),
                floor: floor.unwrap_or(old.floor),
                link: parent.unwrap_or(old.link),
            })
            .await?;
            maps::set_pipeline(tx, &map, repiped).await?;
            if let Some(own) = learning {
                let (text, reason) = own.unzip();
                maps::set_learning(tx, &map, text.as_deref(), reason).await?;
            }
            let now = new_name.as_ref().map_or(map.as_str(), protos::Name::as_str);
            maps::rename(tx, &map, now).await?;
            Ok((maps::of(tx, now).await?, found))
        })
    });
    let (row, found) = write.await.map_err(|e| unknown_parent(e.into()))?;
    Ok(Revised(row.revision.clone(), map_shown(row, found, &principal)))
}

/// Deletes a map and all that is in it.
#[utoipa::path(delete, path = "/maps/{map}", operation_id = "deleteMap",
    tag = "maps", params(("map" = String, Path)), responses(
    (status = 204), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "in_use: a robot stands on it, another map lies in it, or it has a draft")))]
async fn delete(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    IfMatch(is): IfMatch,
) -> Result<StatusCode, ApiError> {
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Map, &is).await?;
            maps::delete(tx, &map).await
        })
    });
    write.await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Makes a new map of all that a map has: landmarks with their views, photographs and models,
/// walls, underlay, reference runs and settings. Robots stay where they are, and the copy begins a
/// history of its own.
#[utoipa::path(post, path = "/maps/{map}/copies", operation_id = "copyMap",
    tag = "maps", params(("map" = String, Path)), request_body = NewCopy,
    responses((status = 201, body = Map), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "exists, too_many: maps, or bytes of one map"),
    (status = 422, body = Problem, description = "bad_name")))]
async fn copy(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Extension(principal): Extension<Principal>,
    Body(new): Body<NewCopy>,
) -> Result<(StatusCode, Json<Map>), ApiError> {
    let new_name = name("name", new.name)?;
    let shown = move |written: &Written| {
        (StatusCode::CREATED, map_shown(written.map.clone(), written.location.clone(), &principal))
    };
    created(shown, contents::copy(&app.store, &map, new_name.as_str(), &app.config.limits)).await
}

fn pose_shown(p: &Pose2Covariance) -> TransformedPose {
    let covariance = row_major(&p.covariance);
    TransformedPose { x_m: p.pose.x_m, y_m: p.pose.y_m, theta_rad: p.pose.theta_rad, covariance }
}

/// How a map lies in another, by the links of both up to a map that both hang on; and a pose in
/// that other map's frame.
#[utoipa::path(get, path = "/maps/{map}/transform", operation_id = "getMapTransform",
    tag = "maps", params(("map" = String, Path), TransformQuery),
    responses((status = 200, body = TransformResponse), (status = 400, body = Problem, description = "bad_query"),
    (status = 404, body = Problem), (status = 409, body = Problem, description = "not_related"),
    (status = 422, body = Problem, description = "missing, out_of_range")))]
async fn transform(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(query): QueryParams<TransformQuery>,
    Extension(principal): Extension<Principal>,
) -> Result<Json<TransformResponse>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    check_map(&principal, &query.to).map_err(|e| e.field("to"))?;
    maps::get(app.store.reads(), &query.to).await.map_err(|e| ApiError::from(e).field("to"))?;
    let links: std::collections::BTreeMap<String, MapLink<String>> =
        map_locations::links(&map_locations::all(app.store.reads()).await?);
    let found = relation(&links, &map, &query.to)
        .map_err(|e| ApiError::from(crate::store::StoreError::from(e)).field("to"))?;
    let pose = match (query.x_m, query.y_m, query.theta_rad) {
        (None, None, None) => None,
        (Some(x_m), Some(y_m), Some(theta_rad)) => {
            let pose = Pose2Covariance::new(Pose2 { x_m, y_m, theta_rad }, Matrix3::zeros());
            Some(found.to_from_map.compose(&pose.map_err(|e| out_of_range(&e, "query"))?))
        }
        _ => return Err(ApiError::invalid("missing", "query", "x_m, y_m and theta_rad go together")),
    };
    Ok(Json(TransformResponse {
        via: found.via.into_iter().filter(|map| principal.may_see(map)).collect(),
        to_from_map: pose_shown(&found.to_from_map),
        level_m: found.level_m,
        pose: pose.as_ref().map(pose_shown),
    }))
}
