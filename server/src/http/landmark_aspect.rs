//! The ratio of a landmark's sides: what its photographs show, against the size that is stated
//! (method 16.7). A size that contradicts them is refused; where they do not determine the ratio,
//! it is taken, and the landmark's `facts` say so.

use super::{App, error::ApiError};
use crate::store::{StoreError, aspect_views::aspect_views, landmarks};
use axum::http::StatusCode;
use protos::api::{Landmark, Size};
use serde_json::{Value, json};
use vision::{
    learn::aspect::{Aspect, AspectAgreement, AspectView, aspect},
    pose::LandmarkSize,
};

/// What the stored views of a landmark show, and one that is not stored yet.
pub(super) async fn shown_by_views(
    app: &App,
    landmark: Option<i64>,
    new: Option<AspectView>,
) -> Result<Option<Aspect>, StoreError> {
    let mut all: Vec<AspectView> = new.into_iter().collect();
    if let Some(landmark) = landmark {
        all.extend(aspect_views(app.store.reads(), landmark).await?);
    }
    Ok(aspect(&all))
}

/// Refuses a size that the views contradict: 409 `aspect_differs`, with what they show and what to
/// do.
pub(super) fn check(shown: Option<Aspect>, landmark: &str, stated: LandmarkSize) -> Result<(), ApiError> {
    let Some(shown) = shown else { return Ok(()) };
    let AspectAgreement::Differs { swapped } = shown.agreement(stated) else { return Ok(()) };
    let LandmarkSize { width_m, height_m } = stated;
    let sigma = shown.ratio * shown.sigma_log;
    let next = if swapped {
        format!(
            "width and height seem to be swapped: give {height_m} x {width_m} m, or turn the photographs upright"
        )
    } else {
        "measure again, at the edges that are outlined; a photograph that was stretched, or that shows something else, \
         does not fit either"
            .to_owned()
    };
    let detail = format!(
        "by the photographs, `{landmark}` is {:.3} +- {:.3} times as wide as high, and a size of {width_m} x {height_m} m \
         says {:.3}; {next}",
        shown.ratio,
        sigma,
        width_m / height_m
    );
    Err(ApiError::new(StatusCode::CONFLICT, "aspect_differs", detail)
        .field("width_m")
        .with("stated", json!({ "width_m": width_m, "height_m": height_m }))
        .with("measured_aspect", json!(shown.ratio))
        .with("aspect_sigma", json!(sigma))
        .with("swapped", json!(swapped)))
}

/// Refuses a view that contradicts the size of its landmark, by hand or given with the view;
/// nothing is made then.
pub(super) async fn check_view(
    app: &App,
    (map, landmark): &(String, String),
    given: Option<LandmarkSize>,
    view: AspectView,
) -> Result<(), ApiError> {
    let row = match landmarks::get(app.store.reads(), map, landmark).await {
        Err(StoreError::NotFound { .. }) => None,
        found => Some(found?),
    };
    let by_hand = row.as_ref().and_then(|row| row.geometry.size_by_hand());
    // Another size than that by hand is refused as such.
    let Some(stated) = given.or(by_hand) else { return Ok(()) };
    let shown = shown_by_views(app, row.map(|row| row.id), Some(view)).await?;
    check(shown, landmark, stated)
}

/// Adds to a learnt landmark's facts what its views show, and how its size agrees.
pub(super) fn add_fact(landmark: &mut Landmark, shown: Option<Aspect>) {
    let (Some(model), Some(shown)) = (&mut landmark.model, shown) else { return };
    model.facts.insert("aspect".into(), fact(&shown, landmark.size));
}

fn fact(shown: &Aspect, size: Option<Size>) -> Value {
    let stated = size.map(|s| LandmarkSize { width_m: s.width_m, height_m: s.height_m });
    let agreement = stated.map(|stated| match shown.agreement(stated) {
        AspectAgreement::Agrees => "agrees",
        AspectAgreement::Doubtful => "doubtful",
        AspectAgreement::Differs { .. } => "differs",
    });
    json!({ "measured": shown.ratio, "sigma": shown.ratio * shown.sigma_log, "size": agreement })
}
