//! Creations: each is sent with a key, and once more with the same key where its answer was lost.
//! The server makes it once.

use reqwest::{Client, Request, Response, StatusCode, header::RETRY_AFTER};
use std::{
    hash::{BuildHasher, Hasher, RandomState},
    time::Duration,
};

/// The header with the key.
pub(super) const KEY: &str = "idempotency-key";
/// Pause before a repeat, where the server says none.
const PAUSE: Duration = Duration::from_millis(250);
/// Longest pause.
const MAX_PAUSE: Duration = Duration::from_secs(5);

/// A key that was never used: 128 random bits.
pub(super) fn fresh_key() -> String {
    // A fresh hasher of the standard library is keyed by the system's randomness.
    let random = || RandomState::new().build_hasher().finish();
    format!("{:016x}{:016x}", random(), random())
}

/// Sends. A request with a key is sent once more if the connection breaks, or the server has no
/// time for it.
pub(super) async fn execute(http: &Client, request: Request) -> reqwest::Result<Response> {
    let repeat = if request.headers().contains_key(KEY) { request.try_clone() } else { None };
    let answer = http.execute(request).await;
    match repeat.zip(pause_of(&answer)) {
        Some((repeat, pause)) => {
            tokio::time::sleep(pause).await;
            http.execute(repeat).await
        }
        None => answer,
    }
}

/// How long to wait before a repeat; `None` if the answer is final.
fn pause_of(answer: &reqwest::Result<Response>) -> Option<Duration> {
    match answer {
        Ok(answer)
            if [StatusCode::REQUEST_TIMEOUT, StatusCode::SERVICE_UNAVAILABLE].contains(&answer.status()) =>
        {
            let seconds = answer.headers().get(RETRY_AFTER).and_then(|v| v.to_str().ok()?.parse().ok());
            Some(seconds.map_or(PAUSE, Duration::from_secs).min(MAX_PAUSE))
        }
        Ok(_) => None,
        Err(error) => (!error.is_timeout() && !error.is_connect()).then_some(PAUSE),
    }
}
