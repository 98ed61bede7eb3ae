//! The id of a request: that of the client if it is harmless, or the next number. In: the headers.
//! Out: a [`RequestId`].

use axum::http::{HeaderMap, HeaderName, HeaderValue};
use std::sync::atomic::{AtomicU64, Ordering};

/// Carries the id of a request, in and out.
pub(super) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");
/// Longest id taken over from a client.
const MAX_BYTES: usize = 64;

static NEXT: AtomicU64 = AtomicU64::new(1);

/// The id of a request, for its log lines and for the audit log.
#[derive(Debug, Clone)]
pub(super) struct RequestId(pub(super) HeaderValue);

impl RequestId {
    pub(super) fn of(headers: &HeaderMap) -> Self {
        let given = headers.get(REQUEST_ID).filter(|v| {
            (1..=MAX_BYTES).contains(&v.len())
                && v.as_bytes().iter().all(|b| b.is_ascii_alphanumeric() || *b == b'-')
        });
        Self(given.cloned().unwrap_or_else(|| HeaderValue::from(NEXT.fetch_add(1, Ordering::Relaxed))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_of_clients_are_taken_over_only_if_harmless() {
        let of = |id: &'static str| {
            RequestId::of(&HeaderMap::from_iter([(REQUEST_ID, HeaderValue::from_static(id))])).0
        };
        assert_eq!(of("abc-1"), "abc-1");
        assert_ne!(of("a b"), "a b");
    }
}
