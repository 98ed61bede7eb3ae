//! `/robots/{robot}/cameras`: what is known of a robot's cameras, and their calibration from views of landmarks.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, Body},
};
use crate::{
    calibrating::{CORNER_SIGMA_PX, Knowledge, Report, calibrated},
    store::robots,
};
use axum::{Json, extract::State, http::StatusCode};
use engine::cameras::CameraState;
use map::localise::intrinsics_monitor::IntrinsicsMonitorState;
use protos::{convert::geometry::intrinsics_wire, v1};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::{camera_calibration::PlanarView, geometry::Corners, pose::LandmarkSize};

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(calibrate))
}

/// A camera of a robot, since the server started.
#[derive(Debug, Serialize, ToSchema)]
struct Camera {
    /// Its name.
    name: String,
    /// As its frames say.
    #[schema(value_type = Object)]
    intrinsics: v1::Intrinsics,
    /// Of its frames.
    width_px: u32,
    /// Of its frames.
    height_px: u32,
    /// Frames with these intrinsics in which a landmark was recognised.
    frames: u64,
    /// Views of landmarks from different sides that are kept for calibration.
    views: usize,
    /// What the residuals of its fixes say: `suspicion` is set when the intrinsics seem off, with the reason and its number.
    #[schema(value_type = Object)]
    watch: IntrinsicsMonitorState,
}

impl From<(String, CameraState)> for Camera {
    fn from((name, state): (String, CameraState)) -> Self {
        Self {
            name,
            intrinsics: intrinsics_wire(&state.intrinsics),
            width_px: state.image_px[0],
            height_px: state.image_px[1],
            frames: state.frames,
            views: state.views,
            watch: state.watch,
        }
    }
}

/// A robot's cameras.
#[derive(Debug, Serialize, ToSchema)]
struct Cameras {
    /// By name.
    cameras: Vec<Camera>,
}

/// Lists the cameras of a robot in whose frames landmarks of known size were recognised.
#[utoipa::path(get, path = "/robots/{robot}/cameras", tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = Cameras), (status = 404, body = Problem)))]
async fn list(State(app): State<Shared>, At(robot): At<String>) -> Result<Json<Cameras>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let cameras = app.live.watched().of_robot(&robot).into_iter().map(Camera::from).collect();
    Ok(Json(Cameras { cameras }))
}

/// One uploaded view.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct GivenView {
    /// Top-left, top-right, bottom-right, bottom-left, in pixels as seen.
    corners: [[f64; 2]; 4],
}

/// Views of one flat thing.
#[derive(Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct Given {
    /// Of the images.
    width_px: u32,
    /// Of the images.
    height_px: u32,
    /// Of the thing; only its ratio matters for the camera.
    size_width_m: f64,
    /// See `size_width_m`.
    size_height_m: f64,
    /// At least two, better five to ten, from at least three sides that differ by more than 15 degrees.
    views: Vec<GivenView>,
}

/// What to calibrate from.
#[derive(Debug, Default, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
struct Request {
    /// Views of one thing; without them, the views that were kept of this camera's frames.
    given: Option<Given>,
    /// What is known beside the views.
    known: Knowledge,
}

/// Calibrates a camera, from uploaded corners or from the views of landmarks kept of its own frames. Nothing is changed:
/// a robot sends its intrinsics with its frames.
#[utoipa::path(post, path = "/robots/{robot}/cameras/{camera}/calibrate", tag = "robots",
    params(("robot" = String, Path), ("camera" = String, Path)), request_body = Request,
    responses((status = 200, body = Report), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "not_determined: too few views, too few orientations, or views that do not fit"),
    (status = 422, body = Problem, description = "bad_value, out_of_range")))]
async fn calibrate(
    State(app): State<Shared>,
    At((robot, camera)): At<(String, String)>,
    asked: Option<Body<Request>>,
) -> Result<Json<Report>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let Request { given, known } = asked.map_or_else(Request::default, |Body(request)| request);
    if usize::from(known.radial) > vision::camera_calibration::MAX_RADIAL {
        return Err(ApiError::invalid("out_of_range", "known.radial", "0 to 2 coefficients can be fitted"));
    }
    let (views, image_px) = match given {
        Some(given) => uploaded(&given)?,
        None => app.live.watched().views(&robot, &camera).ok_or_else(|| {
            let detail = "no frame of this camera showed a landmark of known size yet";
            ApiError::new(StatusCode::NOT_FOUND, "unknown_camera", detail).field("camera")
        })?,
    };
    let size = image_px.map(|s| s as usize);
    let made = app.clone().on_vision_thread(move |_| calibrated(&views, size, &known)).await?;
    made.map(Json).map_err(|error| {
        ApiError::new(StatusCode::CONFLICT, "not_determined", error.to_string()).field("views")
    })
}

fn uploaded(given: &Given) -> Result<(Vec<PlanarView>, [u32; 2]), ApiError> {
    let size = LandmarkSize { width_m: given.size_width_m, height_m: given.size_height_m };
    for (field, value) in [("given.size_width_m", size.width_m), ("given.size_height_m", size.height_m)] {
        if !(LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(&value) {
            return Err(ApiError::invalid("out_of_range", field, format!("{value} is not a side in metres")));
        }
    }
    let covariance = [nalgebra::Matrix2::identity() * CORNER_SIGMA_PX.powi(2); 4];
    let mut views = vec![];
    for (i, view) in given.views.iter().enumerate() {
        let corners = Corners::try_from(view.corners).map_err(|e| {
            ApiError::invalid("bad_value", format!("given.views[{i}].corners"), e.to_string())
        })?;
        views.push(PlanarView::of_quad(&corners, &covariance, size));
    }
    Ok((views, [given.width_px, given.height_px]))
}
