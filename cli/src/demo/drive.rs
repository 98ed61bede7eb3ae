//! The demo's second part: robots drive, send frames and odometry over zenoh, and receive their
//! poses.

use super::{Args, MAP};
use crate::{pictures, screen};
use anyhow::Context as _;
use client::{
    Capture, MapClient, RobotClient, RobotOptions,
    api::{Landmark, LandmarkStatus},
    named_landmarks, quad_corners,
    v1::{Answer, Scan},
};
use map::pose2::Pose2;
use nalgebra::Vector3;
use protos::{Name, convert::geometry::pose2_wire};
use server::RunningServer;
use sim::{
    building::{Building, LandmarkTruth},
    drive::DriveParams,
    robot::{Robot, RobotParams, SensorReadings},
    truth::{FrameTruth, ViewState},
};
use std::{
    collections::BTreeMap,
    sync::Arc,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use tokio::time::Instant;

const CAMERA: &str = "front";
/// A recognition is true when its quad overlaps what is visible of the landmark by this much.
const IOU_TRUE: f64 = 0.5;
/// Views smaller than this are not counted as ones that should be recognised.
const MIN_SIDE_PX: f64 = 30.0;
/// Longest wait for an answer: then the frame counts as unanswered.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(3);

/// Farther than any corridor: the simulator starts the robot at its end.
const FAR_END_M: f64 = 1e3;
/// The pose that a frame led to follows its answer within this time.
const POSE_WAIT: Duration = Duration::from_millis(20);

/// Figures of all drives.
#[derive(Debug, Default)]
pub(super) struct Record {
    pub(super) robots: usize,
    pub(super) frames: usize,
    pub(super) answers: usize,
    pub(super) landmark_views: usize,
    pub(super) recognitions: usize,
    pub(super) false_matches: usize,
    /// Quads that were named by the pose, and those of them that are not that landmark.
    pub(super) guided: usize,
    pub(super) false_guided: usize,
    pub(super) corrections: u64,
    pub(super) position_errors_m: Vec<f64>,
    pub(super) odometry_errors_m: Vec<f64>,
    pub(super) latencies_ms: Vec<f64>,
}

/// Drives every robot to the end of its route.
pub(super) async fn drive(
    building: &Arc<Building>,
    server: &RunningServer,
    args: &Args,
) -> anyhow::Result<Record> {
    let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
    let landmarks = maps.landmarks(MAP).await?;
    let in_use = landmarks.iter().filter(|landmark| landmark.status == LandmarkStatus::Active);
    let taught: BTreeMap<String, String> =
        in_use.map(|landmark| (landmark.name.clone(), true_name(building, landmark))).collect();
    let taught = Arc::new(taught);
    let mut tasks = Vec::new();
    for number in 0..args.robots {
        let name = format!("robot-{}", number + 1);
        maps.put_robot(&name, MAP).await?;
        let params = RobotParams {
            drive: DriveParams {
                seed: args.seed.wrapping_mul(1000) + u64::from(number) + 1,
                // Every other robot comes the other way, from the far end, the others from places
                // of their own.
                start_m: if number % 2 == 0 { 1.5 * f64::from(number) } else { FAR_END_M },
                reverse: number % 2 == 1,
                legs: args.legs,
                rate_hz: args.rate_hz,
                ..DriveParams::default()
            },
            ..RobotParams::default()
        };
        let robot = Robot::new(building.clone(), &params);
        let options = RobotOptions::new(&server.zenoh_endpoint, super::FLEET, &name);
        let journey = Journey {
            robot: Name::new(name.as_str())?,
            name,
            client: RobotClient::connect(&options).await?,
            live: server.live.clone(),
            taught: taught.clone(),
            period: Duration::from_secs_f64(1.0 / args.rate_hz),
            record: Record { robots: 1, ..Record::default() },
            fixed: false,
            has_laser: args.record.is_some(),
        };
        tasks.push(tokio::spawn(journey.run(robot)));
    }
    let mut all = Record::default();
    for task in tasks {
        all.add(task.await.context("a robot's task")??);
    }
    Ok(all)
}

/// What a landmark is in the building: by its name, or what hangs at its place. Its own name where
/// nothing does.
fn true_name(building: &Building, landmark: &Landmark) -> String {
    let own = || landmark.name.clone();
    let Some(place) = landmark.place.filter(|_| building.landmark(&landmark.name).is_none()) else {
        return own();
    };
    let at = Vector3::new(place.x_m, place.y_m, place.z_m);
    let off = |truth: &&LandmarkTruth| (truth.map_from_landmark.translation.vector - at).norm();
    let there = building.landmarks().iter().filter(|t| off(t) < 0.5 * t.width_m.max(t.height_m));
    there.min_by(|a, b| off(a).total_cmp(&off(b))).map_or_else(own, |truth| truth.name.clone())
}

struct Journey {
    robot: Name,
    name: String,
    client: RobotClient,
    live: Arc<engine::live::LiveHub>,
    /// Landmarks in use, and what each is in the building.
    taught: Arc<BTreeMap<String, String>>,
    period: Duration,
    record: Record,
    fixed: bool,
    /// Whether scans are sent, too: for recordings.
    has_laser: bool,
}

impl Journey {
    async fn run(mut self, mut robot: Robot) -> anyhow::Result<Record> {
        let camera = *robot.camera().intrinsics();
        let mut poses = self.client.poses();
        let mut next = Instant::now();
        loop {
            // Rendering is heavy: off the runtime.
            let (next_readings, back) = tokio::task::spawn_blocking(move || {
                let readings = robot.next();
                (readings, robot)
            })
            .await?;
            robot = back;
            let Some(readings) = next_readings else { break };
            tokio::time::sleep_until(next).await;
            next = Instant::now().max(next) + self.period;
            let step = &readings.step;
            self.live.truth(&self.robot, MAP, step.map_from_robot);
            self.client.publish_odometry(&step.odom_from_robot).await?;
            if self.has_laser {
                self.client.publish_scan(scan_of(&readings)).await?;
            }
            let capture = Capture::encoded(pictures::jpeg(&readings.frame.image)?)?
                .with_intrinsics(&camera)
                .with_mounting(&step.robot_from_camera)
                .with_odometry(&step.odom_from_robot);
            self.record.frames += 1;
            let Ok(answer) = self.client.recognise(CAMERA, capture, ANSWER_TIMEOUT).await else { continue };
            self.record.answers += 1;
            self.score(&answer, &readings);
            // The odometry brought one pose, a fix may bring a second: the last one counts.
            tokio::time::sleep(POSE_WAIT).await;
            let mut last = None;
            while let Ok(pose) = poses.try_recv() {
                last = Some(pose);
            }
            if let Some(pose) = last {
                self.compare(&pose, step.map_from_robot, step.odom_from_robot);
            }
            self.report();
        }
        self.client.close().await?;
        Ok(self.record)
    }

    fn is_taught(&self, name: &str) -> bool {
        self.taught.values().any(|taught| taught == name)
    }

    fn score(&mut self, answer: &Answer, readings: &SensorReadings) {
        self.record.latencies_ms.push(answer.latency_ms);
        let truth = &readings.frame.truth;
        let size_px = [readings.frame.image.width(), readings.frame.image.height()];
        self.record.landmark_views += truth
            .landmarks
            .iter()
            .filter(|l| {
                l.state == ViewState::Full && l.min_side_px() >= MIN_SIDE_PX && self.is_taught(&l.name)
            })
            .count();
        for named in named_landmarks(answer) {
            let name = self.taught.get(named.name).map_or(named.name, String::as_str);
            let is_true = is_true(name, named.quad, truth, size_px);
            self.record.count(named.is_guided(), is_true);
            if !is_true {
                let by_pose = if named.is_guided() { " by pose" } else { "" };
                screen::complain(&format!(
                    "{}: false match {}{by_pose} in frame {}",
                    self.name, named.name, answer.seq
                ));
            }
        }
    }

    fn compare(&mut self, pose: &client::v1::RobotPose, truth: Pose2, odometry: Pose2) {
        let Some(estimate) = pose.map_from_robot.as_ref().and_then(|p| p.pose.as_ref()) else { return };
        self.fixed |= pose.corrections > 0;
        self.record.corrections = self.record.corrections.max(pose.corrections);
        if self.fixed {
            let error = |x_m: f64, y_m: f64| (x_m - truth.x_m).hypot(y_m - truth.y_m);
            self.record.position_errors_m.push(error(estimate.x_m, estimate.y_m));
            self.record.odometry_errors_m.push(error(odometry.x_m, odometry.y_m));
        }
    }

    /// A line every hundred frames: the terminal shows that it lives.
    fn report(&self) {
        let r = &self.record;
        if r.frames.is_multiple_of(50) {
            let error = r
                .position_errors_m
                .last()
                .map_or("not localised yet".to_owned(), |e| format!("{e:.2} m off"));
            let odometry =
                r.odometry_errors_m.last().map_or(String::new(), |e| format!(" (odometry alone {e:.2} m)"));
            screen::complain(&format!(
                "{}: {} frames, {} recognitions, {} false, {} by pose, {} false, {error}{odometry}",
                self.name, r.frames, r.recognitions, r.false_matches, r.guided, r.false_guided
            ));
        }
    }
}

/// The laser scan of a moment, stamped now.
fn scan_of(readings: &SensorReadings) -> Scan {
    let scan = &readings.scan;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Scan {
        captured_ns: i64::try_from(now.as_nanos()).unwrap_or(i64::MAX),
        odom_from_robot: Some(pose2_wire(&readings.step.odom_from_robot)),
        robot_from_laser: Some(pose2_wire(scan.robot_from_laser())),
        first_bearing_rad: scan.bearing_rad(0),
        bearing_step_rad: scan.bearing_step_rad(),
        max_range_m: scan.max_range_m(),
        ranges_m: scan.ranges_m().to_vec(),
        ..Scan::default()
    }
}

fn is_true(name: &str, quad: &client::v1::QuadAnswer, truth: &FrameTruth, size_px: [usize; 2]) -> bool {
    let (Some(landmark), Some(quad)) = (truth.landmark(name), quad_corners(quad)) else { return false };
    landmark.visible_iou(&quad, size_px) >= IOU_TRUE
}

impl Record {
    /// Counts a landmark that was named. One that the pose named is no recognition, whether right
    /// or wrong.
    pub(super) fn count(&mut self, is_guided: bool, is_true: bool) {
        match (is_guided, is_true) {
            (false, true) => self.recognitions += 1,
            (false, false) => self.false_matches += 1,
            (true, _) => {
                self.guided += 1;
                self.false_guided += usize::from(!is_true);
            }
        }
    }

    fn add(&mut self, other: Record) {
        self.robots += other.robots;
        self.frames += other.frames;
        self.answers += other.answers;
        self.landmark_views += other.landmark_views;
        self.recognitions += other.recognitions;
        self.false_matches += other.false_matches;
        self.guided += other.guided;
        self.false_guided += other.false_guided;
        self.corrections += other.corrections;
        self.position_errors_m.extend(other.position_errors_m);
        self.odometry_errors_m.extend(other.odometry_errors_m);
        self.latencies_ms.extend(other.latencies_ms);
    }
}
