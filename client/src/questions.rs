//! What a robot asks the server: where to look, where it is, which version a map has.

use crate::{Capture, ClientError, RobotClient, error::fault, robot::name};
use protos::{Key, api::LocaliseResult, convert::localise::localise_result, prost::Message, v1};
use std::time::Duration;
use tokio::sync::watch;
use zenoh::{pubsub::Subscriber, sample::Sample};

/// The versions of a map. A reader that is slow gets the newest only.
#[derive(Debug)]
pub struct MapVersions {
    newest: watch::Receiver<Option<u64>>,
    _subscriber: Subscriber<()>,
}

impl MapVersions {
    /// The next version; waits for it. `None` once the session is closed.
    pub async fn next(&mut self) -> Option<u64> {
        self.newest.changed().await.ok()?;
        *self.newest.borrow_and_update()
    }
}

/// What a robot senses at one place: a frame, a scan, or both.
#[derive(Debug, Clone, Default)]
pub struct LocaliseQuery {
    frame: Option<Capture>,
    request: v1::LocaliseRequest,
}

impl LocaliseQuery {
    /// With a frame, which needs intrinsics and mounting; its odometry, prior and deadline are not
    /// used.
    #[must_use]
    pub fn with_frame(mut self, frame: Capture) -> Self {
        self.frame = Some(frame);
        self
    }

    /// With a laser scan from the same place; its odometry is not used.
    #[must_use]
    pub fn with_scan(mut self, scan: v1::Scan) -> Self {
        self.request.scan = Some(scan);
        self
    }

    /// In another map than the robot's own.
    #[must_use]
    pub fn in_map(mut self, map: impl Into<String>) -> Self {
        self.request.map = map.into();
        self
    }
}

impl RobotClient {
    /// Asks where the robot is by what it senses at one place, without its history; the server
    /// searches for at most 10 s. "No match" is an answer, and the fused pose stays as it is.
    /// Errors: [`ClientError::Rejected`] with code and field, of which `too_many` says to ask again
    /// later; [`ClientError::Transport`] after `wait`.
    pub async fn localise(
        &self,
        query: LocaliseQuery,
        wait: Duration,
    ) -> Result<LocaliseResult, ClientError> {
        const HEAR: &str = "receive a localisation";
        if query.frame.as_ref().is_some_and(Capture::is_quads) {
            return Err(ClientError::Image("a localisation needs the whole image".to_owned()));
        }
        let frame = match query.frame {
            Some(frame) => Some(self.message_limit.within(self, frame).await?.into_frame()),
            None => None,
        };
        let deadline_ms = u32::try_from(wait.as_millis()).unwrap_or(u32::MAX).max(1);
        let map = if query.request.map.is_empty() { self.servers.map() } else { query.request.map };
        let request = v1::LocaliseRequest { frame, deadline_ms, map, ..query.request };
        let key = self.keys.build(&Key::Localise(self.robot.clone()));
        let asked = self.session.get(key).payload(request.encode_to_vec()).timeout(wait);
        let replies = asked.await.map_err(fault("ask for a localisation"))?;
        let reply = replies.recv_async().await.map_err(|e| fault(HEAR)(e))?;
        let transport = |detail: String| ClientError::Transport { action: HEAR, detail };
        let sample = reply.result().map_err(|e| transport(e.to_string()))?;
        let reply = v1::LocaliseReply::decode(&*sample.payload().to_bytes());
        let reply = reply.map_err(|e| transport(e.to_string()))?;
        let result = localise_result(reply);
        let result = result.ok_or_else(|| transport("a status of a newer server".to_owned()))?;
        result.map_err(|v1::Rejection { code, field, detail }| ClientError::Rejected { code, field, detail })
    }

    /// Requests gaze advice and waits for it.
    pub async fn gaze(
        &self,
        request: &v1::GazeRequest,
        wait: Duration,
    ) -> Result<v1::GazeAdvice, ClientError> {
        let key = self.keys.build(&Key::Gaze(self.robot.clone()));
        let map = if request.map.is_empty() { self.servers.map() } else { request.map.clone() };
        let request = v1::GazeRequest { map, ..request.clone() };
        let asked = self.session.get(key).payload(request.encode_to_vec()).timeout(wait);
        let replies = asked.await.map_err(fault("ask for gaze advice"))?;
        let reply = replies.recv_async().await.map_err(|e| fault("receive gaze advice")(e))?;
        let sample = reply
            .result()
            .map_err(|e| ClientError::Transport { action: "receive gaze advice", detail: e.to_string() })?;
        v1::GazeAdvice::decode(&*sample.payload().to_bytes())
            .map_err(|e| ClientError::Transport { action: "read gaze advice", detail: e.to_string() })
    }

    /// The present version of a map; `None` if the server has no such map. For programs that store
    /// data derived from a map: `MapChanged` events may be lost on a full link.
    pub async fn map_version(&self, map: &str, wait: Duration) -> Result<Option<u64>, ClientError> {
        let key = self.keys.build(&Key::MapVersion(name("map", map)?));
        let replies = self.session.get(key).timeout(wait).await.map_err(fault("ask for a map's version"))?;
        let Ok(reply) = replies.recv_async().await else { return Ok(None) };
        let hear = "receive a map's version";
        let sample =
            reply.result().map_err(|e| ClientError::Transport { action: hear, detail: e.to_string() })?;
        v1::MapChanged::decode(&*sample.payload().to_bytes())
            .map(|message| Some(message.version))
            .map_err(|e| ClientError::Transport { action: hear, detail: e.to_string() })
    }

    /// The versions of a map: the present one at once, then each new one. For programs that store
    /// data derived from a map, also those that start after its last change.
    pub async fn map_versions(&self, map: &str, wait: Duration) -> Result<MapVersions, ClientError> {
        let (sender, newest) = watch::channel(None);
        let changed = {
            let sender = sender.clone();
            move |sample: Sample| {
                if let Ok(message) = v1::MapChanged::decode(&*sample.payload().to_bytes()) {
                    sender.send_replace(Some(message.version));
                }
            }
        };
        let key = self.keys.build(&Key::MapChanged(name("map", map)?));
        // Before the question, so that no change is lost between.
        let subscriber = self.session.declare_subscriber(key).callback(changed).await;
        let subscriber = subscriber.map_err(fault("subscribe"))?;
        let present = self.map_version(map, wait).await?;
        // A change that has come meanwhile is newer.
        sender.send_if_modified(|newest| {
            let is_first = newest.is_none() && present.is_some();
            *newest = newest.or(present);
            is_first
        });
        Ok(MapVersions { newest, _subscriber: subscriber })
    }
}
