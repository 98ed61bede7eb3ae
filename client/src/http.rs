//! Requests of [`MapClient`]: pages, refusals as errors, messages that name the address.

use crate::{
    ClientError, MapClient,
    lessons::{Page, Problem},
};
use reqwest::{Method, RequestBuilder, Response};
use serde::de::DeserializeOwned;

impl MapClient {
    pub(crate) fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.http.request(method, format!("{}/api/v1{path}", self.base))
    }

    /// Every page of a list.
    pub(crate) async fn all<T: DeserializeOwned>(&self, path: &str) -> Result<Vec<T>, ClientError> {
        let mut items = Vec::new();
        let mut cursor: Option<String> = None;
        loop {
            // Cursors come from the server and may hold any character.
            let query = cursor.map_or_else(String::new, |c| format!("?cursor={}", escaped(&c)));
            let page: Page<T> = self.send(self.request(Method::GET, &format!("{path}{query}"))).await?;
            items.extend(page.items);
            match page.next {
                Some(next) => cursor = Some(next),
                None => return Ok(items),
            }
        }
    }

    pub(crate) async fn send<T: DeserializeOwned>(&self, request: RequestBuilder) -> Result<T, ClientError> {
        let response = self.checked(request).await?;
        let url = response.url().to_string();
        let bytes =
            response.bytes().await.map_err(|e| ClientError::Http { url: url.clone(), detail: reason(&e) })?;
        serde_json::from_slice(&bytes).map_err(|e| ClientError::Unexpected { url, detail: e.to_string() })
    }

    /// Sends, and turns refusals into errors.
    pub(crate) async fn checked(&self, request: RequestBuilder) -> Result<Response, ClientError> {
        let response = request.send().await.map_err(|e| {
            let url = e.url().map_or_else(|| self.base.clone(), ToString::to_string);
            ClientError::Http { url, detail: reason(&e) }
        })?;
        let status = response.status();
        if status.is_success() {
            return Ok(response);
        }
        let body = response.bytes().await.unwrap_or_default();
        let problem: Problem = serde_json::from_slice(&body).unwrap_or_default();
        Err(ClientError::Refused {
            status: status.as_u16(),
            code: if problem.code.is_empty() { "unknown".to_owned() } else { problem.code },
            field: problem.field.unwrap_or_default(),
            detail: problem.detail.unwrap_or(problem.title),
        })
    }
}

/// An error with its causes: the outer one alone says little.
pub(crate) fn reason(error: &reqwest::Error) -> String {
    let mut text = error.to_string();
    let mut cause = std::error::Error::source(error);
    while let Some(inner) = cause {
        text = format!("{text}: {inner}");
        cause = inner.source();
    }
    text
}

fn escaped(text: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.~".contains(&b);
    text.bytes().map(|b| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cursors_are_escaped() {
        assert_eq!(escaped("a-1/é&="), "a-1%2F%C3%A9%26%3D");
    }
}
