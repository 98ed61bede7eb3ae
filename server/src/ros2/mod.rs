//! Robots of ROS 2, served on the router's own session: no bridge process beside `rmw_zenoh`. In:
//! topics and liveliness tokens of each configured robot. Out: its frames, odometry and scans, to
//! the same intake as those of native robots; and poses, transforms and detections on topics of the
//! robot.
//!
//! Each robot has one thread and one bounded inbox. Callbacks of zenoh put samples there and never
//! wait.

mod counts;
mod inbox;
mod outputs;
mod wire;
mod graph;
mod robot;

use crate::{
    bus::{BusError, Outbox, Receivers, caught},
    config::Ros2Robot,
};
use counts::Counters;
use engine::{
    slots::SlotKey,
    threads::{self, Class},
    workers::Publish,
};
use graph::Graph;
use inbox::{Dropped, Event, Inbox};
use outputs::Outputs;
use protos::{Name, api::Ros2Status, v1};
use robot::RobotThread;
use ros2::robot::{RobotAdapter, TopicUse};
use std::{
    collections::BTreeMap,
    hash::{BuildHasher, RandomState},
    sync::{Arc, Mutex, PoisonError},
    thread::JoinHandle,
};
use wire::Wire;
use zenoh::{
    Session,
    pubsub::Subscriber,
    sample::{Locality, Sample, SampleKind},
};

/// All robots of ROS 2.
#[derive(Debug, Default)]
pub struct Ros2 {
    robots: BTreeMap<Name, Running>,
}

/// One robot at work.
#[derive(Debug)]
struct Running {
    inbox: Arc<Inbox>,
    counts: Arc<Counters>,
    parts: Mutex<Option<Parts>>,
}

/// What ends with the server.
#[derive(Debug)]
struct Parts {
    subscribers: Vec<Subscriber<()>>,
    thread: JoinHandle<()>,
}

impl Ros2 {
    /// Declares the topics of all robots and starts their threads.
    pub async fn open(
        session: &Session,
        robots: &[Ros2Robot],
        (to, outbox): (&Receivers, &Outbox),
    ) -> Result<Self, BusError> {
        let mut opened = Self::default();
        for (index, settings) in robots.iter().enumerate() {
            let running = start(session, (settings, index), to, outbox).await?;
            opened.robots.insert(settings.robot.clone(), running);
        }
        Ok(opened)
    }

    /// What became of the messages of a robot.
    pub fn status(&self, robot: &Name) -> Ros2Status {
        let counts = self.robots.get(robot).map(|running| running.counts.read());
        counts.map_or_else(Ros2Status::default, |counts| Ros2Status { configured: true, ..counts })
    }

    /// The answers and poses of robots that are not of ROS go to `outbox` alone.
    pub fn publisher(self: &Arc<Self>, outbox: Outbox) -> Ros2Publisher {
        Ros2Publisher { outbox, ros2: self.clone() }
    }

    /// Stops listening, and ends the threads.
    pub async fn close(&self) {
        for (robot, running) in &self.robots {
            let parts = running.parts.lock().unwrap_or_else(PoisonError::into_inner).take();
            let Some(Parts { subscribers, thread }) = parts else { continue };
            for subscriber in subscribers {
                if let Err(error) = subscriber.undeclare().await {
                    tracing::warn!(%robot, %error, "ros2_undeclare_failed");
                }
            }
            running.inbox.close();
            let joined = tokio::task::spawn_blocking(move || thread.join()).await;
            if !matches!(joined, Ok(Ok(()))) {
                tracing::error!(%robot, "the thread of a robot of ROS panicked");
            }
        }
    }

    fn put(&self, robot: &Name, event: impl FnOnce() -> Event) {
        if let Some(running) = self.robots.get(robot)
            && running.inbox.put(event()).is_err()
        {
            running.counts.reason("", "queue_full");
        }
    }
}

/// Publishes on the keys of Waymark, and to robots of ROS.
#[derive(Debug, Clone)]
pub struct Ros2Publisher {
    outbox: Outbox,
    ros2: Arc<Ros2>,
}

impl Ros2Publisher {
    /// Where what is not for robots of ROS alone goes.
    pub(crate) fn outbox(&self) -> &Outbox {
        &self.outbox
    }
}

impl Publish for Ros2Publisher {
    fn answer(&self, key: &SlotKey, answer: &v1::Answer) {
        self.outbox.answer(key, answer);
        self.ros2.put(&key.robot, || Event::Answer(key.camera.clone(), Box::new(answer.clone())));
    }

    fn pose(&self, robot: &Name, pose: &v1::RobotPose) {
        self.outbox.pose(robot, pose);
        self.ros2.put(robot, || Event::Pose(Box::new(pose.clone())));
    }
}

async fn start(
    session: &Session,
    (settings, index): (&Ros2Robot, usize),
    to: &Receivers,
    outbox: &Outbox,
) -> Result<Running, BusError> {
    let (inbox, counts) = (Arc::<Inbox>::default(), Arc::<Counters>::default());
    let wire = Wire::of(settings);
    let topics = settings.inputs.topics();
    let outputs = Outputs::new(settings.outputs.clone(), &settings.inputs);
    let zid = session.zid().to_string();
    let (graph, declare) = Graph::new(settings, &zid, index, &outputs.topics());
    let refused =
        |detail: String| BusError::Declare { action: "take the settings of a robot of ROS", detail };
    let adapter = RobotAdapter::new(settings.inputs.clone(), new_epoch());
    let mut thread = RobotThread {
        robot: settings.robot.clone(),
        wire: wire.clone(),
        topics: topics.clone(),
        adapter: adapter.map_err(|e| refused(e.to_string()))?,
        graph,
        outputs,
        session: session.clone(),
        to: to.clone(),
        outbox: outbox.clone(),
        inbox: inbox.clone(),
        counts: counts.clone(),
        tokens: Vec::new(),
        frame_ids: BTreeMap::new(),
        caches_asked: 0,
    };
    thread.declare(declare);
    let pulse = to.vitals.begin(format!("the thread of robot {} of ROS", settings.robot));
    let spawned = threads::spawn(Class::Answers, format!("ros2-{index}"), move || thread.run(pulse))
        .map_err(|source| BusError::Thread { name: "ros2", source })?;
    let listener = Listener { session, wire: &wire, to, inbox: &inbox, counts: &counts };
    let mut subscribers = vec![listener.tokens().await?];
    for (i, used) in topics.iter().enumerate() {
        subscribers.extend(listener.topic(i, used).await?);
    }
    let parts = Mutex::new(Some(Parts { subscribers, thread: spawned }));
    Ok(Running { inbox, counts, parts })
}

/// Declares what a robot is listened to on.
struct Listener<'a> {
    session: &'a Session,
    wire: &'a Wire,
    to: &'a Receivers,
    inbox: &'a Arc<Inbox>,
    counts: &'a Arc<Counters>,
}

impl Listener<'_> {
    async fn tokens(&self) -> Result<Subscriber<()>, BusError> {
        let (inbox, counts) = (self.inbox.clone(), self.counts.clone());
        let callback = move |sample: Sample| {
            let has_appeared = sample.kind() == SampleKind::Put;
            if inbox.put(Event::Token(sample.key_expr().as_str().to_owned(), has_appeared)).is_err() {
                counts.reason("", "queue_full");
            }
        };
        let declared = self
            .session
            .liveliness()
            .declare_subscriber(self.wire.tokens())
            .history(true)
            .callback(caught(&self.to.vitals, "a token of ROS", callback));
        declared.await.map_err(|error| declared_error(&error))
    }

    async fn topic(&self, index: usize, used: &TopicUse) -> Result<Vec<Subscriber<()>>, BusError> {
        let mut subscribers = Vec::new();
        let is_image = used.camera.is_some();
        for key in self.wire.subscriptions(used) {
            let (inbox, counts, topic) = (self.inbox.clone(), self.counts.clone(), used.topic.clone());
            let callback = move |sample: Sample| {
                let put = if is_image {
                    inbox.put_image(index, sample)
                } else {
                    inbox.put(Event::Message(index, sample))
                };
                match put {
                    Ok(()) => {}
                    Err(Dropped::Full) => drop(counts.reason(&topic, "queue_full")),
                    Err(Dropped::Superseded) => drop(counts.reason(&topic, "superseded")),
                }
            };
            let declared = self
                .session
                .declare_subscriber(key)
                .allowed_origin(Locality::Remote)
                .callback(caught(&self.to.vitals, "a message of ROS", callback));
            subscribers.push(declared.await.map_err(|error| declared_error(&error))?);
        }
        if let Some(key) = self.wire.cache_tokens(used) {
            let (inbox, counts, topic) = (self.inbox.clone(), self.counts.clone(), used.topic.clone());
            let callback = move |sample: Sample| {
                let is_there = sample.kind() == SampleKind::Put;
                let key = sample.key_expr().as_str().to_owned();
                if is_there && inbox.put(Event::Cache(index, key)).is_err() {
                    counts.reason(&topic, "queue_full");
                }
            };
            let declared = self.session.liveliness().declare_subscriber(key).history(true).callback(caught(
                &self.to.vitals,
                "a cache of ROS",
                callback,
            ));
            subscribers.push(declared.await.map_err(|error| declared_error(&error))?);
        }
        Ok(subscribers)
    }
}

/// A number that no other start has, exact in JSON.
fn new_epoch() -> u64 {
    (RandomState::new().hash_one(std::process::id()) >> 11).max(1)
}

fn declared_error(error: &zenoh::Error) -> BusError {
    BusError::Declare { action: "listen to a robot of ROS", detail: error.to_string() }
}
