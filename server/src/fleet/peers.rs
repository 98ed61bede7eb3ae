//! The other servers of the router. In: their liveliness tokens as they come and go. Out: who has
//! which map and robot, and what servers had that are gone. Everything is bounded: a name beyond a
//! bound is not known, and counted.

use protos::{Name, ServerToken};
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Most other servers that are known.
pub(crate) const MAX_SERVERS: usize = 64;
/// Most tokens of one server that are known: its maps twice, and its robots.
pub(crate) const MAX_TOKENS: usize = 8192;
/// Most maps and robots of servers that are gone that are remembered; the oldest go.
pub(crate) const MAX_GONE: usize = 2048;

/// What other servers announce.
#[derive(Debug, Default)]
pub(crate) struct Peers {
    servers: BTreeMap<Name, BTreeSet<ServerToken>>,
    gone: VecDeque<(ServerToken, Name)>,
    /// Tokens beyond the bounds.
    ignored: u64,
}

impl Peers {
    /// A token of a server came or went.
    pub(crate) fn hear(&mut self, server: &Name, token: ServerToken, is_there: bool) {
        if is_there {
            let is_known = self.servers.contains_key(server);
            let has_room = if is_known {
                self.servers[server].len() < MAX_TOKENS
            } else {
                self.servers.len() < MAX_SERVERS
            };
            if !has_room {
                self.ignored += 1;
                return;
            }
            self.gone.retain(|(gone, of)| !(of == server && *gone == token));
            self.servers.entry(server.clone()).or_default().insert(token);
            return;
        }
        let Some(tokens) = self.servers.get_mut(server) else { return };
        let was_there = tokens.remove(&token);
        if tokens.is_empty() {
            self.servers.remove(server);
        }
        if was_there && matches!(token, ServerToken::Robot(_) | ServerToken::Holds(_)) {
            self.gone.retain(|(gone, _)| *gone != token);
            if self.gone.len() == MAX_GONE {
                self.gone.pop_front();
            }
            self.gone.push_back((token, server.clone()));
        }
    }

    /// Tokens that did not fit.
    pub(crate) fn ignored(&self) -> u64 {
        self.ignored
    }

    /// Whether a server lives.
    fn lives(&self, server: &Name) -> bool {
        let tokens = self.servers.get(server);
        tokens.is_some_and(|tokens| tokens.iter().any(|token| matches!(token, ServerToken::Alive(_))))
    }

    /// Servers that live, in the order of names.
    pub(crate) fn living(&self) -> impl Iterator<Item = &Name> {
        self.servers.keys().filter(|server| self.lives(server))
    }

    /// Servers that announce a token, in the order of names.
    pub(crate) fn with(&self, token: &ServerToken) -> Vec<Name> {
        let has = |tokens: &BTreeSet<ServerToken>| tokens.contains(token);
        self.servers.iter().filter(|(_, tokens)| has(tokens)).map(|(server, _)| server.clone()).collect()
    }

    /// What a server announces.
    pub(crate) fn tokens(&self, server: &Name) -> impl Iterator<Item = &ServerToken> {
        self.servers.get(server).into_iter().flatten()
    }

    /// The server that had announced this and is not there any more.
    pub(crate) fn gone(&self, token: &ServerToken) -> Option<&Name> {
        self.gone.iter().rev().find(|(gone, server)| gone == token && !self.lives(server)).map(|(_, of)| of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    fn robot(text: &str) -> ServerToken {
        ServerToken::Robot(name(text))
    }

    #[test]
    fn what_a_dead_server_had_is_remembered_and_what_a_living_one_gives_up_is_not() {
        let mut others = Peers::default();
        let hear =
            |others: &mut Peers, token: ServerToken, is_there| others.hear(&name("b"), token, is_there);
        for token in [ServerToken::Alive(1), robot("r1"), robot("r2")] {
            hear(&mut others, token, true);
        }
        hear(&mut others, robot("r1"), false);
        assert_eq!(others.gone(&robot("r1")), None, "b lives, and gave it up");
        hear(&mut others, robot("r2"), false);
        hear(&mut others, ServerToken::Alive(1), false);
        assert_eq!(others.gone(&robot("r2")), Some(&name("b")));
        assert_eq!((others.living().count(), others.with(&robot("r2")).len()), (0, 0));
        for token in [ServerToken::Alive(2), robot("r2")] {
            hear(&mut others, token, true);
        }
        assert_eq!(others.gone(&robot("r2")), None);
        assert_eq!(others.with(&robot("r2")), [name("b")]);
    }

    #[test]
    fn servers_tokens_and_memory_are_bounded() {
        let mut others = Peers::default();
        for i in 0..=MAX_SERVERS {
            others.hear(&name(&format!("s{i}")), ServerToken::Alive(1), true);
        }
        assert_eq!((others.living().count(), others.ignored()), (MAX_SERVERS, 1));
        for i in 0..MAX_TOKENS {
            others.hear(&name("s0"), robot(&format!("r{i}")), true);
        }
        assert_eq!((others.tokens(&name("s0")).count(), others.ignored()), (MAX_TOKENS, 2));
        for i in 0..=MAX_GONE {
            others.hear(&name("s0"), robot(&format!("r{i}")), false);
        }
        others.hear(&name("s0"), ServerToken::Alive(1), false);
        assert_eq!(others.gone.len(), MAX_GONE);
        assert_eq!((others.gone(&robot("r0")), others.gone(&robot("r1"))), (None, Some(&name("s0"))));
    }
}
