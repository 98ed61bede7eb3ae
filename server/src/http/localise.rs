//! `/maps/{map}/localise`: one frame, one scan or both; poses with covariance, or none.

use super::{
    AppState,
    error::ApiError,
    extract::{PathParams, json, too_large},
    photograph_camera::PhotographCamera,
    upload::{FORM_OVERHEAD, Form},
};
use crate::{
    localise_body::localise_body,
    store::{StoreError, kind::Kind},
};
use axum::{
    Json,
    extract::{DefaultBodyLimit, Request, State},
};
use engine::{
    localise::{LocaliseFrame, LocaliseInput, localise},
    picture,
};
use map::{extrinsics::CameraExtrinsics, laser::Scan};
use protos::{
    api::{LocaliseForm, LocaliseResult, Problem, ScanBody},
    convert::{geometry, localise::MAX_LOCALISE_MS, motion::CheckedScan},
    v1,
};
use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router(upload_bytes: usize) -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(at)).layer(DefaultBodyLimit::max(upload_bytes + FORM_OVERHEAD))
}

/// Set when the request is given up: its handler is dropped.
struct GivenUp(Arc<AtomicBool>);

impl Drop for GivenUp {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// What a form holds, checked.
struct Sensed {
    frame: Option<(axum::body::Bytes, PhotographCamera, CameraExtrinsics)>,
    scan: Option<Scan>,
}

/// Finds where a robot is by one picture, one laser scan or both, without knowing anything of it
/// before. A picture needs the camera's intrinsics and its mounting. "No match" is an answer, with
/// its reason; nothing is stored and no robot's pose changes. A scan alone is searched for in the
/// whole map, for at most 10 s.
#[utoipa::path(post, path = "/maps/{map}/localise", operation_id = "localiseRobot",
    tag = "recognition", params(("map" = String, Path)),
    request_body(content = LocaliseForm, content_type = "multipart/form-data"),
    responses((status = 200, body = LocaliseResult), (status = 404, body = Problem), (status = 413, body = Problem),
    (status = 422, body = Problem, description = "missing, bad_image, wrong_encoding, too_large, out_of_range, not_finite, \
     invalid_value, size_mismatch")))]
async fn at(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    request: Request,
) -> Result<Json<LocaliseResult>, ApiError> {
    let snapshot = app.store.snapshots().get(&map);
    let snapshot = snapshot.ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: map })?;
    let mut form = Form::read(&app, request, &["image", "intrinsics", "mounting", "scan"]).await?;
    let sensed = sensed(&mut form, app.config.limits.json_bytes)?;
    let stopped = Arc::new(AtomicBool::new(false));
    let _given_up = GivenUp(stopped.clone());
    let found = app.on_vision_thread(move |app| {
        let frame = sensed.frame.as_ref().map(|(bytes, camera, extrinsics)| {
            let picture = picture::decode(bytes, app.config.limits.upload())?;
            let camera = camera.of_picture([picture.width(), picture.height()])?;
            Ok::<_, ApiError>((picture, camera, extrinsics))
        });
        let frame = frame.transpose()?;
        let frame = frame.as_ref().map(|(picture, camera, extrinsics)| {
            let picture = picture.into();
            LocaliseFrame { picture, camera, extrinsics }
        });
        let input = LocaliseInput { map: &snapshot, frame, scan: sensed.scan.as_ref() };
        // It ends as soon as the client has gone, too.
        let until = Instant::now() + Duration::from_millis(u64::from(MAX_LOCALISE_MS));
        let stop = || stopped.load(Ordering::Relaxed) || Instant::now() >= until;
        Ok(localise_body(localise(&input, &stop), &snapshot))
    });
    found.await?.map(Json)
}

/// The parts of the form.
fn sensed(form: &mut Form, max_scan_bytes: usize) -> Result<Sensed, ApiError> {
    let text = form.optional("scan");
    if text.as_ref().is_some_and(|text| text.len() > max_scan_bytes) {
        return Err(too_large(max_scan_bytes));
    }
    let scan = text.map(|text| scan(&text)).transpose()?;
    let Some(image) = form.optional("image") else {
        if scan.is_none() {
            return Err(ApiError::invalid("missing", "image", "a picture or a scan is needed, or both"));
        }
        if let Some(part) = ["intrinsics", "mounting"].into_iter().find(|part| form.optional(part).is_some())
        {
            return Err(ApiError::invalid("missing", "image", format!("`{part}` is of a picture")));
        }
        return Ok(Sensed { frame: None, scan });
    };
    let intrinsics = PhotographCamera::read(&form.needed("intrinsics")?)?;
    let wire: v1::Pose3 = json(&form.needed("mounting")?, "mounting")?;
    let mounting = geometry::mounting(&wire).map_err(|r| r.inside("mounting"))?;
    Ok(Sensed { frame: Some((image, intrinsics, mounting)), scan })
}

fn scan(text: &[u8]) -> Result<Scan, ApiError> {
    let body: ScanBody = json(text, "scan")?;
    let message = v1::Scan {
        odom_from_robot: Some(v1::Pose2::default()),
        robot_from_laser: Some(body.robot_from_laser),
        first_bearing_rad: body.first_bearing_rad,
        bearing_step_rad: body.bearing_step_rad,
        max_range_m: body.max_range_m,
        ranges_m: body.ranges_m.into_iter().map(|range| range.unwrap_or(f32::NAN)).collect(),
        ..v1::Scan::default()
    };
    Ok(CheckedScan::try_from(message).map_err(|r| r.inside("scan"))?.scan)
}
