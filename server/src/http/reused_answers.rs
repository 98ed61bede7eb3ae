//! Answers to reads of maps, kept until anything is committed or published: pages and robots ask for the same again and again.
//! In: a read that was authorised. Out: the answer of an earlier equal read by the same token, or a new one, which is kept.
//!
//! An answer here is a function of committed rows and published snapshots alone. The [`Stamp`] of both is taken before the
//! rows are read; so an answer that is older than its stamp says is never kept.
//!
//! A kept answer is given at the door, before the request has found its route: tokens do not change but by their end, which
//! is looked at each time, and what is kept was asked by the same token before.

use super::{
    API, AppState,
    authorise::{Asker, bearer},
};
use crate::{identity::TokenId, store::now_ms};
use axum::{
    body::{Body, Bytes, HttpBody as _, to_bytes},
    extract::{MatchedPath, Request},
    http::{HeaderMap, HeaderValue, Method, StatusCode, header},
    middleware::Next,
    response::{IntoResponse, Response},
};
use std::{
    collections::HashMap,
    sync::{Mutex, MutexGuard, PoisonError},
};

/// What is kept, below [`API`]: reads that rest on committed rows and published snapshots alone.
const REUSED: [&str; 5] = [
    "/maps/{map}",
    "/maps/{map}/landmarks",
    "/maps/{map}/landmarks/{landmark}",
    "/maps/{map}/walls",
    "/whoami",
];
/// The same as the router writes them.
const ROUTES: [&str; 5] = [
    "/api/v1/maps/{map}",
    "/api/v1/maps/{map}/landmarks",
    "/api/v1/maps/{map}/landmarks/{landmark}",
    "/api/v1/maps/{map}/walls",
    "/api/v1/whoami",
];
/// How their paths begin.
const BEGINNINGS: [&str; 2] = ["/maps/", "/whoami"];
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
struct Answer {
    content_type: HeaderValue,
    etag: Option<HeaderValue>,
    body: Bytes,
}

impl IntoResponse for Answer {
    fn into_response(self) -> Response {
        let mut headers = HeaderMap::with_capacity(16);
        headers.insert(header::CONTENT_TYPE, self.content_type);
        headers.extend(self.etag.map(|tag| (header::ETAG, tag)));
        (headers, self.body).into_response()
    }
}

#[derive(Debug, Default)]
struct Kept {
    stamp: Stamp,
    answers: HashMap<Question, Answer>,
    bytes: usize,
}

/// The answers that are kept.
#[derive(Debug, Default)]
pub(super) struct ReusedAnswers(Mutex<Kept>);

impl ReusedAnswers {
    fn lock(&self) -> MutexGuard<'_, Kept> {
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
            *kept = Kept { stamp: read, ..Kept::default() };
        }
        kept.bytes += bytes;
        if let Some(earlier) = kept.answers.insert(question, answer) {
            kept.bytes -= address + earlier.body.len();
        }
    }
}

fn stamp(app: &AppState) -> Stamp {
    Stamp { commits: app.store.commits(), publications: app.store.snapshots().publications() }
}

/// The kept answer to a read with a token that is still valid. `None` for everything else: it goes on to its route.
pub(super) fn kept(app: &AppState, request: &Request) -> Option<Response> {
    let path = request.uri().path().strip_prefix(API)?;
    if request.method() != Method::GET || !BEGINNINGS.iter().any(|beginning| path.starts_with(beginning)) {
        return None;
    }
    let token = bearer(request.headers().get(header::AUTHORIZATION)?)?;
    let token = app.store.tokens().principal_of(token, now_ms()).ok()?.token;
    let question = Question { token, path_and_query: request.uri().path_and_query()?.as_str().to_owned() };
    Some(app.reused.get(stamp(app), &question)?.into_response())
}

/// The route of an answer that is given before the request has found it, as the router writes it.
pub(super) fn template(path: &str) -> Option<&'static str> {
    let path = path.strip_prefix(API)?;
    let fits = |route: &str| {
        let pairs = || route.split('/').zip(path.split('/'));
        let is_as_long = route.split('/').count() == path.split('/').count();
        is_as_long && pairs().all(|(a, b)| a == b || a.starts_with('{'))
    };
    ROUTES.into_iter().find(|route| fits(&route[API.len()..]))
}

/// Answers a read of a map as before if nothing has changed; lets everything else pass.
pub(super) async fn reused(app: &AppState, request: Request, next: Next) -> Response {
    let Some(question) = question(&request) else { return next.run(request).await };
    let now = stamp(app);
    // Sessions of pages have no token to look at before.
    if let Some(answer) = app.reused.get(now, &question) {
        return answer.into_response();
    }
    let response = next.run(request).await;
    let is_small = response.body().size_hint().exact().is_some_and(|bytes| bytes <= MAX_BODY);
    if response.status() != StatusCode::OK || !is_small {
        return response;
    }
    let (parts, body) = response.into_parts();
    let Some(content_type) = parts.headers.get(header::CONTENT_TYPE).cloned() else {
        return Response::from_parts(parts, body);
    };
    let Ok(body) = to_bytes(body, MAX_BODY as usize).await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    let etag = parts.headers.get(header::ETAG).cloned();
    app.reused.keep(now, question, Answer { content_type, etag, body: body.clone() });
    Response::from_parts(parts, Body::from(body))
}

/// `None` for what is not kept.
fn question(request: &Request) -> Option<Question> {
    let matched = request.extensions().get::<MatchedPath>()?.as_str().strip_prefix(API)?;
    if request.method() != Method::GET || !REUSED.contains(&matched) {
        return None;
    }
    let token = request.extensions().get::<Asker>()?.principal.token;
    Some(Question { token, path_and_query: request.uri().path_and_query()?.as_str().to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(path: &str) -> Question {
        Question { token: TokenId::Local, path_and_query: path.to_owned() }
    }

    fn answer(bytes: usize) -> Answer {
        let content_type = HeaderValue::from_static("application/json");
        Answer { content_type, etag: None, body: Bytes::from(vec![b'a'; bytes]) }
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
