//! Builds a map scan by scan and finishes it.

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
/// Most keyframes of one map; further scans are placed but add nothing.
pub const MAX_KEYS: usize = 20_000;
/// Most keyframes whose covariance is computed; the others take that of the one before.
const MAX_COVARIANCES: usize = 400;

/// Why no map can be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SlamError {
    /// Odometry is out of range.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// There are [`MAX_SCANS`] scans already.
    #[error("more than {MAX_SCANS} scans")]
    TooMany,
    /// The pose graph cannot be optimised.
    #[error(transparent)]
    Graph(#[from] GraphError),
}

/// A scan's pose relative to a keyframe, which may still move.
#[derive(Debug, Clone, Copy)]
struct Placed {
    key: usize,
    key_from_robot: Pose2,
}

/// A map that is being built.
#[derive(Debug, Clone)]
pub struct Slam {
    params: SlamParams,
    keys: Vec<Keyframe>,
    /// Constraints between consecutive keyframes.
    path: Vec<PoseConstraint>,
    closures: LoopCloser,
    placed: Vec<Placed>,
    matcher: ScanMatcher,
}

/// A keyframe of a finished map.
#[derive(Debug, Clone)]
pub struct MapKey {
    /// Index of its scan.
    pub scan: usize,
    /// `map_from_robot`, with its covariance relative to the first.
    pub pose: Pose2Covariance,
    /// Odometry of its time.
    pub odom: Pose2,
    /// Lines of its scan, robot frame.
    pub lines: Vec<LaserSegment>,
}

/// A finished map.
#[derive(Debug, Clone)]
pub struct SlamMap {
    /// `map_from_robot` of every scan, in order.
    pub path: Vec<Pose2>,
    /// Keyframes.
    pub keys: Vec<MapKey>,
    /// Loop closures, by keyframe.
    pub loops: Vec<LoopClosure>,
    /// Loop closures refused after their match.
    pub refused: usize,
    /// Walls, map frame.
    pub walls: Vec<LaserSegment>,
}

impl Slam {
    /// An empty map.
    pub fn new(params: SlamParams) -> Self {
        Self {
            params,
            keys: Vec::new(),
            path: Vec::new(),
            closures: LoopCloser::default(),
            placed: Vec::new(),
            matcher: ScanMatcher::default(),
        }
    }

    /// Adds the next scan with the odometry of its time. Gives the robot's pose in the present map.
    pub fn add(&mut self, odom_from_robot: &Pose2, scan: &Scan) -> Result<Pose2, SlamError> {
        odom_from_robot.check()?;
        if self.placed.len() >= MAX_SCANS {
            return Err(SlamError::TooMany);
        }
        let cloud = cloud(scan, &self.params.cloud);
        let placement = self.matcher.track(&self.keys, odom_from_robot, &cloud, &self.params);
        let Some(last) = self.keys.len().checked_sub(1) else {
            self.push_key(Pose2::default(), odom_from_robot, cloud, scan, 0.0);
            return Ok(Pose2::default());
        };
        if placement.is_new && self.keys.len() < MAX_KEYS {
            let path_m = self.keys[last].path_m + placement.key_from_robot.pose.position().norm();
            let pose = self.keys[last].pose.compose(&placement.key_from_robot.pose);
            self.path.push(PoseConstraint {
                from: last,
                to: last + 1,
                measured: placement.key_from_robot.pose,
                information: inverse(&placement.key_from_robot.covariance),
                doubt_chi2: None,
            });
            self.push_key(pose, odom_from_robot, cloud, scan, path_m);
            if self.closures.detect(&mut self.keys, &self.path, &self.params)? {
                self.matcher.rebuild(&self.keys, &self.params);
            }
            return Ok(self.keys[last + 1].pose);
        }
        self.placed.push(Placed { key: last, key_from_robot: placement.key_from_robot.pose });
        Ok(self.keys[last].pose.compose(&placement.key_from_robot.pose))
    }

    /// Number of scans added.
    pub fn scans(&self) -> usize {
        self.placed.len()
    }

    fn push_key(&mut self, pose: Pose2, odom: &Pose2, cloud: Cloud, scan: &Scan, path_m: f64) {
        let lines = lines::segments(scan, &self.params.lines);
        self.placed.push(Placed { key: self.keys.len(), key_from_robot: Pose2::default() });
        self.keys.push(Keyframe { pose, odom: *odom, cloud, lines, path_m });
        self.matcher.start(&self.keys, &self.params);
    }

    /// Runs the final fit and collects the walls.
    pub fn finish(mut self) -> Result<SlamMap, SlamError> {
        let refined = refine(&mut self.keys, &self.path, &mut self.closures, &self.params)?;
        let poses: Vec<Pose2> = self.keys.iter().map(|k| k.pose).collect();
        let stride = poses.len().div_ceil(MAX_COVARIANCES).max(1);
        let at: Vec<usize> = (0..poses.len()).step_by(stride).collect();
        let covariances = graph::covariances(&poses, &refined, &at)?;
        let known = |i: usize| Pose2Covariance { pose: poses[i], covariance: covariances[i / stride] };
        let walls = self.walls(&known)?;
        let mut scans = Vec::with_capacity(poses.len());
        for (scan, placed) in self.placed.iter().enumerate() {
            if placed.key == scans.len() {
                scans.push(scan);
            }
        }
        let keys = self.keys.into_iter().zip(scans).enumerate();
        let keys = keys.map(|(i, (Keyframe { odom, lines, .. }, scan))| MapKey {
            scan,
            pose: known(i),
            odom,
            lines,
        });
        Ok(SlamMap {
            path: self.placed.iter().map(|p| poses[p.key].compose(&p.key_from_robot)).collect(),
            keys: keys.collect(),
            refused: self.closures.refused(),
            loops: self.closures.taken(),
            walls,
        })
    }
}

impl Slam {
    /// Walls with covariance relative to the first pose. Lines are merged with the relative
    /// covariance of neighbouring scans, which is far smaller than that of the map; the latter is
    /// added at the end.
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
