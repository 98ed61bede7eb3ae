//! Relocalisation of robots that have no pose and recognise nothing unique: a grid belief
//! (`map::relocalise`) for each. In: frames with odometry and ambiguous observations. Out: pose
//! hypotheses, and a pose once one hypothesis holds 95 %, explains observations of two different
//! landmarks, and no other pose explains nearly as much. Runs on the vision threads only.

use super::ambiguous_observations::{AmbiguousObservation, association_hypotheses, on_floor};
use crate::snapshot::MapSnapshot;
use map::{
    pose2::{Pose2, Pose2Covariance, wrap_rad},
    relocalise::{GridBelief, GridBeliefParams, PoseHypothesis, RelativeObservation},
};
use nalgebra::{Matrix3, Point2, Vector2, Vector3};
use protos::Name;
use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::{Arc, Mutex, PoisonError},
};
use vision::model::LandmarkId;

/// Robots that are relocalised at a time, some 50 MB each at most. A further one replaces the one
/// with the oldest frame.
pub const MAX_RELOCALISERS: usize = 8;
/// Cells of a grid belief: 180 m by 180 m at the coarsest step.
pub const MAX_CELLS: usize = 1_200_000;
/// Coarsest step. A larger map is not searched.
const MAX_CELL_M: f64 = 1.0;
/// Frames whose observations check a pose: the latest.
pub const MAX_FRAMES: usize = 32;
/// A frame counts after this motion, or...
const NEW_FRAME_M: f64 = 0.3;
/// ...this turn: errors of frames from the same place are the same.
const NEW_FRAME_RAD: f64 = 0.3;
/// Different landmarks that a pose must explain: a distractor may look like any one.
const MIN_LANDMARKS: usize = 2;
/// Share of the observations that a pose must explain...
const MIN_EXPLAINED: f64 = 0.8;
/// ...within this distance, plus drift, and...
const EXPLAINED_M: f64 = 0.6;
/// ...this angle, plus drift.
const EXPLAINED_RAD: f64 = 0.35;
/// Drift of odometry: metres and radians per metre driven since the observation.
const DRIFT: f64 = 0.05;
/// Margin around the walls: a robot may stand outside of what was mapped.
const MARGIN_M: f64 = 1.0;

/// A frame of a robot without a pose.
#[derive(Debug, Clone, Copy)]
pub struct RelocalisationInput<'a> {
    /// Epoch of the frame.
    pub epoch: u64,
    /// The map.
    pub map: &'a MapSnapshot,
    /// Odometry at capture (odom frame).
    pub odometry: Pose2,
    /// Its ambiguous observations.
    pub observations: &'a [AmbiguousObservation],
}

/// How far the relocalisation of a robot has come.
#[derive(Debug, Clone, Default)]
pub struct RelocalisationProgress {
    /// Name of the map.
    pub map: String,
    /// Its version.
    pub map_version: u64,
    /// Pose hypotheses, most probable first.
    pub hypotheses: Vec<PoseHypothesis>,
    /// Entropy of the grid belief, nats.
    pub entropy_nats: f64,
    /// Observations so far, of the latest [`MAX_FRAMES`] frames.
    pub observations: usize,
    /// Landmarks by which the first hypothesis explains the observations.
    pub landmarks: Vec<LandmarkId>,
    /// What the first hypothesis lacks to become the robot's pose.
    pub missing: Vec<MissingCondition>,
}

/// A condition that the first hypothesis does not meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MissingCondition {
    /// Other hypotheses are still too probable.
    HigherProbability,
    /// Every observation could be of one landmark: a second one must be observed.
    SecondLandmark,
    /// It does not explain enough of the observations.
    ConsistentObservations,
    /// The landmarks hang so evenly that another pose explains the observations nearly as well.
    NoRivalPose,
}

/// The state after a frame.
#[derive(Debug, Clone, Default)]
pub struct RelocalisationUpdate {
    /// Pose hypotheses, most probable first.
    pub hypotheses: Vec<PoseHypothesis>,
    /// The pose at the frame (map frame) once every condition is met, and the landmarks by which it
    /// explains the observations.
    pub pose: Option<(Pose2Covariance, Vec<LandmarkId>)>,
}

/// The relocalisation of one robot.
#[derive(Debug)]
struct Relocaliser {
    epoch: u64,
    map: String,
    version: u64,
    p: GridBeliefParams,
    belief: GridBelief,
    odometry: Pose2,
    distance_m: f64,
    frames: VecDeque<ObservedFrame>,
    /// After the last frame that counted.
    hypotheses: Vec<PoseHypothesis>,
    entropy_nats: f64,
    landmarks: Vec<LandmarkId>,
    missing: Vec<MissingCondition>,
}

/// A frame with ambiguous observations, and the distance driven until then.
#[derive(Debug)]
struct ObservedFrame {
    odometry: Pose2,
    distance_m: f64,
    observations: Vec<AmbiguousObservation>,
}

/// The relocalisations of all robots.
#[derive(Debug, Default)]
pub struct Relocalisers(Mutex<Open>);

/// The robots that are relocalised, each with the tick of its last frame.
#[derive(Debug, Default)]
struct Open {
    ticks: u64,
    all: BTreeMap<Name, (u64, Arc<Mutex<Relocaliser>>)>,
}

impl Relocalisers {
    /// Takes a frame. `None` until a frame has ambiguous observations, and on a map that is too
    /// large.
    pub fn update(&self, robot: &Name, frame: &RelocalisationInput<'_>) -> Option<RelocalisationUpdate> {
        let relocaliser = self.of(robot, frame)?;
        let mut relocaliser = relocaliser.lock().unwrap_or_else(PoisonError::into_inner);
        relocaliser.update(frame)
    }

    /// How far the relocalisation of a robot has come; `None` for a robot that is not relocalised.
    pub fn progress(&self, robot: &Name) -> Option<RelocalisationProgress> {
        let relocaliser = {
            let open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            open.all.get(robot).map(|(_, relocaliser)| relocaliser.clone())?
        };
        let relocaliser = relocaliser.lock().unwrap_or_else(PoisonError::into_inner);
        Some(RelocalisationProgress {
            map: relocaliser.map.clone(),
            map_version: relocaliser.version,
            hypotheses: relocaliser.hypotheses.clone(),
            entropy_nats: relocaliser.entropy_nats,
            observations: relocaliser.frames.iter().map(|frame| frame.observations.len()).sum(),
            landmarks: relocaliser.landmarks.clone(),
            missing: relocaliser.missing.clone(),
        })
    }

    /// Ends the relocalisation of a robot: it has a pose.
    pub fn stop(&self, robot: &Name) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).all.remove(robot);
    }

    /// The robot's relocaliser; a new one if the frame has ambiguous observations.
    fn of(&self, robot: &Name, frame: &RelocalisationInput<'_>) -> Option<Arc<Mutex<Relocaliser>>> {
        let mut guard = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Open { ticks, all } = &mut *guard;
        *ticks += 1;
        if let Some((tick, relocaliser)) = all.get_mut(robot) {
            *tick = *ticks;
            return Some(relocaliser.clone());
        }
        if frame.observations.is_empty() {
            return None;
        }
        let made = Arc::new(Mutex::new(Relocaliser::new(frame)?));
        all.insert(robot.clone(), (*ticks, made.clone()));
        if all.len() > MAX_RELOCALISERS {
            let stalest = all.iter().min_by_key(|(_, (tick, _))| *tick).map(|(name, _)| name.clone());
            stalest.map(|name| all.remove(&name));
        }
        Some(made)
    }
}

impl Relocaliser {
    /// A uniform belief over the map; `None` if the map is too large or has no extent.
    fn new(frame: &RelocalisationInput<'_>) -> Option<Self> {
        let corners = extent(frame.map)?;
        let area = (corners[1] - corners[0]).map(|v| v.max(0.1)).product();
        let fine = &frame.map.poses.grid_belief;
        let cell_m = fine.cell_m.max((area * fine.headings as f64 / MAX_CELLS as f64).sqrt() * 1.01);
        if cell_m > MAX_CELL_M {
            return None;
        }
        let p = GridBeliefParams { cell_m, ..fine.clone() };
        let belief = GridBelief::new(corners, |_| 1.0, &p).ok()?;
        let RelocalisationInput { epoch, map, odometry, .. } = *frame;
        let (name, version) = (map.name.clone(), map.version);
        Some(Self {
            epoch,
            map: name,
            version,
            p,
            entropy_nats: belief.entropy_nats(),
            belief,
            odometry,
            distance_m: 0.0,
            frames: VecDeque::new(),
            hypotheses: Vec::new(),
            landmarks: Vec::new(),
            missing: vec![MissingCondition::HigherProbability, MissingCondition::SecondLandmark],
        })
    }

    fn update(&mut self, frame: &RelocalisationInput<'_>) -> Option<RelocalisationUpdate> {
        let is_same = (self.epoch, self.map.as_str(), self.version)
            == (frame.epoch, frame.map.name.as_str(), frame.map.version);
        if !is_same {
            *self = Self::new(frame).filter(|_| !frame.observations.is_empty())?;
        }
        let since = |before: &Pose2| before.between(&frame.odometry);
        let is_new = self.frames.back().is_none_or(|last| {
            let motion = since(&last.odometry);
            motion.position().norm() >= NEW_FRAME_M || motion.theta_rad.abs() >= NEW_FRAME_RAD
        });
        if frame.observations.is_empty() || !is_new {
            return Some(RelocalisationUpdate { hypotheses: self.hypotheses.clone(), pose: None });
        }
        let motion = since(&self.odometry);
        self.distance_m += motion.position().norm();
        self.odometry = frame.odometry;
        self.belief.predict(&motion).ok()?;
        for observation in frame.observations {
            let hypotheses = association_hypotheses(observation, frame.map, self.p.clutter);
            self.belief.update_associations(&hypotheses).ok()?;
        }
        if self.frames.len() == MAX_FRAMES {
            self.frames.pop_front();
        }
        self.frames.push_back(ObservedFrame {
            odometry: frame.odometry,
            distance_m: self.distance_m,
            observations: frame.observations.to_vec(),
        });
        self.hypotheses = self.belief.modes();
        self.entropy_nats = self.belief.entropy_nats();
        Some(RelocalisationUpdate { hypotheses: self.hypotheses.clone(), pose: self.resolved(frame.map) })
    }

    /// The pose, if every condition is met. Updates the missing conditions.
    fn resolved(&mut self, map: &MapSnapshot) -> Option<(Pose2Covariance, Vec<LandmarkId>)> {
        self.missing = Vec::new();
        let first = self.hypotheses.first().copied();
        let Some(first) = first.filter(|h| h.mass > self.p.decided) else {
            self.missing.push(MissingCondition::HigherProbability);
            self.landmarks = first.map_or_else(Vec::new, |h| self.explained(&h.pose.pose, map).0);
            return None;
        };
        let (landmarks, share) = self.explained(&first.pose.pose, map);
        if landmarks.len() < MIN_LANDMARKS {
            self.missing.push(MissingCondition::SecondLandmark);
        }
        if share < MIN_EXPLAINED {
            self.missing.push(MissingCondition::ConsistentObservations);
        }
        if self.missing.is_empty() && self.has_rival(&first.pose.pose, &landmarks, map) {
            self.missing.push(MissingCondition::NoRivalPose);
        }
        self.landmarks.clone_from(&landmarks);
        let cell = Vector3::new(self.p.cell_m, self.p.cell_m, 0.1).map(|s| s * s);
        let covariance = first.pose.covariance + Matrix3::from_diagonal(&cell);
        self.missing.is_empty().then_some((Pose2Covariance { covariance, ..first.pose }, landmarks))
    }

    /// Whether another pose explains the observations, too, within the errors of odometry and
    /// places. The belief takes its errors for independent, and is overconfident where look-alikes
    /// hang nearly evenly. The poses tried are those that follow if the landmarks that `now`
    /// explains are other look-alikes.
    fn has_rival(&self, now: &Pose2, landmarks: &[LandmarkId], map: &MapSnapshot) -> bool {
        let place = |id: &LandmarkId| Some(on_floor(map.landmarks.get(id)?.place.as_ref()?));
        let others: BTreeSet<LandmarkId> =
            self.frames.iter().flat_map(|f| f.observations.iter().flatten()).map(|(id, _)| *id).collect();
        let others: Vec<Pose2> = others.iter().filter_map(place).collect();
        let explained: Vec<Pose2> = landmarks.iter().filter_map(place).collect();
        let rivals = explained.iter().flat_map(|here| {
            let from_here = here.between(now);
            others.iter().map(move |there| there.compose(&from_here))
        });
        let is_other = |rival: &Pose2| {
            let e = rival.minus(now);
            e.xy().norm() > self.p.mode_m || wrap_rad(e.z).abs() > self.p.mode_rad
        };
        rivals.filter(is_other).any(|rival| self.explained(&rival, map).1 >= MIN_EXPLAINED)
    }

    /// The landmarks by which a pose explains the observations, and the share of the observations
    /// that it explains, 0 to 1.
    fn explained(&self, now: &Pose2, map: &MapSnapshot) -> (Vec<LandmarkId>, f64) {
        let (mut landmarks, mut explained, mut all) = (BTreeSet::new(), 0.0, 0.0_f64);
        for frame in &self.frames {
            let then = now.compose(&self.odometry.between(&frame.odometry));
            let drift = DRIFT * (self.distance_m - frame.distance_m);
            for observation in &frame.observations {
                all += 1.0;
                let fits = |(id, relative): &&(LandmarkId, RelativeObservation)| {
                    let Some(place) = map.landmarks.get(id).and_then(|l| l.place.as_ref()) else {
                        return false;
                    };
                    let e = relative.robot_from_landmark.minus(&then.between(&on_floor(place)));
                    Vector2::new(e.x, e.y).norm() <= EXPLAINED_M + drift
                        && wrap_rad(e.z).abs() <= EXPLAINED_RAD + drift
                };
                if let Some((id, _)) = observation.iter().find(fits) {
                    landmarks.insert(*id);
                    explained += 1.0;
                }
            }
        }
        (landmarks.into_iter().collect(), explained / all.max(1.0))
    }
}

/// The rectangle around the walls, or without walls around the landmarks and their reach (lower and
/// upper corner, map frame, m).
fn extent(map: &MapSnapshot) -> Option<[Point2<f64>; 2]> {
    let (points, margin): (Vec<Point2<f64>>, f64) = if map.walls.is_empty() {
        let places = map.landmarks.values().filter_map(|l| l.place.as_ref());
        (places.map(|p| Point2::new(p.x_m, p.y_m)).collect(), map.poses.grid_belief.clutter_reach_m)
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
