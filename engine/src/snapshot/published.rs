//! The current version of every map, swapped whole. Only the publication publishes, and only after
//! a transaction is committed; a reader keeps the `Arc` it took, so an answer rests on one version.

use super::map_snapshot::MapSnapshot;
use arc_swap::ArcSwap;
use map::{
    map_links::{MapLinks, relation},
    pose2::Pose2Covariance,
};
use std::{collections::BTreeMap, sync::Arc};
use tokio::sync::{broadcast, watch};

/// Changes that a slow listener may lag behind before it loses the oldest.
const MAX_CHANGES: usize = 256;

/// A map got a new version, or is gone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapChange {
    /// Name of the map.
    pub map: String,
    /// The new version; `None` when the map was deleted.
    pub version: Option<u64>,
    /// It is a draft, of which robots are not told.
    pub is_draft: bool,
}

#[derive(Debug, Default, Clone)]
struct World {
    maps: BTreeMap<String, Arc<MapSnapshot>>,
    robots: BTreeMap<String, String>,
    links: Arc<MapLinks<String>>,
}

/// All maps and the robots' assignments, readable from any thread without waiting.
#[derive(Debug)]
pub struct Snapshots {
    world: ArcSwap<World>,
    changes: broadcast::Sender<MapChange>,
    /// Counts the publications, of derived data too.
    published: watch::Sender<u64>,
}

impl Default for Snapshots {
    fn default() -> Self {
        Self {
            world: ArcSwap::default(),
            changes: broadcast::channel(MAX_CHANGES).0,
            published: watch::Sender::default(),
        }
    }
}

impl Snapshots {
    /// The current version of `map`.
    pub fn get(&self, map: &str) -> Option<Arc<MapSnapshot>> {
        self.world.load().maps.get(map).cloned()
    }

    /// The current version of `map`, as robots may name it: none of a draft.
    pub fn for_robots(&self, map: &str) -> Option<Arc<MapSnapshot>> {
        self.get(map).filter(|map| !map.is_draft)
    }

    /// The current version of every map, by name.
    pub fn all(&self) -> Vec<Arc<MapSnapshot>> {
        self.world.load().maps.values().cloned().collect()
    }

    /// How many snapshots were published, those with more derived data too.
    pub fn publications(&self) -> u64 {
        *self.published.borrow()
    }

    /// Name of the robot's map; `None` for a robot that is not registered.
    pub fn robot_map(&self, robot: &str) -> Option<String> {
        self.world.load().robots.get(robot).cloned()
    }

    /// Every registered robot with its map.
    pub fn robots(&self) -> BTreeMap<String, String> {
        self.world.load().robots.clone()
    }

    /// Events of [`Snapshots::publish`] and [`Snapshots::remove_map`] from now on.
    pub fn changes(&self) -> broadcast::Receiver<MapChange> {
        self.changes.subscribe()
    }

    /// Makes `map` the current version of its name. For the publication, after the commit.
    #[expect(clippy::needless_pass_by_value, reason = "the map is given away: nobody may change it any more")]
    pub fn publish(&self, map: Arc<MapSnapshot>) {
        let change = MapChange { map: map.name.clone(), version: Some(map.version), is_draft: map.is_draft };
        self.world.rcu(|world| {
            let mut world = World::clone(world);
            world.maps.insert(map.name.clone(), map.clone());
            world
        });
        self.announce(change);
    }

    /// Replaces `from` by `map`, the same version with more derived data; nothing if `from` is not
    /// current any more. A map that was deleted and made again may have the same name and version:
    /// the version alone does not tell.
    pub fn publish_derived(&self, from: &Arc<MapSnapshot>, map: &Arc<MapSnapshot>) {
        self.world.rcu(|world| {
            let mut world = World::clone(world);
            if let Some(current) = world.maps.get_mut(&map.name)
                && Arc::ptr_eq(current, from)
            {
                *current = map.clone();
            }
            world
        });
        self.published.send_modify(|count| *count += 1);
    }

    /// Forgets a map. For the publication, after the commit.
    pub fn remove_map(&self, map: &str) {
        let is_draft = self.get(map).is_some_and(|map| map.is_draft);
        self.world.rcu(|world| {
            let mut world = World::clone(world);
            world.maps.remove(map);
            world
        });
        self.announce(MapChange { map: map.to_owned(), version: None, is_draft });
    }

    /// Registers a robot on a map, or takes it off with `None`. For the publication, after the
    /// commit.
    pub fn set_robot(&self, robot: &str, map: Option<&str>) {
        self.world.rcu(|world| {
            let mut world = World::clone(world);
            match map {
                Some(map) => world.robots.insert(robot.to_owned(), map.to_owned()),
                None => world.robots.remove(robot),
            };
            world
        });
    }

    /// Replaces the map links. For the publication, after the commit.
    pub fn set_links(&self, links: MapLinks<String>) {
        let links = Arc::new(links);
        self.world.rcu(|world| World { links: links.clone(), ..World::clone(world) });
    }

    /// `to_from_map` (m, rad) of two maps that are linked to the same one; `None` for others.
    pub fn relation(&self, from: &str, to: &str) -> Option<Pose2Covariance> {
        let links = self.world.load().links.clone();
        Some(relation(&links, &from.to_owned(), &to.to_owned()).ok()?.to_from_map)
    }

    /// The current version of `map` as soon as none of its visibility areas is pending. Waits.
    pub async fn with_visibility(&self, map: &str) -> Option<Arc<MapSnapshot>> {
        let mut published = self.published.subscribe();
        loop {
            published.mark_unchanged();
            match self.get(map) {
                Some(current) if current.pending.visibility => {}
                ready => return ready,
            }
            // Not reached: an error means that `self` was dropped.
            published.changed().await.ok()?;
        }
    }

    fn announce(&self, change: MapChange) {
        self.published.send_modify(|count| *count += 1);
        // An error means that nobody listens.
        drop(self.changes.send(change));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::snapshot::map_snapshot::Pending;

    fn map(name: &str, version: u64) -> Arc<MapSnapshot> {
        Arc::new(MapSnapshot::empty(name, version))
    }

    #[test]
    fn a_reader_keeps_its_version() {
        let snapshots = Snapshots::default();
        let mut changes = snapshots.changes();
        snapshots.publish(map("a", 1));
        let held = snapshots.get("a").unwrap();
        snapshots.publish(map("a", 2));
        assert_eq!((held.version, snapshots.get("a").unwrap().version), (1, 2));
        snapshots.remove_map("a");
        assert!(snapshots.get("a").is_none());
        let versions: Vec<_> = std::iter::from_fn(|| changes.try_recv().ok()).map(|c| c.version).collect();
        assert_eq!(versions, [Some(1), Some(2), None]);
    }

    #[test]
    fn derived_data_goes_to_the_version_that_it_was_derived_from() {
        let snapshots = Snapshots::default();
        let first = map("a", 1);
        snapshots.publish(first.clone());
        let derived = Arc::new(MapSnapshot { pending: Pending::default(), ..MapSnapshot::clone(&first) });
        snapshots.publish_derived(&first, &derived);
        assert!(Arc::ptr_eq(&snapshots.get("a").unwrap(), &derived));
        // Deleted and made again: another map of the same name and version.
        snapshots.remove_map("a");
        let again = map("a", 1);
        snapshots.publish(again.clone());
        snapshots.publish_derived(&derived, &first);
        assert!(Arc::ptr_eq(&snapshots.get("a").unwrap(), &again));
    }

    #[test]
    fn robots_come_and_go() {
        let snapshots = Snapshots::default();
        assert_eq!(snapshots.robot_map("r1"), None);
        snapshots.set_robot("r1", Some("a"));
        assert_eq!(snapshots.robot_map("r1").as_deref(), Some("a"));
        snapshots.set_robot("r1", None);
        assert_eq!(snapshots.robot_map("r1"), None);
    }
}
