//! Parts of answers: pages of lists, covariances, what is kept of creations.

use super::error::ApiError;
use crate::store::kept_answers::{Answer, answered};
use axum::{Json, http::StatusCode};
use nalgebra::Matrix3;
use protos::api::Page;
use serde::Serialize;

/// Nine numbers, row by row.
pub(super) fn row_major(matrix: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|i| matrix[(i / 3, i % 3)])
}

/// A page from one row more than asked for, which only says that there is a next page.
pub(super) fn page<R, T>(
    mut rows: Vec<R>,
    limit: usize,
    key: impl Fn(&R) -> String,
    item: impl Fn(R) -> T,
) -> Page<T> {
    let more = rows.len() > limit;
    rows.truncate(limit);
    let next = if more { rows.last().map(key) } else { None };
    Page { items: rows.into_iter().map(item).collect(), next }
}

/// The answer to a creation: `shown` of what `work` makes by one write. If the request has a key, it is kept with that write.
pub(super) async fn created<T: 'static, B: Serialize, E: Into<ApiError>>(
    shown: impl Fn(&T) -> (StatusCode, B) + Clone + Send + Sync + 'static,
    work: impl Future<Output = Result<T, E>>,
) -> Result<(StatusCode, Json<B>), ApiError> {
    let answer = shown.clone();
    let kept = move |made: &T| {
        let (status, body) = answer(made);
        Answer::json(status.as_u16(), &body)
    };
    let made = answered(kept, work).await.map_err(Into::into)?;
    let (status, body) = shown(&made);
    Ok((status, Json(body)))
}
