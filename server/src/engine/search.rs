//! Where a robot may be while nothing it sees is unique: the belief of `map::hypotheses` over the map, for each robot that
//! searches. In: frames with odometry that show landmarks that have doubles. Out: the hypotheses that are left, and a pose
//! once one of them holds 95 % and explains sightings of two different landmarks. On the vision threads only.

use super::{
    doubles::{Sighted, on_floor, readings},
    snapshot::MapSnapshot,
};
use map::{
    hypotheses::{Hypotheses, HypothesesParams, Mode},
    pose2::{Pose2, Pose2Covariance, wrap_rad},
};
use nalgebra::{Matrix3, Point2, Vector2, Vector3};
use protos::Name;
use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::{Arc, Mutex, PoisonError},
};
use vision::recognise::LandmarkId;

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
pub struct Glance<'a> {
    /// Which start of the robot's software.
    pub epoch: u64,
    /// The map.
    pub map: &'a MapSnapshot,
    /// Odometry at capture.
    pub odometry: Pose2,
    /// What it shows that may be several landmarks.
    pub sighted: &'a [Sighted],
}

/// What is left after a frame.
#[derive(Debug, Clone, Default)]
pub struct Left {
    /// The hypotheses, most probable first.
    pub modes: Vec<Mode>,
    /// The pose at the frame, once it is decided, and the landmarks that it explains.
    pub decided: Option<(Pose2Covariance, Vec<LandmarkId>)>,
}

#[derive(Debug)]
struct Search {
    epoch: u64,
    map: String,
    version: u64,
    p: HypothesesParams,
    belief: Hypotheses,
    odometry: Pose2,
    way_m: f64,
    looks: VecDeque<(Pose2, f64, Vec<Sighted>)>,
    /// After the last sighting.
    modes: Vec<Mode>,
}

/// All searches.
#[derive(Debug, Default)]
pub struct Searches(Mutex<Open>);

/// The robots that search, each with the tick of its last frame.
#[derive(Debug, Default)]
struct Open {
    ticks: u64,
    all: BTreeMap<Name, (u64, Arc<Mutex<Search>>)>,
}

impl Searches {
    /// Takes a frame in. `None` while the robot has seen nothing to search with.
    pub fn glance(&self, robot: &Name, glance: &Glance<'_>) -> Option<Left> {
        let search = self.of(robot, glance)?;
        let mut search = search.lock().unwrap_or_else(PoisonError::into_inner);
        search.glance(glance)
    }

    /// The robot knows where it is.
    pub fn end(&self, robot: &Name) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).all.remove(robot);
    }

    /// The robot's search, begun by a sighting.
    fn of(&self, robot: &Name, glance: &Glance<'_>) -> Option<Arc<Mutex<Search>>> {
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
    fn new(glance: &Glance<'_>) -> Option<Self> {
        let corners = extent(glance.map)?;
        let area = (corners[1] - corners[0]).map(|v| v.max(0.1)).product();
        let fine = HypothesesParams::default();
        let cell_m = fine.cell_m.max((area * fine.headings as f64 / MAX_CELLS as f64).sqrt() * 1.01);
        if cell_m > MAX_CELL_M {
            return None;
        }
        let p = HypothesesParams { cell_m, ..fine };
        let belief = Hypotheses::new(corners, |_| 1.0, &p).ok()?;
        let Glance { epoch, map, odometry, .. } = *glance;
        let (name, version) = (map.name.clone(), map.version);
        let (way_m, looks, modes) = (0.0, VecDeque::new(), Vec::new());
        Some(Self { epoch, map: name, version, p, belief, odometry, way_m, looks, modes })
    }

    fn glance(&mut self, glance: &Glance<'_>) -> Option<Left> {
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
            return Some(Left { modes: self.modes.clone(), decided: None });
        }
        let motion = since(&self.odometry);
        self.way_m += motion.position().norm();
        self.odometry = glance.odometry;
        self.belief.moved(&motion).ok()?;
        for sighted in glance.sighted {
            self.belief.saw_any(&readings(sighted, glance.map, self.p.clutter)).ok()?;
        }
        if self.looks.len() == MAX_LOOKS {
            self.looks.pop_front();
        }
        self.looks.push_back((glance.odometry, self.way_m, glance.sighted.to_vec()));
        self.modes = self.belief.modes();
        let modes = self.modes.clone();
        let decided = modes.first().filter(|m| m.mass > self.p.decided).and_then(|mode| {
            let landmarks = self.explained(&mode.pose.pose, glance.map)?;
            let cell = Vector3::new(self.p.cell_m, self.p.cell_m, 0.1).map(|s| s * s);
            let covariance = mode.pose.covariance + Matrix3::from_diagonal(&cell);
            Some((Pose2Covariance { covariance, ..mode.pose }, landmarks))
        });
        Some(Left { modes, decided })
    }

    /// The landmarks that a pose explains the sightings by; `None` if they are too few.
    fn explained(&self, now: &Pose2, map: &MapSnapshot) -> Option<Vec<LandmarkId>> {
        let (mut landmarks, mut explained, mut all) = (BTreeSet::new(), 0.0, 0.0);
        for (odometry, way_m, looks) in &self.looks {
            let then = now.compose(&self.odometry.between(odometry));
            let drift = DRIFT * (self.way_m - way_m);
            for sighted in looks {
                all += 1.0;
                let fits = |(id, glimpse): &&(LandmarkId, map::hypotheses::Glimpse)| {
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
        let enough = landmarks.len() >= LEAST_LANDMARKS && explained >= LEAST_EXPLAINED * all;
        enough.then(|| landmarks.into_iter().collect())
    }
}

/// The rectangle about the walls, or about the landmarks and what can be seen of them from afar.
fn extent(map: &MapSnapshot) -> Option<[Point2<f64>; 2]> {
    let (points, margin): (Vec<Point2<f64>>, f64) = if map.walls.is_empty() {
        let places = map.landmarks.values().filter_map(|l| l.place.as_ref());
        (places.map(|p| Point2::new(p.x_m, p.y_m)).collect(), HypothesesParams::default().clutter_reach_m)
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
