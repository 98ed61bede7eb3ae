//! The robot's side. Out: frames, odometry, scans, a liveliness token. In: answers and fused poses.
//! Frames are best effort and numbered; the server keeps the newest of each camera, so a robot that
//! sends fast never queues.

use crate::{
    Capture, ClientError, RobotTls,
    error::fault,
    greeting::admitted,
    message_limit::MessageLimit,
    servers::{ServerEvent, Servers},
    transport::{self, Opened},
};
use map::pose2::Pose2;
use protos::{Key, Keys, Name, convert::geometry::pose2_wire, keys::alive_slot, prost::Message, v1};
use std::{
    hash::{BuildHasher, RandomState},
    sync::atomic::{AtomicU64, Ordering},
    time::{Duration, Instant},
};
use tokio::sync::broadcast;
use zenoh::{
    Wait,
    liveliness::LivelinessToken,
    pubsub::Subscriber,
    qos::{CongestionControl, Priority},
    sample::Sample,
};

/// Answers and poses buffered for a slow reader; beyond, it misses the oldest.
pub const INBOX: usize = 64;

/// Behaviour when the link is full.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Delivery {
    /// Drop a message after 50 ms: for robots, whose next frame is more useful.
    #[default]
    Latest,
    /// Wait: for evaluations that need every frame.
    Every,
}

/// Endpoint of the server and identity of the robot.
#[derive(Debug, Clone)]
pub struct RobotOptions {
    /// The server's zenoh endpoint, such as `tcp/127.0.0.1:7447`.
    pub endpoint: String,
    /// Name of the fleet, part of every key.
    pub fleet: String,
    /// Name of the robot, as registered at the server.
    pub robot: String,
    /// Behaviour when the link is full.
    pub delivery: Delivery,
    /// Longest time to find the server.
    pub timeout: Duration,
    /// Epoch of an earlier session, for a program that restarts while odometry goes on; random if
    /// absent. It works only if the server restarted, too: a running server drops sequence numbers
    /// that begin anew as stale. Two programs must not use one robot's name at a time: the later
    /// one is refused with `epoch_conflict`.
    pub epoch: Option<u64>,
    /// What the robot shows at a `tls/` endpoint.
    pub tls: Option<RobotTls>,
}

impl RobotOptions {
    /// Options with defaults: latest frame wins, 5 s to find the server.
    pub fn new(endpoint: impl Into<String>, fleet: impl Into<String>, robot: impl Into<String>) -> Self {
        Self {
            endpoint: endpoint.into(),
            fleet: fleet.into(),
            robot: robot.into(),
            delivery: Delivery::Latest,
            timeout: Duration::from_secs(5),
            epoch: None,
            tls: None,
        }
    }
}

/// An answer and the camera it is for.
#[derive(Debug, Clone)]
pub struct CameraAnswer {
    /// Name of the camera.
    pub camera: Name,
    /// The server's answer.
    pub answer: v1::Answer,
}

/// A robot's connection. Dropping it ends the session and the robot's presence.
pub struct RobotClient {
    pub(crate) session: zenoh::Session,
    opened: Opened,
    pub(crate) keys: Keys,
    pub(crate) robot: Name,
    endpoint: String,
    delivery: Delivery,
    epoch: u64,
    next_seq: AtomicU64,
    answers: broadcast::Sender<CameraAnswer>,
    poses: broadcast::Sender<v1::RobotPose>,
    pub(crate) servers: Servers,
    pub(crate) message_limit: MessageLimit,
    // Held: dropping them ends subscription and token.
    _subscribers: Vec<Subscriber<()>>,
    _alive: LivelinessToken,
}

impl RobotClient {
    /// Connects, subscribes to the robot's answers and poses, and declares its liveliness token.
    pub async fn connect(options: &RobotOptions) -> Result<Self, ClientError> {
        let fleet = name("fleet", &options.fleet)?;
        let robot = name("robot", &options.robot)?;
        let keys = Keys::new(&fleet);
        let opened = match options.tls {
            Some(_) => admitted(&keys, &robot, options).await?,
            None => transport::open(options).await?,
        };
        let session = opened.session.clone();
        let (answers, _) = broadcast::channel(INBOX);
        let (poses, _) = broadcast::channel(INBOX);
        let servers = Servers::new();
        let to_answers = {
            let (keys, answers, servers) = (keys.clone(), answers.clone(), servers.clone());
            move |sample: Sample| {
                let Ok(Key::Answer(_, camera)) = transport::received(&keys, &sample) else { return };
                let Ok(answer) = v1::Answer::decode(&*sample.payload().to_bytes()) else { return };
                if !servers.takes_answer(&answer) {
                    return;
                }
                // No receiver is not an error.
                drop(answers.send(CameraAnswer { camera, answer }));
            }
        };
        let epoch = options.epoch.unwrap_or_else(new_epoch);
        let to_poses = {
            let (poses, servers) = (poses.clone(), servers.clone());
            move |sample: Sample| {
                // A pose of another epoch belongs to another program under this robot's name.
                if let Ok(pose) = v1::RobotPose::decode(&*sample.payload().to_bytes())
                    && pose.epoch == epoch
                    && servers.takes_pose(&pose)
                {
                    drop(poses.send(pose));
                }
            }
        };
        let subscribe = fault("subscribe");
        let mut subscribers = servers.watch(&session, &keys, &robot).await?;
        subscribers.extend([
            session
                .declare_subscriber(keys.answers_of(&robot))
                .callback(to_answers)
                .await
                .map_err(subscribe)?,
            session
                .declare_subscriber(keys.build(&Key::Pose(robot.clone())))
                .callback(to_poses)
                .await
                .map_err(subscribe)?,
        ]);
        let alive =
            session.liveliness().declare_token(keys.build(&Key::Alive(robot.clone(), alive_slot(epoch))));
        let alive = alive.await.map_err(fault("declare the liveliness token"))?;
        Ok(Self {
            session,
            opened,
            keys,
            robot,
            endpoint: options.endpoint.clone(),
            delivery: options.delivery,
            epoch,
            next_seq: AtomicU64::new(1),
            answers,
            poses,
            servers,
            message_limit: MessageLimit::default(),
            _subscribers: subscribers,
            _alive: alive,
        })
    }

    /// Epoch of this start of the robot's software; random at [`Self::connect`] unless the options
    /// state it.
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// From now on frames, odometry, scans and questions name this map, unless they name one
    /// themselves; `None`: none, and the server where the robot is registered takes them. For a
    /// robot that drives into a building whose map another server on the same router has: it is
    /// registered there, too, and goes on.
    pub fn enter_map(&self, map: Option<&str>) -> Result<(), ClientError> {
        self.servers.enter(map.map(|map| name("map", map)).transpose()?);
        Ok(())
    }

    /// When the server of the robot's map goes and comes back, where several servers share a
    /// router. The map is that of [`Self::enter_map`], or the robot's own.
    pub fn server_events(&self) -> broadcast::Receiver<ServerEvent> {
        self.servers.events()
    }

    /// Sends a frame, or the quads of one, and returns its number, at once. One that is larger than
    /// the server takes is sent without its image, and its answer says `too_large`.
    pub async fn publish_frame(&self, camera: &str, capture: Capture) -> Result<u64, ClientError> {
        let seq = self.next_seq.fetch_add(1, Ordering::Relaxed);
        let (robot, camera) = (self.robot.clone(), name("camera", camera)?);
        let capture = self.message_limit.within(self, capture).await?;
        let key = if capture.is_quads() { Key::Quads(robot, camera) } else { Key::Frame(robot, camera) };
        self.put(&key, capture.numbered(self.epoch, seq, self.servers.map()), Priority::DataLow).await?;
        Ok(seq)
    }

    /// Sends a frame, or the quads of one, and waits for its answer. One at a time per camera, or
    /// the older is superseded. [`ClientError::ServerGone`] as soon as it is known that the server
    /// of the robot's map is not there.
    pub async fn recognise(
        &self,
        camera: &str,
        capture: Capture,
        wait: Duration,
    ) -> Result<v1::Answer, ClientError> {
        if let Some(gone) = self.servers.gone_error() {
            return Err(gone);
        }
        let mut answers = self.answers();
        let started = Instant::now();
        let seq = self.publish_frame(camera, capture).await?;
        let none =
            || ClientError::NoAnswer { seq, waited: started.elapsed(), endpoint: self.endpoint.clone() };
        let arrived = async {
            loop {
                let CameraAnswer { camera: of, answer } = match answers.recv().await {
                    Ok(answer) => answer,
                    Err(broadcast::error::RecvError::Lagged(_)) => continue,
                    Err(broadcast::error::RecvError::Closed) => return Err(none()),
                };
                if of.as_str() != camera || answer.epoch != self.epoch {
                    continue;
                }
                match answer.seq.cmp(&seq) {
                    std::cmp::Ordering::Less => {}
                    std::cmp::Ordering::Equal => return Ok(answer),
                    std::cmp::Ordering::Greater => return Err(ClientError::Superseded { seq }),
                }
            }
        };
        tokio::select! {
            // An answer that is there counts.
            biased;
            arrived = tokio::time::timeout(wait, arrived) => arrived.unwrap_or_else(|_| Err(none())),
            gone = self.servers.gone() => Err(gone),
        }
    }

    /// Every answer from now on, of all cameras. A reader more than [`INBOX`] behind misses the
    /// oldest.
    pub fn answers(&self) -> broadcast::Receiver<CameraAnswer> {
        self.answers.subscribe()
    }

    /// Every fused pose of this epoch from now on; [`v1::RobotPose::age_ms`] says how old it was
    /// when it was sent. The server sends none that is more than 2 s old, so that silence means
    /// that the pose is unknown.
    pub fn poses(&self) -> broadcast::Receiver<v1::RobotPose> {
        self.poses.subscribe()
    }

    /// Sends odometry with the present time.
    pub async fn publish_odometry(&self, odom_from_robot: &Pose2) -> Result<u64, ClientError> {
        self.publish_odometry_at(crate::capture::now_ns(), odom_from_robot).await
    }

    /// Sends odometry that was read at `captured_ns` of the robot's clock, ns; the same clock as in
    /// frames and scans.
    pub async fn publish_odometry_at(
        &self,
        captured_ns: i64,
        odom_from_robot: &Pose2,
    ) -> Result<u64, ClientError> {
        let seq = self.next_seq.fetch_add(1, Ordering::Relaxed);
        let message = v1::Odometry {
            epoch: self.epoch,
            seq,
            captured_ns,
            odom_from_robot: Some(pose2_wire(odom_from_robot)),
            map: self.servers.map(),
        };
        self.put(&Key::Odometry(self.robot.clone()), message.encode_to_vec(), Priority::Data).await?;
        Ok(seq)
    }

    /// Sends a laser scan; its epoch and number are set here.
    pub async fn publish_scan(&self, scan: v1::Scan) -> Result<u64, ClientError> {
        let seq = self.next_seq.fetch_add(1, Ordering::Relaxed);
        let map = if scan.map.is_empty() { self.servers.map() } else { scan.map };
        let message = v1::Scan { epoch: self.epoch, seq, map, ..scan };
        self.put(&Key::Scan(self.robot.clone()), message.encode_to_vec(), Priority::Data).await?;
        Ok(seq)
    }

    /// Sends any bytes on the frame key of a camera: for tests of the server's refusals only.
    pub async fn publish_raw_frame(&self, camera: &str, bytes: Vec<u8>) -> Result<(), ClientError> {
        let key = Key::Frame(self.robot.clone(), name("camera", camera)?);
        self.put(&key, bytes, Priority::DataLow).await
    }

    /// Ends the session in order.
    pub async fn close(self) -> Result<(), ClientError> {
        self.opened.close().await.map_err(fault("close the session"))
    }

    async fn put(&self, key: &Key, bytes: Vec<u8>, priority: Priority) -> Result<(), ClientError> {
        let congestion = match self.delivery {
            Delivery::Latest => CongestionControl::Drop,
            Delivery::Every => CongestionControl::Block,
        };
        let (key, camera) = self.keys.on_wire(key);
        let (session, camera) = (self.session.clone(), camera.map(str::to_owned));
        // zenoh waits inside the call when the link is full: not on an async thread.
        let put = move || {
            let put = session.put(key, bytes).attachment(camera);
            put.congestion_control(congestion).priority(priority).wait()
        };
        match tokio::task::spawn_blocking(put).await {
            Ok(sent) => sent.map_err(fault("send")),
            Err(gone) => Err(ClientError::Transport { action: "send", detail: gone.to_string() }),
        }
    }
}

pub(crate) fn name(field: &'static str, text: &str) -> Result<Name, ClientError> {
    Name::new(text).map_err(|error| ClientError::Name { field, text: text.to_owned(), error })
}

/// A random epoch by the system's randomness: 53 bits, so that JSON readers with doubles keep it
/// whole.
fn new_epoch() -> u64 {
    (RandomState::new().hash_one(std::process::id()) >> 11).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn epochs_differ() {
        assert_ne!(new_epoch(), new_epoch());
        assert!(new_epoch() < 1 << 53);
    }

    #[tokio::test]
    async fn invalid_names_are_refused_before_connecting() {
        let error =
            RobotClient::connect(&RobotOptions::new("tcp/127.0.0.1:1", "Site 1", "r1")).await.err().unwrap();
        assert!(matches!(error, ClientError::Name { field: "fleet", .. }), "{error}");
    }
}
