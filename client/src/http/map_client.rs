//! A connection to the server's HTTP interface: sends requests with a token, reads answers, turns
//! refusals into errors.
//!
//! A client without a token takes that of a server on this machine, once the server has answered
//! 401 (`local_token`).

use super::{
    creation::{KEY, execute, fresh_key},
    local_token::{self, LocalTokenError},
    operation::{Operation, PathValue, escaped, path_of, query_of},
    tls,
};
use crate::ClientError;
use protos::api::{Page, PageQuery, Problem};
use reqwest::{
    Method, Request, RequestBuilder, Response, StatusCode,
    header::{AUTHORIZATION, ETAG, HeaderValue, IF_MATCH, WWW_AUTHENTICATE},
};
use serde::{Serialize, de::DeserializeOwned};
use std::{
    fmt,
    sync::{Arc, PoisonError, RwLock},
    time::Duration,
};

/// Carries the reason of a change.
const WHY: &str = "waymark-why";
/// Longest wait for one request.
const REQUEST_TIMEOUT: Duration = Duration::from_mins(1);

/// A connection to the server's HTTP interface.
#[derive(Debug, Clone)]
pub struct MapClient {
    http: reqwest::Client,
    base: String,
    token: Arc<RwLock<Option<TokenText>>>,
    /// Port of a server on this machine, whose local token may be taken.
    local_port: Option<u16>,
    key: Option<String>,
    revision: Option<String>,
    why: Option<String>,
}

/// A token, not shown.
#[derive(Clone, PartialEq, Eq)]
struct TokenText(String);

impl fmt::Debug for TokenText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("…")
    }
}

/// What was read, with its revision for [`MapClient::if_match`].
#[derive(Debug, Clone, PartialEq)]
pub struct Revised<T> {
    /// What was read.
    pub value: T,
    /// Another one after every edit or lesson, the same after what robots do by themselves.
    pub revision: String,
}

impl MapClient {
    /// A client of the server at `base`, such as `http://127.0.0.1:8080`. Nothing is sent yet. On
    /// this machine and for this user no token is needed; else [`MapClient::with_token`].
    ///
    /// With `https`, the server's certificate must be signed by an authority of the system, or see
    /// [`MapClient::with_authority`].
    pub fn new(base: &str) -> Result<Self, ClientError> {
        Self::believing(base, None)
    }

    /// The same for a server whose certificate is signed by one of these authorities, PEM, and by
    /// no other: for one with its built-in authority, the file `tls/authority.pem` of its data
    /// directory.
    pub fn with_authority(base: &str, authority_pem: &[u8]) -> Result<Self, ClientError> {
        Self::believing(base, Some(authority_pem))
    }

    fn believing(base: &str, authority_pem: Option<&[u8]>) -> Result<Self, ClientError> {
        // Ignores proxies of the environment: the server is in the robot's own network.
        let builder = reqwest::Client::builder().no_proxy().timeout(REQUEST_TIMEOUT);
        let http = tls::encrypted(builder, base, authority_pem)?.build();
        let http = http.map_err(|e| ClientError::Http { url: base.to_owned(), detail: reason(&e) })?;
        let base = base.trim_end_matches('/').to_owned();
        let local_port = local_token::local_port(&base);
        Ok(Self { http, base, token: Arc::default(), local_port, key: None, revision: None, why: None })
    }

    /// The same client with this token, as `waymark token create` prints it. No other is taken.
    #[must_use]
    pub fn with_token(self, token: &str) -> Self {
        let token = Arc::new(RwLock::new(Some(TokenText(token.trim().to_owned()))));
        Self { token, local_port: None, ..self }
    }

    /// The same with this key for its next creation, in place of a fresh one: a program that
    /// repeats a creation by itself, also after its own restart, gives the same key again. The
    /// server makes it once, and answers with `idempotency_key_reused` if the key was used for
    /// another one. 1 to 128 visible ASCII characters; kept for a day.
    #[must_use]
    pub fn with_idempotency_key(&self, key: &str) -> Self {
        Self { key: Some(key.to_owned()), ..self.clone() }
    }

    /// The same for changes of what still has this revision: another one is refused with
    /// `changed_meanwhile` (status 412) and changes nothing. Without it, changes are made whatever
    /// is there.
    ///
    /// ```no_run
    /// # async fn example(maps: client::MapClient) -> Result<(), client::ClientError> {
    /// let landmark = maps.landmark("hall", "poster").await?;
    /// // ... a person looks at it ...
    /// maps.if_match(&landmark.revision).delete_landmark("hall", "poster").await?;
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn if_match(&self, revision: &str) -> Self {
        Self { revision: Some(revision.to_owned()), ..self.clone() }
    }

    /// The same with this reason for its changes: the history of the map has it. One line, 1 to 200
    /// characters.
    #[must_use]
    pub fn with_reason(&self, why: &str) -> Self {
        Self { why: Some(why.to_owned()), ..self.clone() }
    }

    /// The token that requests carry now.
    pub(super) fn token(&self) -> Option<String> {
        self.token.read().unwrap_or_else(PoisonError::into_inner).as_ref().map(|token| token.0.clone())
    }

    /// A request of an operation; `at` are the parameters of its path, in order.
    pub(super) fn ask(
        &self,
        operation: &Operation,
        at: &[PathValue<'_>],
    ) -> Result<RequestBuilder, ClientError> {
        self.ask_at(operation, at, "")
    }

    /// The same with a query, `?` first.
    pub(super) fn ask_at(
        &self,
        operation: &Operation,
        at: &[PathValue<'_>],
        query: &str,
    ) -> Result<RequestBuilder, ClientError> {
        let path = path_of(operation.path, at)?;
        let url = format!("{}/api/v1{path}{query}", self.base);
        let mut request = self.http.request(operation.method.clone(), url);
        if operation.takes_key() {
            request = request.header(KEY, self.key.clone().unwrap_or_else(fresh_key));
        }
        if operation.takes_revision() {
            let known = self.revision.as_ref().map(|revision| format!("\"{revision}\""));
            request = request.header(IF_MATCH, known.unwrap_or_else(|| "*".to_owned()));
        }
        if let Some(why) = self.why.as_ref().filter(|_| operation.method != Method::GET) {
            request = request.header(WHY, escaped(why));
        }
        Ok(request)
    }

    /// The same with a query.
    pub(super) fn ask_query(
        &self,
        operation: &Operation,
        at: &[PathValue<'_>],
        query: &impl Serialize,
    ) -> Result<RequestBuilder, ClientError> {
        let (path, query) = (path_of(operation.path, at)?, query_of(query));
        Ok(self.http.request(operation.method.clone(), format!("{}/api/v1{path}{query}", self.base)))
    }

    /// Every page of a list.
    pub(super) async fn all<T: DeserializeOwned>(
        &self,
        operation: &Operation,
        at: &[PathValue<'_>],
    ) -> Result<Vec<T>, ClientError> {
        let mut items = Vec::new();
        let mut query = PageQuery::default();
        loop {
            let page: Page<T> = self.send(self.ask_query(operation, at, &query)?).await?;
            items.extend(page.items);
            if page.next.is_none() {
                return Ok(items);
            }
            query.cursor = page.next;
        }
    }

    /// Sends, and reads the answer.
    pub(super) async fn send<T: DeserializeOwned>(&self, request: RequestBuilder) -> Result<T, ClientError> {
        let response = self.checked(request).await?;
        let url = response.url().to_string();
        let bytes = whole(response).await?;
        serde_json::from_slice(&bytes).map_err(|e| ClientError::Unexpected { url, detail: e.to_string() })
    }

    /// Sends, and reads the answer with its revision.
    pub(super) async fn revised<T: DeserializeOwned>(
        &self,
        request: RequestBuilder,
    ) -> Result<Revised<T>, ClientError> {
        let response = self.checked(request).await?;
        let url = response.url().to_string();
        let tag = response.headers().get(ETAG).and_then(|tag| tag.to_str().ok()?.split('"').nth(1));
        let unexpected = |detail: String| ClientError::Unexpected { url: url.clone(), detail };
        let revision = tag.map(str::to_owned).ok_or_else(|| unexpected("no revision in ETag".to_owned()))?;
        let value = serde_json::from_slice(&whole(response).await?).map_err(|e| unexpected(e.to_string()))?;
        Ok(Revised { value, revision })
    }

    /// Sends; the answer is empty.
    pub(super) async fn done(&self, request: RequestBuilder) -> Result<(), ClientError> {
        self.checked(request).await.map(drop)
    }

    /// Sends, and returns the raw body of the answer.
    pub(super) async fn bytes(&self, request: RequestBuilder) -> Result<Vec<u8>, ClientError> {
        whole(self.checked(request).await?).await
    }

    /// Sends, and turns refusals into errors. A 401 of a server on this machine is followed by a
    /// second try with its token.
    pub(super) async fn checked(&self, request: RequestBuilder) -> Result<Response, ClientError> {
        let request = request.build().map_err(|e| self.unsent(&e))?;
        let again = request.try_clone();
        // A form is a stream that can be sent once, and a refusal may break off a large body: the
        // token is found before.
        if again.is_none() || (request.body().is_some() && self.token().is_none()) {
            self.find_local_token().await;
        }
        let sent = self.token();
        let response = self.execute(request, sent.as_deref()).await?;
        match (self.take_local_token(&response, sent.as_deref()), again) {
            (Ok(true), Some(again)) => {
                refused(self.execute(again, self.token().as_deref()).await?, None).await
            }
            (Ok(_), _) => refused(response, None).await,
            (Err(error), _) => refused(response, Some(error)).await,
        }
    }

    /// Makes sure that the token is that of the server on this machine, if there is one and no
    /// other token was given. What goes wrong here goes wrong with the request, too, which says so.
    async fn find_local_token(&self) {
        let asked = self.http.request(Method::GET, format!("{}/api/v1/whoami", self.base)).build();
        if let Some(asked) = asked.ok().filter(|_| self.local_port.is_some()) {
            let sent = self.token();
            if let Ok(response) = self.execute(asked, sent.as_deref()).await {
                self.take_local_token(&response, sent.as_deref()).ok();
            }
        }
    }

    async fn execute(&self, mut request: Request, token: Option<&str>) -> Result<Response, ClientError> {
        if let Some(token) = token
            && let Ok(mut value) = HeaderValue::from_str(&format!("Bearer {token}"))
        {
            value.set_sensitive(true);
            request.headers_mut().insert(AUTHORIZATION, value);
        }
        execute(&self.http, request).await.map_err(|e| self.unsent(&e))
    }

    /// Takes the local token that a 401 names. Whether it is another than the one that was sent.
    fn take_local_token(&self, response: &Response, sent: Option<&str>) -> Result<bool, LocalTokenError> {
        let challenge = response.headers().get(WWW_AUTHENTICATE);
        let Some((port, challenge)) = self.local_port.zip(challenge) else { return Ok(false) };
        if response.status() != StatusCode::UNAUTHORIZED {
            return Ok(false);
        }
        let Some(file) = local_token::named_file(challenge) else { return Ok(false) };
        let found = local_token::read(&file, port)?;
        let is_other = sent != Some(found.as_str());
        *self.token.write().unwrap_or_else(PoisonError::into_inner) = Some(TokenText(found));
        Ok(is_other)
    }

    fn unsent(&self, error: &reqwest::Error) -> ClientError {
        let url = error.url().map_or_else(|| self.base.clone(), ToString::to_string);
        match tls::untrusted(error) {
            Some(detail) => ClientError::Untrusted { url, detail },
            None => ClientError::Http { url, detail: reason(error) },
        }
    }
}

/// The answer, or what it refuses. `local` says why the local token was not taken.
async fn refused(response: Response, local: Option<LocalTokenError>) -> Result<Response, ClientError> {
    let status = response.status();
    if status.is_success() {
        return Ok(response);
    }
    let body = response.bytes().await.unwrap_or_default();
    let problem: Problem = serde_json::from_slice(&body).unwrap_or_default();
    let why = local.map(|error| format!(" (the local token is not used: {error})")).unwrap_or_default();
    Err(ClientError::Refused {
        status: status.as_u16(),
        code: if problem.code.is_empty() { "unknown".to_owned() } else { problem.code },
        field: problem.field.unwrap_or_default(),
        detail: problem.detail + &why,
        more: problem.more,
    })
}

/// The whole body of an answer.
pub(super) async fn whole(response: Response) -> Result<Vec<u8>, ClientError> {
    let url = response.url().to_string();
    let bytes = response.bytes().await.map_err(|e| ClientError::Http { url, detail: reason(&e) })?;
    Ok(bytes.to_vec())
}

/// An error with its causes, which the outer message lacks.
pub(super) fn reason(error: &reqwest::Error) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(inner) = cause {
        text = format!("{text}: {inner}");
        cause = inner.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_may_be_made_on_any_thread() {
        fn sent<T: Send>(_: T) {}
        let maps = MapClient::new("http://127.0.0.1:1").unwrap();
        sent(maps.maps());
        sent(maps.delete_view("hall", "poster", 1));
        sent(maps.live_events("hall"));
    }

    #[tokio::test]
    async fn an_unreachable_server_gives_advice() {
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let error = MapClient::new(&format!("http://{free}")).unwrap().maps().await.unwrap_err();
        let text = error.to_string();
        assert!(text.contains("waymark serve") && text.contains(&free.to_string()), "{text}");
    }
}
