//! `/tokens` and `/whoami`: who may do what.

use super::{
    AppState,
    answers::page,
    error::ApiError,
    extract::{Body, PathParams, QueryParams, after_number, name, page_limit},
};
use crate::{
    identity::{Principal, Secret, TokenId, TokenText},
    store::{
        now_ms,
        tokens::{self, TokenInsert},
    },
};
use axum::{Extension, Json, extract::State, http::StatusCode};
use protos::api::{CreatedToken, NewToken, Page, PageQuery, Problem, Token, Whoami};
use utoipa_axum::{router::OpenApiRouter, routes};

/// Longest validity of a token that expires: ten years.
const MAX_VALID_S: u64 = 315_360_000;

pub(super) fn router() -> OpenApiRouter<AppState> {
    OpenApiRouter::new().routes(routes!(create, list)).routes(routes!(revoke)).routes(routes!(whoami))
}

/// Makes a token. Its text is in this answer and nowhere else: only a digest is stored.
#[utoipa::path(post, path = "/tokens", operation_id = "createToken",
    tag = "identity", request_body = NewToken, responses(
    (status = 201, body = CreatedToken), (status = 404, body = Problem, description = "unknown_map"),
    (status = 409, body = Problem, description = "too_many"),
    (status = 422, body = Problem, description = "bad_name, invalid_value, out_of_range")))]
async fn create(
    State(app): State<AppState>,
    Body(new): Body<NewToken>,
) -> Result<(StatusCode, Json<CreatedToken>), ApiError> {
    if let Some(maps) = &new.maps
        && !(1..=app.config.limits.maps).contains(&maps.len())
    {
        let detail = format!("1 to {} maps; leave it out to mean all", app.config.limits.maps);
        return Err(ApiError::invalid("out_of_range", "maps", detail));
    }
    let expires_ms = match new.valid_s {
        None => None,
        Some(s) if (1..=MAX_VALID_S).contains(&s) => Some(now_ms() + s as i64 * 1000),
        Some(_) => {
            let detail = format!("1 to {MAX_VALID_S} s; leave it out to mean for ever");
            return Err(ApiError::invalid("out_of_range", "valid_s", detail));
        }
    };
    let secret = Secret::random().map_err(|e| ApiError::internal(&e))?;
    let insert = TokenInsert {
        name: name("name", new.name)?.as_str().to_owned(),
        role: new.role,
        maps: new.maps,
        sha256: secret.digest(),
        expires_ms,
    };
    let token = app.store.write(move |tx| Box::pin(tokens::create(tx, insert))).await?;
    let text = TokenText::stored(token.id, &secret);
    Ok((StatusCode::CREATED, Json(CreatedToken { text, token })))
}

/// Lists tokens by number, with those that were revoked or have expired.
#[utoipa::path(get, path = "/tokens", operation_id = "listTokens", tag = "identity", params(PageQuery),
    responses((status = 200, body = Page<Token>)))]
async fn list(
    State(app): State<AppState>,
    QueryParams(query): QueryParams<PageQuery>,
) -> Result<Json<Page<Token>>, ApiError> {
    let limit = page_limit(query.limit, app.config.limits.page)?;
    let rows = tokens::page(app.store.reads(), after_number(&query)?, limit + 1).await?;
    let total = tokens::count(app.store.reads()).await?;
    Ok(Json(page(rows, limit, total, |row| row.token.id.to_string(), |row| row.token)))
}

/// Revokes a token, and ends the sessions and event streams that it opened.
#[utoipa::path(delete, path = "/tokens/{token}", operation_id = "revokeToken",
    tag = "identity", params(("token" = i64, Path)),
    responses((status = 204), (status = 404, body = Problem, description = "unknown_token")))]
async fn revoke(
    State(app): State<AppState>,
    PathParams(id): PathParams<i64>,
) -> Result<StatusCode, ApiError> {
    app.store.write(move |tx| Box::pin(tokens::revoke(tx, id))).await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Who asks.
#[utoipa::path(get, path = "/whoami", operation_id = "getWhoami",
    tag = "identity", responses((status = 200, body = Whoami)))]
async fn whoami(Extension(principal): Extension<Principal>) -> Json<Whoami> {
    let Principal { token, name, role, maps, expires_ms } = principal;
    let token = match token {
        TokenId::Local => None,
        TokenId::Stored(id) => Some(id),
    };
    let maps = maps.map(|maps| maps.iter().cloned().collect());
    Json(Whoami { name: name.to_string(), role, maps, token, expires_ms })
}
