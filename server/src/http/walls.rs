//! `/maps/{map}/walls`: the walls, replaced and read as a whole.

use super::{
    AppState,
    error::{ApiError, out_of_range},
    extract::{Body, PathParams},
    revision::{IfMatch, Revised},
};
use crate::store::{
    maps,
    revisions::{self, Subject},
    walls::{self, StoredWall},
};
use axum::extract::State;
use protos::api::{Problem, WallBody, WallsBody};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(put, get))
}

/// Checks the ends of a wall and its covariance.
fn checked(index: usize, WallBody { a, b, covariance }: &WallBody) -> Result<StoredWall, ApiError> {
    let wall = StoredWall { ends: [a[0], a[1], b[0], b[1]], covariance: *covariance };
    wall.segment().map(|_| wall).map_err(|e| out_of_range(&e, &format!("segments[{index}]")))
}

fn shown(StoredWall { ends: [ax, ay, bx, by], covariance }: StoredWall) -> WallBody {
    WallBody { a: [ax, ay], b: [bx, by], covariance }
}

/// Replaces the walls.
#[utoipa::path(put, path = "/maps/{map}/walls", operation_id = "setWalls",
    tag = "maps", params(("map" = String, Path)), request_body = WallsBody,
    responses((status = 200, body = WallsBody), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, too_many")))]
async fn put(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    IfMatch(is): IfMatch,
    Body(walls): Body<WallsBody>,
) -> Result<Revised<WallsBody>, ApiError> {
    let max = app.config.limits.laser_segments;
    if walls.segments.len() > max {
        return Err(ApiError::invalid("too_many", "segments", format!("more than {max} segments")));
    }
    let checked =
        walls.segments.iter().enumerate().map(|(i, s)| checked(i, s)).collect::<Result<Vec<_>, _>>()?;
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Walls, &is).await?;
            walls::replace(tx, &map, &checked).await?;
            revisions::after(tx, &map, &Subject::Walls).await
        })
    });
    Ok(Revised(write.await?, walls))
}

/// The walls.
#[utoipa::path(get, path = "/maps/{map}/walls", operation_id = "getWalls",
    tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, body = WallsBody), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
) -> Result<Revised<WallsBody>, ApiError> {
    let revision = app.store.revision(&map, &Subject::Walls).await?;
    let map = maps::get(app.store.reads(), &map).await?;
    let stored = walls::all_of(app.store.reads(), map.id).await?;
    Ok(Revised(revision, WallsBody { segments: stored.into_iter().map(shown).collect() }))
}
