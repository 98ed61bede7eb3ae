//! The server's side of an experiment: one robot in one map, with the code of the server's workers.
//! In: scans, analysed frames, gaze queries. Out: poses, names by the pose, advice. No transport,
//! no threads.

use cli::simulated_errors::SimulatedRobotErrors;
use engine::{
    context::FrameContext,
    gaze::{GazeControllers, GazeQuery},
    guided::{GuidedResult, recognise_guided},
    landmark_checks::{LandmarkChecks, evaluate_frame},
    live::LiveHub,
    motion::{Corrections, FrameStamp as At, MotionTracker, RunRecording},
    scan_job::ScanJob,
    snapshot::{MapSnapshot, Snapshots},
};
use map::{
    gaze::{GazeAction, GazeParams, PanTiltUnit},
    landmark_health::HealthChange,
    laser::Scan,
    pose2::{Pose2, Pose2Covariance},
};
use protos::Name;
use sim::robot::SensorReadings;
use std::{sync::Arc, time::Instant};
use vision::{model::LandmarkId, pipeline::FrameAnalysis};

/// Name of its map.
pub(super) const MAP: &str = "corridor";

/// One run of the robot's software.
const EPOCH: u64 = 1;

/// One robot in one map.
pub(super) struct Server {
    snapshots: Arc<Snapshots>,
    motion: MotionTracker,
    gazes: GazeControllers,
    robot: Name,
    camera: Name,
    /// Constant: no time of the computer passes in a drive.
    now: Instant,
}

impl Server {
    pub(super) fn new(map: &MapSnapshot) -> anyhow::Result<Self> {
        let name = |text| Name::new(text).map_err(|refusal| anyhow::anyhow!("{refusal:?}"));
        let (robot, camera) = (name("robot")?, name("front")?);
        let snapshots = Arc::new(Snapshots::default());
        snapshots.publish(Arc::new(map.clone()));
        snapshots.set_robot(robot.as_ref(), Some(MAP));
        let motion = MotionTracker::new(snapshots.clone(), Arc::new(LiveHub::default()));
        Ok(Self { snapshots, motion, gazes: GazeControllers::default(), robot, camera, now: Instant::now() })
    }

    pub(super) fn map(&self) -> anyhow::Result<Arc<MapSnapshot>> {
        self.snapshots.get(MAP).ok_or_else(|| anyhow::anyhow!("the map is gone"))
    }

    /// The fused pose.
    pub(super) fn pose(&self) -> Option<Pose2Covariance> {
        self.motion.pose(&self.robot, MAP, self.now)
    }

    /// A person says where the robot is, after its first scan.
    pub(super) fn put(&self, pose: &Pose2Covariance) -> anyhow::Result<()> {
        let admitted = self.motion.epochs().admit(&self.robot, EPOCH, self.now);
        admitted.map_err(|refusal| anyhow::anyhow!("{refusal:?}"))?;
        let put = self.motion.set_pose_by_hand(&self.robot, MAP, pose, self.now);
        anyhow::ensure!(put.is_some(), "the robot has sent no odometry yet");
        Ok(())
    }

    pub(super) fn scan(&self, scan: &Scan, odom_from_robot: Pose2, captured_ns: i64) {
        let job =
            ScanJob { map: MAP.to_owned(), epoch: EPOCH, captured_ns, odom_from_robot, scan: scan.clone() };
        self.motion.fix_by_scan(&self.robot, &job, self.now);
    }

    /// Applies a frame to the robot's pose; returns changes of landmark health and guided names.
    pub(super) fn frame(
        &self,
        map: &MapSnapshot,
        analysis: &FrameAnalysis,
        (seen, odom_from_robot): (&SensorReadings, Pose2),
        (wrong, captured_ns): (&SimulatedRobotErrors, i64),
    ) -> (Vec<HealthChange>, Option<GuidedResult>) {
        let at = At { map: MAP, epoch: EPOCH, captured_ns, odometry: Some(odom_from_robot), now: self.now };
        let extrinsics = wrong.extrinsics(&seen.step.robot_from_camera).ok();
        let image = &seen.frame.image;
        let frame = FrameContext {
            is_whole: true,
            analysis,
            map,
            extrinsics: extrinsics.as_ref(),
            camera: Some(&wrong.camera),
            image_px: [image.width() as f64, image.height() as f64],
            prior: None,
        };
        let prior = self.motion.prior_pose(&self.robot, &self.camera, at);
        let guide = prior.as_ref().filter(|p| p.plan.guided).map(|p| p.pose);
        let guided = guide.map(|pose| recognise_guided(image, &frame, &pose));
        let evaluation = evaluate_frame(&frame, prior, guided.as_ref().unwrap_or(&GuidedResult::default()));
        self.motion.apply_frame(&self.robot, &self.camera, at, &evaluation.fixes());
        let changes = |c: LandmarkChecks| {
            self.motion.update_landmark_health(&self.robot, at, &c.prior, &c.observed, &c.missed)
        };
        (evaluation.checks.map_or_else(Vec::new, changes), guided)
    }

    /// As the store does.
    pub(super) fn change(&self, map: &MapSnapshot, changes: &[HealthChange]) {
        let mut next = map.clone();
        next.version += 1;
        for change in changes {
            if let Some(info) = next.landmarks.get_mut(&change.landmark) {
                info.health = change.health;
            }
        }
        self.snapshots.publish(Arc::new(next));
    }

    /// The answer to `rpc/gaze` from the fused pose; none without a pose. `looked`: the landmark
    /// last looked at, and whether it was recognised.
    pub(super) fn gaze(
        &self,
        pan_tilt: PanTiltUnit,
        at_ns: i64,
        looked: Option<(LandmarkId, bool)>,
    ) -> anyhow::Result<Option<GazeAction>> {
        let (map, Some(pose)) = (self.map()?, self.pose()) else { return Ok(None) };
        let camera = map.visibility_settings.viewer.clone();
        let query = GazeQuery { pose, camera, pan_tilt, params: GazeParams::default() };
        Ok(Some(self.gazes.choose(&self.robot, at_ns, looked, &map, &query)?))
    }

    /// Everything that corrected the pose so far.
    pub(super) fn log(&self) -> Corrections {
        self.motion.corrections(&self.robot)
    }

    /// Fixes by landmarks that corrected the pose so far.
    pub(super) fn corrections(&self) -> u64 {
        of(&self.log(), "landmarks", &["started", "applied", "reset"])
    }

    /// Records what the robot sends and what fixes its pose, from now on.
    pub(super) fn record(&self) -> anyhow::Result<()> {
        Ok(self.motion.start_recording(&self.robot, MAP).map(|_| ())?)
    }

    /// Ends the recording and gives it.
    pub(super) fn recording(&self) -> Option<Box<RunRecording>> {
        self.motion.take_recording(&self.robot)
    }
}

/// How often a modality had one of these outcomes.
pub(super) fn of(log: &Corrections, modality: &str, outcomes: &[&str]) -> u64 {
    let counts = log.totals.get(modality);
    counts.map_or(0, |counts| outcomes.iter().filter_map(|o| counts.get(o)).sum())
}
