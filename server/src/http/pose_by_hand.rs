//! `/robots/{robot}/pose`: a person says where a robot is.

use super::{
    AppState,
    error::ApiError,
    extract::{Body, PathParams, name},
};
use crate::store::robots;
use axum::{Json, extract::State, http::StatusCode};
use engine::workers::Publish;
use map::pose2::{Pose2, Pose2Covariance};
use nalgebra::{Matrix3, Vector3};
use protos::{
    Name,
    api::{PoseByHand, Problem, RobotPose},
};
use std::{f64::consts::TAU, ops::RangeInclusive, time::Instant};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Standard deviations of the coordinates that are taken, m.
const SIGMA_M: RangeInclusive<f64> = 0.01..=10.0;
/// Standard deviations of the heading that are taken, rad: beyond half a turn it is unknown.
const SIGMA_RAD: RangeInclusive<f64> = 0.01..=3.15;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(put))
}

fn checked(said: &PoseByHand) -> Result<Pose2Covariance, ApiError> {
    let PoseByHand { x_m, y_m, theta_rad, sigma_m, sigma_rad } = *said;
    let pose = Pose2::new(x_m, y_m, theta_rad);
    let outside = |field: &str, detail: String| ApiError::invalid("out_of_range", field, detail);
    pose.check().map_err(|error| outside(error.field, error.to_string()))?;
    let ranges = [
        ("theta_rad", theta_rad, -TAU..=TAU),
        ("sigma_m", sigma_m, SIGMA_M),
        ("sigma_rad", sigma_rad, SIGMA_RAD),
    ];
    for (field, value, range) in ranges {
        if !range.contains(&value) {
            let detail = format!("{value} is not from {:.2} to {:.2}", range.start(), range.end());
            return Err(outside(field, detail));
        }
    }
    let sigmas = Vector3::new(sigma_m, sigma_m, sigma_rad);
    Ok(Pose2Covariance { pose, covariance: Matrix3::from_diagonal(&sigmas.component_mul(&sigmas)) })
}

fn not_heard(robot: &Name) -> ApiError {
    let detail = format!("no odometry of robot {robot} was heard for 2 s: nothing would carry the pose on");
    ApiError::new(StatusCode::CONFLICT, "no_odometry", detail).field("robot")
}

/// Puts a robot where a person says it is on its map, in place of the pose that it may have. The
/// pose is unsupported until a landmark that the picture alone names agrees with it; landmarks that
/// contradict it replace it as they would any other pose. The robot has to send odometry, which
/// carries the pose on.
#[utoipa::path(put, path = "/robots/{robot}/pose", operation_id = "setRobotPose",
    tag = "robots", params(("robot" = String, Path)),
    request_body = PoseByHand, responses((status = 200, body = RobotPose), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "no_odometry: none was heard for 2 s"),
    (status = 422, body = Problem, description = "out_of_range")))]
async fn put(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
    Body(said): Body<PoseByHand>,
) -> Result<Json<RobotPose>, ApiError> {
    let map = robots::get(app.store.reads(), &robot).await?.map;
    let (pose, robot) = (checked(&said)?, name("robot", robot)?);
    if !app.motion.hears_odometry(&robot, &map, Instant::now()) {
        return Err(not_heard(&robot));
    }
    let noted = robot.clone();
    let write =
        app.store.write(move |tx| Box::pin(async move { robots::note_pose(tx, noted.as_str()).await }));
    write.await?;
    let now = Instant::now();
    let published = app.motion.set_pose_by_hand(&robot, &map, &pose, now).ok_or_else(|| not_heard(&robot))?;
    if let Some(publisher) = &app.publisher {
        publisher.pose(&robot, &published);
    }
    app.searches.stop(&robot);
    let known = app.motion.known_pose(&robot, now).filter(|known| known.map == map);
    let shown = known.map(|known| super::robots::pose_shown(&known, published.trust().into()));
    shown.map(Json).ok_or_else(|| not_heard(&robot))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_deviations_become_variances() {
        let said = PoseByHand { sigma_m: 0.4, sigma_rad: 0.3, ..PoseByHand::new(1.0, 2.0, 0.5) };
        let checked = checked(&said).unwrap();
        assert_eq!(checked.pose, Pose2::new(1.0, 2.0, 0.5));
        let is = Matrix3::from_diagonal(&Vector3::new(0.16, 0.16, 0.09));
        assert!((checked.covariance - is).norm() < 1e-12, "{}", checked.covariance);
    }
}
