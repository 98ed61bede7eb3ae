//! Plays the messages of a drive into a server, as a robot. In: messages in the order of time. Out:
//! the new answers, with the numbers and times of the recording, and counts.
//!
//! One frame is in work at a time, so that none is replaced by a newer one. Capture times are moved
//! to the present ([`recordings::restamp`]), because a server compares them with its own clock.

use super::poses::PosesFile;
use crate::screen;
use client::{
    Capture, ClientError, Delivery, RobotClient, RobotOptions, named_landmarks,
    protos::{
        Key, Name,
        convert::geometry::pose2,
        v1::{Answer, Frame, RobotPose, Status},
    },
};
use recordings::{Body, DriveReader, DriveWriter, Recorded, compare::Play, restamp::Restamp};
use serde::Serialize;
use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufWriter, Read, Seek},
    time::Duration,
};
use tokio::{sync::broadcast, time::Instant};

/// Longest wait for an answer; then the frame counts as not answered.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// The last fused poses have come when none came for so long.
const POSES_QUIET: Duration = Duration::from_millis(500);
/// The server may begin with a frame this late: it never expires while it is waited for.
const DEADLINE_MS: u32 = 60_000;

/// As whom, how fast.
#[derive(Debug, Clone)]
pub(crate) struct PlayerOptions {
    /// Endpoint of zenoh.
    pub(crate) zenoh: String,
    pub(crate) fleet: Name,
    /// Name at the server.
    pub(crate) robot: Name,
    pub(crate) recorded: Name,
    /// Most times as fast as recorded; as fast as the server answers if absent.
    pub(crate) speed: Option<f64>,
    /// Whether frames go against the robot's map, whatever map they name.
    pub(crate) is_map_given: bool,
}

/// Counts of a replay.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Counts {
    /// Frames sent.
    pub(crate) frames: u64,
    /// Frames with an answer, by its status.
    pub(crate) answered: BTreeMap<String, u64>,
    /// Landmarks named in all answers.
    pub(crate) recognised: u64,
    /// Answers with a pose of the robot.
    pub(crate) poses: u64,
    /// Fused poses received.
    pub(crate) fused_poses: u64,
    /// Lines of the file of poses; absent without one. Of one time there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) poses_written: Option<u64>,
    /// Odometry sent.
    pub(crate) odometry: u64,
    /// Scans sent.
    pub(crate) scans: u64,
    /// Messages of ROS that were not used or lack something: how often, and the first.
    pub(crate) problems: BTreeMap<&'static str, (u64, String)>,
    /// Where the file ends inside a record: its recorder was killed.
    pub(crate) cut_off_at: Option<u64>,
}

impl Counts {
    /// Messages that were sent.
    pub(crate) fn sent(&self) -> u64 {
        self.frames + self.odometry + self.scans
    }
}

/// What a replay gave.
#[derive(Debug)]
pub(crate) struct Played {
    pub(crate) counts: Counts,
    /// The answers of the recording.
    pub(crate) before: Play,
    /// The new answers.
    pub(crate) now: Play,
}

/// A robot that plays a recording.
pub(crate) struct Player {
    options: PlayerOptions,
    client: RobotClient,
    fused: broadcast::Receiver<RobotPose>,
    answers: Option<DriveWriter<BufWriter<File>>>,
    poses: Option<PosesFile>,
    clock: Restamp,
    /// Log time of the first message, and when it was played.
    began: Option<(u64, Instant)>,
    played: Played,
}

impl Player {
    /// Connects as the robot.
    pub(super) async fn connect(
        options: PlayerOptions,
        answers: Option<DriveWriter<BufWriter<File>>>,
        poses: Option<PosesFile>,
    ) -> anyhow::Result<Self> {
        let robot = RobotOptions {
            delivery: Delivery::Every,
            ..RobotOptions::new(&options.zenoh, options.fleet.as_str(), options.robot.as_str())
        };
        let client = RobotClient::connect(&robot).await?;
        let fused = client.poses();
        let played = Played { counts: Counts::default(), before: Play::default(), now: Play::default() };
        Ok(Self { options, client, fused, answers, poses, clock: Restamp::default(), began: None, played })
    }

    /// Plays to the end.
    pub(crate) async fn play<R: Read + Seek>(mut self, mut drive: DriveReader<R>) -> anyhow::Result<Played> {
        self.played.counts.cut_off_at = drive.cut_off_at();
        let progress = screen::progress(0, "playing");
        while let Some(recorded) = tokio::task::block_in_place(|| drive.next_message())? {
            self.pace(recorded.log_time_ns).await;
            self.message(recorded).await?;
            while let Some(fused) = self.next_fused() {
                self.fused(&fused);
            }
            progress.inc(1);
        }
        progress.finish_and_clear();
        if let Some(bag) = drive.bag() {
            let problems = bag.problems().map(|(word, count, first)| (word, (count, first.to_owned())));
            self.played.counts.problems.extend(problems);
        }
        self.last_fused().await;
        if let Some(poses) = self.poses {
            self.played.counts.poses_written = Some(poses.finish()?);
        }
        if let Some(answers) = self.answers {
            answers.finish()?;
        }
        self.client.close().await?;
        Ok(self.played)
    }

    /// Waits until a message is due.
    async fn pace(&mut self, log_time_ns: u64) {
        let (first_ns, began) = *self.began.get_or_insert_with(|| (log_time_ns, Instant::now()));
        if let Some(speed) = self.options.speed {
            let after = Duration::from_nanos(log_time_ns.saturating_sub(first_ns)).div_f64(speed);
            tokio::time::sleep_until(began + after).await;
        }
    }

    async fn message(&mut self, recorded: Recorded) -> anyhow::Result<()> {
        let is_ours = match &recorded.key {
            Key::Frame(robot, _) | Key::Answer(robot, _) | Key::Odometry(robot) | Key::Scan(robot) => {
                *robot == self.options.recorded
            }
            _ => false,
        };
        if !is_ours {
            return Ok(());
        }
        match (recorded.key, recorded.body) {
            (Key::Frame(_, camera), Body::Frame(frame)) => {
                self.frame(&camera, frame, recorded.log_time_ns).await?;
            }
            (Key::Answer(robot, camera), Body::Answer(answer)) => {
                self.played.before.add(&robot, &camera, &answer);
            }
            (_, Body::Odometry(message)) => {
                let at_ns = self.clock.stamp(message.captured_ns, now_ns());
                match message.odom_from_robot.as_ref().map(pose2) {
                    Some(Ok(pose)) => {
                        self.client.publish_odometry_at(at_ns, &pose).await?;
                        self.played.counts.odometry += 1;
                    }
                    // The SDK sends poses that are in range.
                    Some(Err(why)) => self.not_sent("bad_odometry", &format!("odometry is not sent: {why}")),
                    None => self.not_sent("bad_odometry", "odometry without a pose is not sent"),
                }
            }
            (_, Body::Scan(mut scan)) => {
                scan.captured_ns = self.clock.stamp(scan.captured_ns, now_ns());
                self.client.publish_scan(scan).await?;
                self.played.counts.scans += 1;
            }
            _ => {}
        }
        Ok(())
    }

    async fn frame(&mut self, camera: &Name, mut frame: Frame, log_time_ns: u64) -> anyhow::Result<()> {
        let (epoch, seq, captured_ns) = (frame.epoch, frame.seq, frame.captured_ns);
        frame.captured_ns = self.clock.stamp(captured_ns, now_ns());
        frame.deadline_ms = DEADLINE_MS;
        if self.options.is_map_given {
            frame.map.clear();
        }
        self.played.counts.frames += 1;
        let asked = self.client.recognise(camera.as_str(), Capture::recorded(frame), ANSWER_TIMEOUT).await;
        let mut answer = match asked {
            Ok(answer) => answer,
            Err(ClientError::NoAnswer { .. } | ClientError::Superseded { .. }) => return Ok(()),
            Err(error) => return Err(error.into()),
        };
        (answer.epoch, answer.seq, answer.captured_ns) = (epoch, seq, captured_ns);
        self.count(&answer);
        let recorded = &self.options.recorded;
        self.played.now.add(recorded, camera, &answer);
        if let Some(answers) = &mut self.answers {
            let key = Key::Answer(recorded.clone(), camera.clone());
            answers.write(Recorded { log_time_ns, key, body: Body::Answer(answer) })?;
        }
        Ok(())
    }

    fn not_sent(&mut self, word: &'static str, why: &str) {
        self.played.counts.problems.entry(word).or_insert_with(|| (0, why.to_owned())).0 += 1;
    }

    fn count(&mut self, answer: &Answer) {
        let counts = &mut self.played.counts;
        let status = client::protos::json::status::word(answer.status);
        *counts.answered.entry(status).or_default() += 1;
        counts.recognised += named_landmarks(answer).count() as u64;
        counts.poses += u64::from(answer.map_from_robot.is_some());
        // The first refusal says why all are refused.
        if let (Status::Rejected, Some(why)) = (answer.status(), &answer.rejection) {
            let first = || (0, format!("refused: {} {}: {}", why.code, why.field, why.detail));
            counts.problems.entry("rejected").or_insert_with(first).0 += 1;
        }
    }

    /// A fused pose that is there.
    fn next_fused(&mut self) -> Option<RobotPose> {
        loop {
            match self.fused.try_recv() {
                Ok(pose) => return Some(pose),
                Err(broadcast::error::TryRecvError::Lagged(missed)) => self.missed(missed),
                Err(_) => return None,
            }
        }
    }

    fn missed(&mut self, missed: u64) {
        self.played.counts.fused_poses += missed;
        if self.poses.is_some() {
            let first =
                || (0, "fused poses came faster than they were read: play slower, --speed 1".to_owned());
            self.played.counts.problems.entry("poses_missed").or_insert_with(first).0 += missed;
        }
    }

    fn fused(&mut self, pose: &RobotPose) {
        self.played.counts.fused_poses += 1;
        let recorded_ns = self.clock.recorded(pose.captured_ns);
        if let (Some(poses), Some(recorded_ns)) = (&mut self.poses, recorded_ns) {
            poses.take(recorded_ns, pose);
        }
    }

    /// The poses that are still on their way: until none comes.
    async fn last_fused(&mut self) {
        while self.poses.is_some() {
            match tokio::time::timeout(POSES_QUIET, self.fused.recv()).await {
                Ok(Ok(pose)) => self.fused(&pose),
                Ok(Err(broadcast::error::RecvError::Lagged(missed))) => self.missed(missed),
                Ok(Err(broadcast::error::RecvError::Closed)) | Err(_) => return,
            }
        }
    }
}

fn now_ns() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.map_or(0, |since| i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
}
