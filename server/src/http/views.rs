//! `/maps/{map}/landmarks/{landmark}/views`: photographs to learn from, each with the corners of the landmark.

use super::{
    App, Shared,
    error::{ApiError, Problem},
    extract::{self, At, Page, PageQuery, Params},
    upload::{FORM_OVERHEAD, Form},
};
use crate::store::{
    landmarks, maps,
    placing::{Capture, Placing},
    teaching::{self, Teaching},
    views::{self, Cut, NewView, Outcome, ViewRow},
};
use axum::{
    Json,
    body::Bytes,
    extract::{DefaultBodyLimit, Request, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use engine::{
    dominant::{Whole, dominant, others, whole_quads},
    picture,
};
use serde::Serialize;
use serde_json::json;
use sha2::{Digest, Sha256};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::{
    frame::GrayImage,
    geometry::Corners,
    icon::{Icon, IconError, icon},
    learn::near_duplicates::NoveltyParams,
    params::Params as Algorithm,
};

pub(super) fn router(upload_bytes: usize) -> OpenApiRouter<Shared> {
    OpenApiRouter::new()
        .routes(routes!(add))
        .layer(DefaultBodyLimit::max(upload_bytes + FORM_OVERHEAD))
        .routes(routes!(list))
        .routes(routes!(delete))
        .routes(routes!(show_icon))
}

/// A stored view.
#[derive(Debug, Clone, Serialize, ToSchema)]
struct View {
    /// Its number.
    id: i64,
    /// The landmark's corners in the picture: top-left, top-right, bottom-right, bottom-left, in pixels.
    corners: [[f64; 2]; 4],
    /// Of the picture, as a viewer shows it.
    width_px: u32,
    /// Of the picture.
    height_px: u32,
    /// `png` or `jpeg`.
    image_kind: String,
    /// ms since the Unix epoch.
    created_ms: i64,
    /// In the answer to an upload: what became of it. With `same` and `alike` the view given is the one that is there.
    #[serde(skip_serializing_if = "Option::is_none")]
    outcome: Option<Outcome>,
    /// In the answer to an upload with `capture`: whether the landmark has a place by its views now, or why not.
    #[serde(skip_serializing_if = "Option::is_none")]
    placing: Option<Placing>,
}

impl From<ViewRow> for View {
    fn from(row: ViewRow) -> Self {
        Self {
            id: row.id,
            corners: row.corners_px,
            width_px: row.size_px[0],
            height_px: row.size_px[1],
            image_kind: row.image_kind,
            created_ms: row.created_ms,
            outcome: None,
            placing: None,
        }
    }
}

/// The form of an upload, for the documentation.
#[derive(ToSchema)]
#[expect(dead_code, reason = "read part by part; this only describes it")]
struct NewViewForm {
    /// PNG or JPEG.
    #[schema(value_type = String, format = Binary)]
    image: Vec<u8>,
    /// JSON, `[[x,y],[x,y],[x,y],[x,y]]`: top-left, top-right, bottom-right, bottom-left, in pixels.
    corners: Option<String>,
    /// `true`: the picture shows the landmark and nothing else.
    whole_image: Option<String>,
    /// JSON, how it was taken: `intrinsics`, `map_from_robot` (pose with covariance), `robot_from_camera`, and
    /// `ceiling_height_m` for a landmark under a ceiling; also `corner_covariance_px2`, `[[uu,uv,vv], ...]` of the four
    /// corners, where their noise is known (else 1 px, or the detector's where the server finds them). With it the server places the landmark on the map's walls
    /// itself, unless it was placed by hand.
    capture: Option<String>,
    /// `true`: stored even if a stored view shows it from the same side, as large and in the same light.
    keep_alike: Option<String>,
}

/// What the form says of the landmark's place in the picture.
enum Extent {
    Detect,
    Whole,
    Corners(Corners),
}

/// Adds a view. Without corners the server looks for the landmark itself and takes the one dominant quad; if there is
/// none or more than one, the refusal lists what it saw. The same picture with the same corners a second time is
/// answered with 200 and the view that is there; so is a near-duplicate of a view, which is not stored, as it would teach
/// nothing (`outcome` says which).
#[utoipa::path(post, path = "/maps/{map}/landmarks/{landmark}/views", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    request_body(content = NewViewForm, content_type = "multipart/form-data"),
    responses((status = 201, body = View), (status = 200, body = View), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "too_many"), (status = 413, body = Problem),
    (status = 422, body = Problem, description = "bad_image, too_large, bad_value, too_small, outside, \
     quad_not_found, quad_ambiguous")))]
async fn add(
    State(app): State<Shared>,
    At((map, landmark)): At<(String, String)>,
    request: Request,
) -> Result<(StatusCode, Json<View>), ApiError> {
    landmarks::get(app.store.reads(), &map, &landmark).await?;
    let mut form =
        Form::read(&app, request, &["image", "corners", "whole_image", "capture", "keep_alike"]).await?;
    let image = form.needed("image")?;
    let extent = extent(form.optional("corners").as_ref(), form.optional("whole_image").as_ref())?;
    let mut capture = capture(form.optional("capture").as_ref())?;
    let thinning = (!flag("keep_alike", form.optional("keep_alike").as_ref())?).then(NoveltyParams::default);
    let max = app.config.limits.views;
    let (new, detected) = app.clone().on_vision_thread(move |app| prepare(app, &image, &extent)).await??;
    if let (Some(capture), Some(quad)) = (&mut capture, detected) {
        capture.corners_by_detector(&quad.covariance_px2);
    }
    let capture =
        capture.map(|c| serde_json::to_string(&c)).transpose().map_err(|e| ApiError::internal(&e))?;
    let teaching = Teaching { map, landmark, view: NewView { capture, ..new }, max, thinning };
    let (row, outcome, placing) = teaching::add(&app.store, teaching).await?;
    let view = View { placing, outcome: Some(outcome), ..View::from(row) };
    let status = if outcome == Outcome::New { StatusCode::CREATED } else { StatusCode::OK };
    Ok((status, Json(view)))
}

/// How the picture was taken, checked.
fn capture(bytes: Option<&Bytes>) -> Result<Option<Capture>, ApiError> {
    let Some(bytes) = bytes else { return Ok(None) };
    let capture: Capture = extract::json(bytes, "capture")?;
    capture.check().map_err(|r| r.inside("capture"))?;
    Ok(Some(capture))
}

/// A part that is `true`, `false` or absent.
fn flag(name: &'static str, part: Option<&Bytes>) -> Result<bool, ApiError> {
    match part.map(|b| &b[..]) {
        None | Some(b"false") => Ok(false),
        Some(b"true") => Ok(true),
        Some(_) => Err(ApiError::invalid("bad_value", name, "neither `true` nor `false`")),
    }
}

fn extent(corners: Option<&Bytes>, whole_image: Option<&Bytes>) -> Result<Extent, ApiError> {
    let whole = flag("whole_image", whole_image)?;
    match (corners, whole) {
        (Some(_), true) => Err(ApiError::invalid("bad_value", "whole_image", "not together with corners")),
        (Some(corners), false) => Ok(Extent::Corners(extract::json(corners, "corners")?)),
        (None, true) => Ok(Extent::Whole),
        (None, false) => Ok(Extent::Detect),
    }
}

/// Other quads of one picture that are kept as strangers.
const MAX_STRANGERS: usize = 20;

/// The view, and the quad that was taken for it where nobody said.
fn prepare(app: &App, bytes: &Bytes, extent: &Extent) -> Result<(NewView, Option<Whole>), ApiError> {
    let image = picture::decode(bytes, app.config.limits.upload())?;
    let p = &app.config.params;
    let quads = if matches!(extent, Extent::Whole) { Vec::new() } else { whole_quads(&image, p) };
    let corners: Vec<Corners> = quads.iter().map(|q| q.corners_px).collect();
    let corners_px = match extent {
        Extent::Corners(corners) => *corners,
        Extent::Whole => whole(&image)?,
        Extent::Detect => found(&corners)?,
    };
    let meant = |q: &&Whole| matches!(extent, Extent::Detect) && q.corners_px == corners_px;
    let detected = quads.iter().find(meant).copied();
    let icon = cut(&image, &corners_px, p)?;
    let stranger =
        |corners: &Corners| Some(Cut { corners_px: *corners, icon: icon_of(&image, corners, p).ok()? });
    let view = NewView {
        image: bytes.to_vec(),
        image_sha256: Sha256::digest(bytes).into(),
        image_kind: picture::kind(bytes).unwrap_or_default(),
        size_px: [image.width(), image.height()],
        cut: Cut { corners_px, icon },
        strangers: others(&corners, &corners_px).filter_map(stranger).take(MAX_STRANGERS).collect(),
        capture: None,
    };
    Ok((view, detected))
}

/// The quad that is meant, or a refusal that proposes what was seen.
fn found(quads: &[Corners]) -> Result<Corners, ApiError> {
    dominant(quads).copied().ok_or_else(|| {
        let proposed: Vec<[[f64; 2]; 4]> = quads.iter().map(|q| (*q).into()).collect();
        let (code, detail) = if quads.is_empty() {
            ("quad_not_found", "no whole quad was found; give the corners")
        } else {
            ("quad_ambiguous", "more than one quad could be meant; give the corners, perhaps one of `quads`")
        };
        ApiError::invalid(code, "corners", detail).with("quads", json!(proposed))
    })
}

/// The outermost pixel centres.
fn whole(image: &GrayImage) -> Result<Corners, ApiError> {
    let (right, bottom) = (image.width() as f64 - 1.0, image.height() as f64 - 1.0);
    Corners::try_from([[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]])
        .map_err(|e| ApiError::invalid("too_small", "image", e.to_string()))
}

fn icon_of(image: &GrayImage, corners: &Corners, p: &Algorithm) -> Result<Icon, IconError> {
    icon(image, corners, &p.icon)
}

fn cut(image: &GrayImage, corners: &Corners, p: &Algorithm) -> Result<Icon, ApiError> {
    icon_of(image, corners, p).map_err(|error| {
        let code = match error {
            IconError::TooSmall { .. } => "too_small",
            IconError::Outside { .. } => "outside",
            _ => "bad_value",
        };
        ApiError::invalid(code, "corners", error.to_string())
    })
}

/// Lists the views of a landmark by number.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/views", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), PageQuery),
    responses((status = 200, body = Page<View>), (status = 404, body = Problem)))]
async fn list(
    State(app): State<Shared>,
    At((map, landmark)): At<(String, String)>,
    Params(page): Params<PageQuery>,
) -> Result<Json<Page<View>>, ApiError> {
    let limit = page.limit(app.config.limits.page)?;
    let after = page.after_number()?;
    maps::get(app.store.reads(), &map).await?;
    let landmark = landmarks::get(app.store.reads(), &map, &landmark).await?;
    let rows = views::page(app.store.reads(), landmark.id, after, limit + 1).await?;
    Ok(Json(Page::new(rows, limit, |r| r.id.to_string(), View::from)))
}

/// Deletes a view. The model stays until the landmark is learnt again.
#[utoipa::path(delete, path = "/maps/{map}/landmarks/{landmark}/views/{view}", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), ("view" = i64, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn delete(
    State(app): State<Shared>,
    At((map, landmark, view)): At<(String, String, i64)>,
) -> Result<StatusCode, ApiError> {
    app.store
        .write(move |tx| Box::pin(async move { views::delete(tx, &map, &landmark, view).await }))
        .await?;
    Ok(StatusCode::NO_CONTENT)
}

/// The rectified picture that is learnt from, as PNG.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/views/{view}/icon", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), ("view" = i64, Path)),
    responses((status = 200, content_type = "image/png"), (status = 404, body = Problem)))]
async fn show_icon(
    State(app): State<Shared>,
    At((map, landmark, view)): At<(String, String, i64)>,
) -> Result<Response, ApiError> {
    let icon = views::icon(app.store.reads(), &map, &landmark, view).await?;
    let grey: Vec<u8> = icon.pixels.iter().map(|g| *g as u8).collect();
    let png = picture::png(icon.size, icon.size, &grey).map_err(|e| ApiError::internal(&e))?;
    // A view never changes; its number never comes to mean another.
    let headers =
        [(header::CONTENT_TYPE, "image/png"), (header::CACHE_CONTROL, "private, max-age=86400, immutable")];
    Ok((headers, png).into_response())
}
