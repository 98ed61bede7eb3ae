//! The first drives of a robot in an unknown corridor. In: the stops of a lesson. Out: the walls of
//! a map made by SLAM there and back, and the pose at every stop by laser and odometry in these
//! walls. A person steers; where the first drive began is the only pose that is told.

use crate::evaluate::experiment::{robot_server::Server, way::way};
use engine::snapshot::MapSnapshot;
use map::{
    laser_fix::WallIndex,
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
    slam::{Slam, SlamParams},
};
use nalgebra::{Matrix3, Vector3};
use sim::{
    building::Building,
    drive::{Drive, DriveParams, Step},
    laser::{LaserParams, scan},
    lesson::Stop,
    odometry::{Odometry, OdometryParams},
};
use std::sync::Arc;

/// Name of the map.
pub(super) const MAP: &str = "corridor";
/// How well a robot is put back where its map began: x, y (metres) and heading (radians).
const PUT_SIGMA: [f64; 3] = [0.01, 0.01, 0.005];
/// Between two scans on the way from stop to stop.
const STEP_NS: i64 = 200_000_000;

/// What the first drives gave.
pub(super) struct Explored {
    /// By SLAM, map frame.
    pub(super) walls: Vec<LaserSegment>,
    /// The stops, each with the pose that the robot takes itself to have there.
    pub(super) stops: Vec<(Stop, Pose2Covariance)>,
}

/// Maps the walls, then goes from stop to stop. The map frame is that of the building at the first
/// pose.
pub(super) fn explore(building: &Arc<Building>, stops: Vec<Stop>, seed: u64) -> anyhow::Result<Explored> {
    let drive = DriveParams { seed, legs: 2, ..DriveParams::default() };
    let steps: Vec<Step> = Drive::new(building.clone(), &drive).collect();
    let mut slam = Slam::new(SlamParams::default());
    for step in &steps {
        let scan = scan(building, &step.map_from_robot, &LaserParams::default(), seed ^ (step.index << 8));
        slam.add(&step.odom_from_robot, &scan)?;
    }
    let start = steps.first().map(|step| step.map_from_robot).unwrap_or_default();
    let origin = Pose2Covariance { pose: start, covariance: Matrix3::zeros() };
    let walls: Vec<LaserSegment> = slam.finish()?.walls.iter().map(|w| w.transformed(&origin)).collect();
    let mut map = MapSnapshot::empty(MAP, 1);
    (map.wall_index, map.walls) = (Arc::new(WallIndex::new(&walls)), Arc::new(walls.clone()));
    let mut tour = Tour::begin(building, &map, start, !seed)?;
    let localised = |stop: Stop| {
        tour.go_to(&stop.step.map_from_robot);
        let pose = tour.server.pose().ok_or_else(|| anyhow::anyhow!("the robot of the lesson is lost"))?;
        Ok((stop, pose))
    };
    let stops = stops.into_iter().map(localised).collect::<anyhow::Result<_>>()?;
    Ok(Explored { walls, stops })
}

/// The way from stop to stop.
struct Tour<'a> {
    building: &'a Building,
    server: Server,
    odometry: Odometry,
    truth: Pose2,
    scans: u64,
    seed: u64,
}

impl<'a> Tour<'a> {
    fn begin(building: &'a Building, map: &MapSnapshot, start: Pose2, seed: u64) -> anyhow::Result<Self> {
        let odometry = Odometry::new(OdometryParams::default(), start, seed);
        let mut tour = Self { building, server: Server::new(map)?, odometry, truth: start, scans: 0, seed };
        tour.measure();
        let covariance = Matrix3::from_diagonal(&Vector3::from(PUT_SIGMA).map(|s| s * s));
        tour.server.put(&Pose2Covariance { pose: start, covariance })?;
        Ok(tour)
    }

    fn go_to(&mut self, stop: &Pose2) {
        for motion in way(&self.truth, stop) {
            self.step(&motion);
        }
    }

    fn step(&mut self, motion: &Pose2) {
        self.truth = self.truth.compose(motion);
        self.odometry.advance(motion);
        self.measure();
    }

    fn measure(&mut self) {
        let scan = scan(self.building, &self.truth, &LaserParams::default(), self.seed ^ (self.scans << 8));
        self.server.scan(&scan, self.odometry.pose(), self.scans as i64 * STEP_NS);
        self.scans += 1;
    }
}
