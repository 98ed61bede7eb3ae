//! Where a robot may be while nothing it sees is unique: the belief of `map::relocalise` over the map, for each robot that
//! searches. In: frames with odometry that show landmarks that have doubles. Out: the hypotheses that are left, and a pose
//! once one of them holds 95 %, explains sightings of two different landmarks, and no other place does nearly as well. On
//! the vision threads only.

use super::{
    doubles::{AmbiguousObservation, on_floor, readings},
    snapshot::MapSnapshot,
};
use map::{
    pose2::{Pose2, Pose2Covariance, wrap_rad},
    relocalise::{GridBelief, GridBeliefParams, PoseHypothesis},
};
use nalgebra::{Matrix3, Point2, Vector2, Vector3};
use protos::Name;
use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::{Arc, Mutex, PoisonError},
};
use vision::model::LandmarkId;

/// Robots that search at a time, some 50 MB each at most; the one longest without a sighting gives way.
pub const MAX_SEARCHES: usize = 8;
/// Cells of a belief: 180 m by 180 m at the coarsest step.
pub const MAX_CELLS: usize = 1_200_000;
/// Coarsest step: beyond it a map is too large to search.
const MAX_CELL_M: f64 = 1.0;
/// Sightings that a pose is checked with: the latest.
pub const MAX_LOOKS: usize = 32;
/// A sighting is new after this way, or...
const NEW_LOOK_M: f64 = 0.3;
/// ...this turn: from the same place its errors are the same.
const NEW_LOOK_RAD: f64 = 0.3;
/// Different landmarks that a pose must explain: something that is on no map looks like any one.
const LEAST_LANDMARKS: usize = 2;
/// Share of the sightings that a pose must explain...
const LEAST_EXPLAINED: f64 = 0.8;
/// ...within this distance, and more the longer the way since, and...
const EXPLAINED_M: f64 = 0.6;
/// ...this turn.
const EXPLAINED_RAD: f64 = 0.35;
/// How far drifting odometry may move a sighting, metres and radians per metre.
const DRIFT: f64 = 0.05;
/// Room about the walls: a robot may stand outside of what was mapped.
const MARGIN_M: f64 = 1.0;

/// A frame of a robot that does not know where it is.
#[derive(Debug, Clone, Copy)]
pub struct RelocalisationInput<'a> {
    /// Which start of the robot's software.
    pub epoch: u64,
    /// The map.
    pub map: &'a MapSnapshot,
    /// Odometry at capture.
    pub odometry: Pose2,
    /// What it shows that may be several landmarks.
    pub sighted: &'a [AmbiguousObservation],
}

/// How far a robot's search has come.
#[derive(Debug, Clone, Default)]
pub struct RelocalisationProgress {
    /// On which map.
    pub map: String,
    /// Its version.
    pub map_version: u64,
    /// The hypotheses, most probable first.
    pub modes: Vec<PoseHypothesis>,
    /// Of the belief, nats.
    pub entropy_nats: f64,
    /// Sightings so far, the latest 32 at most.
    pub sightings: usize,
    /// Landmarks by which the first hypothesis explains them.
    pub landmarks: Vec<LandmarkId>,
    /// What is missing before the first one is the robot's pose.
    pub needed: Vec<MissingCondition>,
}

/// Why the first hypothesis is not yet the pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MissingCondition {
    /// It is not probable enough: other places are too probable still.
    HigherProbability,
    /// All observations could be of one landmark: a second is to be seen.
    SecondLandmark,
    /// It does not explain enough of what was seen.
    ConsistentObservations,
    /// The landmarks hang so evenly that another place would explain what was seen nearly as well.
    NoRivalPose,
}

/// What is left after a frame.
#[derive(Debug, Clone, Default)]
pub struct RelocalisationUpdate {
    /// The hypotheses, most probable first.
    pub modes: Vec<PoseHypothesis>,
    /// The pose at the frame, once it is decided, and the landmarks that it explains.
    pub decided: Option<(Pose2Covariance, Vec<LandmarkId>)>,
}

#[derive(Debug)]
struct Search {
    epoch: u64,
    map: String,
    version: u64,
    p: GridBeliefParams,
    belief: GridBelief,
    odometry: Pose2,
    way_m: f64,
    looks: VecDeque<(Pose2, f64, Vec<AmbiguousObservation>)>,
    /// After the last sighting.
    modes: Vec<PoseHypothesis>,
    entropy_nats: f64,
    landmarks: Vec<LandmarkId>,
    needed: Vec<MissingCondition>,
}

/// All searches.
#[derive(Debug, Default)]
pub struct Relocalisers(Mutex<Open>);

/// The robots that search, each with the tick of its last frame.
#[derive(Debug, Default)]
struct Open {
    ticks: u64,
    all: BTreeMap<Name, (u64, Arc<Mutex<Search>>)>,
}

impl Relocalisers {
    /// Takes a frame in. `None` while the robot has seen nothing to search with.
    pub fn glance(&self, robot: &Name, glance: &RelocalisationInput<'_>) -> Option<RelocalisationUpdate> {
        let search = self.of(robot, glance)?;
        let mut search = search.lock().unwrap_or_else(PoisonError::into_inner);
        search.glance(glance)
    }

    /// How far a robot's search has come; `None` for one that is not searching.
    pub fn progress(&self, robot: &Name) -> Option<RelocalisationProgress> {
        let search = {
            let open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            open.all.get(robot).map(|(_, search)| search.clone())?
        };
        let search = search.lock().unwrap_or_else(PoisonError::into_inner);
        Some(RelocalisationProgress {
            map: search.map.clone(),
            map_version: search.version,
            modes: search.modes.clone(),
            entropy_nats: search.entropy_nats,
            sightings: search.looks.iter().map(|(.., sighted)| sighted.len()).sum(),
            landmarks: search.landmarks.clone(),
            needed: search.needed.clone(),
        })
    }

    /// The robot knows where it is.
    pub fn end(&self, robot: &Name) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).all.remove(robot);
    }

    /// The robot's search, begun by a sighting.
    fn of(&self, robot: &Name, glance: &RelocalisationInput<'_>) -> Option<Arc<Mutex<Search>>> {
        let mut guard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Open { ticks, all } = &mut *guard;
        *ticks += 1;
        if let Some((tick, search)) = all.get_mut(robot) {
            *tick = *ticks;
            return Some(search.clone());
        }
        if glance.sighted.is_empty() {
            return None;
        }
        let made = Arc::new(Mutex::new(Search::new(glance)?));
        all.insert(robot.clone(), (*ticks, made.clone()));
        if all.len() > MAX_SEARCHES {
            let stalest = all.iter().min_by_key(|(_, (tick, _))| *tick).map(|(name, _)| name.clone());
            stalest.map(|name| all.remove(&name));
        }
        Some(made)
    }
}

impl Search {
    /// Anywhere on the map; `None` if the map is too large or shows no extent.
    fn new(glance: &RelocalisationInput<'_>) -> Option<Self> {
        let corners = extent(glance.map)?;
        let area = (corners[1] - corners[0]).map(|v| v.max(0.1)).product();
        let fine = GridBeliefParams::default();
        let cell_m = fine.cell_m.max((area * fine.headings as f64 / MAX_CELLS as f64).sqrt() * 1.01);
        if cell_m > MAX_CELL_M {
            return None;
        }
        let p = GridBeliefParams { cell_m, ..fine };
        let belief = GridBelief::new(corners, |_| 1.0, &p).ok()?;
        let RelocalisationInput { epoch, map, odometry, .. } = *glance;
        let (name, version) = (map.name.clone(), map.version);
        Some(Self {
            epoch,
            map: name,
            version,
            p,
            entropy_nats: belief.entropy_nats(),
            belief,
            odometry,
            way_m: 0.0,
            looks: VecDeque::new(),
            modes: Vec::new(),
            landmarks: Vec::new(),
            needed: vec![MissingCondition::HigherProbability, MissingCondition::SecondLandmark],
        })
    }

    fn glance(&mut self, glance: &RelocalisationInput<'_>) -> Option<RelocalisationUpdate> {
        let same = (self.epoch, self.map.as_str(), self.version)
            == (glance.epoch, glance.map.name.as_str(), glance.map.version);
        if !same {
            *self = Self::new(glance).filter(|_| !glance.sighted.is_empty())?;
        }
        let since = |before: &Pose2| before.between(&glance.odometry);
        let new = self.looks.back().is_none_or(|(before, ..)| {
            let motion = since(before);
            motion.position().norm() >= NEW_LOOK_M || motion.theta_rad.abs() >= NEW_LOOK_RAD
        });
        if glance.sighted.is_empty() || !new {
            return Some(RelocalisationUpdate { modes: self.modes.clone(), decided: None });
        }
        let motion = since(&self.odometry);
        self.way_m += motion.position().norm();
        self.odometry = glance.odometry;
        self.belief.predict(&motion).ok()?;
        for sighted in glance.sighted {
            self.belief.update_associations(&readings(sighted, glance.map, self.p.clutter)).ok()?;
        }
        if self.looks.len() == MAX_LOOKS {
            self.looks.pop_front();
        }
        self.looks.push_back((glance.odometry, self.way_m, glance.sighted.to_vec()));
        self.modes = self.belief.modes();
        self.entropy_nats = self.belief.entropy_nats();
        Some(RelocalisationUpdate { modes: self.modes.clone(), decided: self.decided(glance.map) })
    }

    /// The pose, if nothing is missing any more.
    fn decided(&mut self, map: &MapSnapshot) -> Option<(Pose2Covariance, Vec<LandmarkId>)> {
        self.needed = Vec::new();
        let Some(mode) = self.modes.first().copied().filter(|m| m.mass > self.p.decided) else {
            self.needed.push(MissingCondition::HigherProbability);
            self.landmarks =
                self.modes.first().map_or_else(Vec::new, |m| self.explained(&m.pose.pose, map).0);
            return None;
        };
        let (landmarks, share) = self.explained(&mode.pose.pose, map);
        if landmarks.len() < LEAST_LANDMARKS {
            self.needed.push(MissingCondition::SecondLandmark);
        }
        if share < LEAST_EXPLAINED {
            self.needed.push(MissingCondition::ConsistentObservations);
        }
        if self.needed.is_empty() && self.has_rival(&mode.pose.pose, &landmarks, map) {
            self.needed.push(MissingCondition::NoRivalPose);
        }
        self.landmarks.clone_from(&landmarks);
        let cell = Vector3::new(self.p.cell_m, self.p.cell_m, 0.1).map(|s| s * s);
        let covariance = mode.pose.covariance + Matrix3::from_diagonal(&cell);
        self.needed.is_empty().then_some((Pose2Covariance { covariance, ..mode.pose }, landmarks))
    }

    /// Whether some other place explains the sightings too, within what odometry and places may be wrong by: the belief
    /// takes its errors for independent and is too sure where like doors hang nearly evenly. Where the robot would be if the
    /// landmarks that `now` explains were others that look like them.
    fn has_rival(&self, now: &Pose2, landmarks: &[LandmarkId], map: &MapSnapshot) -> bool {
        let place = |id: &LandmarkId| Some(on_floor(map.landmarks.get(id)?.place.as_ref()?));
        let others: BTreeSet<LandmarkId> =
            self.looks.iter().flat_map(|(.., looks)| looks.iter().flatten().map(|(id, _)| *id)).collect();
        let others: Vec<Pose2> = others.iter().filter_map(place).collect();
        let explained: Vec<Pose2> = landmarks.iter().filter_map(place).collect();
        let images = explained.iter().flat_map(|here| {
            let from_here = here.between(now);
            others.iter().map(move |there| there.compose(&from_here))
        });
        let elsewhere = |image: &Pose2| {
            let e = image.minus(now);
            e.xy().norm() > self.p.mode_m || wrap_rad(e.z).abs() > self.p.mode_rad
        };
        images.filter(elsewhere).any(|image| self.explained(&image, map).1 >= LEAST_EXPLAINED)
    }

    /// The landmarks that a pose explains the sightings by, and the share of them that it explains.
    fn explained(&self, now: &Pose2, map: &MapSnapshot) -> (Vec<LandmarkId>, f64) {
        let (mut landmarks, mut explained, mut all) = (BTreeSet::new(), 0.0, 0.0_f64);
        for (odometry, way_m, looks) in &self.looks {
            let then = now.compose(&self.odometry.between(odometry));
            let drift = DRIFT * (self.way_m - way_m);
            for sighted in looks {
                all += 1.0;
                let fits = |(id, glimpse): &&(LandmarkId, map::relocalise::RelativeObservation)| {
                    let Some(place) = map.landmarks.get(id).and_then(|l| l.place.as_ref()) else {
                        return false;
                    };
                    let e = glimpse.robot_from_landmark.minus(&then.between(&on_floor(place)));
                    Vector2::new(e.x, e.y).norm() <= EXPLAINED_M + drift
                        && wrap_rad(e.z).abs() <= EXPLAINED_RAD + drift
                };
                if let Some((id, _)) = sighted.iter().find(fits) {
                    landmarks.insert(*id);
                    explained += 1.0;
                }
            }
        }
        (landmarks.into_iter().collect(), explained / all.max(1.0))
    }
}

/// The rectangle about the walls, or about the landmarks and what can be seen of them from afar.
fn extent(map: &MapSnapshot) -> Option<[Point2<f64>; 2]> {
    let (points, margin): (Vec<Point2<f64>>, f64) = if map.walls.is_empty() {
        let places = map.landmarks.values().filter_map(|l| l.place.as_ref());
        (places.map(|p| Point2::new(p.x_m, p.y_m)).collect(), GridBeliefParams::default().clutter_reach_m)
    } else {
        (map.walls.iter().flat_map(|w| [w.a, w.b]).collect(), MARGIN_M)
    };
    let first = points.first()?;
    let (low, high) = points.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
    let margin = Vector2::new(margin, margin);
    Some([low - margin, high + margin])
}

#[cfg(test)]
mod tests;
