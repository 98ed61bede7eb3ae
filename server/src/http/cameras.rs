//! `/robots/{robot}/cameras`: what is known of a robot's cameras, and their calibration from views
//! of landmarks.

use super::{
    AppState,
    error::ApiError,
    extract::{Body, PathParams},
};
use crate::{
    calibrating::{CORNER_SIGMA_PX, CalibrationConstraints, calibrated},
    store::robots,
};
use axum::{Json, extract::State, http::StatusCode};
use engine::cameras::CameraState;
use map::localise::{intrinsics_monitor::IntrinsicsMonitorState, intrinsics_monitor::Suspicion};
use protos::{
    api::{
        CalibrationReport, CalibrationRequest, Camera, Cameras, IntrinsicsMonitorBody,
        IntrinsicsSuspicionBody, Problem, UploadedViews,
    },
    convert::geometry::intrinsics_wire,
};
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::{camera_calibration::PlanarView, geometry::Corners, pose::LandmarkSize};

/// Largest height of a camera above or below a landmark that can be said, metres.
const MAX_HEIGHT_M: f64 = 100.0;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(calibrate))
}

fn monitor_shown(state: &IntrinsicsMonitorState) -> IntrinsicsMonitorBody {
    IntrinsicsMonitorBody {
        tries: state.tries,
        refused: state.refused,
        landmarks: state.landmarks,
        reduced_chi2: state.reduced_chi2,
        focal_error: state.focal_error,
        focal_sigma: state.focal_sigma,
        suspicion: state.suspicion.map(|suspicion| match suspicion {
            Suspicion::Focal { error, sigma } => IntrinsicsSuspicionBody::Focal { error, sigma },
            Suspicion::Misfit { reduced_chi2 } => IntrinsicsSuspicionBody::Misfit { reduced_chi2 },
            Suspicion::Refused { share } => IntrinsicsSuspicionBody::Refused { share },
        }),
    }
}

fn camera_shown((name, state): (String, CameraState)) -> Camera {
    Camera {
        name,
        intrinsics: intrinsics_wire(&state.intrinsics),
        width_px: state.image_px[0],
        height_px: state.image_px[1],
        frames: state.frames,
        views: state.views,
        intrinsics_monitor: monitor_shown(&state.monitor),
    }
}

/// Lists the cameras of a robot in whose frames landmarks of known size were recognised.
#[utoipa::path(get, path = "/robots/{robot}/cameras", operation_id = "listCameras",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = Cameras), (status = 404, body = Problem)))]
async fn list(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<Json<Cameras>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let cameras = app.live.camera_registry().of_robot(&robot).into_iter().map(camera_shown).collect();
    Ok(Json(Cameras { cameras }))
}

/// Calibrates a camera, from uploaded corners or from the views of landmarks kept of its own
/// frames. Nothing is changed: a robot sends its intrinsics with its frames.
#[utoipa::path(post, path = "/robots/{robot}/cameras/{camera}/calibrate", operation_id = "calibrateCamera",
    tag = "robots",
    params(("robot" = String, Path), ("camera" = String, Path)), request_body = CalibrationRequest,
    responses((status = 200, body = CalibrationReport), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "not_determined: too few views, too few orientations, or views that do not fit"),
    (status = 422, body = Problem, description = "invalid_value, out_of_range")))]
async fn calibrate(
    State(app): State<AppState>,
    PathParams((robot, camera)): PathParams<(String, String)>,
    asked: Option<Body<CalibrationRequest>>,
) -> Result<Json<CalibrationReport>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let CalibrationRequest { uploaded_views, constraints } =
        asked.map_or_else(CalibrationRequest::default, |Body(request)| request);
    if usize::from(constraints.radial) > vision::camera_calibration::MAX_RADIAL {
        return Err(ApiError::invalid(
            "out_of_range",
            "constraints.radial",
            "0 to 2 coefficients can be fitted",
        ));
    }
    if constraints.height_m.is_some_and(|height_m| height_m.is_nan() || height_m.abs() > MAX_HEIGHT_M) {
        let detail = format!("a camera is at most {MAX_HEIGHT_M} m above or below a landmark");
        return Err(ApiError::invalid("out_of_range", "constraints.height_m", detail));
    }
    let (views, image_px) = match uploaded_views {
        Some(given) => uploaded(&given)?,
        None => app.live.camera_registry().views(&robot, &camera).ok_or_else(|| {
            let detail = "no frame of this camera showed a landmark of known size yet";
            ApiError::new(StatusCode::NOT_FOUND, "unknown_camera", detail).field("camera")
        })?,
    };
    let known = CalibrationConstraints::from(constraints);
    let size = image_px.map(|s| s as usize);
    let made = app.clone().on_vision_thread(move |_| calibrated(&views, size, &known)).await?;
    made.map(Json).map_err(|error| {
        ApiError::new(StatusCode::CONFLICT, "not_determined", error.to_string()).field("views")
    })
}

fn uploaded(given: &UploadedViews) -> Result<(Vec<PlanarView>, [u32; 2]), ApiError> {
    let size = LandmarkSize { width_m: given.size_width_m, height_m: given.size_height_m };
    for (field, value) in
        [("uploaded_views.size_width_m", size.width_m), ("uploaded_views.size_height_m", size.height_m)]
    {
        if !(LandmarkSize::MIN_M..=LandmarkSize::MAX_M).contains(&value) {
            return Err(ApiError::invalid("out_of_range", field, format!("{value} is not a side in metres")));
        }
    }
    let covariance = [nalgebra::Matrix2::identity() * CORNER_SIGMA_PX.powi(2); 4];
    let mut views = vec![];
    for (i, view) in given.views.iter().enumerate() {
        let corners = Corners::try_from(view.corners).map_err(|e| {
            ApiError::invalid("invalid_value", format!("uploaded_views.views[{i}].corners"), e.to_string())
        })?;
        views.push(PlanarView::of_quad(&corners, &covariance, size));
    }
    Ok((views, [given.width_px, given.height_px]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_of_intrinsics_is_shown_whole() {
        let state = |suspicion| IntrinsicsMonitorState {
            tries: 40,
            refused: 3,
            landmarks: 5,
            reduced_chi2: Some(1.5),
            focal_error: Some(-0.02),
            focal_sigma: None,
            suspicion,
        };
        for suspicion in [
            None,
            Some(Suspicion::Focal { error: 0.1, sigma: 0.01 }),
            Some(Suspicion::Misfit { reduced_chi2: 9.0 }),
            Some(Suspicion::Refused { share: 0.6 }),
        ] {
            let state = state(suspicion);
            let shown = serde_json::to_value(monitor_shown(&state)).unwrap();
            assert_eq!(shown, serde_json::to_value(state).unwrap());
        }
    }
}
