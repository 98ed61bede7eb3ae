//! Response cache for reads of maps, valid until the next commit or publication: pages and robots
//! repeat the same requests. In: an authorised read. Out: the cached answer of an equal read by the
//! same token, or a new one, which is cached.
//!
//! An answer here is a function of committed rows and published snapshots alone. The [`Stamp`] of
//! both is taken before the rows are read; so an answer that is older than its stamp says is never
//! kept.
//!
//! Cache hits are served before routing. A token's rights never change; its expiry is checked on
//! each hit.

use super::{App, AppState, authorise::Caller, safe_headers};
use crate::identity::TokenId;
use axum::{
    body::{Body, Bytes, HttpBody as _, to_bytes},
    extract::{MatchedPath, Request},
    http::{HeaderMap, Method, StatusCode},
    middleware::Next,
    response::{IntoResponse, Response},
};
use std::{
    collections::HashMap,
    sync::{Mutex, MutexGuard, PoisonError},
};

/// What is kept, as the router writes it: reads that rest on committed rows and published snapshots
/// alone.
const REUSED: [&str; 5] = [
    "/api/v1/maps/{map}",
    "/api/v1/maps/{map}/landmarks",
    "/api/v1/maps/{map}/landmarks/{landmark}",
    "/api/v1/maps/{map}/walls",
    "/api/v1/whoami",
];
/// How their paths begin.
const BEGINNINGS: [&str; 2] = ["/api/v1/maps/", "/api/v1/whoami"];
/// Larger answers are made anew, bytes: they are sent rarely, and cost more to send than to make.
const MAX_BODY: u64 = 256 << 10;
/// All bodies and addresses together, bytes. Beyond it, all are forgotten.
const MAX_KEPT: usize = 8 << 20;

/// How many writes were committed and how many snapshots published.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Stamp {
    commits: u64,
    publications: u64,
}

/// What was asked, and by whom: what a token may see is part of an answer.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct Question {
    token: TokenId,
    path_and_query: String,
}

#[derive(Debug, Clone)]
pub(super) struct Answer {
    /// That of its request, of [`REUSED`].
    pub(super) route: &'static str,
    /// All but those of a single request.
    headers: HeaderMap,
    body: Bytes,
}

impl IntoResponse for Answer {
    fn into_response(self) -> Response {
        let mut response = Response::new(Body::from(self.body));
        *response.headers_mut() = self.headers;
        response
    }
}

#[derive(Debug, Default)]
struct CacheEntry {
    stamp: Stamp,
    answers: HashMap<Question, Answer>,
    bytes: usize,
}

/// The answers that are kept.
#[derive(Debug, Default)]
pub(super) struct ReusedAnswers(Mutex<CacheEntry>);

impl ReusedAnswers {
    fn lock(&self) -> MutexGuard<'_, CacheEntry> {
        // What a panic could leave half done is only a count of bytes that is too high.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn get(&self, now: Stamp, question: &Question) -> Option<Answer> {
        let kept = self.lock();
        if kept.stamp == now { kept.answers.get(question).cloned() } else { None }
    }

    /// Keeps an answer that was made of what `read` stands for.
    fn keep(&self, read: Stamp, question: Question, answer: Answer) {
        let address = question.path_and_query.len();
        let mut kept = self.lock();
        let bytes = address + answer.body.len();
        if kept.stamp != read || kept.bytes + bytes > MAX_KEPT {
            *kept = CacheEntry { stamp: read, ..CacheEntry::default() };
        }
        kept.bytes += bytes;
        if let Some(earlier) = kept.answers.insert(question, answer) {
            kept.bytes -= address + earlier.body.len();
        }
    }
}

fn stamp(app: &App) -> Stamp {
    Stamp { commits: app.store.commits(), publications: app.store.snapshots().publications() }
}

/// The kept answer to a read with this valid token. `None` for everything else: it goes on to its
/// route.
pub(super) fn kept(app: &App, request: &Request, token: TokenId) -> Option<Answer> {
    let path = request.uri().path();
    if request.method() != Method::GET || !BEGINNINGS.iter().any(|beginning| path.starts_with(beginning)) {
        return None;
    }
    let question = Question { token, path_and_query: request.uri().path_and_query()?.as_str().to_owned() };
    app.reused.get(stamp(app), &question)
}

/// Answers a read of a map as before if nothing has changed; lets everything else pass.
pub(super) async fn reused(app: &AppState, request: Request, next: Next) -> Response {
    let Some((route, question)) = question(&request) else { return next.run(request).await };
    let now = stamp(app);
    let response = next.run(request).await;
    let is_small = response.body().size_hint().exact().is_some_and(|bytes| bytes <= MAX_BODY);
    if response.status() != StatusCode::OK || !is_small {
        return response;
    }
    let (mut parts, body) = response.into_parts();
    safe_headers::set(&mut parts.headers, &question.path_and_query);
    let Ok(body) = to_bytes(body, MAX_BODY as usize).await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    app.reused.keep(now, question, Answer { route, headers: parts.headers.clone(), body: body.clone() });
    Response::from_parts(parts, Body::from(body))
}

/// The route and what is asked; `None` for what is not kept.
fn question(request: &Request) -> Option<(&'static str, Question)> {
    let matched = request.extensions().get::<MatchedPath>()?.as_str();
    let route = REUSED.into_iter().find(|route| *route == matched && request.method() == Method::GET)?;
    let token = request.extensions().get::<Caller>()?.principal.token;
    Some((route, Question { token, path_and_query: request.uri().path_and_query()?.as_str().to_owned() }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(path: &str) -> Question {
        Question { token: TokenId::Local, path_and_query: path.to_owned() }
    }

    fn answer(bytes: usize) -> Answer {
        Answer { route: REUSED[0], headers: HeaderMap::new(), body: Bytes::from(vec![b'a'; bytes]) }
    }

    #[test]
    fn an_answer_is_used_again_until_something_is_committed_or_published() {
        let (kept, now) = (ReusedAnswers::default(), Stamp { commits: 3, publications: 2 });
        kept.keep(now, question("/a"), answer(7));
        assert_eq!(kept.get(now, &question("/a")).unwrap().body.len(), 7);
        assert!(kept.get(now, &question("/b")).is_none());
        let other = Question { token: TokenId::Stored(1), ..question("/a") };
        assert!(kept.get(now, &other).is_none(), "another token may see less");
        for later in [Stamp { commits: 4, ..now }, Stamp { publications: 3, ..now }] {
            assert!(kept.get(later, &question("/a")).is_none());
        }
        // An answer of rows that were read before the newest one.
        kept.keep(Stamp { commits: 5, ..now }, question("/b"), answer(1));
        assert!(kept.get(Stamp { commits: 5, ..now }, &question("/a")).is_none());
    }

    #[test]
    fn what_is_kept_is_bounded() {
        let (kept, now) = (ReusedAnswers::default(), Stamp::default());
        let pages = 3 * MAX_KEPT / MAX_BODY as usize;
        for page in 0..pages {
            kept.keep(now, question(&format!("/a?cursor={page}")), answer(MAX_BODY as usize));
            assert!(kept.lock().bytes <= MAX_KEPT);
        }
        assert!(kept.get(now, &question(&format!("/a?cursor={}", pages - 1))).is_some());
        let before = kept.lock().bytes;
        kept.keep(now, question(&format!("/a?cursor={}", pages - 1)), answer(MAX_BODY as usize));
        assert_eq!(kept.lock().bytes, before, "one question is counted twice");
    }
}
