//! Which of its maps a server serves to robots where others may have them, too. In: its maps, what
//! others announce, the time. Out: for each map whether it is served.
//!
//! A server announces that it *holds* a map, waits [`SETTLE`] so that all know, and serves only if
//! no other holds it. One that serves goes on when another comes, which sees that and refuses. Two
//! that come at the same time both refuse; two that both serve and meet both stop. A server that
//! refused may serve only once no other holds the map: two that refuse stay so until a person
//! deletes or renames one of the maps, so that they cannot alternate.

use super::peers::Peers;
use protos::{Name, ServerToken};
use std::{
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

/// From an announcement until everybody is taken to know it.
pub(crate) const SETTLE: Duration = Duration::from_secs(1);
/// After the connection to the router: so long others may take to come back before a map that was
/// refused is taken.
pub(crate) const RETURN: Duration = Duration::from_secs(10);

/// Whether a map is served.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum MapClaim {
    /// Not yet: others may not know of it.
    Waiting {
        /// When it was announced.
        since: Instant,
        /// It was served until the connection broke.
        was_served: bool,
    },
    /// Robots are answered.
    Served,
    /// Another server holds it.
    Refused {
        /// Since when no other does.
        free: Option<Instant>,
    },
}

/// The claims of a server, by map.
#[derive(Debug, Default)]
pub(crate) struct Claims {
    maps: BTreeMap<Name, MapClaim>,
}

impl Claims {
    /// What became of a map.
    pub(crate) fn of(&self, map: &Name) -> Option<MapClaim> {
        self.maps.get(map).copied()
    }

    /// All, by map.
    pub(crate) fn all(&self) -> impl Iterator<Item = (&Name, &MapClaim)> {
        self.maps.iter()
    }

    /// The connection broke: nobody is heard, and others may take over.
    pub(crate) fn suspend(&mut self, now: Instant) {
        for claim in self.maps.values_mut() {
            if *claim == MapClaim::Served {
                *claim = MapClaim::Waiting { since: now, was_served: true };
            }
        }
    }

    /// Moves on. `joined`: when the connection was made.
    pub(crate) fn step(&mut self, own: &BTreeSet<Name>, others: &Peers, joined: Instant, now: Instant) {
        self.maps.retain(|map, _| own.contains(map));
        for map in own {
            let new = MapClaim::Waiting { since: now, was_served: false };
            let claim = self.maps.entry(map.clone()).or_insert(new);
            let holders = others.with(&ServerToken::Holds(map.clone()));
            let serving = others.with(&ServerToken::Serves(map.clone()));
            let next = next(*claim, (&holders, &serving), joined, now);
            if next != *claim {
                tell(map, next, &holders, &serving);
                *claim = next;
            }
        }
    }
}

fn next(claim: MapClaim, (holders, serving): (&[Name], &[Name]), joined: Instant, now: Instant) -> MapClaim {
    let has_settled = |since: Instant| now.duration_since(since.max(joined)) >= SETTLE;
    match claim {
        MapClaim::Waiting { since, was_served } if has_settled(since) => {
            let is_free = serving.is_empty() && (was_served || holders.is_empty());
            if is_free { MapClaim::Served } else { MapClaim::Refused { free: None } }
        }
        MapClaim::Served if !serving.is_empty() => MapClaim::Refused { free: None },
        MapClaim::Refused { .. } if !holders.is_empty() || !serving.is_empty() => {
            MapClaim::Refused { free: None }
        }
        MapClaim::Refused { free: None } => MapClaim::Refused { free: Some(now) },
        MapClaim::Refused { free: Some(since) }
            if has_settled(since) && now.duration_since(joined) >= RETURN =>
        {
            MapClaim::Served
        }
        same => same,
    }
}

fn tell(map: &Name, claim: MapClaim, holders: &[Name], serving: &[Name]) {
    let names = |of: &[Name]| of.iter().map(Name::as_str).collect::<Vec<_>>().join(", ");
    match claim {
        MapClaim::Served => tracing::info!(%map, "map_served"),
        MapClaim::Refused { free: None } => tracing::error!(
            %map,
            held_by = names(holders),
            served_by = names(serving),
            follows = "robots are refused on it here; delete or rename the map on one of the servers",
            "map_contested"
        ),
        MapClaim::Refused { .. } | MapClaim::Waiting { .. } => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF: Duration = Duration::from_millis(500);

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    /// Two servers that see each other's tokens at once, on one map.
    struct Pair {
        now: Instant,
        joined: [Instant; 2],
        claims: [Claims; 2],
        has: [bool; 2],
    }

    impl Pair {
        fn new() -> Self {
            let now = Instant::now();
            Self { now, joined: [now; 2], claims: Default::default(), has: [false; 2] }
        }

        fn view(&self, of: usize) -> Peers {
            let (mut others, other) = (Peers::default(), name(["a", "b"][1 - of]));
            if self.has[1 - of] {
                others.hear(&other, ServerToken::Holds(name("hall")), true);
                if self.is_served(1 - of) {
                    others.hear(&other, ServerToken::Serves(name("hall")), true);
                }
            }
            others
        }

        fn is_served(&self, i: usize) -> bool {
            self.claims[i].of(&name("hall")) == Some(MapClaim::Served)
        }

        fn step(&mut self, by: Duration) -> [bool; 2] {
            self.now += by;
            let views = [self.view(0), self.view(1)];
            for (i, view) in views.iter().enumerate() {
                let own = self.has[i].then(|| name("hall")).into_iter().collect();
                self.claims[i].step(&own, view, self.joined[i], self.now);
            }
            [self.is_served(0), self.is_served(1)]
        }

        fn after(&mut self, time: Duration) -> [bool; 2] {
            let until = self.now + time;
            while self.now < until {
                self.step(HALF);
            }
            [self.is_served(0), self.is_served(1)]
        }
    }

    #[test]
    fn who_comes_later_refuses_and_takes_over_when_the_map_is_free() {
        let mut pair = Pair::new();
        pair.has[0] = true;
        assert_eq!(pair.step(Duration::ZERO), [false, false], "nobody knows of it yet");
        assert_eq!(pair.after(SETTLE), [true, false]);
        pair.has[1] = true;
        assert_eq!(pair.after(30 * SETTLE), [true, false]);
        pair.has[0] = false;
        assert_eq!(pair.step(HALF), [false, false], "it may come back");
        assert_eq!(pair.after(3 * SETTLE), [false, true]);
        pair.has[0] = true;
        assert_eq!(pair.after(30 * SETTLE), [false, true]);
    }

    #[test]
    fn who_come_together_both_refuse_for_ever() {
        let mut pair = Pair::new();
        pair.has = [true; 2];
        assert_eq!(pair.after(100 * SETTLE), [false, false]);
        pair.has[1] = false;
        assert_eq!(pair.after(3 * SETTLE), [true, false]);
    }

    #[test]
    fn two_that_serve_and_meet_both_stop() {
        let mut pair = Pair::new();
        pair.has = [true; 2];
        for claims in &mut pair.claims {
            claims.maps.insert(name("hall"), MapClaim::Served);
        }
        assert_eq!(pair.step(HALF), [false, false]);
        assert_eq!(pair.after(100 * SETTLE), [false, false]);
    }

    /// A restart of the router leaves things as they were, whoever comes back first.
    #[test]
    fn a_lost_connection_changes_nothing() {
        for (first, second) in [(0, 1), (1, 0)] {
            let mut pair = Pair::new();
            pair.has[0] = true;
            pair.after(2 * SETTLE);
            pair.has[1] = true;
            assert_eq!(pair.after(15 * SETTLE), [true, false]);
            for claims in &mut pair.claims {
                claims.suspend(pair.now);
            }
            pair.has[second] = false;
            pair.joined[first] = pair.now;
            pair.after(5 * SETTLE);
            pair.has[second] = true;
            pair.joined[second] = pair.now;
            if second == 1 {
                // It was not without the map, but without a connection.
                pair.claims[1].maps.insert(name("hall"), MapClaim::Refused { free: None });
            } else {
                pair.claims[0]
                    .maps
                    .insert(name("hall"), MapClaim::Waiting { since: pair.now, was_served: true });
            }
            assert_eq!(pair.after(30 * SETTLE), [true, false], "{first} came back first");
        }
    }
}
