//! Multipart forms with one picture: parts by name, each once, within their bounds.

use super::{App, error::ApiError, extract::too_large};
use axum::{
    body::Bytes,
    extract::{FromRequest, Multipart, Request},
    http::StatusCode,
};
use std::collections::BTreeMap;

/// Room for part heads and small parts beside the picture.
pub(super) const FORM_OVERHEAD: usize = 64 << 10;
/// Most parts of a form.
const MAX_PARTS: usize = 8;

/// The parts of a form.
#[derive(Debug, Default)]
pub(super) struct Form {
    parts: BTreeMap<String, Bytes>,
}

impl Form {
    /// Reads the whole form. `known` are the names that may occur.
    pub(super) async fn read(app: &App, request: Request, known: &[&str]) -> Result<Self, ApiError> {
        let mut multipart = Multipart::from_request(request, &()).await.map_err(|e| {
            ApiError::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, "not_multipart", e.body_text())
                .field("content-type")
        })?;
        let max = app.config.limits.upload_bytes;
        let refused = |e: axum::extract::multipart::MultipartError| {
            if e.status() == StatusCode::PAYLOAD_TOO_LARGE {
                too_large(max)
            } else {
                ApiError::new(StatusCode::BAD_REQUEST, "bad_multipart", e.body_text()).field("body")
            }
        };
        let mut form = Self::default();
        while let Some(part) = multipart.next_field().await.map_err(refused)? {
            let name = part.name().unwrap_or_default().to_owned();
            if !known.contains(&name.as_str()) {
                let detail = format!("unknown part; known are {}", known.join(", "));
                return Err(ApiError::invalid("unknown_field", clipped(name), detail));
            }
            let bytes = part.bytes().await.map_err(refused)?;
            if bytes.len() > max {
                return Err(too_large(max));
            }
            if form.parts.len() >= MAX_PARTS || form.parts.insert(name.clone(), bytes).is_some() {
                return Err(ApiError::invalid("repeated_field", name, "this part is there more than once"));
            }
        }
        Ok(form)
    }

    /// A part that must be there.
    pub(super) fn needed(&mut self, name: &str) -> Result<Bytes, ApiError> {
        self.optional(name)
            .ok_or_else(|| ApiError::invalid("missing", name, format!("the part `{name}` is missing")))
    }

    /// A part that may be there.
    pub(super) fn optional(&mut self, name: &str) -> Option<Bytes> {
        self.parts.remove(name)
    }
}

/// A name of the client's own making, short enough to be sent back.
fn clipped(mut name: String) -> String {
    name.truncate(name.floor_char_boundary(64));
    name
}
