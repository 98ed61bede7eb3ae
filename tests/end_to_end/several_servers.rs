//! Claim: several servers share a router of the operator. Every frame is answered once, by the
//! server of its map or robot, while servers join, are killed and come back; a robot that drives
//! from one to the other goes on; robots of a server that is killed are told; a map that two
//! servers have is served by one at most; a restart of the router changes nothing.

use client::{Capture, ClientError, Delivery, RobotClient, RobotOptions, ServerEvent, api::NewMap, v1};
use protos::{Key, Keys, Name, prost::Message};
use std::{
    collections::BTreeMap,
    path::Path,
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};
use tests::{Child, SOON, eventually, pictures, router::ExternalRouter};
use tokio::task::JoinHandle;
use zenoh::pubsub::Subscriber;

/// Between two frames of a robot.
const EVERY: Duration = Duration::from_millis(100);

/// Servers and codes that answered, by robot and number.
type Answers = BTreeMap<(String, u64), Vec<(String, String)>>;

/// Everything that is answered on a router.
struct Heard {
    answers: Arc<Mutex<Answers>>,
    _subscriber: Subscriber<()>,
}

impl Heard {
    async fn on(router: &ExternalRouter) -> Self {
        Self::into(router, Arc::default()).await
    }

    async fn into(router: &ExternalRouter, answers: Arc<Mutex<Answers>>) -> Self {
        let keys = Keys::new(&Name::new("default").expect("a name"));
        let (to, all) = (answers.clone(), keys.all_answers());
        let hear = move |sample: zenoh::sample::Sample| {
            let attached = sample.attachment().map(|attached| attached.to_bytes());
            let received = keys.received(sample.key_expr().as_str(), attached.as_deref());
            let Ok(Key::Answer(robot, _)) = received else { return };
            let answer = v1::Answer::decode(&*sample.payload().to_bytes()).expect("an answer");
            let code = answer.rejection.map(|rejection| rejection.code).unwrap_or_default();
            let mut answers = to.lock().expect("unharmed");
            answers.entry((robot.to_string(), answer.seq)).or_default().push((answer.server, code));
        };
        let subscriber = router.session().declare_subscriber(all).callback(hear).await.expect("subscribed");
        Self { answers, _subscriber: subscriber }
    }

    /// None was answered twice; who answered a robot, and how often.
    fn tally(&self, robot: &str) -> BTreeMap<(String, String), usize> {
        let answers = self.answers.lock().expect("unharmed");
        let twice: Vec<_> = answers.iter().filter(|(_, by)| by.len() > 1).collect();
        assert!(twice.is_empty(), "answered more than once: {twice:?}");
        let mut tally = BTreeMap::new();
        for ((_, _), by) in answers.iter().filter(|((of, _), _)| of == robot) {
            *tally.entry(by[0].clone()).or_default() += 1;
        }
        tally
    }

    /// Waits until a robot is answered so, more than before.
    async fn more(&self, robot: &str, server: &str, code: &str) {
        let of = (server.to_owned(), code.to_owned());
        let count = || self.tally(robot).get(&of).copied().unwrap_or_default();
        let before = count();
        let what = format!("{robot} is answered by {server} with {code:?}");
        eventually(&what, || async { (count() > before + 2).then_some(()) }).await;
    }
}

fn frame() -> Capture {
    Capture::encoded(pictures::picture(1)).expect("a picture").with_deadline_ms(60_000)
}

async fn robot(router: &ExternalRouter, name: &str) -> Arc<RobotClient> {
    let options = RobotOptions {
        delivery: Delivery::Every,
        timeout: SOON,
        ..RobotOptions::new(&router.endpoint, "default", name)
    };
    Arc::new(RobotClient::connect(&options).await.expect("connected"))
}

/// Sends frames without an end.
fn sending(robot: &Arc<RobotClient>) -> JoinHandle<()> {
    let robot = robot.clone();
    tokio::spawn(async move {
        loop {
            // Not sent while the router is gone.
            drop(robot.publish_frame("front", frame()).await);
            tokio::time::sleep(EVERY).await;
        }
    })
}

fn start(data: &Path, router: &ExternalRouter, name: &str) -> Child {
    Child::joined(data, (&router.endpoint, name), &[])
}

async fn with(server: &Child, map: &str, robots: &[&str]) {
    server.maps().create_map(&NewMap::new(map)).await.expect("map");
    for robot in robots {
        server.maps().put_robot(robot, map).await.expect("robot");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_frame_is_answered_once_while_servers_come_and_go() {
    let mut router = ExternalRouter::start(None).await;
    let (data_a, data_b) = (tempfile::tempdir().expect("data"), tempfile::tempdir().expect("data"));
    let a = start(data_a.path(), &router, "a");
    with(&a, "hall", &["r1", "rover"]).await;
    let heard = Heard::on(&router).await;
    let (r1, r2, rover) =
        (robot(&router, "r1").await, robot(&router, "r2").await, robot(&router, "rover").await);
    rover.enter_map(Some("hall")).expect("a name");
    let senders = [sending(&r1), sending(&r2), sending(&rover)];
    heard.more("r1", "a", "").await;
    heard.more("r2", "a", "unknown_robot").await;

    // A second server joins while frames are under way.
    let b = start(data_b.path(), &router, "b");
    with(&b, "annex", &["r2", "rover"]).await;
    heard.more("r2", "b", "").await;
    heard.more("rover", "a", "").await;
    let servers = a.maps().servers().await.expect("servers");
    let names: Vec<_> = servers.servers.iter().map(|server| server.name.as_str()).collect();
    assert_eq!((names, servers.server.as_str()), (vec!["a", "b"], "a"));
    assert_eq!(servers.contested_robots["rover"], ["a", "b"]);

    // A robot of both that names no map gets one refusal, and drives on with the name of a map.
    rover.enter_map(None).expect("no name");
    heard.more("rover", "a", "robot_contested").await;
    let mut answers = rover.answers();
    rover.enter_map(Some("annex")).expect("a name");
    let entered = Instant::now();
    let by_b = async { while answers.recv().await.is_ok_and(|a| a.answer.server != "b") {} };
    tokio::time::timeout(SOON, by_b).await.expect("it goes on");
    println!("a robot that enters the map of another server is answered after {:?}", entered.elapsed());
    heard.more("rover", "b", "").await;

    // The second server is killed: its robots are told, and another one says so to those that do
    // not listen.
    let mut events = r2.server_events();
    let killed = Instant::now();
    b.kill();
    let gone = ServerEvent::Gone { server: Name::new("b").expect("a name"), map: None };
    assert_eq!(tokio::time::timeout(SOON, events.recv()).await.expect("told"), Ok(gone));
    println!("a robot of a killed server is told after {:?}", killed.elapsed());
    let refused = r2.recognise("front", frame(), SOON).await;
    assert!(matches!(&refused, Err(ClientError::ServerGone { server, .. }) if server == "b"), "{refused:?}");
    heard.more("r2", "a", "server_gone").await;
    heard.more("rover", "a", "server_gone").await;
    heard.more("r1", "a", "").await;

    let b = start(data_b.path(), &router, "b");
    let back = tokio::time::timeout(SOON, events.recv()).await.expect("told").expect("an event");
    assert!(matches!(back, ServerEvent::Back { server, .. } if server.as_str() == "b"));
    heard.more("r2", "b", "").await;
    senders.iter().for_each(JoinHandle::abort);
    println!("answers of r2 by server and code: {:?}", heard.tally("r2"));
    drop((a, b));
    router.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_map_of_two_servers_is_served_by_the_first_until_it_is_gone() {
    let mut router = ExternalRouter::start(None).await;
    let (data_a, data_b) = (tempfile::tempdir().expect("data"), tempfile::tempdir().expect("data"));
    let (a, b) = (start(data_a.path(), &router, "a"), start(data_b.path(), &router, "b"));
    with(&b, "hall", &["r2"]).await;
    let heard = Heard::on(&router).await;
    let (r1, r2) = (robot(&router, "r1").await, robot(&router, "r2").await);
    let senders = [sending(&r1), sending(&r2)];
    heard.more("r2", "b", "").await;
    with(&a, "hall", &["r1"]).await;
    heard.more("r1", "a", "map_contested").await;
    heard.more("r2", "b", "").await;
    let readiness = a.maps().readiness().await.expect("it answers");
    assert_eq!(readiness.status, "degraded");
    assert!(readiness.maps_not_served["hall"].contains("also on b"), "{readiness:?}");
    assert_eq!(b.maps().readiness().await.expect("it answers").status, "ready");
    a.maps().add_landmark("hall", "poster", None, None).await.expect("people may edit it");
    r1.enter_map(Some("hall")).expect("a name");
    heard.more("r1", "b", "unknown_robot").await;
    r1.enter_map(None).expect("no name");

    b.kill();
    heard.more("r1", "a", "").await;
    let ready = || async { (a.maps().readiness().await.ok()?.status == "ready").then_some(()) };
    eventually("nothing is contested", ready).await;
    // Who comes back finds it taken.
    let b = start(data_b.path(), &router, "b");
    heard.more("r2", "b", "map_contested").await;
    heard.more("r1", "a", "").await;
    senders.iter().for_each(JoinHandle::abort);
    heard.tally("r1");
    drop((a, b));
    router.stop().await;
}

/// T8: the router ends and begins again, five times.
#[tokio::test(flavor = "multi_thread")]
async fn a_restart_of_the_router_is_survived() {
    let mut router = ExternalRouter::start(None).await;
    let (data_a, data_b) = (tempfile::tempdir().expect("data"), tempfile::tempdir().expect("data"));
    let (a, b) = (start(data_a.path(), &router, "a"), start(data_b.path(), &router, "b"));
    with(&a, "hall", &["r1"]).await;
    with(&b, "annex", &["r2"]).await;
    let mut heard = Heard::on(&router).await;
    let (r1, r2) = (robot(&router, "r1").await, robot(&router, "r2").await);
    let senders = [sending(&r1), sending(&r2)];
    for round in 1..=5 {
        heard.more("r1", "a", "").await;
        heard.more("r2", "b", "").await;
        router.stop().await;
        let degraded = || async { a.maps().readiness().await.ok()?.router };
        eventually("the server says that it has no router", degraded).await;
        // HTTP has nothing to do with the router.
        a.maps().add_landmark("hall", &format!("poster-{round}"), None, None).await.expect("a change");
        router.restart().await;
        let restarted = Instant::now();
        heard = Heard::into(&router, heard.answers.clone()).await;
        tokio::join!(heard.more("r1", "a", ""), heard.more("r2", "b", ""));
        println!(
            "round {round}: both robots are answered {:?} after the router is back",
            restarted.elapsed()
        );
    }
    assert_eq!(a.maps().landmarks("hall").await.expect("landmarks").len(), 5);
    senders.iter().for_each(JoinHandle::abort);
    heard.tally("r1");
    drop((a, b));
    router.stop().await;
}

/// A server starts without a router, says so, and joins when there is one.
#[tokio::test(flavor = "multi_thread")]
async fn a_server_waits_for_its_router() {
    let mut router = ExternalRouter::start(None).await;
    router.stop().await;
    let data = tempfile::tempdir().expect("data");
    let a = start(data.path(), &router, "a");
    with(&a, "hall", &["r1"]).await;
    let readiness = a.maps().readiness().await.expect("it answers");
    assert_eq!(readiness.status, "degraded");
    assert!(readiness.router.expect("a reason").contains(&router.endpoint));
    assert_eq!(a.maps().version().await.expect("version").server, "a");
    router.restart().await;
    let r1 = robot(&router, "r1").await;
    let answered = || async { r1.recognise("front", frame(), EVERY * 20).await.ok() };
    let answer = eventually("an answer", answered).await;
    assert_eq!((answer.server.as_str(), answer.map.as_str()), ("a", "hall"));
    drop(a);
    router.stop().await;
}
