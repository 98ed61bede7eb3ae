//! Servers that hear each other's tokens at once, or not at all: of every message exactly one takes
//! or refuses it.

use super::*;
use protos::Code;
use std::time::Duration;

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

/// Servers of one router, by name.
struct Site {
    now: Instant,
    servers: Vec<(Fleet, BTreeSet<ServerToken>, bool)>,
}

impl Site {
    fn new(names: &[&str]) -> Self {
        let fleet = |(i, own): (usize, &&str)| {
            let endpoints = vec!["tcp/127.0.0.1:7447".to_owned()];
            (Fleet::new(name(own), i as u64 + 1, endpoints, Arc::default()), BTreeSet::new(), true)
        };
        Self { now: Instant::now(), servers: names.iter().enumerate().map(fleet).collect() }
    }

    fn snapshots(&self, server: &str) -> &Snapshots {
        &self.servers.iter().find(|(fleet, ..)| fleet.own.as_str() == server).unwrap().0.snapshots
    }

    fn add(&self, server: &str, map: &str, robots: &[&str]) {
        let snapshots = self.snapshots(server);
        snapshots.publish(Arc::new(engine::snapshot::MapSnapshot::empty(map, 1)));
        for robot in robots {
            snapshots.set_robot(robot, Some(map));
        }
    }

    /// Server `i` is connected, or not.
    fn connect(&mut self, i: usize, is_connected: bool) {
        self.servers[i].2 = is_connected;
    }

    fn step(&mut self) {
        self.now += Duration::from_millis(250);
        for i in 0..self.servers.len() {
            let is_connected = self.servers[i].2;
            let wanted = self.servers[i].0.step(is_connected, self.now);
            let shown = if is_connected { wanted } else { BTreeSet::new() };
            let before = std::mem::replace(&mut self.servers[i].1, shown.clone());
            let own = self.servers[i].0.own.clone();
            for (k, (other, ..)) in self.servers.iter().enumerate() {
                if k == i {
                    continue;
                }
                before.difference(&shown).for_each(|token| other.hear(&own, token.clone(), false));
                shown.difference(&before).for_each(|token| other.hear(&own, token.clone(), true));
            }
        }
    }

    fn settle(&mut self) {
        (0..60).for_each(|_| self.step());
    }

    /// Who answers, and how: `take`, or the code.
    fn answers(&self, robot: &str, map: &str) -> Vec<(String, String)> {
        let connected = self.servers.iter().filter(|(.., is_connected)| *is_connected);
        let answer = |fleet: &Fleet| match fleet.responsibility(&name(robot), map, self.now) {
            Responsibility::Take => Some((fleet.own.to_string(), "take".to_owned())),
            Responsibility::Refuse(rejection) => Some((fleet.own.to_string(), rejection.code.to_string())),
            Responsibility::Silent => None,
        };
        connected.filter_map(|(fleet, ..)| answer(fleet)).collect()
    }

    fn one(&self, robot: &str, map: &str) -> (String, String) {
        let mut answers = self.answers(robot, map);
        assert_eq!(answers.len(), 1, "{robot} {map:?}: {answers:?}");
        answers.remove(0)
    }
}

fn is(server: &str, how: &str) -> (String, String) {
    (server.to_owned(), how.to_string())
}

#[test]
fn exactly_one_server_answers_a_message() {
    let mut site = Site::new(&["a", "b", "c"]);
    site.add("a", "ground", &["r1", "rover"]);
    site.add("b", "annex", &["r2", "rover"]);
    assert_eq!(site.answers("r1", ""), [], "nobody knows of the others yet");
    site.settle();
    assert_eq!(site.one("r1", ""), is("a", "take"));
    assert_eq!(site.one("r2", ""), is("b", "take"));
    assert_eq!(site.one("r2", "annex"), is("b", "take"));
    // Where the map is, it is decided whether the robot is known.
    assert_eq!(site.one("r1", "annex"), is("b", "take"));
    assert_eq!(site.one("rover", ""), is("a", Code::RobotContested.as_str()));
    assert_eq!(site.one("rover", "ground"), is("a", "take"));
    assert_eq!(site.one("rover", "annex"), is("b", "take"));
    assert_eq!(site.one("nobody", ""), is("a", "take"), "unknown_robot is the intake's answer");
    assert_eq!(site.one("r2", "nowhere"), is("b", "take"));
    assert_eq!(site.one("nobody", "No Name"), is("a", "take"));
}

#[test]
fn a_server_that_is_gone_is_named_by_another_until_it_is_back() {
    let mut site = Site::new(&["a", "b", "c"]);
    site.add("a", "ground", &["r1"]);
    site.add("b", "annex", &["r2", "r1"]);
    site.settle();
    site.connect(0, false);
    site.step();
    assert_eq!(site.one("r1", "ground"), is("b", Code::ServerGone.as_str()));
    assert_eq!(site.one("r2", ""), is("b", "take"));
    site.connect(1, false);
    site.step();
    assert_eq!(site.one("r2", ""), is("c", Code::ServerGone.as_str()));
    assert_eq!(site.one("r2", "annex"), is("c", Code::ServerGone.as_str()));
    site.connect(1, true);
    // It may be late, but never are there two.
    for _ in 0..20 {
        site.step();
        assert!(site.answers("r2", "annex").len() <= 1);
    }
    assert_eq!(site.one("r2", "annex"), is("b", "take"));
    // What was deleted is not gone with a server.
    site.snapshots("b").set_robot("r2", None);
    site.settle();
    assert_eq!(site.one("r2", ""), is("b", "take"));
}

#[test]
fn a_contested_map_is_served_by_the_first_and_said_by_one() {
    let mut site = Site::new(&["a", "b"]);
    site.add("b", "hall", &["r2"]);
    site.settle();
    site.add("a", "hall", &["r1"]);
    for _ in 0..60 {
        site.step();
        assert_eq!(site.answers("r1", "hall"), [is("b", "take")]);
    }
    assert_eq!(site.one("r1", ""), is("a", Code::MapContested.as_str()));
    let (router, not_served) = site.servers[0].0.faults();
    assert!(router.is_none() && not_served["hall"].contains("also on b"), "{not_served:?}");
    assert_eq!(site.servers[0].0.overview().contested_maps["hall"], ["a", "b"]);
    // Gone with its server, it is free.
    site.connect(1, false);
    site.settle();
    assert_eq!(site.one("r1", "hall"), is("a", "take"));
    site.connect(1, true);
    site.settle();
    assert_eq!(site.one("r2", "hall"), is("a", "take"));
    assert_eq!(site.one("r2", ""), is("b", Code::MapContested.as_str()));
}

#[test]
fn two_that_claim_a_map_together_both_refuse() {
    let mut site = Site::new(&["a", "b"]);
    site.add("a", "hall", &["r1"]);
    site.add("b", "hall", &["r2"]);
    site.settle();
    assert_eq!(site.one("r1", "hall"), is("a", Code::MapContested.as_str()));
    assert_eq!(site.one("r2", ""), is("b", Code::MapContested.as_str()));
    site.snapshots("a").remove_map("hall");
    site.settle();
    assert_eq!(site.one("r1", "hall"), is("b", "take"));
}

#[test]
fn a_second_server_of_the_same_name_serves_nobody() {
    let mut site = Site::new(&["a", "b"]);
    site.add("a", "hall", &["r1"]);
    site.settle();
    site.servers[1].0.own = name("a");
    site.connect(1, false);
    site.step();
    site.connect(1, true);
    site.servers[1].0.hear(&name("a"), ServerToken::Alive(1), true);
    site.settle();
    assert_eq!(site.one("r1", ""), is("a", "take"));
    assert!(site.servers[1].0.faults().0.unwrap().contains("another server is called a"));
}

#[test]
fn a_draft_is_not_announced() {
    let mut site = Site::new(&["a"]);
    let draft =
        engine::snapshot::MapSnapshot { is_draft: true, ..engine::snapshot::MapSnapshot::empty("draft", 1) };
    site.snapshots("a").publish(Arc::new(draft));
    site.settle();
    assert_eq!(site.servers[0].1.len(), 1, "{:?}", site.servers[0].1);
}
