//! The server's side of an experiment: one robot in one map, with the code of the server's workers.
//! In: scans, analysed frames, gaze queries. Out: poses, names by the pose, advice. No transport,
//! no threads.

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
    extrinsics::CameraExtrinsics,
    gaze::{GazeAction, GazeParams, PanTiltUnit},
    landmark_health::HealthChange,
    laser::Scan,
    pose2::{Pose2, Pose2Covariance},
};
use protos::Name;
use std::{sync::Arc, time::Instant};
use vision::{
    frame::{GrayImage, Intrinsics},
    model::LandmarkId,
    pipeline::FrameAnalysis,
};

/// One run of the robot's software.
const EPOCH: u64 = 1;

/// A frame as the robot sends it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SentFrame<'a> {
    pub(crate) image: &'a GrayImage,
    /// The camera as the robot states it.
    pub(crate) camera: &'a Intrinsics,
    /// Its mounting as the robot states it.
    pub(crate) mounting: Option<&'a CameraExtrinsics>,
    pub(crate) odom_from_robot: Pose2,
    pub(crate) captured_ns: i64,
}

/// One robot in one map.
pub(crate) struct Server {
    snapshots: Arc<Snapshots>,
    motion: MotionTracker,
    gazes: GazeControllers,
    robot: Name,
    camera: Name,
    /// Name of its map.
    map: String,
    /// Constant: no time of the computer passes in a drive.
    now: Instant,
}

impl Server {
    pub(crate) fn new(map: &MapSnapshot) -> anyhow::Result<Self> {
        let name = |text| Name::new(text).map_err(|refusal| anyhow::anyhow!("{refusal:?}"));
        let (robot, camera) = (name("robot")?, name("front")?);
        let snapshots = Arc::new(Snapshots::default());
        snapshots.publish(Arc::new(map.clone()));
        snapshots.set_robot(robot.as_ref(), Some(&map.name));
        let motion = MotionTracker::new(snapshots.clone(), Arc::new(LiveHub::default()));
        let (gazes, map, now) = (GazeControllers::default(), map.name.clone(), Instant::now());
        Ok(Self { snapshots, motion, gazes, robot, camera, map, now })
    }

    pub(crate) fn map(&self) -> anyhow::Result<Arc<MapSnapshot>> {
        self.snapshots.get(&self.map).ok_or_else(|| anyhow::anyhow!("the map is gone"))
    }

    /// The fused pose.
    pub(crate) fn pose(&self) -> Option<Pose2Covariance> {
        self.motion.pose(&self.robot, &self.map, self.now)
    }

    /// A person says where the robot is, after its first scan.
    pub(crate) fn put(&self, pose: &Pose2Covariance) -> anyhow::Result<()> {
        let admitted = self.motion.epochs().admit(&self.robot, EPOCH, self.now);
        admitted.map_err(|refusal| anyhow::anyhow!("{refusal:?}"))?;
        let put = self.motion.set_pose_by_hand(&self.robot, &self.map, pose, self.now);
        anyhow::ensure!(put.is_some(), "the robot has sent no odometry yet");
        Ok(())
    }

    pub(crate) fn scan(&self, scan: &Scan, odom_from_robot: Pose2, captured_ns: i64) {
        let job =
            ScanJob { map: self.map.clone(), epoch: EPOCH, captured_ns, odom_from_robot, scan: scan.clone() };
        self.motion.fix_by_scan(&self.robot, &job, self.now);
    }

    /// Carries the pose on by odometry.
    pub(crate) fn travel(&self, odom_from_robot: Pose2, captured_ns: i64) {
        // Reading a pose at a time takes the odometry of that time.
        self.motion.prior_pose(&self.robot, &self.camera, self.at(odom_from_robot, captured_ns));
    }

    fn at(&self, odom_from_robot: Pose2, captured_ns: i64) -> At<'_> {
        At { map: &self.map, epoch: EPOCH, captured_ns, odometry: Some(odom_from_robot), now: self.now }
    }

    /// Applies a frame to the robot's pose; returns changes of landmark health and guided names.
    pub(crate) fn frame(
        &self,
        map: &MapSnapshot,
        analysis: &FrameAnalysis,
        frame: &SentFrame<'_>,
    ) -> (Vec<HealthChange>, Option<GuidedResult>) {
        let SentFrame { image, camera, mounting, odom_from_robot, captured_ns } = *frame;
        let at = self.at(odom_from_robot, captured_ns);
        let frame = FrameContext {
            is_whole: true,
            analysis,
            map,
            extrinsics: mounting,
            camera: Some(camera),
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
    pub(crate) fn change(&self, map: &MapSnapshot, changes: &[HealthChange]) {
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
    pub(crate) fn gaze(
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
    pub(crate) fn log(&self) -> Corrections {
        self.motion.corrections(&self.robot)
    }

    /// Fixes by landmarks that corrected the pose so far.
    pub(crate) fn corrections(&self) -> u64 {
        of(&self.log(), "landmarks", &["started", "applied", "reset"])
    }

    /// Records what the robot sends and what fixes its pose, from now on.
    pub(crate) fn record(&self) -> anyhow::Result<()> {
        Ok(self.motion.start_recording(&self.robot, &self.map).map(|_| ())?)
    }

    /// Ends the recording and gives it.
    pub(crate) fn recording(&self) -> Option<Box<RunRecording>> {
        self.motion.take_recording(&self.robot)
    }
}

/// How often a modality had one of these outcomes.
pub(crate) fn of(log: &Corrections, modality: &str, outcomes: &[&str]) -> u64 {
    let counts = log.totals.get(modality);
    counts.map_or(0, |counts| outcomes.iter().filter_map(|o| counts.get(o)).sum())
}
