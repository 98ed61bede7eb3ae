//! Forms with a picture (`multipart/form-data`), whole in memory, so that they can be sent a second
//! time.

use super::creation::fresh_key;
use reqwest::{RequestBuilder, header::CONTENT_TYPE};

#[derive(Debug)]
pub(super) struct Form {
    boundary: String,
    body: Vec<u8>,
}

impl Form {
    /// A form without parts.
    pub(super) fn new() -> Self {
        Self { boundary: fresh_key(), body: Vec::new() }
    }

    /// A form with a photograph.
    pub(super) fn with_image(image: &[u8]) -> Self {
        let mut form = Self::new();
        form.body.reserve(image.len() + 1024);
        form.part("name=\"image\"; filename=\"image\"", image)
    }

    /// The same with a text.
    pub(super) fn text(self, name: &'static str, value: &str) -> Self {
        self.part(&format!("name=\"{name}\""), value.as_bytes())
    }

    fn part(mut self, head: &str, value: &[u8]) -> Self {
        let head = format!("--{}\r\nContent-Disposition: form-data; {head}\r\n\r\n", self.boundary);
        self.body.extend_from_slice(head.as_bytes());
        self.body.extend_from_slice(value);
        self.body.extend_from_slice(b"\r\n");
        self
    }

    /// A request with this form as its body.
    pub(super) fn of(mut self, request: RequestBuilder) -> RequestBuilder {
        self.body.extend_from_slice(format!("--{}--\r\n", self.boundary).as_bytes());
        let kind = format!("multipart/form-data; boundary={}", self.boundary);
        request.header(CONTENT_TYPE, kind).body(self.body)
    }
}
