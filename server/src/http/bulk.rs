//! `/maps/{map}/bulk`: several landmarks made or deleted in one transaction, all or none. Its paths
//! have words of their own: below `/landmarks` every word is the name of a landmark.

use super::{
    AppState,
    answers::created,
    error::ApiError,
    extract::{Body, PathParams, name},
    landmarks::geometry,
};
use crate::store::{
    StoreError, landmarks, maps,
    revisions::{self, Precondition, Subject},
};
use axum::{Json, extract::State, http::StatusCode};
use protos::api::{BulkOutcome, LandmarkDeletions, NewLandmark, NewLandmarks, Problem};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Most landmarks of one request.
const MAX_BULK: usize = 2_000;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(create)).routes(routes!(delete))
}

fn within_bound(count: usize) -> Result<(), ApiError> {
    if (1..=MAX_BULK).contains(&count) {
        return Ok(());
    }
    Err(ApiError::invalid("out_of_range", "landmarks", format!("1 to {MAX_BULK} landmarks at a time")))
}

/// Creates landmarks without views: all, or none. The field of a refusal has the number of the
/// landmark at fault, from 0.
#[utoipa::path(post, path = "/maps/{map}/bulk/create-landmarks", operation_id = "createLandmarks",
    tag = "landmarks", params(("map" = String, Path)),
    request_body = NewLandmarks, responses((status = 201, body = BulkOutcome), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "exists, too_many"),
    (status = 422, body = Problem, description = "bad_name, invalid_value, out_of_range")))]
async fn create(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Body(new): Body<NewLandmarks>,
) -> Result<(StatusCode, Json<BulkOutcome>), ApiError> {
    within_bound(new.landmarks.len())?;
    let checked = |(i, new): (usize, NewLandmark)| {
        let inside = |error: ApiError| {
            let field = format!("landmarks[{i}].{}", error.field.as_deref().unwrap_or("name"));
            error.field(field)
        };
        let name = name("name", new.name).map_err(inside)?;
        Ok((name, geometry(new.size, new.place).map_err(inside)?))
    };
    let all = new.landmarks.into_iter().enumerate().map(checked).collect::<Result<Vec<_>, ApiError>>()?;
    let max = app.config.limits.landmarks;
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            maps::of(tx, &map).await?;
            let count = all.len() as u64;
            for (i, (name, geometry)) in all.into_iter().enumerate() {
                let made = landmarks::create(tx, &map, name.as_str(), geometry, max).await;
                made.map_err(|error| error.at(i))?;
            }
            Ok::<_, StoreError>(count)
        })
    });
    created(|count: &u64| (StatusCode::CREATED, BulkOutcome { count: *count }), write).await
}

/// Deletes landmarks with their views and models: all, or none. The field of a refusal has the
/// number of the landmark at fault, from 0.
#[utoipa::path(post, path = "/maps/{map}/bulk/delete-landmarks", operation_id = "deleteLandmarks",
    tag = "landmarks", params(("map" = String, Path)),
    request_body = LandmarkDeletions, responses((status = 200, body = BulkOutcome), (status = 404, body = Problem),
    (status = 412, body = Problem, description = "changed_meanwhile: a landmark has another revision than the one given"),
    (status = 422, body = Problem, description = "out_of_range")))]
async fn delete(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Body(gone): Body<LandmarkDeletions>,
) -> Result<Json<BulkOutcome>, ApiError> {
    within_bound(gone.landmarks.len())?;
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            maps::of(tx, &map).await?;
            let count = gone.landmarks.len() as u64;
            for (i, landmark) in gone.landmarks.into_iter().enumerate() {
                let is =
                    landmark.revision.map_or(Precondition::Any, |known| Precondition::OneOf(vec![known]));
                let subject = Subject::Landmark(landmark.name.clone());
                revisions::check(tx, &map, &subject, &is).await.map_err(|error| error.at(i))?;
                landmarks::delete(tx, &map, &landmark.name).await.map_err(|error| error.at(i))?;
            }
            Ok::<_, StoreError>(count)
        })
    });
    Ok(Json(BulkOutcome { count: write.await? }))
}
