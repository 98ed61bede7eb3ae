//! Where a robot may be while nothing that it sees is unique.

use super::{
    AppState,
    answers::row_major,
    error::ApiError,
    extract::{PathParams, name},
};
use crate::store::robots;
use axum::{Json, extract::State};
use engine::relocalise::MissingCondition;
use map::relocalise::{GridBeliefParams, PoseHypothesis};
use protos::api::{MissingConditionBody, PoseHypothesisBody, Problem, RelocalisationStatus};
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(relocalisation))
}

fn shown(PoseHypothesis { mass, pose }: &PoseHypothesis) -> PoseHypothesisBody {
    let (x_m, y_m, theta_rad) = (pose.pose.x_m, pose.pose.y_m, pose.pose.theta_rad);
    PoseHypothesisBody { probability: *mass, x_m, y_m, theta_rad, covariance: row_major(&pose.covariance) }
}

fn missing(need: MissingCondition) -> MissingConditionBody {
    match need {
        MissingCondition::HigherProbability => MissingConditionBody::HigherProbability,
        MissingCondition::SecondLandmark => MissingConditionBody::SecondLandmark,
        MissingCondition::ConsistentObservations => MissingConditionBody::ConsistentObservations,
        MissingCondition::NoRivalPose => MissingConditionBody::NoRivalPose,
    }
}

/// Where a robot may be that sees only things which look like several landmarks: places with
/// covariance and probability, and what is missing before one of them is its pose. The answers to
/// its frames say the same (`hypotheses`).
#[utoipa::path(get, path = "/robots/{robot}/relocalisation", operation_id = "getRelocalisation",
    tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = RelocalisationStatus), (status = 404, body = Problem)))]
async fn relocalisation(
    State(app): State<AppState>,
    PathParams(robot): PathParams<String>,
) -> Result<Json<RelocalisationStatus>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let min_probability = GridBeliefParams::default().decided;
    let (robot, searches) = (name("robot", robot)?, app.searches.clone());
    // A search may be in work for some milliseconds, on its own thread.
    let asked = tokio::task::spawn_blocking(move || searches.progress(&robot));
    let Some(found) = asked.await.map_err(|e| ApiError::internal(&e))? else {
        return Ok(Json(RelocalisationStatus { min_probability, ..RelocalisationStatus::default() }));
    };
    let map = app.store.snapshots().get(&found.map);
    let named = |id| map.as_ref().and_then(|map| map.landmarks.get(id)).map(|l| l.name.clone());
    Ok(Json(RelocalisationStatus {
        relocalising: true,
        map_version: Some(found.map_version),
        hypotheses: found.hypotheses.iter().map(shown).collect(),
        entropy_nats: found.entropy_nats,
        sightings: found.observations,
        landmarks: found.landmarks.iter().filter_map(named).collect(),
        missing: found.missing.into_iter().map(missing).collect(),
        min_probability,
        map: Some(found.map),
    }))
}
