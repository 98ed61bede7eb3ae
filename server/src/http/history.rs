//! `/maps/{map}/commits`, `/difference`, `/rollback`: what was changed of a map, by whom and why,
//! and the way back.

use super::{
    API, AppState,
    answers::page,
    error::ApiError,
    extract::{Body, PathParams, QueryParams, after_number, number_cursor, page_limit},
    revision::IfMatch,
};
use crate::{
    label::check_label,
    store::{
        history::{self, CommitRow, LandmarkChange, MAX_WHY},
        maps,
        revisions::{self, Subject},
    },
};
use axum::{
    Json,
    extract::State,
    http::{HeaderMap, HeaderName, HeaderValue},
};
use protos::api::{
    ChangeKind, Commit, Difference, DifferenceQuery, LandmarkDifference, Page, PageQuery, Problem, Rollback,
    RollbackOutcome,
};
use utoipa::openapi::{
    ObjectBuilder, OpenApi, RefOr, Type,
    path::{ParameterBuilder, ParameterIn},
};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Carries the reason of a change.
const WHY: HeaderName = HeaderName::from_static("waymark-why");

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new()
        .routes(routes!(list))
        .routes(routes!(get))
        .routes(routes!(difference))
        .routes(routes!(roll_back))
        .routes(routes!(undo))
}

pub(super) fn shown(row: CommitRow) -> Commit {
    Commit {
        id: row.id as u64,
        parent: row.parent.map(|id| id as u64),
        created_ms: row.created_ms,
        author: row.author.name,
        job: row.author.job.map(|id| id as u64),
        operation: row.author.operation,
        why: row.author.why,
        summary: row.summary,
    }
}

/// Lists the kept commits of a map, newest first. `limits.kept_commits` and `limits.history_bytes`
/// say how many are kept.
#[utoipa::path(get, path = "/maps/{map}/commits", operation_id = "listCommits",
    tag = "history", params(("map" = String, Path), PageQuery),
    responses((status = 200, body = Page<Commit>), (status = 404, body = Problem)))]
async fn list(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(query): QueryParams<PageQuery>,
) -> Result<Json<Page<Commit>>, ApiError> {
    let (limit, db) = (page_limit(query.limit, app.config.limits.page)?, app.store.reads());
    let before = number_cursor(query.cursor.as_deref())?.unwrap_or(i64::MAX);
    let map = maps::get(db, &map).await?.id;
    let rows = history::page(db, map, before, limit + 1).await?;
    let total = history::count(db, map).await?;
    Ok(Json(page(rows, limit, total, |row| row.id.to_string(), shown)))
}

/// One kept commit of a map.
#[utoipa::path(get, path = "/maps/{map}/commits/{commit}", operation_id = "getCommit", tag = "history",
    params(("map" = String, Path), ("commit" = i64, Path)), responses((status = 200, body = Commit),
    (status = 404, body = Problem, description = "unknown_commit: it never was, or is not kept any more")))]
async fn get(
    State(app): State<AppState>,
    PathParams((map, commit)): PathParams<(String, i64)>,
) -> Result<Json<Commit>, ApiError> {
    let map = maps::get(app.store.reads(), &map).await?.id;
    Ok(Json(shown(history::get(app.store.reads(), map, commit).await?)))
}

/// What differs between a map at two kept commits, or at one and now.
#[utoipa::path(get, path = "/maps/{map}/difference", operation_id = "getDifference",
    tag = "history", params(("map" = String, Path), DifferenceQuery),
    responses((status = 200, body = Difference), (status = 404, body = Problem, description = "unknown_commit"),
    (status = 422, body = Problem, description = "out_of_range: `to` is before `from`")))]
async fn difference(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    QueryParams(query): QueryParams<DifferenceQuery>,
) -> Result<Json<Difference>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    let after = after_number(&PageQuery { limit: None, cursor: query.cursor })?;
    let map = maps::get(app.store.reads(), &map).await?.id;
    // One state of the database for all that is compared.
    let mut reading = app.store.reads().begin().await.map_err(crate::store::StoreError::during("compare"))?;
    let of = |id: u64| i64::try_from(id).unwrap_or(i64::MAX);
    let from = of(query.from);
    history::get(&mut reading, map, from).await.map_err(|e| ApiError::from(e).field("from"))?;
    let to = match query.to {
        None => history::newest(&mut reading, map).await?,
        Some(to) => {
            history::get(&mut reading, map, of(to)).await.map_err(|e| ApiError::from(e).field("to"))?;
            of(to)
        }
    };
    if to < from {
        return Err(ApiError::invalid("out_of_range", "to", "the later commit has the greater number"));
    }
    let found = history::between(&mut reading, map, (from, to)).await?;
    let later = found.landmarks.iter().filter(|(id, _)| **id > after).take(limit + 1);
    let mut rows: Vec<(i64, LandmarkChange)> = later.map(|(id, change)| (*id, change.clone())).collect();
    history::fill_unchanged(&mut reading, &mut rows, to).await?;
    let total = found.landmarks.len() as u64;
    let landmarks = page_of(rows, limit, total);
    let summary = history::summary(&mut reading, &found, to).await?;
    let (from_commit, to_commit) = (from as u64, to as u64);
    Ok(Json(Difference { from_commit, to_commit, summary, walls: found.walls, landmarks }))
}

pub(super) fn page_of(
    rows: Vec<(i64, LandmarkChange)>,
    limit: usize,
    total: u64,
) -> Page<LandmarkDifference> {
    page(rows, limit, total, |(id, _)| id.to_string(), |(_, change)| landmark(change))
}

fn landmark(change: LandmarkChange) -> LandmarkDifference {
    let name = change.name().to_owned();
    let LandmarkChange { present, names: [old, _], geometry: [before, after], fields, views, model } = change;
    LandmarkDifference {
        old_name: old.filter(|old| *old != name),
        name,
        change: match present {
            [false, _] => ChangeKind::Added,
            [true, false] => ChangeKind::Removed,
            [true, true] => ChangeKind::Changed,
        },
        before,
        after,
        fields: fields.into_iter().map(str::to_owned).collect(),
        views_added: views[0],
        views_removed: views[1],
        model_changed: model,
    }
}

/// Makes a map what it was at a kept commit: landmarks with their views, pictures, models and
/// thresholds, walls, underlay, reference runs and settings. It is a commit of its own, which can
/// be taken back. The map keeps its name.
#[utoipa::path(post, path = "/maps/{map}/rollback", operation_id = "rollBackMap",
    tag = "history", params(("map" = String, Path)),
    request_body = Rollback, responses((status = 200, body = RollbackOutcome),
    (status = 404, body = Problem, description = "unknown_commit"),
    (status = 409, body = Problem, description = "in_use: a job works on the map, or the map that it lay in is gone; \
     cycle, too_deep")))]
async fn roll_back(
    State(app): State<AppState>,
    PathParams(map): PathParams<String>,
    IfMatch(is): IfMatch,
    Body(Rollback { to }): Body<Rollback>,
) -> Result<Json<RollbackOutcome>, ApiError> {
    let to = i64::try_from(to).unwrap_or(i64::MAX);
    let id = maps::get(app.store.reads(), &map).await?.id;
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Map, &is).await?;
            history::roll_back(tx, &map, to).await
        })
    });
    let changed = write.await.map_err(in_body)?;
    newest(&app, id, changed).await
}

/// A commit that does not exist is named in the body, not in the path.
fn in_body(error: crate::store::StoreError) -> ApiError {
    let error = ApiError::from(error);
    if error.code == "unknown_commit" { error.field("to") } else { error }
}

/// Takes one commit back, if no later one has changed the same rows. It is a commit of its own.
#[utoipa::path(post, path = "/maps/{map}/commits/{commit}/undo", operation_id = "undoCommit", tag = "history",
    params(("map" = String, Path), ("commit" = i64, Path)), responses((status = 200, body = RollbackOutcome),
    (status = 404, body = Problem, description = "unknown_commit"),
    (status = 409, body = Problem, description = "changed_since: `by` is the later commit that has changed the same; \
     in_use: a job works on the map, a name is taken, or there is nothing that can be taken back; cycle, too_deep")))]
async fn undo(
    State(app): State<AppState>,
    PathParams((map, commit)): PathParams<(String, i64)>,
    IfMatch(is): IfMatch,
) -> Result<Json<RollbackOutcome>, ApiError> {
    let id = maps::get(app.store.reads(), &map).await?.id;
    let write = app.store.write(move |tx| {
        Box::pin(async move {
            revisions::check(tx, &map, &Subject::Map, &is).await?;
            history::undo(tx, &map, commit).await
        })
    });
    write.await?;
    newest(&app, id, true).await
}

pub(super) async fn newest(
    app: &AppState,
    map: i64,
    changed: bool,
) -> Result<Json<RollbackOutcome>, ApiError> {
    let db = app.store.reads();
    let id = history::newest(db, map).await?;
    let commit = shown(history::get(db, map, id).await?);
    Ok(Json(RollbackOutcome { changed, commit }))
}

/// The reason that a request gives: text of one line, percent-encoded where it is not ASCII.
/// Errors: `invalid_value`.
pub(super) fn why(headers: &HeaderMap) -> Result<Option<String>, ApiError> {
    let mut given = headers.get_all(WHY).iter();
    let Some(value) = given.next() else { return Ok(None) };
    let text = decoded(value).filter(|_| given.next().is_none()).map(|text| text.trim().to_owned());
    let refused = |detail| ApiError::invalid("invalid_value", WHY.as_str(), detail);
    let Some(text) = text else {
        let detail = format!("one line of 1 to {MAX_WHY} characters, percent-encoded where it is not ASCII");
        return Err(refused(detail));
    };
    check_label(&text, MAX_WHY).map_err(|error| refused(error.to_string()))?;
    Ok(Some(text))
}

/// Percent-encoded UTF-8 as text.
fn decoded(value: &HeaderValue) -> Option<String> {
    let mut bytes = value.as_bytes().iter().copied();
    let mut text = Vec::with_capacity(value.len());
    while let Some(byte) = bytes.next() {
        if byte == b'%' {
            let digit = |byte: Option<u8>| char::from(byte?).to_digit(16);
            let (high, low) = (digit(bytes.next())?, digit(bytes.next())?);
            text.push((high * 16 + low) as u8);
        } else {
            text.push(byte);
        }
    }
    String::from_utf8(text).ok()
}

/// Says of every change of a map that it takes a reason.
pub(super) fn with_reasons(mut document: OpenApi) -> OpenApi {
    let below = format!("{API}/maps/{{map}}");
    for (path, item) in &mut document.paths.paths {
        if !path.starts_with(&below) {
            continue;
        }
        for operation in
            [&mut item.post, &mut item.put, &mut item.patch, &mut item.delete].into_iter().flatten()
        {
            let text = ObjectBuilder::new().schema_type(Type::String).min_length(Some(1));
            let described = "The reason of a change, for the history of the map: one line of at most 200 characters, \
                             percent-encoded where it is not ASCII.";
            let parameter = ParameterBuilder::new()
                .name("Waymark-Why")
                .parameter_in(ParameterIn::Header)
                .description(Some(described))
                .schema(Some(text));
            operation.parameters.get_or_insert_default().push(RefOr::T(parameter.build()));
        }
    }
    document
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_are_one_line_of_text() {
        let read = |values: &[&str]| {
            let headers = values.iter().map(|v| (WHY, HeaderValue::from_bytes(v.as_bytes()).unwrap()));
            why(&headers.collect()).map_err(|error| error.code)
        };
        let text = |text: &str| Ok(Some(text.to_owned()));
        assert_eq!(read(&[]), Ok(None));
        assert_eq!(read(&["the poster hangs elsewhere"]), text("the poster hangs elsewhere"));
        assert_eq!(read(&["t%C3%BCr%20zu",]), text("tür zu"));
        assert_eq!(read(&[&"x".repeat(MAX_WHY)]), text(&"x".repeat(MAX_WHY)));
        for wrong in ["", " ", "100%", "%0", "%0a", "%ff", "%zz", "a%E2%80%AEb"] {
            assert_eq!(read(&[wrong]), Err("invalid_value"), "{wrong}");
        }
        assert_eq!(read(&[&"x".repeat(MAX_WHY + 1)]), Err("invalid_value"));
        assert_eq!(read(&["a", "b"]), Err("invalid_value"));
    }
}
