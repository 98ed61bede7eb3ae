//! `/maps/{map}/landmarks/{landmark}/views`: photographs to learn from, each with the corners of
//! the landmark.

use super::{
    App, AppState,
    answers::{created, page},
    error::ApiError,
    extract::{self, PathParams, QueryParams, number_cursor, page_limit},
    landmark_aspect,
    landmarks::checked_size,
    pictures::{FOREVER, IfNoneMatch, PictureHead, grey_answer},
    refused_views::{self, Refused},
    upload::{FORM_OVERHEAD, Form},
};
use crate::store::{
    StoreError,
    kind::Kind,
    landmark_placement::{PlacementReport, StoredCapture},
    landmarks, maps, pictures,
    refused_views::{RefusedUpload, SmallPicture},
    teaching::{self, Teaching},
    views::{self, NewView, QuadCrop, UploadOutcome, ViewFilter, ViewRow},
};
use axum::{
    Json,
    body::Bytes,
    extract::{DefaultBodyLimit, Request, State},
    http::StatusCode,
    response::Response,
};
use engine::{
    dominant::{WholeQuad, dominant, others, whole_quads},
    picture,
};
use protos::api::{
    CaptureMetadata, LandmarkChange, NewViewForm, NumberOrder, Page, PlacementReportBody, Problem,
    ServerEventBody, Size, TrainingView, UploadOutcomeBody, ViewQuery,
};
use serde_json::json;
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::{
    frame::{GrayImage, Picture},
    geometry::Corners,
    icon::{Icon, IconError, icon},
    learn::{aspect::AspectView, near_duplicates::NoveltyParams},
    params::Params as Algorithm,
    pose::LandmarkSize,
};

pub(super) fn router(upload_bytes: usize) -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(add))
        .layer(DefaultBodyLimit::max(upload_bytes + FORM_OVERHEAD))
        .routes(routes!(list))
        .routes(routes!(delete))
        .routes(routes!(show_icon))
        .routes(routes!(show_image))
}

fn view_shown(row: ViewRow) -> TrainingView {
    TrainingView {
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

fn outcome_shown(outcome: UploadOutcome) -> UploadOutcomeBody {
    match outcome {
        UploadOutcome::New => UploadOutcomeBody::New,
        UploadOutcome::Duplicate => UploadOutcomeBody::Duplicate,
        UploadOutcome::NearDuplicate => UploadOutcomeBody::NearDuplicate,
    }
}

/// What came of placing a landmark by its views.
pub(super) fn placement_shown(
    PlacementReport { placed, views_used, reason }: PlacementReport,
) -> PlacementReportBody {
    PlacementReportBody { placed, views_used, reason }
}

/// The parts of the form.
const PARTS: [&str; 8] =
    ["image", "corners", "whole_image", "capture", "keep_near_duplicate", "create", "width_m", "height_m"];

/// What the form says of the landmark's place in the picture.
enum LandmarkRegion {
    Detect,
    Whole,
    Corners(Corners),
}

/// Adds a view. Without corners the server looks for the landmark itself and takes the one dominant
/// quad; if there is none or more than one, the refusal lists what it saw. The same picture with
/// the same corners a second time is answered with 200 and the view that is there; so is a
/// near-duplicate of a view, which is not stored, as it would teach nothing (`outcome` says which).
/// With `create` the landmark is made, too, if there is none of this name: nothing is made where
/// the view is refused. A size is set where the landmark has none by hand; another one is refused,
/// and so is one whose ratio of sides the photographs contradict.
#[utoipa::path(post, path = "/maps/{map}/landmarks/{landmark}/views", operation_id = "createView", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    request_body(content = NewViewForm, content_type = "multipart/form-data"),
    responses((status = 201, body = TrainingView), (status = 200, body = TrainingView), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "too_many; size_differs, with `stored` and `given`; aspect_differs, \
     with `stated`, `measured_aspect`, `aspect_sigma` and `swapped`"), (status = 413, body = Problem),
    (status = 422, body = Problem, description = "bad_image, too_large, invalid_value, too_small, outside, \
     quad_not_found, quad_ambiguous")))]
async fn add(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    request: Request,
) -> Result<(StatusCode, Json<TrainingView>), ApiError> {
    let exists = match landmarks::get(app.store.reads(), &map, &landmark).await {
        Err(StoreError::NotFound { .. }) => false,
        found => found.map(|_| true)?,
    };
    maps::get(app.store.reads(), &map).await?;
    let mut form = Form::read(&app, request, &PARTS).await?;
    let creates = flag("create", form.optional("create").as_ref())?;
    if !exists && !creates {
        return Err(StoreError::NotFound { what: Kind::Landmark, name: landmark }.into());
    }
    let landmark = if exists { landmark } else { extract::name("landmark", landmark)?.to_string() };
    let size = size(form.optional("width_m").as_ref(), form.optional("height_m").as_ref())?;
    let image = form.needed("image")?;
    let extent = extent(form.optional("corners").as_ref(), form.optional("whole_image").as_ref())?;
    let mut capture = capture(form.optional("capture").as_ref())?;
    let novelty = (!flag("keep_near_duplicate", form.optional("keep_near_duplicate").as_ref())?)
        .then(NoveltyParams::default);
    let max = app.config.limits.views;
    let changed = (map.clone(), landmark.clone());
    let taken = capture.clone();
    let prepare = move |app: &App| prepare(app, &image, &extent, taken.as_ref());
    let prepared = app.clone().on_vision_thread(prepare).await?;
    let (new, detected) = match prepared {
        Ok(prepared) => prepared,
        Err(Refused { error, picture }) => {
            if exists {
                refused_views::keep_refused(&app, changed, &error, picture).await;
            }
            return Err(error);
        }
    };
    let taught = AspectView {
        corners_px: new.crop.corners_px,
        size_px: new.size_px,
        camera: capture.as_ref().and_then(StoredCapture::camera),
    };
    landmark_aspect::check_view(&app, &changed, size, taught).await?;
    if let (Some(capture), Some(quad)) = (&mut capture, detected) {
        capture.set_detected_corners(&quad.covariance_px2);
    }
    let capture =
        capture.map(|c| serde_json::to_string(&c)).transpose().map_err(|e| ApiError::internal(&e))?;
    let create = creates.then_some(app.config.limits.landmarks);
    let view = NewView { capture, ..new };
    let seen = refused_views::of_icon(&view.crop.icon);
    let teaching = Teaching { map, landmark, view, max, novelty, size, create };
    let answer = created(added_shown, teaching::add(&app.store, teaching)).await?;
    let (status, Json(view)) = &answer;
    match view.outcome {
        Some(UploadOutcomeBody::Duplicate) => repeated(&app, changed, "duplicate", (view.id, seen)).await,
        Some(UploadOutcomeBody::NearDuplicate) => {
            repeated(&app, changed, "near_duplicate", (view.id, seen)).await;
        }
        _ if *status == StatusCode::CREATED => tell_changed(&app, changed),
        _ => {}
    }
    Ok(answer)
}

/// Keeps a photograph that repeats a view.
async fn repeated(app: &App, at: (String, String), reason: &'static str, (view, seen): (i64, SmallPicture)) {
    refused_views::keep(app, at, RefusedUpload { reason, view: Some(view), picture: Some(seen) }).await;
}

/// Tells readers of events that the views of a landmark are others: that makes no new version of
/// the map.
fn tell_changed(app: &App, (map, landmark): (String, String)) {
    let change = LandmarkChange::Changed;
    app.store.events().tell(ServerEventBody::LandmarkChanged { map, landmark, change });
}

/// What came of a view.
fn added_shown((row, outcome, placing): &teaching::Added) -> (StatusCode, TrainingView) {
    let view = TrainingView {
        placing: placing.clone().map(placement_shown),
        outcome: Some(outcome_shown(*outcome)),
        ..view_shown(row.clone())
    };
    (if *outcome == UploadOutcome::New { StatusCode::CREATED } else { StatusCode::OK }, view)
}

/// A size by hand, checked. Both sides or none.
fn size(width: Option<&Bytes>, height: Option<&Bytes>) -> Result<Option<LandmarkSize>, ApiError> {
    let side = |part: Option<&Bytes>, name| part.map(|b| extract::json::<f64>(b, name)).transpose();
    match (side(width, "width_m")?, side(height, "height_m")?) {
        (None, None) => Ok(None),
        (Some(width_m), Some(height_m)) => checked_size(Size { width_m, height_m }).map(Some),
        (Some(_), None) => Err(ApiError::invalid("missing", "height_m", "`width_m` needs `height_m`")),
        (None, Some(_)) => Err(ApiError::invalid("missing", "width_m", "`height_m` needs `width_m`")),
    }
}

/// How the picture was taken, checked.
fn capture(bytes: Option<&Bytes>) -> Result<Option<StoredCapture>, ApiError> {
    let Some(bytes) = bytes else { return Ok(None) };
    let capture = StoredCapture::from(extract::json::<CaptureMetadata>(bytes, "capture")?);
    capture.check().map_err(|r| r.inside("capture"))?;
    Ok(Some(capture))
}

/// A part that is `true`, `false` or absent.
fn flag(name: &'static str, part: Option<&Bytes>) -> Result<bool, ApiError> {
    match part.map(|b| &b[..]) {
        None | Some(b"false") => Ok(false),
        Some(b"true") => Ok(true),
        Some(_) => Err(ApiError::invalid("invalid_value", name, "neither `true` nor `false`")),
    }
}

fn extent(corners: Option<&Bytes>, whole_image: Option<&Bytes>) -> Result<LandmarkRegion, ApiError> {
    let whole = flag("whole_image", whole_image)?;
    match (corners, whole) {
        (Some(_), true) => {
            Err(ApiError::invalid("invalid_value", "whole_image", "not together with corners"))
        }
        (Some(corners), false) => Ok(LandmarkRegion::Corners(extract::json(corners, "corners")?)),
        (None, true) => Ok(LandmarkRegion::Whole),
        (None, false) => Ok(LandmarkRegion::Detect),
    }
}

/// Other quads of one picture that are kept as strangers.
const MAX_DISTRACTORS: usize = 20;

/// The view, and the quad that was taken for it where nobody said.
fn prepare(
    app: &App,
    bytes: &Bytes,
    extent: &LandmarkRegion,
    capture: Option<&StoredCapture>,
) -> Result<(NewView, Option<WholeQuad>), Refused> {
    let picture = picture::decode(bytes, app.config.limits.upload()).map_err(ApiError::from)?;
    let small = || Box::new(refused_views::small(picture.grey()));
    let of_photograph = |error| Refused { error, picture: Some(small()) };
    view_of(app, bytes, (&picture, capture), extent).map_err(of_photograph)
}

/// The view of a decoded photograph. The mounting of its camera says which corner of a quad is the
/// top-left one.
fn view_of(
    app: &App,
    bytes: &Bytes,
    (picture, capture): (&Picture, Option<&StoredCapture>),
    extent: &LandmarkRegion,
) -> Result<(NewView, Option<WholeQuad>), ApiError> {
    let (p, image) = (&app.config.params, picture.grey());
    let quads = if matches!(extent, LandmarkRegion::Whole) { Vec::new() } else { whole_quads(picture, p) };
    let upright = |q: WholeQuad| q.rotated(capture.and_then(|c| c.top_left(&q.corners_px)).unwrap_or(0));
    let quads: Vec<WholeQuad> = quads.into_iter().map(upright).collect();
    let corners: Vec<Corners> = quads.iter().map(|q| q.corners_px).collect();
    let corners_px = match extent {
        LandmarkRegion::Corners(corners) => *corners,
        LandmarkRegion::Whole => whole(image)?,
        LandmarkRegion::Detect => found(&corners)?,
    };
    let meant = |q: &&WholeQuad| matches!(extent, LandmarkRegion::Detect) && q.corners_px == corners_px;
    let detected = quads.iter().find(meant).copied();
    let icon = cut(image, &corners_px, p)?;
    let distractor =
        |corners: &Corners| Some(QuadCrop { corners_px: *corners, icon: icon_of(image, corners, p).ok()? });
    let view = NewView {
        image: bytes.to_vec(),
        image_sha256: pictures::digest(bytes),
        image_kind: picture::kind(bytes).unwrap_or_default(),
        size_px: [image.width(), image.height()],
        crop: QuadCrop { corners_px, icon },
        distractors: others(&corners, &corners_px).filter_map(distractor).take(MAX_DISTRACTORS).collect(),
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
            _ => "invalid_value",
        };
        ApiError::invalid(code, "corners", error.to_string())
    })
}

/// Lists the views of a landmark, the oldest or the newest first.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/views", operation_id = "listViews", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), ViewQuery),
    responses((status = 200, body = Page<TrainingView>), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, invalid_value")))]
async fn list(
    State(app): State<AppState>,
    PathParams((map, landmark)): PathParams<(String, String)>,
    QueryParams(query): QueryParams<ViewQuery>,
) -> Result<Json<Page<TrainingView>>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    let last = number_cursor(query.cursor.as_deref())?;
    maps::get(app.store.reads(), &map).await?;
    let landmark = landmarks::get(app.store.reads(), &map, &landmark).await?;
    let ViewQuery { sort, has_capture, since_ms, until_ms, .. } = query;
    let filter = ViewFilter { has_capture, since_ms, until_ms };
    let newest_first = sort == Some(NumberOrder::NumberReversed);
    let rows = views::page(app.store.reads(), landmark.id, filter, (last, newest_first), limit + 1).await?;
    let total = views::count(app.store.reads(), landmark.id, filter).await?;
    Ok(Json(page(rows, limit, total, |r| r.id.to_string(), view_shown)))
}

/// Deletes a view. The model stays until the landmark is learnt again.
#[utoipa::path(delete, path = "/maps/{map}/landmarks/{landmark}/views/{view}", operation_id = "deleteView",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), ("view" = i64, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn delete(
    State(app): State<AppState>,
    PathParams((map, landmark, view)): PathParams<(String, String, i64)>,
) -> Result<StatusCode, ApiError> {
    let changed = (map.clone(), landmark.clone());
    app.store
        .write(move |tx| Box::pin(async move { views::delete(tx, &map, &landmark, view).await }))
        .await?;
    tell_changed(&app, changed);
    Ok(StatusCode::NO_CONTENT)
}

/// The rectified picture that is learnt from, as PNG. `ETag` is the digest of its grey levels.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/views/{view}/icon", operation_id = "getViewIcon",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), ("view" = i64, Path)),
    responses((status = 200, content_type = "image/png"), (status = 304, description = "`If-None-Match` has it"),
    (status = 404, body = Problem)))]
async fn show_icon(
    State(app): State<AppState>,
    PathParams((map, landmark, view)): PathParams<(String, String, i64)>,
    known: IfNoneMatch,
) -> Result<Response, ApiError> {
    let icon = views::icon(app.store.reads(), &map, &landmark, view).await?;
    let grey: Vec<u8> = icon.pixels.iter().map(|g| *g as u8).collect();
    // A view never changes; its number never comes to mean another.
    grey_answer(&known, FOREVER, (icon.size, &grey)).await
}

/// The photograph as it was uploaded, PNG or JPEG. `ETag` is its SHA-256.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}/views/{view}/image", operation_id = "getViewImage",
    tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path), ("view" = i64, Path)),
    responses((status = 200, content_type = "image/jpeg"), (status = 304, description = "`If-None-Match` has it"),
    (status = 404, body = Problem), (status = 500, body = Problem, description = "picture_damaged")))]
async fn show_image(
    State(app): State<AppState>,
    PathParams((map, landmark, view)): PathParams<(String, String, i64)>,
    known: IfNoneMatch,
) -> Result<Response, ApiError> {
    let (sha256, kind) = views::picture(app.store.reads(), &map, &landmark, view).await?;
    let image = async { Ok(pictures::read(&app.store, &sha256).await?) };
    // A view never changes; its number never comes to mean another.
    PictureHead::new(&kind, &sha256, FOREVER).answer(&known, image).await
}
