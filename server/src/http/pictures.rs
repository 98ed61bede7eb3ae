//! Pictures as answers, with their digest as `ETag`. A client that has the picture already
//! (`If-None-Match`) gets 304 and no bytes.

use super::{AppState, error::ApiError};
use crate::store::pictures::{digest, hex};
use axum::{
    extract::FromRequestParts,
    http::{StatusCode, header, request::Parts},
    response::{IntoResponse, Response},
};
use engine::picture;
use std::convert::Infallible;

/// For what never changes under its path.
pub(super) const FOREVER: &str = "private, max-age=86400, immutable";
/// For what may be another picture the next time: ask again, with the digest.
pub(super) const ASK_AGAIN: &str = "private, no-cache";

/// The digests of the pictures that the client has.
#[derive(Debug, Default)]
pub(super) struct IfNoneMatch(String);

impl FromRequestParts<AppState> for IfNoneMatch {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &AppState) -> Result<Self, Infallible> {
        let lines = parts.headers.get_all(header::IF_NONE_MATCH).iter();
        Ok(Self(lines.filter_map(|line| line.to_str().ok()).collect::<Vec<_>>().join(",")))
    }
}

impl IfNoneMatch {
    /// By weak comparison (RFC 9110, 13.1.2).
    fn has(&self, tag: &str) -> bool {
        let mut tags = self.0.split(',').map(|each| each.trim().trim_start_matches("W/"));
        tags.any(|each| each == "*" || each == tag)
    }
}

/// What is said of a picture besides its bytes.
#[derive(Debug)]
pub(super) struct PictureHead {
    tag: String,
    /// `png` or `jpeg`.
    kind: String,
    cache_control: &'static str,
}

impl PictureHead {
    /// Of a picture with this digest.
    pub(super) fn new(kind: &str, sha256: &[u8; 32], cache_control: &'static str) -> Self {
        Self { tag: format!("\"{}\"", hex(sha256)), kind: kind.to_owned(), cache_control }
    }

    /// The answer; `bytes` is asked for only if the client does not have the picture.
    pub(super) async fn answer(
        self,
        known: &IfNoneMatch,
        bytes: impl Future<Output = Result<Vec<u8>, ApiError>>,
    ) -> Result<Response, ApiError> {
        let Self { tag, kind, cache_control } = self;
        let is_known = known.has(&tag);
        let headers = [(header::ETAG, tag), (header::CACHE_CONTROL, cache_control.to_owned())];
        if is_known {
            return Ok((StatusCode::NOT_MODIFIED, headers).into_response());
        }
        let kind = [(header::CONTENT_TYPE, format!("image/{kind}"))];
        Ok((headers, kind, bytes.await?).into_response())
    }
}

/// A square grey picture as PNG.
pub(super) async fn grey_answer(
    known: &IfNoneMatch,
    cache_control: &'static str,
    (side, grey): (usize, &[u8]),
) -> Result<Response, ApiError> {
    let png = async { picture::png(side, side, grey).map_err(|e| ApiError::internal(&e)) };
    PictureHead::new("png", &digest(grey), cache_control).answer(known, png).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_has_what_it_names_strongly_weakly_or_by_a_star() {
        for (text, has) in [
            ("\"a\"", true),
            ("W/\"a\"", true),
            ("\"b\", \"a\"", true),
            ("*", true),
            ("\"b\"", false),
            ("a", false),
            ("", false),
        ] {
            assert_eq!(IfNoneMatch(text.to_owned()).has("\"a\""), has, "{text}");
        }
    }
}
