//! What the workers read: one immutable [`MapSnapshot`] per map, swapped whole. Only the store publishes, and only
//! after its transaction is committed; a reader keeps the `Arc` it took, so an answer rests on one version.

use super::doubles::Doubles;
use crate::store::areas::Kept;
use arc_swap::ArcSwap;
use map::{
    landmark_health::LandmarkHealth,
    laser_fix::WallIndex,
    map_links::{MapLinks, relation},
    place::LandmarkPlace,
    pose2::Pose2Covariance,
    segments::LaserSegment,
    visibility::{VisibilityMap, VisibilitySettings},
};
use std::{collections::BTreeMap, sync::Arc};
use tokio::sync::broadcast;
use vision::{
    learn::model::LandmarkModel,
    localise::pose::LandmarkSize,
    params::Params,
    recognise::{DistanceKind, LandmarkId, models::ModelSet},
};

/// Changes that a slow listener may lag behind before it loses the oldest.
const CHANGES_KEPT: usize = 256;

/// One version of one map.
#[derive(Debug, Clone)]
pub struct MapSnapshot {
    /// Name of the map.
    pub name: String,
    /// Counts up with every change of the map.
    pub version: u64,
    /// Every landmark of the map by number, learnt or not.
    pub landmarks: BTreeMap<LandmarkId, LandmarkInfo>,
    /// The sizes of those of them that have one.
    pub sizes: BTreeMap<LandmarkId, LandmarkSize>,
    /// The models that are matched: the active ones of `learnt`.
    pub models: ModelSet,
    /// The landmarks that have look-alikes, with thresholds as if they had none: for robots that search.
    pub doubles: Arc<Doubles>,
    /// Every learnt model that reads and fits the parameters, candidates included.
    pub learnt: BTreeMap<LandmarkId, Learnt>,
    /// Models that are stored but must not be used, and why: damaged, or learnt under other parameters.
    pub quarantined: BTreeMap<LandmarkId, String>,
    /// The walls.
    pub walls: Vec<LaserSegment>,
    /// The same, made ready for localisation by scans; kept from version to version while the walls are the same.
    pub wall_index: Arc<WallIndex>,
    /// What runs have shown of modalities; kept from version to version while it is the same.
    pub(crate) areas: Kept,
    /// The camera that looks for its landmarks, and what counts as seen.
    pub sight: VisibilitySettings,
    /// From where each placed landmark is seen by that camera.
    pub visibility: BTreeMap<LandmarkId, Arc<VisibilityMap>>,
    /// Which distance decides.
    pub distance: DistanceKind,
    /// The parameters the models were learnt under, with the map's own distance.
    pub params: Arc<Params>,
}

impl MapSnapshot {
    /// A map without content.
    pub fn empty(name: impl Into<String>, version: u64) -> Self {
        Self {
            name: name.into(),
            version,
            landmarks: BTreeMap::new(),
            sizes: BTreeMap::new(),
            models: ModelSet::default(),
            doubles: Arc::default(),
            learnt: BTreeMap::new(),
            quarantined: BTreeMap::new(),
            walls: Vec::new(),
            wall_index: Arc::new(WallIndex::new([])),
            areas: Kept::default(),
            sight: VisibilitySettings::default(),
            visibility: BTreeMap::new(),
            distance: DistanceKind::Both,
            params: Arc::default(),
        }
    }
}

/// What is known of a landmark besides its appearance.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LandmarkInfo {
    /// Readable name, unique in the map.
    pub name: String,
    /// Width and height, if measured; without it there is no pose.
    pub size: Option<LandmarkSize>,
    /// Where it hangs, if that and its size are known; without it there is no robot pose.
    pub place: Option<LandmarkPlace>,
    /// How far it is trusted: what is quarantined corrects no pose.
    pub standing: LandmarkHealth,
}

impl LandmarkInfo {
    /// Whether it may correct poses.
    pub fn is_trusted(&self) -> bool {
        self.standing != LandmarkHealth::Quarantined
    }
}

/// A model with the digest of its stored bytes: the same digest is the same model.
#[derive(Debug, Clone)]
pub struct Learnt {
    /// SHA-256 of the bytes.
    pub digest: [u8; 32],
    /// The model.
    pub model: Arc<LandmarkModel>,
}

/// A map got a new version, or is gone.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MapChange {
    /// Name of the map.
    pub map: String,
    /// The new version; `None` when the map was deleted.
    pub version: Option<u64>,
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
}

impl Default for Snapshots {
    fn default() -> Self {
        Self { world: ArcSwap::default(), changes: broadcast::channel(CHANGES_KEPT).0 }
    }
}

impl Snapshots {
    /// The current version of `map`.
    pub fn get(&self, map: &str) -> Option<Arc<MapSnapshot>> {
        self.world.load().maps.get(map).cloned()
    }

    /// The current version of every map, by name.
    pub fn all(&self) -> Vec<Arc<MapSnapshot>> {
        self.world.load().maps.values().cloned().collect()
    }

    /// Name of the robot's map; `None` for a robot that is not registered.
    pub fn robot_map(&self, robot: &str) -> Option<String> {
        self.world.load().robots.get(robot).cloned()
    }

    /// Events of [`Snapshots::publish`] and [`Snapshots::remove_map`] from now on.
    pub fn changes(&self) -> broadcast::Receiver<MapChange> {
        self.changes.subscribe()
    }

    /// Makes `map` the current version of its name. For the store, after the commit.
    #[expect(clippy::needless_pass_by_value, reason = "the map is given away: nobody may change it any more")]
    pub fn publish(&self, map: Arc<MapSnapshot>) {
        let change = MapChange { map: map.name.clone(), version: Some(map.version) };
        self.world.rcu(|world| {
            let mut world = World::clone(world);
            world.maps.insert(map.name.clone(), map.clone());
            world
        });
        self.announce(change);
    }

    /// Forgets a map. For the store, after the commit.
    pub fn remove_map(&self, map: &str) {
        self.world.rcu(|world| {
            let mut world = World::clone(world);
            world.maps.remove(map);
            world
        });
        self.announce(MapChange { map: map.to_owned(), version: None });
    }

    /// Registers a robot on a map, or takes it off with `None`. For the store, after the commit.
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

    /// How maps lie to each other from now on. For the store, after the commit.
    pub fn set_links(&self, links: MapLinks<String>) {
        let links = Arc::new(links);
        self.world.rcu(|world| World { links: links.clone(), ..World::clone(world) });
    }

    /// `to_from_map` of two maps that hang on the same one; nothing for others.
    pub fn relation(&self, from: &str, to: &str) -> Option<Pose2Covariance> {
        let links = self.world.load().links.clone();
        Some(relation(&links, &from.to_owned(), &to.to_owned()).ok()?.to_from_map)
    }

    fn announce(&self, change: MapChange) {
        // An error only says that nobody listens.
        drop(self.changes.send(change));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn robots_come_and_go() {
        let snapshots = Snapshots::default();
        assert_eq!(snapshots.robot_map("r1"), None);
        snapshots.set_robot("r1", Some("a"));
        assert_eq!(snapshots.robot_map("r1").as_deref(), Some("a"));
        snapshots.set_robot("r1", None);
        assert_eq!(snapshots.robot_map("r1"), None);
    }
}
