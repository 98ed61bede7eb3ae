//! Parts of answers: pages of lists, covariances, stored pictures.

use super::error::ApiError;
use crate::store::StoreError;
use crate::store::pictures::{self, Digest};
use axum::{
    http::header,
    response::{IntoResponse, Response},
};
use nalgebra::Matrix3;
use protos::api::Page;

/// Nine numbers, row by row.
pub(super) fn row_major(matrix: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|i| matrix[(i / 3, i % 3)])
}

/// Rows for a page of `limit`, without those that are not to be shown. `read` gives at most one more than `limit` of the
/// rows after a name.
pub(super) async fn visible_rows<R, F: Future<Output = Result<Vec<R>, StoreError>>>(
    (mut after, limit): (String, usize),
    read: impl Fn(String) -> F,
    name: impl Fn(&R) -> &str,
    is_visible: impl Fn(&R) -> bool,
) -> Result<Vec<R>, ApiError> {
    let mut rows = Vec::new();
    loop {
        let batch = read(after).await?;
        let is_last = batch.len() <= limit;
        after = batch.last().map(|row| name(row).to_owned()).unwrap_or_default();
        rows.extend(batch.into_iter().filter(&is_visible));
        if is_last || rows.len() > limit {
            return Ok(rows);
        }
    }
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

/// A stored picture as it was uploaded; its digest is its `ETag`.
pub(super) fn picture_answer(
    kind: &str,
    sha256: &Digest,
    cache_control: &'static str,
    image: Vec<u8>,
) -> Response {
    let headers = [
        (header::CONTENT_TYPE, format!("image/{kind}")),
        (header::ETAG, format!("\"{}\"", pictures::hex(sha256))),
        (header::CACHE_CONTROL, cache_control.to_owned()),
    ];
    (headers, image).into_response()
}
