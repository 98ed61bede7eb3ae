//! How an encrypted session begins. In: the options of a robot. Out: a session whose messages
//! arrive.

use crate::{
    ClientError, RobotOptions,
    error::fault,
    transport::{self, Opened},
};
use protos::{Key, Keys, Name};
use std::time::{Duration, Instant};

/// Longest wait for one hello of the server.
const HELLO_WAIT: Duration = Duration::from_millis(500);
/// Time between two questions for it.
const HELLO_EVERY: Duration = Duration::from_millis(50);
/// A session that was not greeted for so long is opened anew; each later one is given twice the
/// time of the one before.
const FIRST_GREETED: Duration = Duration::from_millis(500);
/// The most that is given to one session.
const GREETED: Duration = Duration::from_secs(2);

/// Opens an encrypted session and waits for the answer to a hello: without access, everything is
/// dropped without a word.
///
/// A session that is not greeted is opened anew: one that meets the server's gate as that closes,
/// to open again with other rights, may keep a link to what was closed, for ever. The first
/// sessions are given up early, so that there is time for several. That the robot is not admitted
/// is said only if the last session was linked or something still listens.
pub(crate) async fn admitted(
    keys: &Keys,
    robot: &Name,
    options: &RobotOptions,
) -> Result<Opened, ClientError> {
    let (key, until) = (keys.build(&Key::Hello(robot.clone())), Instant::now() + options.timeout);
    let endpoint = || options.endpoint.clone();
    let silent = || ClientError::NotAdmitted { robot: robot.to_string(), endpoint: endpoint() };
    let (mut left, mut was_linked, mut patience) = (options.timeout, false, FIRST_GREETED);
    loop {
        let opened = match transport::open(&RobotOptions { timeout: left, ..options.clone() }).await {
            Ok(opened) => opened,
            // The server was there and silent: that says more than that the rest of the time was
            // too short for one more link.
            Err(ClientError::TlsRefused { .. }) if was_linked => return Err(silent()),
            Err(error) => return Err(error),
        };
        let session = opened.session.clone();
        if is_greeted(&session, &key, until.min(Instant::now() + patience)).await? {
            return Ok(opened);
        }
        let is_linked = session.info().routers_zid().await.next().is_some();
        was_linked |= is_linked;
        opened.close().await.map_err(fault("close the session"))?;
        patience = GREETED.min(2 * patience);
        left = until.saturating_duration_since(Instant::now());
        if left < HELLO_WAIT {
            let detail = "the connection was closed, and there is no other".to_owned();
            let lost = ClientError::Unreachable { endpoint: endpoint(), detail };
            return Err(if is_linked { silent() } else { lost });
        }
    }
}

/// Whether the server answers a hello before `until`.
async fn is_greeted(session: &zenoh::Session, key: &str, until: Instant) -> Result<bool, ClientError> {
    while Instant::now() < until {
        let replies = session.get(key).timeout(HELLO_WAIT).await.map_err(fault("ask for the server"))?;
        if replies.recv_async().await.is_ok_and(|reply| reply.result().is_ok()) {
            return Ok(true);
        }
        tokio::time::sleep(HELLO_EVERY).await;
        if session.info().routers_zid().await.next().is_none() {
            // Closed, to open again: another session finds it sooner.
            return Ok(false);
        }
    }
    Ok(false)
}
