//! `/maps/{map}/underlay`: the picture that is shown under a map.

use super::{
    App, AppState,
    error::{ApiError, out_of_range},
    extract::{self, PathParams},
    pictures::{ASK_AGAIN, IfNoneMatch, PictureHead},
    revision::{IfMatch, Revised},
    upload::{FORM_OVERHEAD, Form},
};
use crate::store::{
    maps, pictures,
    revisions::{self, Subject},
    underlays::{self, UnderlayRow},
};
use axum::{
    body::Bytes,
    extract::{DefaultBodyLimit, Request, State},
    http::StatusCode,
    response::Response,
};
use engine::picture;
use map::check::{MAX_COORDINATE_M, OutOfRange};
use protos::api::{Problem, Underlay, UnderlayForm, UnderlayPlace};
use std::f64::consts::TAU;
use utoipa_axum::{router::OpenApiRouter, routes};

/// Side of a pixel, metres.
const METRES_PER_PIXEL: [f64; 2] = [1e-4, 10.0];

pub(super) fn router(upload_bytes: usize) -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(put, get, delete))
        .layer(DefaultBodyLimit::max(upload_bytes + FORM_OVERHEAD))
        .routes(routes!(image))
}

fn shown(row: UnderlayRow) -> Underlay {
    let [x_m, y_m, theta_rad] = row.map_from_picture;
    Underlay {
        place: UnderlayPlace { metres_per_pixel: row.metres_per_pixel, x_m, y_m, theta_rad },
        width_px: row.size_px[0],
        height_px: row.size_px[1],
        image_kind: row.image_kind,
        created_ms: row.created_ms,
    }
}

/// A number of the form within its range.
fn number(part: Option<&Bytes>, field: &'static str, [low, high]: [f64; 2]) -> Result<Option<f64>, ApiError> {
    let Some(part) = part else { return Ok(None) };
    let value = extract::json::<f64>(part, field)?;
    if (low..=high).contains(&value) {
        return Ok(Some(value));
    }
    Err(out_of_range(&OutOfRange { field, value }, "underlay"))
}

/// Replaces the picture under the map. It changes no answer to a robot.
#[utoipa::path(put, path = "/maps/{map}/underlay", operation_id = "setUnderlay",
    tag = "maps", params(("map" = String, Path)),
    request_body(content = UnderlayForm, content_type = "multipart/form-data"),
    responses((status = 200, body = Underlay), (status = 404, body = Problem), (status = 413, body = Problem),
    (status = 422, body = Problem, description = "bad_image, too_large, missing, out_of_range, invalid_value")))]
async fn put(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    IfMatch(is): IfMatch,
    request: Request,
) -> Result<Revised<Underlay>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let mut form =
        Form::read(&app, request, &["image", "metres_per_pixel", "x_m", "y_m", "theta_rad"]).await?;
    let bytes = form.needed("image")?;
    let scale = number(Some(&form.needed("metres_per_pixel")?), "metres_per_pixel", METRES_PER_PIXEL)?;
    let mut coordinate = |field, bound: f64| {
        Ok::<_, ApiError>(number(form.optional(field).as_ref(), field, [-bound, bound])?.unwrap_or(0.0))
    };
    let (x_m, y_m) = (coordinate("x_m", MAX_COORDINATE_M)?, coordinate("y_m", MAX_COORDINATE_M)?);
    let theta_rad = coordinate("theta_rad", TAU)?;
    let (image, size_px) = app.clone().on_vision_thread(move |app: &App| decoded(app, bytes)).await??;
    let row = UnderlayRow {
        image_sha256: pictures::digest(&image),
        image_kind: picture::kind(&image).unwrap_or_default().to_owned(),
        size_px,
        metres_per_pixel: scale.unwrap_or_default(),
        map_from_picture: [x_m, y_m, theta_rad],
        created_ms: 0,
    };
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Underlay, &is).await?;
            let row = underlays::put(tx, &map, row, &image).await?;
            Ok((revisions::after(tx, &map, &Subject::Underlay).await?, row))
        })
    });
    let (revision, row) = write.await?;
    Ok(Revised(revision, shown(row)))
}

/// The picture, if it can be shown, with its size.
fn decoded(app: &App, bytes: Bytes) -> Result<(Bytes, [u32; 2]), ApiError> {
    let upright = picture::decode(&bytes, app.config.limits.upload())?;
    Ok((bytes, [upright.width() as u32, upright.height() as u32]))
}

/// Where the picture under the map lies.
#[utoipa::path(get, path = "/maps/{map}/underlay", operation_id = "getUnderlay",
    tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, body = Underlay), (status = 404, body = Problem, description = "unknown_map, unknown_underlay")))]
async fn get(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
) -> Result<Revised<Underlay>, ApiError> {
    let revision = app.store.revision(&map, &Subject::Underlay).await?;
    let map = maps::get(app.store.reads(), &map).await?;
    Ok(Revised(revision, shown(underlays::get(app.store.reads(), (map.id, &map.name)).await?)))
}

/// Deletes the picture under the map.
#[utoipa::path(delete, path = "/maps/{map}/underlay", operation_id = "deleteUnderlay",
    tag = "maps", params(("map" = String, Path)), responses(
    (status = 204), (status = 404, body = Problem, description = "unknown_map, unknown_underlay")))]
async fn delete(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    IfMatch(is): IfMatch,
) -> Result<StatusCode, ApiError> {
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Underlay, &is).await?;
            underlays::delete(tx, &map).await
        })
    });
    write.await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The picture under the map, as it was uploaded.
#[utoipa::path(get, path = "/maps/{map}/underlay/image", operation_id = "getUnderlayImage",
    tag = "maps", params(("map" = String, Path)), responses(
    (status = 200, content_type = "image/png"), (status = 304, description = "`If-None-Match` has it"),
    (status = 404, body = Problem)))]
async fn image(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    known: IfNoneMatch,
) -> Result<Response, ApiError> {
    let map = maps::get(app.store.reads(), &map).await?;
    let row = underlays::get(app.store.reads(), (map.id, &map.name)).await?;
    let image = async { Ok(pictures::read(&app.store, &row.image_sha256).await?) };
    PictureHead::new(&row.image_kind, &row.image_sha256, ASK_AGAIN).answer(&known, image).await
}
