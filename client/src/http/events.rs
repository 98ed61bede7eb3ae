//! Server-sent events. In: the parts of a body. Out: events, each with its name and data.

use super::map_client::reason;
use crate::ClientError;
use reqwest::{RequestBuilder, Response};
use std::time::Duration;

/// Longest duration of a stream.
const STREAM_TIMEOUT: Duration = Duration::from_hours(24 * 365);
/// The server sends something every 15 s; a stream without data for longer than this has ended.
const SILENCE: Duration = Duration::from_mins(1);
/// Largest event.
const MAX_EVENT_BYTES: usize = 4 << 20;

/// An event: its name and its data.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Event {
    pub(super) name: String,
    pub(super) data: String,
}

/// The events of one answer.
#[derive(Debug)]
pub(super) struct Events {
    response: Response,
    parser: Parser,
}

/// A request whose answer is a stream.
pub(super) fn endless(request: RequestBuilder) -> RequestBuilder {
    request.timeout(STREAM_TIMEOUT)
}

impl Events {
    /// The events of an answer whose status is checked.
    pub(super) fn new(response: Response) -> Self {
        Self { response, parser: Parser::default() }
    }

    /// URL of the stream.
    pub(super) fn url(&self) -> String {
        self.response.url().to_string()
    }

    /// The next event; `None` when the server has ended the stream.
    pub(super) async fn next(&mut self) -> Result<Option<Event>, ClientError> {
        loop {
            if let Some(event) = self.parser.next() {
                return Ok(Some(event));
            }
            if self.parser.buffer.len() > MAX_EVENT_BYTES {
                let detail = format!("an event of more than {MAX_EVENT_BYTES} bytes");
                return Err(ClientError::Unexpected { url: self.url(), detail });
            }
            let url = self.url();
            let broken = |detail| ClientError::Http { url, detail };
            match tokio::time::timeout(SILENCE, self.response.chunk()).await {
                Ok(Ok(Some(part))) => self.parser.push(&part),
                Ok(Ok(None)) => return Ok(None),
                Ok(Err(error)) => return Err(broken(reason(&error))),
                Err(_elapsed) => return Err(broken(format!("silent for {SILENCE:?}"))),
            }
        }
    }
}

/// Cuts a body into events.
#[derive(Debug, Default)]
struct Parser {
    buffer: Vec<u8>,
}

impl Parser {
    fn push(&mut self, part: &[u8]) {
        self.buffer.extend(part.iter().filter(|byte| **byte != b'\r'));
    }

    /// The next whole event; comments are skipped.
    fn next(&mut self) -> Option<Event> {
        loop {
            let end = self.buffer.windows(2).position(|two| two == b"\n\n")?;
            let block: Vec<u8> = self.buffer.drain(..end + 2).collect();
            let block = String::from_utf8_lossy(&block);
            let field = |name: &str| {
                let values = block.lines().filter_map(move |line| line.strip_prefix(name)?.strip_prefix(':'));
                values.map(|value| value.strip_prefix(' ').unwrap_or(value).to_owned()).collect::<Vec<_>>()
            };
            let (names, data) = (field("event"), field("data"));
            if !names.is_empty() || !data.is_empty() {
                let name = names.into_iter().next_back().unwrap_or_else(|| "message".to_owned());
                return Some(Event { name, data: data.join("\n") });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_whole_for_every_cut_of_the_body() {
        let body = b":\n\nevent: pose\ndata: {\"a\": 1}\n\n: still here\n\ndata: x\r\ndata: y\r\n\r\nevent: cut\ndata: ";
        for cut in 0..body.len() {
            let mut parser = Parser::default();
            let mut events = Vec::new();
            for part in [&body[..cut], &body[cut..]] {
                parser.push(part);
                events.extend(std::iter::from_fn(|| parser.next()));
            }
            let parsed: Vec<_> = events.iter().map(|e| (e.name.as_str(), e.data.as_str())).collect();
            assert_eq!(parsed, [("pose", r#"{"a": 1}"#), ("message", "x\ny")], "cut at {cut}");
        }
    }
}
