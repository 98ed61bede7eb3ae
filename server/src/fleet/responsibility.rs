//! Which server answers a message of a robot. In: what this server serves and has registered, what
//! others announce. Out: whether this one takes it, refuses it, or is silent because another one
//! answers. Every server decides by itself, by the same rule and without a word to the others, so
//! that exactly one answers.

use super::{
    claims::{Claims, MapClaim},
    peers::Peers,
};
use protos::{Code, Name, Rejection, ServerToken};

/// What a server does with a message of a robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Responsibility {
    /// It takes it.
    Take,
    /// Another one answers, or none yet.
    Silent,
    /// It says why nobody takes it.
    Refuse(Rejection),
}

/// A message, as far as its server depends on it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Addressed<'a> {
    /// Who sends it.
    pub(crate) robot: &'a Name,
    /// The map that it names; empty for none.
    pub(crate) map: &'a str,
    /// The map where the robot is registered here.
    pub(crate) registered: Option<&'a str>,
    /// Whether others know of that registration.
    pub(crate) is_announced: bool,
}

/// What a server decides by.
#[derive(Debug, Clone, Copy)]
pub(crate) struct World<'a> {
    /// This server.
    pub(crate) own: &'a Name,
    pub(crate) claims: &'a Claims,
    pub(crate) others: &'a Peers,
}

/// The rule.
pub(crate) fn responsibility(world: World<'_>, message: Addressed<'_>) -> Responsibility {
    if message.map.is_empty() {
        return by_registration(world, message);
    }
    // A name that is none is no map: who has the robot says so.
    let Ok(map) = Name::new(message.map) else { return by_registration(world, message) };
    match on_map(world, &map) {
        Some(responsibility) => responsibility,
        None => {
            match (world.others.gone(&ServerToken::Holds(map.clone())), by_registration(world, message)) {
                (_, Responsibility::Silent) => Responsibility::Silent,
                (Some(server), _) => Responsibility::Refuse(gone("map", &format!("map {map}"), server)),
                // Robots that nobody knows, and maps that nobody has: the intake says so.
                (None, _) => Responsibility::Take,
            }
        }
    }
}

/// What follows from the map alone; `None` if nobody has it.
fn on_map(World { own, claims, others }: World<'_>, map: &Name) -> Option<Responsibility> {
    let claim = claims.of(map);
    if claim == Some(MapClaim::Served) {
        return Some(Responsibility::Take);
    }
    if !others.with(&ServerToken::Serves(map.clone())).is_empty() {
        return Some(Responsibility::Silent);
    }
    let holders = others.with(&ServerToken::Holds(map.clone()));
    match claim {
        Some(MapClaim::Refused { .. }) if holders.first().is_none_or(|first| own < first) => {
            Some(Responsibility::Refuse(contested_map(map, own, &holders)))
        }
        Some(_) => Some(Responsibility::Silent),
        None => (!holders.is_empty()).then_some(Responsibility::Silent),
    }
}

fn by_registration(world: World<'_>, message: Addressed<'_>) -> Responsibility {
    let World { own, others, .. } = world;
    let robot = message.robot;
    let elsewhere = others.with(&ServerToken::Robot(robot.clone()));
    match (message.registered, elsewhere.first()) {
        (Some(_), _) if !message.is_announced => Responsibility::Silent,
        (Some(_), Some(first)) if own < first => {
            Responsibility::Refuse(contested_robot(robot, own, &elsewhere))
        }
        (Some(map), None) => {
            Name::new(map).ok().and_then(|map| on_own_map(world, &map)).unwrap_or(Responsibility::Take)
        }
        (_, Some(_)) => Responsibility::Silent,
        (None, None) if others.living().next().is_some_and(|first| first < own) => Responsibility::Silent,
        (None, None) => match others.gone(&ServerToken::Robot(robot.clone())) {
            Some(server) => Responsibility::Refuse(gone("robot", &format!("robot {robot}"), server)),
            None => Responsibility::Take,
        },
    }
}

/// A robot that is registered here alone, on a map that this server may not serve: then this one
/// says so.
fn on_own_map(World { own, claims, others }: World<'_>, map: &Name) -> Option<Responsibility> {
    match claims.of(map)? {
        MapClaim::Served => Some(Responsibility::Take),
        MapClaim::Waiting { .. } => Some(Responsibility::Silent),
        MapClaim::Refused { .. } => {
            let holders = others.with(&ServerToken::Holds(map.clone()));
            Some(Responsibility::Refuse(contested_map(map, own, &holders)))
        }
    }
}

fn contested_map(map: &Name, own: &Name, holders: &[Name]) -> Rejection {
    let detail = if holders.is_empty() {
        format!("map {map} was another server's until now; {own} serves it in a moment")
    } else {
        let all = listed(own, holders);
        format!("servers {all} each have a map {map}: delete it on all but one, or give one another name")
    };
    Rejection::new(Code::MapContested, "map", detail)
}

fn contested_robot(robot: &Name, own: &Name, others: &[Name]) -> Rejection {
    let all = listed(own, others);
    let detail = format!(
        "robot {robot} is registered with the servers {all}: name the map in its messages (enter_map of the SDK), \
         or remove it from all but one"
    );
    Rejection::new(Code::RobotContested, "robot", detail)
}

fn gone(field: &str, what: &str, server: &Name) -> Rejection {
    let detail = format!("{what} is served by {server}, which is gone: start it, or wait until it is back");
    Rejection::new(Code::ServerGone, field, detail)
}

fn listed(own: &Name, others: &[Name]) -> String {
    let mut all: Vec<&str> = others.iter().map(Name::as_str).chain([own.as_str()]).collect();
    all.sort_unstable();
    all.join(", ")
}
