//! `/maps/{map}/recognise`: one photograph, the same pipeline that robots' frames go through.

use super::{
    AppState,
    error::ApiError,
    extract::PathParams,
    photograph_camera::PhotographCamera,
    upload::{FORM_OVERHEAD, Form},
};
use crate::store::StoreError;
use crate::store::kind::Kind;
use axum::{
    Json,
    extract::{DefaultBodyLimit, Request, State},
};
use engine::{answer::answer_to_photograph, picture};
use protos::{
    api::{PhotographForm, Problem},
    v1,
};
use std::sync::Arc;
use utoipa_axum::{router::OpenApiRouter, routes};
use vision::params::preset::Preset;

pub(super) fn router(upload_bytes: usize) -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(recognise)).layer(DefaultBodyLimit::max(upload_bytes + FORM_OVERHEAD))
}

/// Recognises the landmarks of a photograph.
#[utoipa::path(post, path = "/maps/{map}/recognise", operation_id = "recogniseLandmarks",
    tag = "recognition", params(("map" = String, Path)),
    request_body(content = PhotographForm, content_type = "multipart/form-data"),
    responses((status = 200, body = protos::v1::Answer),
    (status = 404, body = Problem), (status = 413, body = Problem),
    (status = 422, body = Problem, description = "bad_image, wrong_encoding, too_large, out_of_range, not_finite, \
     size_mismatch, invalid_value: the preset")))]
async fn recognise(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    request: Request,
) -> Result<Json<v1::Answer>, ApiError> {
    let snapshot = app.store.snapshots().get(&map);
    let snapshot = snapshot.ok_or_else(|| StoreError::NotFound { what: Kind::Map, name: map })?;
    let mut form = Form::read(&app, request, &["image", "intrinsics", "preset"]).await?;
    let bytes = form.needed("image")?;
    let camera = form.optional("intrinsics").map(|part| PhotographCamera::read(&part)).transpose()?;
    let snapshot = match form.optional("preset") {
        Some(word) => Arc::new(snapshot.under(preset(&word)?)),
        None => snapshot,
    };
    let answer = app.on_vision_thread(move |app| {
        let picture = picture::decode(&bytes, app.config.limits.upload())?;
        let size = [picture.width(), picture.height()];
        let camera = camera.map(|camera| camera.of_picture(size)).transpose()?;
        Ok(answer_to_photograph(&picture, camera.as_ref(), &snapshot))
    });
    answer.await?.map(Json)
}

fn preset(word: &[u8]) -> Result<Preset, ApiError> {
    let word = String::from_utf8_lossy(word);
    word.parse().map_err(|why: String| ApiError::invalid("invalid_value", "preset", why))
}
