//! `server/{id}/ping`: the server asks itself, as a robot would: a client of its own, over a link,
//! through the router, to a callback on the router's session, and back. An answer says that
//! messages of robots arrive and are answered.

use super::{BusError, Receivers, caught, router};
use protos::Keys;
use std::time::Duration;
use tokio::sync::OnceCell;
use zenoh::{
    Session, Wait,
    query::{Query, Queryable},
};

/// Longest wait for the answer.
const ANSWER: Duration = Duration::from_millis(1500);

/// Asks the server itself.
pub(crate) struct Pinger {
    key: String,
    endpoint: String,
    /// Opened by the first ping: the start of the server does not wait for it.
    session: OnceCell<Session>,
}

impl std::fmt::Debug for Pinger {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Pinger").field("endpoint", &self.endpoint).finish_non_exhaustive()
    }
}

/// Answers the pings, and gives who sends them to `endpoint`.
pub(super) async fn answer_pings(
    session: &Session,
    keys: &Keys,
    to: &Receivers,
    endpoint: &str,
) -> Result<(Queryable<()>, Pinger), BusError> {
    let key = keys.ping(&session.zid().to_string());
    let answer = |query: Query| {
        if let Err(error) = query.reply(query.key_expr().clone(), "").wait() {
            tracing::debug!(%error, "ping_not_answered");
        }
    };
    let declared = session.declare_queryable(&key).callback(caught(&to.vitals, "a ping", answer)).await;
    let queryable =
        declared.map_err(|e| BusError::Declare { action: "answer pings", detail: e.to_string() })?;
    Ok((queryable, Pinger { key, endpoint: reachable(endpoint), session: OnceCell::new() }))
}

impl Pinger {
    /// Opens the link, if it is not open. False: it cannot be opened now.
    pub(crate) async fn open(&self) -> bool {
        let opened = self.session.get_or_try_init(|| router::open_client(&self.endpoint)).await;
        opened.inspect_err(|error| tracing::debug!(%error, "ping_not_sent")).is_ok()
    }

    /// Whether an answer came in time.
    pub(crate) async fn ping(&self) -> bool {
        let Some(session) = self.session.get() else {
            self.open().await;
            return false;
        };
        let answered = async {
            let Ok(replies) = session.get(&self.key).timeout(ANSWER).await else { return false };
            replies.recv_async().await.is_ok_and(|reply| reply.result().is_ok())
        };
        tokio::time::timeout(ANSWER, answered).await.unwrap_or(false)
    }
}

/// An address of this machine for a listener on all of them.
fn reachable(endpoint: &str) -> String {
    endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_listener_on_all_addresses_is_asked_on_this_machine() {
        for (listens, asked) in [
            ("tcp/0.0.0.0:7447", "tcp/127.0.0.1:7447"),
            ("tcp/[::]:7447", "tcp/[::1]:7447"),
            ("tcp/192.168.1.4:7447", "tcp/192.168.1.4:7447"),
        ] {
            assert_eq!(reachable(listens), asked);
        }
    }
}
