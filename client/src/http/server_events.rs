//! What changes on the server, as a stream that outlives its connections.

use super::{
    events::{Events, endless},
    map_client::MapClient,
    operation::operations,
};
use crate::ClientError;
use protos::api::{EventQuery, ServerEvent, ServerEventBody};
use serde_json::Value;
use std::time::Duration;

operations! {
    EVENTS: GET "/events" => events,
}

/// First pause before the next connection; it doubles with each that fails.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
/// Longest pause.
const MAX_PAUSE: Duration = Duration::from_secs(5);

/// The events of a server, one after the other. A lost connection is replaced, and the events
/// meanwhile follow; where the server has forgotten some of them, [`ServerEventBody::Reset`] says
/// to read anew.
#[derive(Debug)]
pub struct ServerEvents {
    client: MapClient,
    /// With the id of the last event.
    query: EventQuery,
    stream: Option<Events>,
    pause: Duration,
}

impl MapClient {
    /// Follows what changes on the server, as far as the token may see it.
    pub async fn events(&self, query: &EventQuery) -> Result<ServerEvents, ClientError> {
        let (client, query) = (self.clone(), query.clone());
        let mut events = ServerEvents { client, query, stream: None, pause: FIRST_PAUSE };
        // A first connection that fails says why.
        events.stream = Some(events.connect().await?);
        Ok(events)
    }
}

impl ServerEvents {
    async fn connect(&self) -> Result<Events, ClientError> {
        let request = endless(self.client.ask_query(&EVENTS, &[], &self.query)?);
        Ok(Events::new(self.client.checked(request).await?))
    }

    /// The id of the last event, for a query that goes on after it: also after a start of this
    /// program.
    pub fn last_event_id(&self) -> Option<&str> {
        self.query.last_event_id.as_deref()
    }

    /// The next event; waits for it, and connects again as long as the server cannot be reached or
    /// is busy. Errors: the server refuses, for instance because the token was revoked.
    pub async fn next(&mut self) -> Result<ServerEvent, ClientError> {
        loop {
            let Some(stream) = &mut self.stream else {
                match self.connect().await {
                    Ok(stream) => self.stream = Some(stream),
                    Err(error) if is_passing(&error) => {
                        tokio::time::sleep(self.pause).await;
                        self.pause = (2 * self.pause).min(MAX_PAUSE);
                    }
                    Err(error) => return Err(error),
                }
                continue;
            };
            let Ok(Some(event)) = stream.next().await else {
                self.stream = None;
                tokio::time::sleep(self.pause).await;
                continue;
            };
            self.pause = FIRST_PAUSE;
            if let Some(event) = self.read(&event.data) {
                return Ok(event);
            }
        }
    }

    /// An event, if it is for whoever follows: not the first of a connection, and not one that only
    /// a newer server sends.
    fn read(&mut self, data: &str) -> Option<ServerEvent> {
        let value: Value = serde_json::from_str(data).ok()?;
        if let Some(id) = value["id"].as_str() {
            self.query.last_event_id = Some(id.to_owned());
        }
        let event: ServerEvent = serde_json::from_value(value).ok()?;
        (event.what != ServerEventBody::Ready).then_some(event)
    }
}

/// Whether it is worth another try.
fn is_passing(error: &ClientError) -> bool {
    match error {
        ClientError::Http { .. } => true,
        ClientError::Refused { status, .. } => matches!(status, 408 | 503),
        _ => false,
    }
}
