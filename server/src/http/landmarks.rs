//! `/maps/{map}/landmarks`: create, list, read, measure, delete.

use super::{
    App, Shared,
    error::{ApiError, Problem},
    extract::{At, Body, Page, PageQuery, Params, name},
    resources::{Landmark, Place, Size, Trust, measures},
};
use crate::{
    jobs::Learning,
    store::{
        landmarks::{self, LandmarkRow},
        maps,
    },
};
use axum::{Json, extract::State, http::StatusCode};
use map::landmark_health::LandmarkHealth;
use serde::{Deserialize, Deserializer};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::model::LandmarkId;

pub(super) fn router() -> OpenApiRouter<Shared> {
    OpenApiRouter::new().routes(routes!(create, list)).routes(routes!(get, patch, delete))
}

/// A landmark to be.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
struct NewLandmark {
    /// `[a-z0-9_-]{1,64}`, unique in the map.
    name: String,
    /// Width and height; without it there is no pose.
    size: Option<Size>,
    /// Where it hangs; without it there is no robot pose.
    place: Option<Place>,
}

/// What changes. A field that is absent stays, one that is null is forgotten.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[expect(clippy::option_option, reason = "absent and null differ in a PATCH")]
struct Changes {
    /// Width and height.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<Size>)]
    size: Option<Option<Size>>,
    /// Where it hangs.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<Place>)]
    place: Option<Option<Place>>,
    /// A person's decision; a new size or place is sound by itself.
    standing: Option<Trust>,
}

/// Tells null from absent.
#[expect(clippy::option_option, reason = "absent and null differ in a PATCH")]
pub(super) fn given<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Option<Option<T>>, D::Error> {
    Option::deserialize(from).map(Some)
}

/// The landmark with what only the running server knows: a model out of use, a job at work.
fn shown(app: &App, learning: &Learning, map: &str, row: LandmarkRow) -> Landmark {
    let snapshot = app.store.snapshots().get(map);
    let quarantined = snapshot.and_then(|s| s.unusable_models.get(&LandmarkId(row.id as u64)).cloned());
    let learning = learning.has(&row.name) && row.views > 0;
    Landmark::new(row, quarantined, learning)
}

/// Creates a landmark without views.
#[utoipa::path(post, path = "/maps/{map}/landmarks", tag = "landmarks", params(("map" = String, Path)),
    request_body = NewLandmark, responses((status = 201, body = Landmark), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "exists, too_many"),
    (status = 422, body = Problem, description = "bad_name, bad_value, out_of_range")))]
async fn create(
    State(app): State<Shared>,
    At(map): At<String>,
    Body(new): Body<NewLandmark>,
) -> Result<(StatusCode, Json<Landmark>), ApiError> {
    let (name, measures) = (name("name", new.name)?, measures(new.size, new.place)?);
    let max = app.config.limits.landmarks;
    let write = app.store.write(move |tx| {
        Box::pin(async move { landmarks::create(tx, &map, name.as_str(), measures, max).await })
    });
    Ok((StatusCode::CREATED, Json(Landmark::new(write.await?, None, false))))
}

/// Lists the landmarks of a map by name.
#[utoipa::path(get, path = "/maps/{map}/landmarks", tag = "landmarks", params(("map" = String, Path), PageQuery),
    responses((status = 200, body = Page<Landmark>), (status = 404, body = Problem)))]
async fn list(
    State(app): State<Shared>,
    At(map): At<String>,
    Params(page): Params<PageQuery>,
) -> Result<Json<Page<Landmark>>, ApiError> {
    let limit = page.limit(app.config.limits.page)?;
    let map = maps::get(app.store.reads(), &map).await?;
    let rows = landmarks::page(app.store.reads(), map.id, &page.after(), limit + 1).await?;
    let learning = app.jobs.learning(&map.name).await?;
    Ok(Json(Page::new(rows, limit, |r| r.name.clone(), |r| shown(&app, &learning, &map.name, r))))
}

/// One landmark.
#[utoipa::path(get, path = "/maps/{map}/landmarks/{landmark}", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    responses((status = 200, body = Landmark), (status = 404, body = Problem)))]
async fn get(
    State(app): State<Shared>,
    At((map, landmark)): At<(String, String)>,
) -> Result<Json<Landmark>, ApiError> {
    maps::get(app.store.reads(), &map).await?;
    let row = landmarks::get(app.store.reads(), &map, &landmark).await?;
    Ok(Json(shown(&app, &app.jobs.learning(&map).await?, &map, row)))
}

/// Sets or forgets size and place; sets how far it is trusted.
#[utoipa::path(patch, path = "/maps/{map}/landmarks/{landmark}", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)), request_body = Changes,
    responses((status = 200, body = Landmark), (status = 404, body = Problem),
    (status = 422, body = Problem, description = "out_of_range, bad_value")))]
async fn patch(
    State(app): State<Shared>,
    At((map, landmark)): At<(String, String)>,
    Body(changes): Body<Changes>,
) -> Result<Json<Landmark>, ApiError> {
    let checked = measures(changes.size.flatten(), changes.place.flatten())?;
    let (size, place) = (changes.size.is_some(), changes.place.is_some());
    let (map_name, standing) = (map.clone(), changes.standing.map(LandmarkHealth::from));
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            let changed = landmarks::update(tx, &map, &landmark, |old| landmarks::Measures {
                size: if size { checked.size } else { old.size },
                place: if place { checked.place } else { old.place },
                size_from_views: old.size_from_views && !size,
            })
            .await?;
            match standing {
                Some(standing) => landmarks::set_standing(tx, &map, &landmark, standing, None).await,
                None => Ok(changed),
            }
        })
    });
    let changed = write.await?;
    Ok(Json(shown(&app, &app.jobs.learning(&map_name).await?, &map_name, changed)))
}

/// Deletes a landmark with its views and its model.
#[utoipa::path(delete, path = "/maps/{map}/landmarks/{landmark}", tag = "landmarks",
    params(("map" = String, Path), ("landmark" = String, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn delete(
    State(app): State<Shared>,
    At((map, landmark)): At<(String, String)>,
) -> Result<StatusCode, ApiError> {
    app.store.write(move |tx| Box::pin(async move { landmarks::delete(tx, &map, &landmark).await })).await?;
    Ok(StatusCode::NO_CONTENT)
}
