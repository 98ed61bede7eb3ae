//! `/maps/{map}/walls`: the walls, replaced and read as a whole; and those of a file, before any is
//! stored.

use super::{
    AppState,
    error::{ApiError, out_of_range},
    extract::{Body, PathParams, QueryParams, too_large},
    revision::{IfMatch, Revised},
};
use crate::store::{
    maps,
    revisions::{self, Subject},
    walls::{self, StoredWall},
};
use axum::{
    Json,
    extract::{Request, State},
};
use formats::walls::{ImportOptions, Imported, import_bytes};
use protos::api::{FileWalls, Problem, WallBody, WallFileQuery, WallsBody};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(put, get)).routes(routes!(read))
}

/// Checks the ends of a wall and its covariance.
fn checked(index: usize, WallBody { a, b, covariance }: &WallBody) -> Result<StoredWall, ApiError> {
    let wall = StoredWall { ends: [a[0], a[1], b[0], b[1]], covariance: *covariance };
    wall.segment().map(|_| wall).map_err(|e| out_of_range(&e, &format!("segments[{index}]")))
}

pub(super) fn shown(StoredWall { ends: [ax, ay, bx, by], covariance }: StoredWall) -> WallBody {
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

/// Reads the walls of another program's file, and stores nothing: to be looked at before they
/// replace any.
#[utoipa::path(post, path = "/maps/{map}/walls/read", operation_id = "readWallFile",
    tag = "maps", params(("map" = String, Path), WallFileQuery),
    request_body(content = Vec<u8>, content_type = "application/octet-stream"),
    responses((status = 200, body = FileWalls), (status = 404, body = Problem), (status = 413, body = Problem),
    (status = 422, body = Problem, description = "bad_walls: what is wrong with the file; out_of_range, too_many")))]
async fn read(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(query): QueryParams<WallFileQuery>,
    request: Request,
) -> Result<Json<FileWalls>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    if query.metres_per_unit.is_some_and(|scale| !(scale.is_finite() && scale > 0.0)) {
        return Err(ApiError::invalid("out_of_range", "metres_per_unit", "it must be above 0"));
    }
    let (bytes_max, walls_max) = (app.config.limits.upload_bytes, app.config.limits.laser_segments);
    let body = axum::body::to_bytes(request.into_body(), bytes_max).await;
    let bytes = body.map_err(|_too_long| too_large(bytes_max))?;
    let options = ImportOptions { metres_per_unit: query.metres_per_unit, ..ImportOptions::default() };
    let imported = app.on_vision_thread(move |_| import_bytes(&query.kind, &bytes, &options)).await?;
    let imported = imported.map_err(|e| ApiError::invalid("bad_walls", "body", e.to_string()))?;
    let found = imported.map.segments.len();
    if found > walls_max {
        let detail = format!("it has {found} walls, a map at most {walls_max} (`limits.laser_segments`)");
        return Err(ApiError::invalid("too_many", "body", detail));
    }
    Ok(Json(of_file(imported)))
}

fn of_file(Imported { map, report, .. }: Imported) -> FileWalls {
    let wall =
        |s: &formats::walls::Wall| WallBody { a: s.a, b: s.b, covariance: s.covariance_about_middle() };
    FileWalls {
        segments: map.segments.iter().map(wall).collect(),
        length_m: report.length_m,
        note: report.note,
    }
}
