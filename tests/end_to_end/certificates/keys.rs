//! Every key of the protocol, with the certificate of another robot.

use super::Fleet;
use client::{
    RobotClient,
    protos::{Key, Keys, Name, ServerToken, prost::Message},
    v1,
};
use std::{
    collections::BTreeSet,
    sync::{Arc, Mutex},
    time::Duration,
};
use tests::eventually;
use zenoh::{Session, pubsub::Subscriber};

/// Time after which what was sent has arrived, where it may: everything of one session goes one
/// way.
const ARRIVED: Duration = Duration::from_millis(300);

fn named(text: &str) -> Name {
    Name::new(text).expect("a name")
}

/// Every key of the protocol, of this robot and map. A key that is added to the protocol does not
/// compile here until it is in.
fn every_key(robot: &str, map: &str) -> Vec<Key> {
    let (robot, map, camera) = (named(robot), named(map), named("front"));
    let all = vec![
        Key::Frame(robot.clone(), camera.clone()),
        Key::Quads(robot.clone(), camera.clone()),
        Key::Answer(robot.clone(), camera),
        Key::Odometry(robot.clone()),
        Key::Scan(robot.clone()),
        Key::Pose(robot.clone()),
        Key::Alive(robot.clone(), 0),
        Key::Alive(robot.clone(), 7),
        Key::Gaze(robot.clone()),
        Key::Hello(robot.clone()),
        Key::Localise(robot),
        Key::MapChanged(map.clone()),
        Key::MapVersion(map.clone()),
        Key::Server(map.clone(), ServerToken::Serves(map)),
    ];
    for key in &all {
        match key {
            Key::Frame(..)
            | Key::Quads(..)
            | Key::Answer(..)
            | Key::Odometry(_)
            | Key::Scan(_)
            | Key::Pose(_)
            | Key::Alive(..)
            | Key::Gaze(_)
            | Key::Hello(_)
            | Key::Localise(_)
            | Key::MapChanged(_)
            | Key::MapVersion(_)
            | Key::Server(..) => {}
        }
    }
    all
}

/// What a session has heard: keys, with the first byte of what was sent.
type Heard = Arc<Mutex<BTreeSet<(String, u8)>>>;

async fn hear(session: &Session, keys: &[String]) -> (Heard, Vec<Subscriber<()>>) {
    let heard = Heard::default();
    let mut subscribers = Vec::new();
    for key in keys {
        let to = heard.clone();
        let callback = move |sample: zenoh::sample::Sample| {
            let first = sample.payload().to_bytes().first().copied().unwrap_or_default();
            to.lock().expect("heard").insert((sample.key_expr().as_str().to_owned(), first));
        };
        subscribers.push(session.declare_subscriber(key).callback(callback).await.expect("a subscriber"));
    }
    (heard, subscribers)
}

fn of(heard: &Heard, mark: u8) -> BTreeSet<String> {
    let heard = heard.lock().expect("heard");
    heard.iter().filter(|(_, first)| *first == mark).map(|(key, _)| key.clone()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_writes_its_own_keys_alone() {
    let fleet = Fleet::start().await;
    let keys = Keys::new(&named("default"));
    let [own, foreign] = [("r1", "hall"), ("r2", "yard")]
        .map(|(robot, map)| every_key(robot, map).iter().map(|key| keys.on_wire(key).0).collect::<Vec<_>>());
    let observer = fleet.everything().await;
    let (heard, _subscribers) = hear(&observer, &["**".to_owned()]).await;
    let tokens = Arc::new(Mutex::new(BTreeSet::new()));
    let seen = tokens.clone();
    let _tokens = observer
        .liveliness()
        .declare_subscriber("**")
        .callback(move |sample| {
            seen.lock().expect("seen").insert(sample.key_expr().as_str().to_owned());
        })
        .await
        .expect("a subscriber of tokens");
    let r1 = fleet.raw("r1").await;
    let mut held = Vec::new();
    for key in own.iter().chain(&foreign) {
        r1.put(key, vec![1]).await.expect("put");
        r1.delete(key).await.expect("delete");
        held.push(r1.liveliness().declare_token(key).await.expect("a token"));
    }
    let [_, _, _, odometry, ..] = own.as_slice() else { panic!("keys") };
    let last = || async {
        // The last message that may pass: everything before it has passed or was dropped.
        r1.put(odometry, vec![9]).await.expect("put");
        (!of(&heard, 9).is_empty()).then_some(())
    };
    eventually("the last message", last).await;
    tokio::time::sleep(ARRIVED).await;
    let written: BTreeSet<String> =
        ["frame", "odometry", "quads", "scan"].map(|key| format!("waymark/1/default/robot/r1/{key}")).into();
    assert_eq!(of(&heard, 1), written, "what r1's certificate may write");
    assert_eq!(of(&heard, 0), BTreeSet::new(), "deletions, and what the server writes itself");
    let alive: BTreeSet<String> =
        ["alive/0", "alive/7"].map(|key| format!("waymark/1/default/robot/r1/{key}")).into();
    assert_eq!(*tokens.lock().expect("seen"), alive, "tokens of r1's certificate");
    fleet.inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_reads_its_own_keys_alone() {
    let fleet = Fleet::start().await;
    let keys = Keys::new(&named("default"));
    let [own, foreign] = [("r1", "hall"), ("r2", "yard")]
        .map(|(robot, map)| every_key(robot, map).iter().map(|key| keys.on_wire(key).0).collect::<Vec<_>>());
    let all: Vec<String> = own.iter().chain(&foreign).cloned().collect();
    let r1 = fleet.raw("r1").await;
    let patterns =
        ["**", "waymark/**", "waymark/1/default/robot/*/answer", "waymark/1/default/map/*/changed"];
    let asked: Vec<String> = all.iter().cloned().chain(patterns.map(str::to_owned)).collect();
    let (heard, _subscribers) = hear(&r1, &asked).await;
    let everything = fleet.everything().await;
    let readable: BTreeSet<String> = ["robot/r1/answer", "robot/r1/pose", "map/hall/changed"]
        .map(|k| format!("waymark/1/default/{k}"))
        .into();
    let arrived = || async {
        for key in &all {
            everything.put(key, vec![1]).await.expect("put");
        }
        (of(&heard, 1).len() >= readable.len()).then_some(())
    };
    eventually("what r1 may read", arrived).await;
    tokio::time::sleep(ARRIVED).await;
    assert_eq!(of(&heard, 1), readable);
    // Questions: own ones are answered, those of others are not, and of the maps it gets its own.
    for (key, mine) in own.iter().map(|key| (key, true)).chain(foreign.iter().map(|key| (key, false))) {
        let is_question = key.contains("/rpc/") || key.ends_with("/version");
        let replies = r1.get(key).timeout(Duration::from_secs(2)).await.expect("a query");
        let answered = replies.recv_async().await.is_ok_and(|reply| reply.result().is_ok());
        assert_eq!(answered, is_question && mine, "{key}");
    }
    let all = r1.get("waymark/1/default/map/*/version").timeout(ARRIVED).await.expect("a query");
    assert!(all.recv_async().await.is_err(), "maps are asked for by name");
    fleet.inside.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_forged_pose_or_answer_reaches_no_program_of_another_robot() {
    let fleet = Fleet::start().await;
    let keys = Keys::new(&named("default"));
    let r2 = RobotClient::connect(&fleet.options("r2")).await.expect("connected");
    let (mut poses, mut answers) = (r2.poses(), r2.answers());
    let pose = |map: &str| v1::RobotPose { epoch: r2.epoch(), map: map.into(), ..v1::RobotPose::default() };
    let answer = |seq| v1::Answer { epoch: r2.epoch(), seq, ..v1::Answer::default() };
    let (pose_key, answer_key) = (keys.build(&Key::Pose(named("r2"))), keys.answers_of(&named("r2")));
    let r1 = fleet.raw("r1").await;
    // Nobody without a certificate has a session at all.
    let endpoint = fleet.options("r1").endpoint;
    assert!(super::session(&endpoint, None).await.is_err());
    for _ in 0..50 {
        r1.put(&pose_key, pose("forged").encode_to_vec()).await.expect("put");
        r1.put(&answer_key, answer(1).encode_to_vec()).attachment("front").await.expect("put");
    }
    // The server's own arrive: what came before them would have, too.
    let everything = fleet.everything().await;
    let own = || async {
        everything.put(&pose_key, pose("yard").encode_to_vec()).await.expect("put");
        everything.put(&answer_key, answer(2).encode_to_vec()).attachment("front").await.expect("put");
        (!poses.is_empty() && !answers.is_empty()).then_some(())
    };
    eventually("the server's pose and answer", own).await;
    tokio::time::sleep(ARRIVED).await;
    while let Ok(pose) = poses.try_recv() {
        assert_eq!(pose.map, "yard", "a forged pose");
    }
    while let Ok(answer) = answers.try_recv() {
        assert_eq!(answer.answer.seq, 2, "a forged answer");
    }
    fleet.inside.server.stop().await;
}
