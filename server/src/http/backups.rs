//! `/backups`: copies of the whole database, made while the server runs.

use super::{
    AppState,
    answers::page,
    error::ApiError,
    extract::{PathParams, QueryParams, page_limit},
};
use crate::store::StoreError;
use axum::{
    Json,
    body::{Body, Bytes},
    extract::State,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
};
use futures::stream;
use protos::api::{Backup, Page, PageQuery, Problem};
use std::io;
use tokio::{fs::File, io::AsyncReadExt as _};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Bytes of a file that are read at a time.
const PART_BYTES: usize = 256 << 10;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(create, list)).routes(routes!(get, delete)).routes(routes!(file))
}

/// Begins a backup: one file with one committed state, and a manifest of its digests. Writes go on
/// meanwhile. The oldest backups beyond `backup.keep` are removed when it is complete.
#[utoipa::path(post, path = "/backups", operation_id = "createBackup",
    tag = "backups", responses((status = 202, body = Backup),
    (status = 409, body = Problem, description = "in_use: another one is being made")))]
async fn create(State(app): State<AppState>) -> Result<(StatusCode, Json<Backup>), ApiError> {
    // It goes on without the request.
    let (backup, _task) = app.backups.begin()?;
    Ok((StatusCode::ACCEPTED, Json(backup)))
}

/// Lists the backups in the data directory by time, with the one in work and a failed last attempt.
#[utoipa::path(get, path = "/backups", operation_id = "listBackups",
    tag = "backups", params(PageQuery), responses((status = 200, body = Page<Backup>)))]
async fn list(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<PageQuery>,
) -> Result<Json<Page<Backup>>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    let after = query.cursor.unwrap_or_default();
    let mut all = blocking(&app, |app| Ok(app.backups.list())).await?;
    let total = all.len() as u64;
    all.sort_by(|a, b| a.name.cmp(&b.name));
    all.retain(|backup| backup.name > after);
    all.truncate(limit + 1);
    Ok(Json(page(all, limit, total, |backup| backup.name.clone(), |backup| backup)))
}

/// One backup: how far it is, and what it holds.
#[utoipa::path(get, path = "/backups/{backup}", operation_id = "getBackup",
    tag = "backups", params(("backup" = String, Path)),
    responses((status = 200, body = Backup), (status = 404, body = Problem)))]
async fn get(
    State(app): State<AppState>,
    PathParams(name): PathParams<String>,
) -> Result<Json<Backup>, ApiError> {
    Ok(Json(blocking(&app, move |app| app.backups.get(&name)).await?))
}

/// The file of a complete backup, for `waymark restore`.
#[utoipa::path(get, path = "/backups/{backup}/file", operation_id = "getBackupFile",
    tag = "backups", params(("backup" = String, Path)),
    responses((status = 200, content_type = "application/octet-stream"), (status = 404, body = Problem)))]
async fn file(
    State(app): State<AppState>,
    PathParams(name): PathParams<String>,
) -> Result<Response, ApiError> {
    let path = blocking(&app, move |app| app.backups.file(&name)).await?;
    let opened = async {
        let file = File::open(&path).await?;
        let length = file.metadata().await?.len();
        Ok::<_, io::Error>((file, length))
    };
    let (file, length) = opened.await.map_err(|e| ApiError::internal(&e))?;
    let parts = stream::try_unfold(file, async |mut file| {
        let mut part = vec![0; PART_BYTES];
        let count = file.read(&mut part).await?;
        part.truncate(count);
        Ok::<_, io::Error>((count > 0).then(|| (Bytes::from(part), file)))
    });
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_LENGTH, length.to_string()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
    ];
    Ok((headers, Body::from_stream(parts)).into_response())
}

/// Deletes a complete backup.
#[utoipa::path(delete, path = "/backups/{backup}", operation_id = "deleteBackup",
    tag = "backups", params(("backup" = String, Path)),
    responses((status = 204), (status = 404, body = Problem)))]
async fn delete(
    State(app): State<AppState>,
    PathParams(name): PathParams<String>,
) -> Result<StatusCode, ApiError> {
    blocking(&app, move |app| app.backups.delete(&name)).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Work on files, off the runtime.
async fn blocking<T: Send + 'static>(
    app: &AppState,
    work: impl FnOnce(&AppState) -> Result<T, StoreError> + Send + 'static,
) -> Result<T, ApiError> {
    let app = app.clone();
    let done = tokio::task::spawn_blocking(move || work(&app)).await;
    Ok(done.map_err(|e| ApiError::internal(&e))??)
}
