//! The process of the robots. In: a plan. Out, on its standard output: what became of every frame.
//! The load is open: frames have intended times, whatever became of the ones before, and latency
//! counts from the intended time, so a server that stands still is charged for every frame that was
//! due meanwhile.

use super::{
    plan::{End, Outcome, Phase, Plan, PlannedRobot, RobotOutcome, Sent},
    process::usage,
    site::drive,
};
use anyhow::Context as _;
use cli::screen;
use client::{Capture, RobotClient, RobotOptions, RobotTls, robot::CameraAnswer, v1};
use protos::prost::bytes::Bytes;
use sim::{building::Building, drive::Step, robot::Robot};
use std::{
    collections::BTreeMap,
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
    time::{Duration, Instant},
};
use tokio::{
    sync::{Semaphore, broadcast::error::RecvError},
    task::{JoinHandle, JoinSet},
    time::sleep_until,
};

const CAMERA: &str = "front";
/// Connections that are opened at a time.
const CONNECTING: usize = 16;
/// Longest time to connect.
const CONNECT: Duration = Duration::from_mins(1);
/// From the last connection to the first frame.
const LEAD: Duration = Duration::from_secs(1);
/// Answers are waited for so long after the last frame.
const LAST_ANSWERS: Duration = Duration::from_secs(3);
/// With faults, every so many frames one that the server refuses follows; and a robot is connected
/// anew so often.
const REFUSED_EVERY: usize = 40;
const RECONNECT_EVERY: Duration = Duration::from_mins(2);

/// `waymark-lab bench load-generator`.
#[derive(Debug, clap::Args)]
pub(in crate::bench) struct Args {
    /// The plan, JSON.
    plan: PathBuf,
}

/// The frames of the drive, there and back, so that the robot's way has no jump.
struct Drive {
    frames: Vec<(Bytes, Step)>,
    camera: vision::frame::Intrinsics,
}

impl Drive {
    fn read(plan: &Plan) -> anyhow::Result<Self> {
        let building = Arc::new(Building::corridor(plan.seed));
        let mut robot = Robot::new(building, &drive(plan.seed, plan.rate_hz));
        let camera = *robot.camera().intrinsics();
        let steps: Vec<Step> = robot.drive_mut().take(plan.frames).collect();
        let read = |i: usize| std::fs::read(plan.folder.join(format!("{i}.jpg")));
        let frames = steps.into_iter().enumerate().map(|(i, step)| anyhow::Ok((read(i)?.into(), step)));
        Ok(Self { frames: frames.collect::<Result<_, _>>()?, camera })
    }

    /// Frame number `i` of a robot that begins at `from`.
    fn capture(&self, from: usize, i: usize) -> anyhow::Result<Capture> {
        let period = 2 * (self.frames.len() - 1).max(1);
        let at = (from + i) % period;
        let (jpeg, step) = &self.frames[at.min(period - at)];
        Ok(Capture::encoded(jpeg.clone())?
            .with_intrinsics(&self.camera)
            .with_mounting(&step.robot_from_camera)
            .with_odometry(&step.odom_from_robot))
    }
}

pub(in crate::bench) fn run(args: &Args) -> anyhow::Result<()> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let plan: Plan = serde_json::from_slice(&std::fs::read(&args.plan)?)?;
    let outcome = runtime.block_on(generated(plan))?;
    screen::say(&serde_json::to_string(&outcome)?);
    Ok(())
}

async fn generated(plan: Plan) -> anyhow::Result<Outcome> {
    let (plan, drive) = (Arc::new(plan.clone()), Arc::new(Drive::read(&plan)?));
    let began = Instant::now();
    let places = Arc::new(Semaphore::new(CONNECTING));
    let mut connecting = JoinSet::new();
    for (index, robot) in plan.robots.iter().enumerate() {
        let (options, places) = (options(&plan, robot), places.clone());
        connecting.spawn(async move {
            let _place = places.acquire_owned().await?;
            let started = Instant::now();
            let client = RobotClient::connect(&options).await.with_context(|| options.robot.clone())?;
            anyhow::Ok((index, client, started.elapsed().as_secs_f32() * 1e3))
        });
    }
    let (mut clients, mut connect_ms) = (BTreeMap::new(), Vec::new());
    while let Some(connected) = connecting.join_next().await {
        let (index, client, ms) = connected??;
        clients.insert(index, client);
        connect_ms.push(ms);
    }
    let connected_s = began.elapsed().as_secs_f64();
    let start = Instant::now() + LEAD;
    let before = usage(std::process::id()).unwrap_or_default();
    let mut sending = JoinSet::new();
    for (index, client) in clients {
        sending.spawn(Sender { plan: plan.clone(), drive: drive.clone(), index, start }.run(client));
    }
    let mut robots: Vec<RobotOutcome> = vec![RobotOutcome::default(); plan.robots.len()];
    while let Some(sent) = sending.join_next().await {
        let (index, outcome) = sent??;
        robots[index] = outcome;
    }
    let after = usage(std::process::id()).unwrap_or_default();
    let processor_s = after.processor_s - before.processor_s;
    Ok(Outcome { robots, connected_s, connect_ms, processor_s, rss_mb: after.rss_mb })
}

fn options(plan: &Plan, robot: &PlannedRobot) -> RobotOptions {
    let tls = RobotTls {
        certificate: robot.certificate.clone(),
        key: robot.key.clone(),
        authority: Some(plan.authority.clone()),
        expires_ms: None,
    };
    RobotOptions {
        tls: Some(tls),
        timeout: CONNECT,
        ..RobotOptions::new(&plan.endpoint, &robot.fleet, &robot.name)
    }
}

struct Sender {
    plan: Arc<Plan>,
    drive: Arc<Drive>,
    index: usize,
    start: Instant,
}

/// Frames by number, and those sent in this session alone.
#[derive(Debug, Default)]
struct Log {
    outcome: RobotOutcome,
    /// Place in the outcome, and intended time, of frames without an answer, by their number.
    open: BTreeMap<u64, (usize, Instant)>,
}

impl Sender {
    async fn run(self, client: RobotClient) -> anyhow::Result<(usize, RobotOutcome)> {
        let log = Arc::<Mutex<Log>>::default();
        let mut client = client;
        let mut listening = listen(&client, &log);
        // Frames of a session are numbered from 1.
        let (mut sent, mut seq, mut opened) = (0, 0, Instant::now());
        for at in self.schedule() {
            let intended = self.start + at;
            sleep_until(intended.into()).await;
            if self.plan.has_faults
                && opened.elapsed() > RECONNECT_EVERY.mul_f64(1.0 + self.index as f64 / 20.0)
            {
                listening.abort();
                client.close().await?;
                client = RobotClient::connect(&options(&self.plan, &self.plan.robots[self.index])).await?;
                listening = listen(&client, &log);
                let mut log = lock(&log);
                log.open.clear();
                log.outcome.faults += 1;
                (seq, opened) = (0, Instant::now());
            }
            // Robots are spread over the drive.
            let capture = self.drive.capture(self.index * 7, sent)?;
            // Noted before it is sent: its answer may be here before the call returns.
            seq += 1;
            {
                let Log { outcome, open } = &mut *lock(&log);
                open.insert(seq, (outcome.frames.len(), intended));
                outcome.frames.push(Sent { intended_s: at.as_secs_f32(), ..UNANSWERED });
            }
            let numbered = client.publish_frame(CAMERA, capture).await?;
            anyhow::ensure!(numbered == seq, "frame {numbered} was to be number {seq}");
            sent += 1;
            if self.plan.has_faults && sent.is_multiple_of(REFUSED_EVERY) {
                client.publish_raw_frame(CAMERA, vec![0xff; 2_000]).await?;
                lock(&log).outcome.faults += 1;
            }
        }
        tokio::time::sleep(LAST_ANSWERS).await;
        listening.abort();
        client.close().await?;
        let outcome = std::mem::take(&mut lock(&log).outcome);
        Ok((self.index, outcome))
    }

    /// Intended times after the start. Robots begin at different moments of their period.
    fn schedule(&self) -> Vec<Duration> {
        let (mut all, mut begins) = (Vec::new(), 0.0);
        for phase @ Phase { seconds, .. } in &self.plan.phases {
            let period = 1.0 / self.plan.rate_hz(self.index, phase);
            let mut at = period * ((0.618 * self.index as f64).fract());
            while at < *seconds {
                all.push(Duration::from_secs_f64(begins + at));
                at += period;
            }
            begins += seconds;
        }
        all
    }
}

const UNANSWERED: Sent = Sent {
    intended_s: 0.0,
    end: End::Unanswered,
    latency_ms: 0.0,
    age_ms: 0.0,
    work_ms: 0.0,
    is_guided: false,
    is_named: false,
};

fn listen(client: &RobotClient, log: &Arc<Mutex<Log>>) -> JoinHandle<()> {
    let (mut answers, log) = (client.answers(), log.clone());
    tokio::spawn(async move {
        loop {
            match answers.recv().await {
                Ok(CameraAnswer { answer, .. }) => note(&mut lock(&log), &answer, Instant::now()),
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            }
        }
    })
}

/// Notes an answer.
fn note(log: &mut Log, answer: &v1::Answer, arrived: Instant) {
    let Some((place, intended)) = log.open.remove(&answer.seq) else { return };
    let work_ms: f64 = answer.timings.iter().map(|stage| stage.ms).sum();
    let end = match answer.status() {
        v1::Status::Expired => End::Expired,
        v1::Status::Rejected => End::Rejected,
        _ => End::Processed,
    };
    if end == End::Processed {
        // Older ones of the same camera were superseded.
        log.open = log.open.split_off(&answer.seq);
    }
    if let (End::Rejected, Some(rejection)) = (end, &answer.rejection) {
        *log.outcome.refusals.entry(rejection.code.clone()).or_default() += 1;
    }
    let sent = &mut log.outcome.frames[place];
    *sent = Sent {
        end,
        latency_ms: arrived.saturating_duration_since(intended).as_secs_f32() * 1e3,
        age_ms: (answer.latency_ms - work_ms).max(0.0) as f32,
        work_ms: work_ms as f32,
        is_guided: answer.only_expected,
        is_named: answer.map_from_robot.is_some() || answer.guided_map_from_robot.is_some(),
        ..*sent
    };
}

fn lock(log: &Mutex<Log>) -> std::sync::MutexGuard<'_, Log> {
    log.lock().unwrap_or_else(PoisonError::into_inner)
}
