//! `/maps`: create, list, read, say where they are, delete; and how they lie to each other.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, Body, Page, PageQuery, Params, name},
    landmarks::given,
    resources::{Distance, Map, Parent, out_of_range, row_major},
};
use crate::store::{
    maps,
    sites::{self, Whereabouts},
};
use axum::{Json, extract::State, http::StatusCode};
use map::{
    map_links::{MapLink, relation},
    pose2::{Pose2, Pose2Covariance},
};
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(create, list))
        .routes(routes!(get, patch, delete))
        .routes(routes!(transform))
}

/// A map to be.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct NewMap {
    /// `[a-z0-9_-]{1,64}`, unique.
    name: String,
    /// Which distance decides.
    #[serde(default)]
    distance: Distance,
    /// Where it belongs, in words: 1 to 64 characters.
    site: Option<String>,
    /// Where it belongs.
    building: Option<String>,
    /// Where it belongs.
    floor: Option<String>,
    /// Where it lies in another map.
    parent: Option<Parent>,
}

/// What changes. A field that is absent stays, one that is null is forgotten.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(clippy::option_option, reason = "absent and null differ in a PATCH")]
struct Changes {
    /// Where it belongs.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<String>)]
    site: Option<Option<String>>,
    /// Where it belongs.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<String>)]
    building: Option<Option<String>>,
    /// Where it belongs.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<String>)]
    floor: Option<Option<String>>,
    /// Where it lies in another map.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<Parent>)]
    parent: Option<Option<Parent>>,
}

/// Longest word for a site, a building or a floor.
const MAX_WORD: usize = 64;

/// A word for people: something to read, on one line.
fn word(field: &'static str, text: Option<String>) -> Result<Option<String>, ApiError> {
    let Some(text) = text else { return Ok(None) };
    let fits = (1..=MAX_WORD).contains(&text.chars().count()) && !text.chars().any(char::is_control);
    if fits && !text.trim().is_empty() {
        Ok(Some(text))
    } else {
        Err(ApiError::invalid("out_of_range", field, format!("1 to {MAX_WORD} characters on one line")))
    }
}

/// The field of a parent that does not exist is not the map of the path.
fn unknown_parent(error: ApiError) -> ApiError {
    if error.code == "unknown_map" { error.field("parent.map") } else { error }
}

/// Creates an empty map.
#[utoipa::path(post, path = "/maps", tag = "maps", request_body = NewMap, responses(
    (status = 201, body = Map), (status = 404, body = Problem, description = "unknown_map: the parent"),
    (status = 409, body = Problem, description = "exists, too_many, too_deep"),
    (status = 422, body = Problem, description = "bad_name, bad_value, out_of_range")))]
async fn create(
    State(app): State<Shared>,
    Body(new): Body<NewMap>,
) -> Result<(StatusCode, Json<Map>), ApiError> {
    let (name, distance, max) = (name("name", new.name)?, new.distance.into(), app.config.limits.maps);
    let found = Whereabouts {
        site: word("site", new.site)?,
        building: word("building", new.building)?,
        floor: word("floor", new.floor)?,
        link: new.parent.map(Parent::link).transpose()?,
    };
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            let row = maps::create(tx, name.as_str(), distance, max).await?;
            let found = sites::set(tx, name.as_str(), |_| found).await?;
            Ok((row, found))
        })
    });
    let (row, found) = write.await.map_err(|e| unknown_parent(e.into()))?;
    Ok((StatusCode::CREATED, Json(Map::new(row, found))))
}

/// Lists maps by name.
#[utoipa::path(get, path = "/maps", tag = "maps", params(PageQuery), responses((status = 200, body = Page<Map>)))]
async fn list(
    State(app): State<Shared>,
    Params(page): Params<PageQuery>,
) -> Result<Json<Page<Map>>, ApiError> {
    let limit = page.limit(app.config.limits.page)?;
    let rows = maps::page(app.store.reads(), &page.after(), limit + 1).await?;
    let known = sites::all(app.store.reads()).await?;
    let found = |name: &str| known.get(name).cloned().unwrap_or_default();
    Ok(Json(Page::new(
        rows,
        limit,
        |r| r.name.clone(),
        |r| {
            let found = found(&r.name);
            Map::new(r, found)
        },
    )))
}

/// One map.
#[utoipa::path(get, path = "/maps/{map}", tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, body = Map), (status = 404, body = Problem)))]
async fn get(State(app): State<Shared>, At(map): At<String>) -> Result<Json<Map>, ApiError> {
    let row = maps::get(app.store.reads(), &map).await?;
    let found = sites::all(app.store.reads()).await?.remove(&map).unwrap_or_default();
    Ok(Json(Map::new(row, found)))
}

/// Says where a map is.
#[utoipa::path(patch, path = "/maps/{map}", tag = "maps", params(("map" = String, Path)), request_body = Changes,
    responses((status = 200, body = Map), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "cycle: it would lie in itself; too_deep"),
    (status = 422, body = Problem, description = "out_of_range, bad_value")))]
async fn patch(
    State(app): State<Shared>,
    At(map): At<String>,
    Body(changes): Body<Changes>,
) -> Result<Json<Map>, ApiError> {
    let changed = |field, given: Option<Option<String>>| given.map(|text| word(field, text)).transpose();
    let (site, building) = (changed("site", changes.site)?, changed("building", changes.building)?);
    let floor = changed("floor", changes.floor)?;
    let link = changes.parent.map(|parent| parent.map(Parent::link).transpose()).transpose()?;
    maps::get(app.store.reads(), &map).await?;
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            let found = sites::set(tx, &map, |old| Whereabouts {
                site: site.unwrap_or(old.site),
                building: building.unwrap_or(old.building),
                floor: floor.unwrap_or(old.floor),
                link: link.unwrap_or(old.link),
            })
            .await?;
            Ok((maps::of(tx, &map).await?, found))
        })
    });
    let (row, found) = write.await.map_err(|e| unknown_parent(e.into()))?;
    Ok(Json(Map::new(row, found)))
}

/// Deletes a map and all that is in it.
#[utoipa::path(delete, path = "/maps/{map}", tag = "maps", params(("map" = String, Path)), responses(
    (status = 204), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "in_use: a robot stands on it, or another map lies in it")))]
async fn delete(State(app): State<Shared>, At(map): At<String>) -> Result<StatusCode, ApiError> {
    app.store.write(move |tx| Box::pin(async move { maps::delete(tx, &map).await })).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Into which map, and perhaps a pose to say there.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct Wanted {
    /// Name of the other map.
    to: String,
    /// A pose in the first map, all three numbers or none.
    x_m: Option<f64>,
    /// Of the pose.
    y_m: Option<f64>,
    /// Of the pose.
    theta_rad: Option<f64>,
}

/// A pose with its covariance over (x, y, theta), row-major.
#[derive(Debug, Serialize, ToSchema)]
struct Laid {
    x_m: f64,
    y_m: f64,
    theta_rad: f64,
    covariance: [f64; 9],
}

impl From<&Pose2Covariance> for Laid {
    fn from(p: &Pose2Covariance) -> Self {
        let covariance = row_major(&p.covariance);
        Self { x_m: p.pose.x_m, y_m: p.pose.y_m, theta_rad: p.pose.theta_rad, covariance }
    }
}

/// How one map lies in another.
#[derive(Debug, Serialize, ToSchema)]
struct Transform {
    /// The maps on the way, both ends included.
    via: Vec<String>,
    /// Maps coordinates of the first to the other.
    to_from_map: Laid,
    /// Height of the first one's floor above the other's.
    level_m: f64,
    /// The pose that was asked for, in the other map; its covariance is that of the maps alone.
    pose: Option<Laid>,
}

/// How a map lies in another, by the links of both up to a map that both hang on; and a pose in that other map's frame.
#[utoipa::path(get, path = "/maps/{map}/transform", tag = "maps", params(("map" = String, Path), Wanted),
    responses((status = 200, body = Transform), (status = 400, body = Problem, description = "bad_query"),
    (status = 404, body = Problem), (status = 409, body = Problem, description = "not_related"),
    (status = 422, body = Problem, description = "missing, out_of_range")))]
async fn transform(
    State(app): State<Shared>,
    At(map): At<String>,
    Params(query): Params<Wanted>,
) -> Result<Json<Transform>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    maps::get(app.store.reads(), &query.to).await.map_err(|e| ApiError::from(e).field("to"))?;
    let links: std::collections::BTreeMap<String, MapLink<String>> =
        sites::links(&sites::all(app.store.reads()).await?);
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
    Ok(Json(Transform {
        via: found.via,
        to_from_map: (&found.to_from_map).into(),
        level_m: found.level_m,
        pose: pose.as_ref().map(Laid::from),
    }))
}
