//! Parts of answers: pages of lists, covariances, stored pictures.

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
