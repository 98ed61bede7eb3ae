//! Where a robot may be while nothing that it sees is unique.

use super::{
    Shared,
    error::{ApiError, Problem},
    extract::{At, name},
    resources::row_major,
};
use crate::store::robots;
use axum::{Json, extract::State};
use engine::search::Need;
use map::relocalise::{GridBeliefParams, PoseHypothesis};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(hypotheses))
}

/// A place where a robot may be.
#[derive(Debug, Serialize, ToSchema)]
struct Hypothesis {
    /// Its share of the belief, 0 to 1; all of them together leave some for everywhere else.
    probability: f64,
    /// Metres.
    x_m: f64,
    /// Metres.
    y_m: f64,
    /// Heading.
    theta_rad: f64,
    /// Over (x, y, theta), row-major.
    covariance: [f64; 9],
}

impl From<&PoseHypothesis> for Hypothesis {
    fn from(PoseHypothesis { mass, pose }: &PoseHypothesis) -> Self {
        let (x_m, y_m, theta_rad) = (pose.pose.x_m, pose.pose.y_m, pose.pose.theta_rad);
        Self { probability: *mass, x_m, y_m, theta_rad, covariance: row_major(&pose.covariance) }
    }
}

/// How far a robot's search for itself has come.
#[derive(Debug, Default, Serialize, ToSchema)]
struct Possible {
    /// False for a robot that knows where it is, or has seen nothing to search with: all else is empty then.
    searching: bool,
    /// The map it searches.
    map: Option<String>,
    /// Its version.
    map_version: Option<u64>,
    /// Most probable first, eight at most.
    hypotheses: Vec<Hypothesis>,
    /// Of the belief over the whole map, nats: 0 when one cell of 0.2 m and 10 degrees has it all.
    entropy_nats: f64,
    /// Sightings that it rests on.
    sightings: usize,
    /// The landmarks by which the first hypothesis explains them.
    landmarks: Vec<String>,
    /// What is missing before the first one becomes the robot's pose; empty if nothing is.
    needed: Vec<Need>,
    /// The first one must be more probable than this.
    decided_above: f64,
}

/// Where a robot may be that sees only things which look like several landmarks: places with covariance and probability,
/// and what is missing before one of them is its pose. The answers to its frames say the same (`hypotheses`).
#[utoipa::path(get, path = "/robots/{robot}/hypotheses", tag = "robots", params(("robot" = String, Path)),
    responses((status = 200, body = Possible), (status = 404, body = Problem)))]
async fn hypotheses(State(app): State<Shared>, At(robot): At<String>) -> Result<Json<Possible>, ApiError> {
    robots::get(app.store.reads(), &robot).await?;
    let decided_above = GridBeliefParams::default().decided;
    let (robot, searches) = (name("robot", robot)?, app.searches.clone());
    // A search may be in work for some milliseconds, on its own thread.
    let asked = tokio::task::spawn_blocking(move || searches.progress(&robot));
    let Some(found) = asked.await.map_err(|e| ApiError::internal(&e))? else {
        return Ok(Json(Possible { decided_above, ..Possible::default() }));
    };
    let map = app.store.snapshots().get(&found.map);
    let named = |id| map.as_ref().and_then(|map| map.landmarks.get(id)).map(|l| l.name.clone());
    Ok(Json(Possible {
        searching: true,
        map_version: Some(found.map_version),
        hypotheses: found.modes.iter().map(Hypothesis::from).collect(),
        entropy_nats: found.entropy_nats,
        sightings: found.sightings,
        landmarks: found.landmarks.iter().filter_map(named).collect(),
        needed: found.needed,
        decided_above,
        map: Some(found.map),
    }))
}
