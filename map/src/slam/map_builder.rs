//! Builds a map scan by scan, and finishes it.

use crate::{
    check::OutOfRange,
    laser::Scan,
    lines,
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
    slam::{
        cloud::{Cloud, cloud},
        graph::{self, GraphError, PoseConstraint},
        information::inverse,
        keyframe::Keyframe,
        loop_closure::{LoopCloser, LoopClosure},
        params::SlamParams,
        refine::refine,
        scan_matcher::ScanMatcher,
    },
    walls::Walls,
};
use nalgebra::{Matrix3, Vector3};

/// Most scans of one map.
pub const MAX_SCANS: usize = 500_000;
/// Most key poses of one map; when they are reached, scans are still placed but add nothing.
pub const MAX_KEYS: usize = 20_000;
/// Most key poses whose covariance is computed; the others take that of the one before.
const MAX_COVARIANCES: usize = 400;

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
    keys: Vec<Keyframe>,
    /// Between key poses that follow one another.
    path: Vec<PoseConstraint>,
    closures: LoopCloser,
    placed: Vec<Placed>,
    tracker: ScanMatcher,
}

/// The finished map.
#[derive(Debug, Clone)]
pub struct SlamMap {
    /// `map_from_robot` of every scan, in order.
    pub path: Vec<Pose2>,
    /// The key poses: index of the scan, pose and covariance relative to the first.
    pub keys: Vec<(usize, Pose2Covariance)>,
    /// Loops that were closed, by key pose.
    pub loops: Vec<LoopClosure>,
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
            closures: LoopCloser::default(),
            placed: Vec::new(),
            tracker: ScanMatcher::default(),
        }
    }

    /// Takes the next scan and the odometry of its moment. Gives the robot's pose in the map so far.
    pub fn add(&mut self, odom_from_robot: &Pose2, scan: &Scan) -> Result<Pose2, SlamError> {
        odom_from_robot.check()?;
        if self.placed.len() >= MAX_SCANS {
            return Err(SlamError::TooMany);
        }
        let cloud = cloud(scan, &self.params.cloud);
        let seen = self.tracker.track(&self.keys, odom_from_robot, &cloud, &self.params);
        let Some(last) = self.keys.len().checked_sub(1) else {
            self.push_key(Pose2::default(), odom_from_robot, cloud, scan, 0.0);
            return Ok(Pose2::default());
        };
        if seen.is_new && self.keys.len() < MAX_KEYS {
            let path_m = self.keys[last].path_m + seen.key_from_robot.pose.position().norm();
            let pose = self.keys[last].pose.compose(&seen.key_from_robot.pose);
            self.path.push(PoseConstraint {
                from: last,
                to: last + 1,
                measured: seen.key_from_robot.pose,
                information: inverse(&seen.key_from_robot.covariance),
                doubt_chi2: None,
            });
            self.push_key(pose, odom_from_robot, cloud, scan, path_m);
            if self.closures.detect(&mut self.keys, &self.path, &self.params)? {
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
        self.keys.push(Keyframe { pose, odom: *odom, cloud, lines, path_m });
        self.tracker.start(&self.keys, &self.params);
    }

    /// Fits everything once more and collects the walls.
    pub fn finish(mut self) -> Result<SlamMap, SlamError> {
        let refined = refine(&mut self.keys, &self.path, &mut self.closures, &self.params)?;
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
