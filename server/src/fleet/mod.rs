//! Several servers on one router. In: what they announce by liveliness tokens, and this server's
//! own maps and robots. Out: what it announces, which messages of robots it answers, and what
//! people are told of it. Knows no zenoh: [`crate::bus`] does.
//!
//! A server that is its own router has no such state, answers everything and announces nothing.

pub(crate) mod claims;
mod responsibility;
mod name;
pub(crate) mod peers;

pub(crate) use name::server_name;
pub(crate) use responsibility::Responsibility;

use claims::{Claims, MapClaim, SETTLE};
use engine::snapshot::Snapshots;
use peers::Peers;
use protos::{
    Name, ServerToken,
    api::{ServedMap, ServerBody, Servers},
};
use responsibility::{Addressed, World};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

/// What a server knows of the others, and what follows for itself.
#[derive(Debug)]
pub(crate) struct Fleet {
    own: Name,
    /// Random number of this start: another one under the same name is another server.
    start: u64,
    endpoints: Vec<String>,
    snapshots: Arc<Snapshots>,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    others: Peers,
    /// Starts of other servers under this one's name.
    namesakes: BTreeSet<u64>,
    claims: Claims,
    /// Robots registered here, and since when that is announced.
    robots: BTreeMap<Name, Instant>,
    /// Since when there is a connection to the router.
    joined: Option<Instant>,
    /// Everybody knows of this server, and no other has its name: it may answer.
    has_settled: bool,
}

/// Most namesakes that are counted.
const MAX_NAMESAKES: usize = 16;

impl Fleet {
    /// Of a server that will join a router at `endpoints`.
    pub(crate) fn new(own: Name, start: u64, endpoints: Vec<String>, snapshots: Arc<Snapshots>) -> Self {
        Self { own, start, endpoints, snapshots, state: Mutex::default() }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A token came or went.
    pub(crate) fn hear(&self, server: &Name, token: ServerToken, is_there: bool) {
        let mut state = self.state();
        if *server != self.own {
            return state.others.hear(server, token, is_there);
        }
        let ServerToken::Alive(start) = token else { return };
        if start == self.start {
            return;
        }
        if !is_there {
            state.namesakes.remove(&start);
        } else if state.namesakes.len() < MAX_NAMESAKES && state.namesakes.insert(start) {
            tracing::error!(
                server = %self.own,
                follows = "the one that came later serves nobody; give one of them another server_name",
                "server_name_in_use"
            );
        }
    }

    /// Moves on: whether there is a connection, how late it is. Gives the tokens that this server
    /// wants to be known by.
    pub(crate) fn step(&self, is_connected: bool, now: Instant) -> BTreeSet<ServerToken> {
        let mut state = self.state();
        let state = &mut *state;
        match (is_connected, state.joined) {
            (true, None) => {
                tracing::info!(server = %self.own, "router_joined");
                state.joined = Some(now);
            }
            (false, Some(_)) => {
                tracing::warn!(follows = "it is tried again; robots are not heard meanwhile", "router_lost");
                state.joined = None;
                state.has_settled = false;
                state.claims.suspend(now);
                state.robots.clear();
            }
            _ => {}
        }
        let mut tokens = BTreeSet::from([ServerToken::Alive(self.start)]);
        let Some(joined) = state.joined else { return tokens };
        if !state.has_settled && !state.namesakes.is_empty() {
            return tokens;
        }
        state.has_settled |= now.duration_since(joined) >= SETTLE;
        let maps = self.snapshots.all().into_iter().filter(|map| !map.is_draft);
        let maps: BTreeSet<Name> = maps.filter_map(|map| Name::new(map.name.as_str()).ok()).collect();
        let robots = self.snapshots.robots();
        let robots: BTreeSet<Name> = robots.into_keys().filter_map(|robot| Name::new(robot).ok()).collect();
        state.robots.retain(|robot, _| robots.contains(robot));
        for robot in robots {
            state.robots.entry(robot).or_insert(now);
        }
        state.claims.step(&maps, &state.others, joined, now);
        tokens.extend(state.robots.keys().cloned().map(ServerToken::Robot));
        for (map, claim) in state.claims.all() {
            tokens.insert(ServerToken::Holds(map.clone()));
            if *claim == MapClaim::Served {
                tokens.insert(ServerToken::Serves(map.clone()));
            }
        }
        tokens
    }

    /// What this server does with a message of a robot that names `map`, or none.
    pub(crate) fn responsibility(&self, robot: &Name, map: &str, now: Instant) -> Responsibility {
        let state = self.state();
        if !state.has_settled {
            return Responsibility::Silent;
        }
        let registered = self.snapshots.robot_map(robot.as_str());
        let announced = state.robots.get(robot);
        let message = Addressed {
            robot,
            map,
            registered: registered.as_deref(),
            is_announced: announced.is_some_and(|since| now.duration_since(*since) >= SETTLE),
        };
        responsibility::responsibility(
            World { own: &self.own, claims: &state.claims, others: &state.others },
            message,
        )
    }

    /// Whether robots are answered on a map here.
    pub(crate) fn serves(&self, map: &Name) -> bool {
        let state = self.state();
        state.has_settled && state.claims.of(map) == Some(MapClaim::Served)
    }

    /// Why the router is not joined, if it is not; and why maps are not served, by map.
    pub(crate) fn faults(&self) -> (Option<String>, BTreeMap<String, String>) {
        let state = self.state();
        let router = match state.joined {
            None => Some(format!("no connection to {}; it is tried again", self.endpoints.join(", "))),
            Some(_) if !state.has_settled && !state.namesakes.is_empty() => {
                Some(format!("another server is called {}: give one of them another server_name", self.own))
            }
            Some(_) => None,
        };
        let refused = state.claims.all().filter(|(_, claim)| matches!(claim, MapClaim::Refused { .. }));
        let maps = refused.map(|(map, _)| {
            let holders = state.others.with(&ServerToken::Holds(map.clone()));
            let names: Vec<&str> = holders.iter().map(Name::as_str).collect();
            let why = if names.is_empty() {
                "another server had it until now; it is served in a moment".to_owned()
            } else {
                format!("also on {}: delete or rename it on one of the servers", names.join(", "))
            };
            (map.to_string(), why)
        });
        (router, maps.collect())
    }

    /// This server and the others, for people.
    pub(crate) fn overview(&self) -> Servers {
        let state = self.state();
        let own_maps = state.claims.all().map(|(map, claim)| (map.to_string(), *claim == MapClaim::Served));
        let own = body(&self.own, own_maps.collect(), state.robots.len());
        let mut servers = vec![own];
        for server in state.others.living() {
            let (mut maps, mut robots) = (BTreeMap::new(), 0);
            for token in state.others.tokens(server) {
                match token {
                    ServerToken::Holds(map) | ServerToken::Serves(map) => {
                        let is_served = matches!(token, ServerToken::Serves(_));
                        *maps.entry(map.to_string()).or_insert(false) |= is_served;
                    }
                    ServerToken::Robot(_) => robots += 1,
                    ServerToken::Alive(_) => {}
                }
            }
            servers.push(body(server, maps, robots));
        }
        servers.sort_by(|a, b| a.name.cmp(&b.name));
        let contested_maps =
            contested(servers.iter().flat_map(|server| {
                server.maps.iter().map(move |map| (map.name.clone(), server.name.clone()))
            }));
        let robot_of = |server: &Name, token: &ServerToken| match token {
            ServerToken::Robot(robot) => Some((robot.to_string(), server.to_string())),
            _ => None,
        };
        let elsewhere = state
            .others
            .living()
            .flat_map(|server| state.others.tokens(server).filter_map(move |token| robot_of(server, token)));
        let here = state.robots.keys().map(|robot| (robot.to_string(), self.own.to_string()));
        let contested_robots = contested(here.chain(elsewhere));
        Servers {
            server: self.own.to_string(),
            router: self.endpoints.clone(),
            is_connected: state.joined.is_some(),
            servers,
            contested_maps,
            contested_robots,
            ignored: state.others.ignored(),
        }
    }
}

/// The overview of a server that is its own router.
pub(crate) fn alone(own: &Name, snapshots: &Snapshots) -> Servers {
    let maps = snapshots.all().into_iter().filter(|map| !map.is_draft).map(|map| (map.name.clone(), true));
    let server = body(own, maps.collect(), snapshots.robots().len());
    Servers { server: own.to_string(), is_connected: true, servers: vec![server], ..Servers::default() }
}

fn body(name: &Name, maps: BTreeMap<String, bool>, robots: usize) -> ServerBody {
    let maps = maps.into_iter().map(|(name, is_served)| ServedMap { name, is_served }).collect();
    ServerBody { name: name.to_string(), maps, robots: robots as u64 }
}

/// What more than one server has, with the servers.
fn contested(all: impl Iterator<Item = (String, String)>) -> BTreeMap<String, Vec<String>> {
    let mut by_name = BTreeMap::<String, Vec<String>>::new();
    for (name, server) in all {
        by_name.entry(name).or_default().push(server);
    }
    by_name.retain(|_, servers| servers.len() > 1);
    by_name
}

#[cfg(test)]
mod tests;
