//! The laser map from scans and odometry: every scan is matched with those before it, places met again close loops, and
//! all key poses are fitted to everything at once (method 17; 17.6's global optimisation).
//!
//! In: scans with odometry, in order. Out: the path, the walls with their covariance, the loops. The first pose is the
//! origin of the map. What does not fit is left out and counted: a false loop folds a building over.
//!
//! Departs from method 17.6, an EKF over robot and lines: key poses and scans are kept instead of lines, so that a line
//! wrongly associated once does no harm for ever, curved walls help too, and loops cost no more than they must.

pub mod cloud;
pub(crate) mod surface_index;
pub mod icp;
pub mod correlative;
pub mod graph;
mod scan_matcher;
mod loop_closure;
mod refine;
pub use {correlative as field, icp as align};

use crate::{
    check::OutOfRange,
    laser::Scan,
    lines::{self, LineParams},
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
    walls::{WallParams, Walls},
};
use cloud::{Cloud, CloudParams};
use correlative::SearchParams;
use graph::{Edge, GraphError};
use icp::AlignParams;
pub use loop_closure::{Closure, LoopParams};
use nalgebra::{Matrix3, Vector3};
pub use refine::RefineParams;
use scan_matcher::Tracker;
use serde::{Deserialize, Serialize};

/// Most scans of one map.
pub const MAX_SCANS: usize = 500_000;
/// Most key poses of one map; when they are reached, scans are still placed but add nothing.
pub const MAX_KEYS: usize = 20_000;
/// Most key poses whose covariance is computed; the others take that of the one before.
const MAX_COVARIANCES: usize = 400;

/// Knobs of mapping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlamParams {
    /// Points of a scan.
    pub cloud: CloudParams,
    /// Search for a pose near the predicted one.
    pub search: SearchParams,
    /// The last step of every match.
    pub align: AlignParams,
    /// Loops.
    pub loops: LoopParams,
    /// The final fit.
    pub refine: RefineParams,
    /// Segments of a scan.
    pub lines: LineParams,
    /// Walls from segments.
    pub walls: WallParams,
    /// How surely neighbouring key scans lie on each other: position, for joining their segments to walls...
    pub near_m: f64,
    /// ...and heading.
    pub near_rad: f64,
    /// Odometry: standard deviation of the position per metre driven.
    pub odometry_m_per_m: f64,
    /// Of the heading per metre driven.
    pub odometry_rad_per_m: f64,
    /// Of the heading per radian turned.
    pub odometry_rad_per_rad: f64,
    /// Of the position, whatever the motion.
    pub odometry_m: f64,
    /// Of the heading, whatever the motion.
    pub odometry_rad: f64,
    /// A new key pose after this way...
    pub key_m: f64,
    /// ...or this turn...
    pub key_rad: f64,
    /// ...or when less than this share of a scan is seen again.
    pub key_matched: f64,
    /// Key scans that make up the recent map.
    pub recent_keys: usize,
    /// And no older than this way.
    pub recent_m: f64,
    /// A match with a smaller share of the scan is none: odometry alone counts.
    pub min_matched: f64,
}

impl Default for SlamParams {
    fn default() -> Self {
        Self {
            cloud: CloudParams::default(),
            search: SearchParams::default(),
            align: AlignParams::default(),
            loops: LoopParams::default(),
            refine: RefineParams::default(),
            lines: LineParams {
                range_sigma_m: 0.02,
                split_m: 0.06,
                min_points: 6,
                min_length_m: 0.3,
                ..LineParams::default()
            },
            walls: WallParams::default(),
            near_m: 0.02,
            near_rad: 0.004,
            odometry_m_per_m: 0.08,
            odometry_rad_per_m: 0.06,
            odometry_rad_per_rad: 0.15,
            odometry_m: 0.02,
            odometry_rad: 0.01,
            key_m: 0.4,
            key_rad: 0.35,
            key_matched: 0.6,
            recent_keys: 30,
            recent_m: 15.0,
            min_matched: 0.15,
        }
    }
}

impl SlamParams {
    /// Covariance of a motion measured by odometry, in the frame where it starts.
    fn motion(&self, motion: &Pose2) -> Pose2Covariance {
        let (metres, radians) = (motion.position().norm(), motion.theta_rad.abs());
        let position = self.odometry_m.powi(2) + (self.odometry_m_per_m * metres).powi(2);
        let heading = self.odometry_rad.powi(2)
            + (self.odometry_rad_per_m * metres).powi(2)
            + (self.odometry_rad_per_rad * radians).powi(2);
        let covariance = Matrix3::from_diagonal(&Vector3::new(position, position, heading));
        Pose2Covariance { pose: *motion, covariance }
    }
}

/// Why no map can be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SlamError {
    /// Odometry is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// Too many scans.
    #[error("more than {MAX_SCANS} scans")]
    TooMany,
    /// The key poses cannot be fitted.
    #[error(transparent)]
    Graph(#[from] GraphError),
}

/// A pose from which the map is made.
#[derive(Debug, Clone)]
pub(crate) struct Key {
    pub pose: Pose2,
    pub odom: Pose2,
    pub cloud: Cloud,
    pub lines: Vec<LaserSegment>,
    /// Way driven up to here.
    pub path_m: f64,
}

/// A scan's place: relative to a key pose, which may still move.
#[derive(Debug, Clone, Copy)]
struct Placed {
    key: usize,
    key_from_robot: Pose2,
}

/// Builds a map scan by scan.
#[derive(Debug, Clone)]
pub struct Slam {
    params: SlamParams,
    keys: Vec<Key>,
    /// Between key poses that follow one another.
    path: Vec<Edge>,
    closures: loop_closure::Closures,
    placed: Vec<Placed>,
    tracker: Tracker,
}

/// The finished map.
#[derive(Debug, Clone)]
pub struct SlamMap {
    /// `map_from_robot` of every scan, in order.
    pub path: Vec<Pose2>,
    /// The key poses: index of the scan, pose and covariance relative to the first.
    pub keys: Vec<(usize, Pose2Covariance)>,
    /// Loops that were closed, by key pose.
    pub loops: Vec<Closure>,
    /// Loops that looked right but were refused.
    pub refused: usize,
    /// The walls.
    pub walls: Vec<LaserSegment>,
}

impl Slam {
    /// No scan yet.
    pub fn new(params: SlamParams) -> Self {
        Self {
            params,
            keys: Vec::new(),
            path: Vec::new(),
            closures: loop_closure::Closures::default(),
            placed: Vec::new(),
            tracker: Tracker::default(),
        }
    }

    /// Takes the next scan and the odometry of its moment. Gives the robot's pose in the map so far.
    pub fn add(&mut self, odom_from_robot: &Pose2, scan: &Scan) -> Result<Pose2, SlamError> {
        odom_from_robot.check()?;
        if self.placed.len() >= MAX_SCANS {
            return Err(SlamError::TooMany);
        }
        let cloud = cloud::cloud(scan, &self.params.cloud);
        let seen = self.tracker.track(&self.keys, odom_from_robot, &cloud, &self.params);
        let Some(last) = self.keys.len().checked_sub(1) else {
            self.push_key(Pose2::default(), odom_from_robot, cloud, scan, 0.0);
            return Ok(Pose2::default());
        };
        if seen.is_new && self.keys.len() < MAX_KEYS {
            let path_m = self.keys[last].path_m + seen.key_from_robot.pose.position().norm();
            let pose = self.keys[last].pose.compose(&seen.key_from_robot.pose);
            self.path.push(Edge {
                from: last,
                to: last + 1,
                measured: seen.key_from_robot.pose,
                information: inverse(&seen.key_from_robot.covariance),
                doubt_chi2: None,
            });
            self.push_key(pose, odom_from_robot, cloud, scan, path_m);
            if self.closures.look(&mut self.keys, &self.path, &self.params)? {
                self.tracker.relaid(&self.keys, &self.params);
            }
            return Ok(self.keys[last + 1].pose);
        }
        self.placed.push(Placed { key: last, key_from_robot: seen.key_from_robot.pose });
        Ok(self.keys[last].pose.compose(&seen.key_from_robot.pose))
    }

    /// How many scans were taken.
    pub fn scans(&self) -> usize {
        self.placed.len()
    }

    fn push_key(&mut self, pose: Pose2, odom: &Pose2, cloud: Cloud, scan: &Scan, path_m: f64) {
        let lines = lines::segments(scan, &self.params.lines);
        self.placed.push(Placed { key: self.keys.len(), key_from_robot: Pose2::default() });
        self.keys.push(Key { pose, odom: *odom, cloud, lines, path_m });
        self.tracker.start(&self.keys, &self.params);
    }

    /// Fits everything once more and collects the walls.
    pub fn finish(mut self) -> Result<SlamMap, SlamError> {
        let refined = refine::refine(&mut self.keys, &self.path, &mut self.closures, &self.params)?;
        let poses: Vec<Pose2> = self.keys.iter().map(|k| k.pose).collect();
        let stride = poses.len().div_ceil(MAX_COVARIANCES).max(1);
        let at: Vec<usize> = (0..poses.len()).step_by(stride).collect();
        let covariances = graph::covariances(&poses, &refined, &at)?;
        let known = |i: usize| Pose2Covariance { pose: poses[i], covariance: covariances[i / stride] };
        let walls = self.walls(&known)?;
        let mut keys = Vec::with_capacity(poses.len());
        for (scan, placed) in self.placed.iter().enumerate() {
            if placed.key == keys.len() {
                keys.push((scan, known(placed.key)));
            }
        }
        Ok(SlamMap {
            path: self.placed.iter().map(|p| poses[p.key].compose(&p.key_from_robot)).collect(),
            keys,
            refused: self.closures.refused(),
            loops: self.closures.taken(),
            walls,
        })
    }
}

impl Slam {
    /// The walls, their covariance relative to the first pose. Sightings are joined by how surely the scans lie on each
    /// other, which is far better than where they lie in the map; that is added at the end.
    fn walls(&self, known: &impl Fn(usize) -> Pose2Covariance) -> Result<Vec<LaserSegment>, SlamError> {
        let p = &self.params;
        let near = Vector3::new(p.near_m.powi(2), p.near_m.powi(2), p.near_rad.powi(2));
        let mut walls = Walls::new(p.walls.clone());
        for key in &self.keys {
            let pose = Pose2Covariance { pose: key.pose, covariance: Matrix3::from_diagonal(&near) };
            walls.add(&pose, &key.lines)?;
        }
        let placed = |wall: &LaserSegment| {
            let middle = nalgebra::center(&wall.a, &wall.b).coords;
            let away = |k: &usize| (self.keys[*k].pose.position() - middle).norm();
            let nearest = (0..self.keys.len()).min_by(|a, b| away(a).total_cmp(&away(b)))?;
            let still = known(nearest);
            let back = Pose2Covariance { pose: still.pose.inverse(), covariance: Matrix3::zeros() };
            Some(wall.transformed(&back).transformed(&still))
        };
        Ok(walls.segments().filter_map(placed).collect())
    }
}

/// Inverse of a covariance that may be singular; as information it may not be.
pub(crate) fn inverse(m: &Matrix3<f64>) -> Matrix3<f64> {
    let floor = Matrix3::from_diagonal(&Vector3::new(1e-8, 1e-8, 1e-9));
    (m + floor).cholesky().map_or_else(Matrix3::zeros, |c| c.inverse())
}

#[cfg(test)]
pub(crate) mod world;
#[cfg(test)]
mod tests;
