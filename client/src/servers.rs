//! The servers that a robot meets, where several share a router. In: their liveliness tokens, and
//! what they send. Out: which server a map follows, and events when the robot's server goes and
//! comes back.
//!
//! A server that is its own router announces nothing; then nothing here changes what a client does.

use crate::error::{ClientError, fault};
use protos::{Key, Keys, Name, ServerToken, v1};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};
use tokio::sync::{broadcast, watch};
use zenoh::{
    Session,
    pubsub::Subscriber,
    sample::{Sample, SampleKind},
};

/// Events that wait for a slow reader; beyond, it misses the oldest.
const EVENTS: usize = 16;
/// Most tokens that are known, and most maps whose server is.
const MAX_KNOWN: usize = 4096;

/// What became of the server of the robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ServerEvent {
    /// It is gone: nobody answers until it is back.
    Gone {
        /// The server.
        server: Name,
        /// The map that the robot's messages name; `None`: the robot's own.
        map: Option<Name>,
    },
    /// There is a server again.
    Back {
        /// The server.
        server: Name,
        /// The map that the robot's messages name; `None`: the robot's own.
        map: Option<Name>,
    },
}

/// What a robot knows of the servers.
#[derive(Debug, Clone)]
pub(crate) struct Servers(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    state: Mutex<State>,
    events: broadcast::Sender<ServerEvent>,
    /// The robot's server while it is gone.
    gone: watch::Sender<Option<Name>>,
}

#[derive(Debug, Default)]
struct State {
    /// The map that messages name.
    map: Option<Name>,
    tokens: BTreeSet<(Name, ServerToken)>,
    /// The server that had this last: the map of a token, or `None` for the robot itself.
    last: BTreeMap<Option<Name>, Name>,
    /// The server whose answers on a map are taken.
    followed: BTreeMap<String, Name>,
    /// The server of which it was told last that it is gone, until one is back.
    told: Option<Name>,
}

impl State {
    /// Servers of what the robot's messages name.
    fn present(&self, map: Option<&Name>) -> Option<&Name> {
        let of = |token: &ServerToken| match (token, map) {
            (ServerToken::Serves(served), Some(map)) => served == map,
            (ServerToken::Robot(_), None) => true,
            _ => false,
        };
        self.tokens.iter().find(|(_, token)| of(token)).map(|(server, _)| server)
    }

    fn lives(&self, server: &Name) -> bool {
        self.tokens.iter().any(|(of, token)| of == server && matches!(token, ServerToken::Alive(_)))
    }

    /// The robot's server, if it is gone.
    fn gone(&self) -> Option<Name> {
        if self.present(self.map.as_ref()).is_some() {
            return None;
        }
        self.last.get(&self.map).filter(|last| !self.lives(last)).cloned()
    }

    fn hear(&mut self, server: Name, token: ServerToken, is_there: bool) {
        if !is_there {
            self.tokens.remove(&(server, token));
            return;
        }
        let of = match &token {
            ServerToken::Serves(map) => Some(Some(map.clone())),
            ServerToken::Robot(_) => Some(None),
            ServerToken::Alive(_) | ServerToken::Holds(_) => None,
        };
        if let Some(of) = of
            && (self.last.len() < MAX_KNOWN || self.last.contains_key(&of))
        {
            self.last.insert(of, server.clone());
        }
        if self.tokens.len() < MAX_KNOWN {
            self.tokens.insert((server, token));
        }
    }

    /// Whether what a server says of a map is taken: of one at a time, as long as that serves it.
    fn takes(&mut self, map: &str, server: &str) -> bool {
        let Ok(server) = Name::new(server) else { return server.is_empty() };
        if let Some(followed) = self.followed.get(map)
            && *followed != server
        {
            let serves = |map: Name| self.tokens.contains(&(followed.clone(), ServerToken::Serves(map)));
            if Name::new(map).is_ok_and(serves) {
                return false;
            }
        }
        if self.followed.len() >= MAX_KNOWN {
            self.followed.clear();
        }
        self.followed.insert(map.to_owned(), server);
        true
    }
}

impl Servers {
    pub(crate) fn new() -> Self {
        let (events, gone) = (broadcast::channel(EVENTS).0, watch::channel(None).0);
        Self(Arc::new(Shared { state: Mutex::default(), events, gone }))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Watches the servers of a robot.
    pub(crate) async fn watch(
        &self,
        session: &Session,
        keys: &Keys,
        robot: &Name,
    ) -> Result<Vec<Subscriber<()>>, ClientError> {
        let mut subscribers = Vec::new();
        // Whether a server lives is known before it is what it has.
        for expression in [keys.all_servers(), keys.all_served_maps(), keys.servers_of(robot)] {
            let (servers, keys) = (self.clone(), keys.clone());
            let hear = move |sample: Sample| {
                if let Ok(Key::Server(server, token)) = keys.parse(sample.key_expr().as_str()) {
                    servers.change(|state| state.hear(server, token, sample.kind() == SampleKind::Put));
                }
            };
            let liveliness = session.liveliness();
            let watched = liveliness.declare_subscriber(expression).history(true).callback(hear).await;
            subscribers.push(watched.map_err(fault("watch the servers"))?);
        }
        Ok(subscribers)
    }

    /// Changes what is known, and tells what follows for the robot's server.
    fn change(&self, change: impl FnOnce(&mut State)) {
        let mut state = self.state();
        change(&mut state);
        let (gone, map) = (state.gone(), state.map.clone());
        self.0.gone.send_replace(gone.clone());
        let event = match (gone, state.present(map.as_ref())) {
            (Some(server), _) if state.told.as_ref() != Some(&server) => {
                state.told = Some(server.clone());
                ServerEvent::Gone { server, map }
            }
            // A server that lives is back when it has what the robot needs.
            (None, Some(server)) if state.told.is_some() => {
                let server = server.clone();
                state.told = None;
                ServerEvent::Back { server, map }
            }
            _ => return,
        };
        // No receiver is not an error.
        drop(self.0.events.send(event));
    }

    /// Messages name this map from now on; `None`: none.
    pub(crate) fn enter(&self, map: Option<Name>) {
        self.change(|state| state.map = map);
    }

    /// The map that messages name; empty for none.
    pub(crate) fn map(&self) -> String {
        self.state().map.as_ref().map(Name::to_string).unwrap_or_default()
    }

    pub(crate) fn events(&self) -> broadcast::Receiver<ServerEvent> {
        self.0.events.subscribe()
    }

    /// The error while the robot's server is gone. A map that the message itself names is not
    /// looked at.
    pub(crate) fn gone_error(&self) -> Option<ClientError> {
        let gone = self.0.gone.borrow().clone()?;
        Some(ClientError::ServerGone { server: gone.to_string(), map: self.map() })
    }

    /// Returns when the robot's server is gone.
    pub(crate) async fn gone(&self) -> ClientError {
        let mut gone = self.0.gone.subscribe();
        loop {
            if let Some(error) = self.gone_error() {
                return error;
            }
            if gone.changed().await.is_err() {
                std::future::pending::<()>().await;
            }
        }
    }

    /// Whether an answer is of the server that its map follows. Refusals are of whoever says them.
    pub(crate) fn takes_answer(&self, answer: &v1::Answer) -> bool {
        answer.status() == v1::Status::Rejected || self.state().takes(&answer.map, &answer.server)
    }

    /// The same of a pose.
    pub(crate) fn takes_pose(&self, pose: &v1::RobotPose) -> bool {
        self.state().takes(&pose.map, &pose.server)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    fn token(servers: &Servers, server: &str, token: ServerToken, is_there: bool) {
        servers.change(|state| state.hear(name(server), token, is_there));
    }

    #[test]
    fn a_map_follows_one_server_until_that_serves_it_no_longer() {
        let servers = Servers::new();
        let takes = |server: &str| servers.state().takes("hall", server);
        token(&servers, "a", ServerToken::Serves(name("hall")), true);
        assert!(takes("a") && !takes("b") && takes("a"));
        token(&servers, "a", ServerToken::Serves(name("hall")), false);
        assert!(takes("b"));
        assert!(servers.state().takes("annex", "c"), "another map");
        assert!(takes(""), "an older server");
    }

    #[test]
    fn gone_and_back_are_told_once_for_the_map_that_was_entered() {
        let servers = Servers::new();
        let mut events = servers.events();
        let all = [ServerToken::Alive(1), ServerToken::Robot(name("r1")), ServerToken::Serves(name("hall"))];
        for there in &all {
            token(&servers, "a", there.clone(), true);
        }
        assert!(servers.gone_error().is_none());
        // It lives, and has another map now: that is no end.
        token(&servers, "a", all[2].clone(), false);
        token(&servers, "a", all[1].clone(), false);
        assert!(events.try_recv().is_err());
        token(&servers, "a", all[0].clone(), false);
        assert_eq!(events.try_recv(), Ok(ServerEvent::Gone { server: name("a"), map: None }));
        token(&servers, "b", ServerToken::Alive(2), true);
        token(&servers, "b", ServerToken::Serves(name("annex")), true);
        servers.enter(Some(name("annex")));
        assert_eq!(events.try_recv(), Ok(ServerEvent::Back { server: name("b"), map: Some(name("annex")) }));
        servers.enter(Some(name("hall")));
        assert_eq!(events.try_recv(), Ok(ServerEvent::Gone { server: name("a"), map: Some(name("hall")) }));
        assert!(
            matches!(servers.gone_error(), Some(ClientError::ServerGone { server, .. }) if server == "a")
        );
        for there in &all {
            token(&servers, "a", there.clone(), true);
        }
        assert_eq!(events.try_recv(), Ok(ServerEvent::Back { server: name("a"), map: Some(name("hall")) }));
        assert!(events.try_recv().is_err());
    }
}
