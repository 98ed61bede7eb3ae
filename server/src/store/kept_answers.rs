//! Creations with a key (`Idempotency-Key`), and the answers that are kept under their keys. An
//! answer is stored in the transaction of its change: where there is one, there is the other. A
//! repeat gets the answer and changes nothing.
//!
//! The key travels beside the functions that write. [`CreationKey::scope`] puts it into the task,
//! [`answered`] says how the answer is made of what the write returns, and `Store::write` takes
//! both along to the writer.

use super::{Store, StoreError, Tx, db, now_ms, statements::statements};
use serde::Serialize;
use std::{
    any::Any,
    collections::BTreeSet,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

statements! {
    FIND = "SELECT request_sha256, status, body FROM kept_answers WHERE key = $1 AND created_ms > $2";
    KEEP = "INSERT INTO kept_answers (key, request_sha256, status, body, created_ms) \
            VALUES ($1, $2, $3, $4, $5)";
    // One under the same key is older than a day. There is room for one more after it.
    FORGET = "DELETE FROM kept_answers WHERE key = $1 OR created_ms <= $2 \
              OR id <= (SELECT max(id) FROM kept_answers) + 1 - $3";
}

/// How long an answer is kept, ms.
const KEPT_MS: i64 = 24 * 3600 * 1000;

/// SHA-256 of a request.
pub(crate) type RequestDigest = [u8; 32];

/// An answer as it is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Answer {
    /// 200 to 299.
    pub(crate) status: u16,
    /// JSON.
    pub(crate) body: String,
}

impl Answer {
    /// An answer with this body. Errors: the body is no JSON.
    pub(crate) fn json(status: u16, body: &impl Serialize) -> Result<Self, StoreError> {
        let damaged =
            |e: serde_json::Error| StoreError::Damaged { what: "an answer".into(), reason: e.to_string() };
        serde_json::to_string(body).map(|body| Self { status, body }).map_err(damaged)
    }
}

/// The keys of creations that are at work: one for each open request with a key, or write of one.
#[derive(Debug, Clone, Default)]
pub(super) struct InFlightKeys(Arc<Mutex<BTreeSet<String>>>);

impl InFlightKeys {
    fn lock(&self) -> MutexGuard<'_, BTreeSet<String>> {
        // Every change is one insertion or removal: nothing can be left half done.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The key of a creation that is at work, until the last of its request and its write has ended.
#[derive(Debug)]
pub(crate) struct CreationKey {
    key: String,
    request: RequestDigest,
    at_work: InFlightKeys,
    /// Most answers that are kept.
    max: usize,
}

impl Drop for CreationKey {
    fn drop(&mut self) {
        self.at_work.lock().remove(&self.key);
    }
}

/// What a request with a key is.
#[derive(Debug)]
pub(crate) enum Creation {
    /// The first one, or the first after all that were refused.
    First(CreationKey),
    /// A repeat of one that was answered so.
    Repeat(Answer),
}

tokio::task_local! {
    static KEY: Arc<CreationKey>;
    static KEEPING: IdempotencyRecord;
}

impl CreationKey {
    /// Handles a request under this key.
    pub(crate) async fn scope<T>(self, request: impl Future<Output = T>) -> T {
        KEY.scope(Arc::new(self), request).await
    }
}

type AnswerOf = dyn Fn(&dyn Any) -> Option<Result<Answer, StoreError>> + Send + Sync;

/// A key, and how the answer under it is made.
#[derive(Clone)]
pub(super) struct IdempotencyRecord {
    key: Arc<CreationKey>,
    answer_of: Arc<AnswerOf>,
}

/// Does `work`, which writes once and gets a `T` of it. If the request has a key, `answer` to that
/// is kept in the transaction.
pub(crate) async fn answered<T: 'static, R>(
    answer: impl Fn(&T) -> Result<Answer, StoreError> + Send + Sync + 'static,
    work: impl Future<Output = R>,
) -> R {
    let Ok(key) = KEY.try_with(Arc::clone) else { return work.await };
    let answer_of = Arc::new(move |made: &dyn Any| made.downcast_ref().map(&answer));
    KEEPING.scope(IdempotencyRecord { key, answer_of }, work).await
}

impl IdempotencyRecord {
    /// That of the present task, if its request has a key.
    pub(super) fn current() -> Option<Self> {
        KEEPING.try_with(Self::clone).ok()
    }

    /// Keeps the answer to what a write has made.
    pub(super) async fn keep(
        &self,
        tx: &mut Tx,
        answer: Option<Result<Answer, StoreError>>,
    ) -> Result<(), StoreError> {
        let Some(answer) = answer else { return Ok(()) };
        let (Answer { status, body }, now) = (answer?, now_ms());
        let oldest = db::query(FORGET).bind(&self.key.key).bind(now - KEPT_MS).bind(self.key.max as i64);
        oldest.execute(&mut tx.conn).await.map_err(StoreError::during("forget answers"))?;
        let kept = db::query(KEEP)
            .bind(&self.key.key)
            .bind(&self.key.request[..])
            .bind(status)
            .bind(body)
            .bind(now)
            .execute(&mut tx.conn)
            .await;
        kept.map_err(StoreError::during("keep an answer")).map(drop)
    }

    /// The answer to what a write has made; `None` if that is something else than was announced.
    pub(super) fn answer_to(&self, made: &dyn Any) -> Option<Result<Answer, StoreError>> {
        (self.answer_of)(made)
    }
}

impl Store {
    /// Whether a request with this key is at work.
    #[cfg(test)]
    pub(crate) fn is_at_work(&self, key: &str) -> bool {
        self.keys.lock().contains(key)
    }

    /// What a request with this key is. Errors: `KeyAtWork`, `KeyReused`.
    pub(crate) async fn creation(&self, key: &str, request: RequestDigest) -> Result<Creation, StoreError> {
        if !self.keys.lock().insert(key.to_owned()) {
            return Err(StoreError::KeyAtWork);
        }
        // From here on no other request has this key: what it stores was stored before it was at
        // work.
        let key =
            CreationKey { key: key.to_owned(), request, at_work: self.keys.clone(), max: self.kept_answers };
        let at = || StoreError::during("look for an answer");
        let row = db::query(FIND).bind(&key.key).bind(now_ms() - KEPT_MS).fetch_optional(&self.reads).await;
        let Some(row) = row.map_err(at())? else { return Ok(Creation::First(key)) };
        let (was, status): (Vec<u8>, i64) =
            (row.try_get("request_sha256").map_err(at())?, row.try_get("status").map_err(at())?);
        if was != key.request {
            return Err(StoreError::KeyReused);
        }
        let body = row.try_get("body").map_err(at())?;
        Ok(Creation::Repeat(Answer { status: status as u16, body }))
    }
}

#[cfg(test)]
mod tests;
