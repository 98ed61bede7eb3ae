//! The events of a map as they come.

use super::{
    events::{Events, endless},
    map_client::MapClient,
    operation::operations,
};
use crate::ClientError;
use protos::api::LiveEventBody;

operations! {
    EVENTS: GET "/maps/{map}/live" => live_events,
}

/// Answers, poses and changes of a map from now on. A reader that is too slow misses events and
/// gets their number.
#[derive(Debug)]
pub struct LiveEvents(Events);

impl LiveEvents {
    /// The next event; `None` when the server stops.
    pub async fn next(&mut self) -> Result<Option<LiveEventBody>, ClientError> {
        while let Some(event) = self.0.next().await? {
            let read = LiveEventBody::read(&event.name, &event.data);
            let unexpected = |e: serde_json::Error| ClientError::Unexpected {
                url: self.0.url(),
                detail: format!("event {}: {e}", event.name),
            };
            // A newer server may send other events.
            if let Some(known) = read.map_err(unexpected)? {
                return Ok(Some(known));
            }
        }
        Ok(None)
    }
}

impl MapClient {
    /// Follows a map.
    pub async fn live_events(&self, map: &str) -> Result<LiveEvents, ClientError> {
        let response = self.checked(endless(self.ask(&EVENTS, &[&map])?)).await?;
        Ok(LiveEvents(Events::new(response)))
    }
}
