//! `/maps/{map}/laser`: the walls, replaced and read as a whole.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, Body},
    resources::wall,
};
use crate::store::{laser, maps};
use axum::{Json, extract::State};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(put, get))
}

/// A straight piece of wall, the free side on the left of a to b.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Segment {
    /// First end: x, y in metres.
    a: [f64; 2],
    /// Second end.
    b: [f64; 2],
}

/// The walls of a map.
#[derive(Debug, Clone, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Walls {
    /// In the order given.
    segments: Vec<Segment>,
}

/// Replaces the walls.
#[utoipa::path(put, path = "/maps/{map}/laser", tag = "maps", params(("map" = String, Path)), request_body = Walls,
    responses((status = 200, body = Walls), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, too_many")))]
async fn put(
    State(app): State<Shared>,
    At(map): At<String>,
    Body(walls): Body<Walls>,
) -> Result<Json<Walls>, ApiError> {
    let max = app.config.limits.laser_segments;
    if walls.segments.len() > max {
        return Err(ApiError::invalid("too_many", "segments", format!("more than {max} segments")));
    }
    let checked =
        walls.segments.iter().enumerate().map(|(i, s)| wall(i, s.a, s.b)).collect::<Result<Vec<_>, _>>()?;
    app.store.write(move |tx| Box::pin(async move { laser::replace(tx, &map, &checked).await })).await?;
    Ok(Json(walls))
}

/// The walls.
#[utoipa::path(get, path = "/maps/{map}/laser", tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, body = Walls), (status = 404, body = Problem)))]
async fn get(State(app): State<Shared>, At(map): At<String>) -> Result<Json<Walls>, ApiError> {
    let map = maps::get(app.store.reads(), &map).await?;
    let ends = laser::all_of(app.store.reads(), map.id).await?;
    let segments = ends.into_iter().map(|[ax, ay, bx, by]| Segment { a: [ax, ay], b: [bx, by] }).collect();
    Ok(Json(Walls { segments }))
}
