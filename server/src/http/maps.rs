//! `/maps`: create, list, read, delete.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, Body, Page, PageQuery, Params, name},
    resources::{Distance, Map},
};
use crate::store::maps;
use axum::{Json, extract::State, http::StatusCode};
use serde::Deserialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(create, list)).routes(routes!(get, delete))
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
}

/// Creates an empty map.
#[utoipa::path(post, path = "/maps", tag = "maps", request_body = NewMap, responses(
    (status = 201, body = Map), (status = 409, body = Problem, description = "exists, too_many"),
    (status = 422, body = Problem, description = "bad_name, bad_value")))]
async fn create(
    State(app): State<Shared>,
    Body(new): Body<NewMap>,
) -> Result<(StatusCode, Json<Map>), ApiError> {
    let (name, distance, max) = (name("name", new.name)?, new.distance.into(), app.config.limits.maps);
    let write = app
        .store
        .write(move |tx| Box::pin(async move { maps::create(tx, name.as_str(), distance, max).await }));
    Ok((StatusCode::CREATED, Json(write.await?.into())))
}

/// Lists maps by name.
#[utoipa::path(get, path = "/maps", tag = "maps", params(PageQuery), responses((status = 200, body = Page<Map>)))]
async fn list(
    State(app): State<Shared>,
    Params(page): Params<PageQuery>,
) -> Result<Json<Page<Map>>, ApiError> {
    let limit = page.limit(app.config.limits.page)?;
    let rows = maps::page(app.store.reads(), &page.after(), limit + 1).await?;
    Ok(Json(Page::new(rows, limit, |r| r.name.clone(), Map::from)))
}

/// One map.
#[utoipa::path(get, path = "/maps/{map}", tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, body = Map), (status = 404, body = Problem)))]
async fn get(State(app): State<Shared>, At(map): At<String>) -> Result<Json<Map>, ApiError> {
    Ok(Json(maps::get(app.store.reads(), &map).await?.into()))
}

/// Deletes a map and all that is in it.
#[utoipa::path(delete, path = "/maps/{map}", tag = "maps", params(("map" = String, Path)), responses(
    (status = 204), (status = 404, body = Problem), (status = 409, body = Problem, description = "in_use")))]
async fn delete(State(app): State<Shared>, At(map): At<String>) -> Result<StatusCode, ApiError> {
    app.store.write(move |tx| Box::pin(async move { maps::delete(tx, &map).await })).await?;
    Ok(StatusCode::NO_CONTENT)
}
