//! How large a message of the robot may be. In: captures. Out: the same, or without an image that
//! the server does not take: what is larger than its router takes is dropped on the way, and no
//! answer comes.

use crate::{Capture, ClientError, RobotClient, error::fault};
use protos::{Key, prost::Message as _, v1};
use std::{
    sync::atomic::{AtomicUsize, Ordering},
    time::Duration,
};

/// Captures up to here are sent without a question, in bytes of their pixels: one batch of the
/// transport.
const SMALL_BYTES: usize = 60_000;
/// Longest wait for the server's answer. A frame is sent whole after that.
const WAIT: Duration = Duration::from_secs(1);

/// The largest message that the server takes, as far as it is known; 0 before it was asked.
#[derive(Debug, Default)]
pub(crate) struct MessageLimit(AtomicUsize);

impl MessageLimit {
    /// The capture as it can be sent. The server is asked where that is larger than what it was
    /// known to take: another one, with other settings, may have taken its place.
    pub(crate) async fn within(&self, robot: &RobotClient, capture: Capture) -> Result<Capture, ClientError> {
        let bytes = capture.pixel_bytes() + crate::capture::MESSAGE_HEAD_BYTES;
        if bytes <= SMALL_BYTES || bytes <= self.0.load(Ordering::Relaxed) {
            return Ok(capture);
        }
        let key = robot.keys.build(&Key::Hello(robot.robot.clone()));
        let replies = robot.session.get(key).timeout(WAIT).await.map_err(fault("ask for limits"))?;
        let mut most = None;
        // Of several servers on a router any may be the robot's: the least counts.
        while let Ok(reply) = replies.recv_async().await {
            let Ok(sample) = reply.result() else { continue };
            let hello = v1::Hello::decode(&*sample.payload().to_bytes()).unwrap_or_default();
            if let Ok(bytes @ 1..) = usize::try_from(hello.frame_bytes) {
                most = Some(most.map_or(bytes, |most: usize| most.min(bytes)));
            }
        }
        self.0.store(most.unwrap_or_default(), Ordering::Relaxed);
        Ok(match most {
            Some(most) => capture.withheld(most),
            None => capture,
        })
    }
}
