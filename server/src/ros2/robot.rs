//! The thread of one robot: what it receives becomes messages of Waymark, and goes the way of those
//! of native robots; answers and poses become messages of ROS.

use super::{
    counts::Counters,
    graph::Graph,
    inbox::{Event, Inbox},
    outputs::{Outgoing, Outputs},
    wire::{Wire, refusal_word},
};
use crate::bus::{Outbox, Receivers, announce_presence, take_frame};
use engine::{
    intake::FrameKind,
    panics::Edge,
    robot_activity::{Input, Refused},
    slots::SlotKey,
    vitals::Pulse,
    workers::Publish,
};
use protos::{Name, keys::alive_slot, prost::Message, v1};
use ros2::{
    messages::MessageKind,
    robot::{ConvertedMessage, MissingInput, Problem, RobotAdapter, RobotMessage, TopicUse},
};
use std::{
    collections::BTreeMap,
    fmt::Display,
    sync::Arc,
    time::{Instant, SystemTime, UNIX_EPOCH},
};
use zenoh::{
    Session, Wait,
    liveliness::LivelinessToken,
    qos::{CongestionControl, Priority},
    query::{ConsolidationMode, QueryTarget, ReplyKeyExpr},
    sample::{Locality, Sample},
};

/// Most samples that one publisher is asked for: tf2's depth of `/tf_static`.
const MAX_LATCHED: u32 = 100;
/// Most caches that are asked while the robot is there; publishers beyond are counted.
const MAX_CACHES: usize = 256;

/// Everything that the thread needs.
pub(super) struct RobotThread {
    pub(super) robot: Name,
    pub(super) wire: Wire,
    pub(super) topics: Vec<TopicUse>,
    pub(super) adapter: RobotAdapter,
    pub(super) graph: Graph,
    pub(super) outputs: Outputs,
    pub(super) session: Session,
    pub(super) to: Receivers,
    pub(super) outbox: Outbox,
    pub(super) inbox: Arc<Inbox>,
    pub(super) counts: Arc<Counters>,
    /// Declared tokens; they go with the thread.
    pub(super) tokens: Vec<LivelinessToken>,
    /// Frames of ROS by camera, for detections.
    pub(super) frame_ids: BTreeMap<Name, String>,
    pub(super) caches_asked: usize,
}

impl RobotThread {
    /// Works until the inbox is closed.
    pub(super) fn run(mut self, pulse: Pulse) {
        let panics = self.to.vitals.panics().clone();
        while let Some(event) = self.inbox.next() {
            let what = format!("a message of robot {} over ROS", self.robot);
            panics.catch(Edge::Message, what, "it is dropped", || self.handle(event));
        }
        announce_presence(&self.to, &self.robot, (alive_slot(self.adapter.epoch()), false));
        pulse.end();
    }

    fn handle(&mut self, event: Event) {
        match event {
            Event::Message(topic, sample) => self.receive(topic, &sample),
            Event::Token(token, has_appeared) => self.token(&token, has_appeared),
            Event::Cache(topic, key) => self.ask(topic, &key),
            Event::Answer(camera, answer) => {
                let frame_id = self.frame_ids.get(&camera).map_or("", String::as_str);
                let outgoing = self.outputs.of_answer(&answer, frame_id);
                self.send(&outgoing);
            }
            Event::Pose(pose) => self.pose(&pose),
        }
    }

    fn receive(&mut self, topic: usize, sample: &Sample) {
        let Some(used) = self.topics.get(topic) else { return };
        self.counts.received(&used.topic);
        let payload = sample.payload().to_bytes();
        let attachment = sample.attachment().map(zenoh::bytes::ZBytes::to_bytes);
        let message = self.wire.read(used, sample.key_expr().as_str(), (&payload, attachment.as_deref()));
        let taken = match message {
            Ok(message) => self.adapter.take(&used.topic, &message),
            Err(refusal) => return self.note(&used.topic, refusal_word(&refusal), &refusal),
        };
        let topic = used.topic.clone();
        self.take(&topic, taken);
    }

    fn take(&mut self, topic: &str, ConvertedMessage { messages, problems }: ConvertedMessage) {
        for problem in &problems {
            self.note(topic, Problem::word(problem), problem);
        }
        for message in messages {
            match message {
                RobotMessage::Frame { camera, frame_id, frame, lacks } => {
                    let image = self.adapter.settings().cameras.iter().find(|c| c.name == camera);
                    let image = image.map_or(String::new(), |camera| camera.image.clone());
                    for lack in &lacks {
                        self.note(&image, MissingInput::word(lack), lack);
                    }
                    if self.frame_ids.get(&camera) != Some(&frame_id) {
                        self.frame_ids.insert(camera.clone(), frame_id);
                    }
                    let slot = SlotKey { robot: self.robot.clone(), camera };
                    let kind = FrameKind::Image;
                    take_frame(&self.to, &self.outbox, kind, &slot, &frame.encode_to_vec().into());
                }
                RobotMessage::Odometry(odometry) => {
                    let message = odometry.encode_to_vec().into();
                    if let Some(pose) = self.to.motion.odometry(&self.robot, message, Instant::now()) {
                        self.outbox.pose(&self.robot, &pose);
                        self.pose(&pose);
                    }
                }
                RobotMessage::Scan(scan) => {
                    self.to.motion.scan(&self.robot, scan.encode_to_vec().into(), Instant::now());
                }
            }
        }
    }

    fn pose(&mut self, pose: &v1::RobotPose) {
        let outgoing = self.outputs.of_pose(pose, &self.adapter);
        self.send(&outgoing);
    }

    fn token(&mut self, token: &str, has_appeared: bool) {
        let Some(token) = self.wire.token(token) else { return };
        let follows = self.graph.token(token, has_appeared);
        if let Some((topic, given)) = follows.other_type
            && let Some(used) = self.topics.get(topic)
        {
            let detail = format!("a publisher has type {given}, the settings say {}", used.kind.name());
            self.note(&used.topic, "other_type", &detail);
        }
        self.declare(follows.declare);
        if let Some(is_there) = follows.presence {
            if !is_there {
                self.caches_asked = 0;
            }
            announce_presence(&self.to, &self.robot, (alive_slot(self.adapter.epoch()), is_there));
        }
    }

    /// Declares tokens of the server's node.
    pub(super) fn declare(&mut self, tokens: Vec<String>) {
        for token in tokens {
            let key = self.wire.with_prefix(&token);
            match self.session.liveliness().declare_token(key.as_str()).wait() {
                Ok(token) => self.tokens.push(token),
                Err(error) => tracing::warn!(robot = %self.robot, key, %error, "ros2_token_not_declared"),
            }
        }
    }

    /// Asks a publisher for the samples that it keeps. The replies come as messages of the topic.
    fn ask(&mut self, topic: usize, key: &str) {
        let Some(used) = self.topics.get(topic) else { return };
        if self.caches_asked >= MAX_CACHES {
            return self.note(&used.topic, "too_many_publishers", &"earlier messages are not asked for");
        }
        self.caches_asked += 1;
        let (inbox, counts, name) = (self.inbox.clone(), self.counts.clone(), used.topic.clone());
        let asked = self
            .session
            .get(format!("{key}?{}", ros2::rmw_zenoh::newest(MAX_LATCHED)))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .accept_replies(ReplyKeyExpr::Any)
            .callback(move |reply| {
                if let Ok(sample) = reply.into_result()
                    && inbox.put(Event::Message(topic, sample)).is_err()
                {
                    counts.reason(&name, "queue_full");
                }
            })
            .wait();
        if let Err(error) = asked {
            self.note(&used.topic, "not_asked", &error);
        }
    }

    fn send(&mut self, outgoing: &[Outgoing]) {
        for message in outgoing {
            for (key, attachment) in self.graph.address(message, now_ns()) {
                let put = self.session.put(key.as_str(), message.payload.clone());
                let put = put.attachment(attachment).allowed_destination(Locality::Remote);
                let put = put.congestion_control(CongestionControl::Drop).priority(Priority::InteractiveHigh);
                match put.express(true).wait() {
                    Ok(()) => self.counts.sent(&message.topic),
                    Err(error) => self.note(&message.topic, "not_sent", &error),
                }
            }
        }
    }

    /// Counts what was not used, or only in part, by topic and for the robot.
    fn note(&self, topic: &str, word: &str, detail: &impl Display) {
        let used = self.topics.iter().find(|used| used.topic == topic);
        if let Some(input) = used.and_then(|used| input_of(used.kind)) {
            let detail = detail.to_string();
            let refused = Refused { code: word, field: topic, detail: &detail };
            self.to.live.refused_by_topic(&self.robot, input, refused, Instant::now());
        }
        if let Some(count) = self.counts.reason(topic, word) {
            tracing::warn!(robot = %self.robot, topic, word, count, %detail, "ros2_message_incomplete");
        }
    }
}

/// What a topic brings.
fn input_of(kind: MessageKind) -> Option<Input> {
    Some(match kind {
        MessageKind::Image | MessageKind::CompressedImage => Input::Frame,
        MessageKind::CameraInfo => Input::CameraInfo,
        MessageKind::LaserScan => Input::Scan,
        MessageKind::Odometry => Input::Odometry,
        MessageKind::TFMessage => Input::Transform,
        _ => return None,
    })
}

fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
