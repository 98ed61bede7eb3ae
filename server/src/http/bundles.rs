//! `/maps/{map}/bundle` and `/bundles`: a map as one file, out and in.

use super::{
    AppState,
    answers::created,
    creation,
    error::ApiError,
    extract::{PathParams, QueryParams, name, too_large},
    maps::{map_shown, unknown_parent},
};
use crate::{
    bundle::{self, BundleError},
    identity::Principal,
    store::{StoreError, contents::Written, kind::Kind},
};
use axum::{
    Extension,
    body::Body,
    extract::{Request, State},
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use futures::{StreamExt as _, stream};
use protos::api::{BundleQuery, Map, Problem};
use sha2::{Digest as _, Sha256};
use std::{fs::File, io};
use tokio::io::{AsyncReadExt as _, AsyncSeekExt as _, AsyncWriteExt as _};
use utoipa_axum::{router::OpenApiRouter, routes};

const ZIP: &str = "application/zip";
/// Bytes of a file that are read at a time.
const PART_BYTES: usize = 256 << 10;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(save)).routes(routes!(load))
}

impl From<BundleError> for ApiError {
    fn from(error: BundleError) -> Self {
        match error {
            BundleError::Refused { fault, ref file, .. } => {
                Self::invalid(fault.code(), file.clone(), error.to_string())
            }
            BundleError::Store(error) => error.into(),
            BundleError::Io(error) => Self::internal(&error),
        }
    }
}

/// The whole map as one file, a bundle: a zip with JSON, GeoJSON, pictures and models
/// (docs/BUNDLE.md).
#[utoipa::path(get, path = "/maps/{map}/bundle", operation_id = "saveBundle",
    tag = "maps", params(("map" = String, Path)),
    responses((status = 200, content_type = "application/zip"), (status = 404, body = Problem),
    (status = 409, body = Problem, description = "too_many: bytes of one map, or files of a bundle"),
    (status = 500, body = Problem, description = "picture_damaged")))]
async fn save(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    Extension(principal): Extension<Principal>,
) -> Result<Response, ApiError> {
    let place = app.bundle_place().await?;
    let file = bundle::save(&app.store, &map, &app.config.data, |other| principal.may_see(other)).await?;
    drop(place);
    let length = file.metadata().map_err(|e| ApiError::internal(&e))?.len();
    let parts = stream::try_unfold(tokio::fs::File::from_std(file), async |mut file| {
        let mut part = vec![0; PART_BYTES];
        let count = file.read(&mut part).await?;
        part.truncate(count);
        Ok::<_, io::Error>((count > 0).then(|| (axum::body::Bytes::from(part), file)))
    });
    let headers = [
        (header::CONTENT_TYPE, ZIP.to_owned()),
        (header::CONTENT_LENGTH, length.to_string()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{map}.zip\"")),
    ];
    Ok((headers, Body::from_stream(parts)).into_response())
}

/// Makes a new map of a bundle: with landmarks, views, models, walls, underlay, reference runs and
/// settings, as one commit. A bundle of which anything is wrong is refused as a whole, with the
/// file in it as `field`.
#[utoipa::path(post, path = "/bundles", operation_id = "loadBundle", tag = "maps", params(BundleQuery),
    request_body(content = Vec<u8>, content_type = "application/zip"), responses((status = 201, body = Map),
    (status = 404, body = Problem, description = "unknown_map: the map that it lies in"),
    (status = 409, body = Problem, description = "exists, too_many, too_deep"), (status = 413, body = Problem),
    (status = 415, body = Problem, description = "not_zip"), (status = 422, body = Problem, description = "bad_name; \
     not_a_bundle, newer_format, bundle_damaged, bad_path, too_large, missing, invalid_value: what is wrong with the bundle")))]
async fn load(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<BundleQuery>,
    Extension(principal): Extension<Principal>,
    request: Request,
) -> Result<Response, ApiError> {
    let new_name = query.name.map(|text| name("name", text)).transpose()?;
    let (head, body) = request.into_parts();
    let is_zip = head.headers.get(header::CONTENT_TYPE).is_some_and(|kind| kind == ZIP);
    let uri = head.uri.to_string();
    let (file, digest) = received(&app, body, &uri).await?;
    let request = bundle::Request {
        name: new_name.map(|name| name.as_str().to_owned()),
        without_link: query.without_link,
    };
    let work = app.clone();
    let answer = async move {
        if !is_zip {
            let (status, detail) = (StatusCode::UNSUPPORTED_MEDIA_TYPE, "the body must be application/zip");
            return Err(ApiError::new(status, "not_zip", detail).field("content-type"));
        }
        let _place = work.bundle_place().await?;
        let shown = move |made: &Written| {
            (StatusCode::CREATED, map_shown(made.map.clone(), made.location.clone(), &principal))
        };
        let loaded =
            async { bundle::load(&work.store, file, request, &work.config.limits).await.map_err(in_words) };
        Ok::<_, ApiError>(created(shown, loaded).await?.into_response())
    };
    Box::pin(creation::under_key(&app, &head, digest, answer)).await
}

/// Says what to do about a map that is not there.
fn in_words(error: BundleError) -> ApiError {
    let is_parent = matches!(&error, BundleError::Store(StoreError::NotFound { what: Kind::Map, .. }));
    let error = unknown_parent(ApiError::from(error));
    if is_parent {
        return error.detail(
            "the map lies in a map that is not here: make that one first, or load it without its link",
        );
    }
    error
}

/// The body in a file without a name, and the digest of the request.
async fn received(app: &AppState, body: Body, uri: &str) -> Result<(File, [u8; 32]), ApiError> {
    let failed = |e: io::Error| ApiError::from(BundleError::from(e));
    let max = app.config.limits.bundle_bytes;
    let file = tempfile::tempfile_in(&app.config.data).map_err(failed)?;
    let (mut file, mut hash, mut length) = (tokio::fs::File::from_std(file), Sha256::new(), 0_usize);
    hash.update(uri.as_bytes());
    hash.update([0]);
    let mut parts = body.into_data_stream();
    while let Some(part) = parts.next().await {
        let broken = "the body ended early";
        let part = part
            .map_err(|_hung_up| ApiError::new(StatusCode::BAD_REQUEST, "bad_body", broken).field("body"))?;
        length = length.saturating_add(part.len());
        if length > max {
            return Err(too_large(max));
        }
        hash.update(&part);
        file.write_all(&part).await.map_err(failed)?;
    }
    file.flush().await.map_err(failed)?;
    file.rewind().await.map_err(failed)?;
    Ok((file.into_std().await, hash.finalize().into()))
}
