//! Claim: a robot may put, delete, ask, reply, declare and be interested in keys of more than 65
//! 535 bytes, which zenoh cannot send: its connection ends, it is told so, no thread panics, the
//! server stays ready, and another robot loses no message. So it is with a certificate and without.
//! A panic inside zenoh by another way ends the program in order, with its cause. A process of its
//! own: what is looked for ends the process.

mod raw;

use client::{Capture, RobotClient, RobotOptions, RobotTls, api::NewMap, v1};
use raw::{Kind, RawRobot};
use server::config::{RawConfig, RawTls};
use std::{
    fs,
    io::Read,
    panic,
    process::Stdio,
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::{Duration, Instant},
};
use tempfile::TempDir;
use tests::{Child, Inside, SOON, command::waymark, http, pictures};

/// At the bound of one part of a key on the wire, beyond it, and beyond two.
const LENGTHS: [usize; 3] = [65_535, 65_536, 200_000];

static PANICS: AtomicU64 = AtomicU64::new(0);

fn count_panics() {
    let before = panic::take_hook();
    panic::set_hook(Box::new(move |what| {
        PANICS.fetch_add(1, Ordering::Relaxed);
        before(what);
    }));
}

/// Keys of a length: below what the robot `r1` writes and hears, of a map, of a server, of another
/// robot, of none.
fn keys(length: usize) -> Vec<String> {
    let shapes = [
        ("robot/r1/frame/", ""),
        ("robot/r1/answer/", ""),
        ("robot/r1/alive/", ""),
        ("robot/r1/rpc/", ""),
        ("robot/", "/frame"),
        ("robot/", "/rpc/hello"),
        ("map/", "/version"),
        ("map/", "/changed"),
        ("server/a/serves/", ""),
        ("server/", "/alive/*"),
    ];
    let long = |(before, after): (&str, &str)| {
        let before = format!("waymark/1/default/{before}");
        let middle = "a".repeat(length - before.len() - after.len());
        format!("{before}{middle}{after}")
    };
    shapes.map(long).to_vec()
}

/// A frame of the robot is answered, and the server is ready.
async fn is_served(robot: &RobotClient, inside: &Inside) {
    let capture = Capture::encoded(pictures::picture(5)).expect("a picture").with_deadline_ms(60_000);
    let answer = robot.recognise("front", capture, SOON).await.expect("an answer");
    assert_eq!(answer.status(), v1::Status::NoMatch);
    let ready = http(&inside.url()).await.get(format!("{}/readyz", inside.url())).send().await;
    assert_eq!(ready.expect("an answer").status().as_u16(), 200);
}

#[tokio::test(flavor = "multi_thread")]
async fn long_keys_of_a_robot_disturb_no_other() {
    count_panics();
    for enabled in [true, false] {
        let tls = RawTls { enabled, ..RawTls::default() };
        let inside = Inside::start_with(RawConfig { tls, ..RawConfig::default() }).await;
        let folders = TempDir::new().expect("a folder");
        inside.maps().create_map(&NewMap::new("hall")).await.expect("a map");
        let options = async |robot: &str| {
            inside.maps().put_robot(robot, "hall").await.expect("a robot");
            if !enabled {
                return RobotOptions::new(inside.server.zenoh_endpoint.clone(), "default", robot);
            }
            let out = folders.path().join(robot);
            let run = waymark(
                ["robot", "enrol", robot, "--out", out.to_str().expect("a path"), "--server", &inside.url()],
                SOON,
            );
            assert_eq!(run.status, 0, "{run:?}");
            RobotOptions::from_file(out.join("robot.json")).expect("the robot's file")
        };
        let (hostile, other) = (options("r1").await, options("r2").await);
        let other = RobotOptions { timeout: SOON, ..other };
        let other = RobotClient::connect(&other).await.expect("connected");
        is_served(&other, &inside).await;
        for kind in Kind::ALL {
            let (endpoint, tls) = (hostile.endpoint.clone(), hostile.tls.clone());
            let said = tokio::task::spawn_blocking(move || said(&endpoint, tls.as_ref(), kind));
            said.await.expect("said");
            is_served(&other, &inside).await;
            assert_eq!(PANICS.load(Ordering::Relaxed), 0, "panics after {kind:?}");
        }
        if enabled {
            // Whoever runs the server sees it, too.
            let activity = inside.maps().robot("r1").await.expect("the robot").activity.expect("activity");
            let [connections] = activity.inputs.as_slice() else { panic!("{activity:?}") };
            let [why] = connections.reasons.as_slice() else { panic!("{connections:?}") };
            assert_eq!((connections.input.as_str(), why.code.as_str()), ("connection", "long_key"));
            assert!(why.count >= 12 && !why.advice.is_empty(), "{why:?}");
        }
        inside.server.stop().await;
    }
}

/// Says one kind of thing about keys of all lengths and of all shapes, each in a session of its
/// own. Each is told that it ends.
fn said(endpoint: &str, tls: Option<&RobotTls>, kind: Kind) {
    let of_all_lengths = LENGTHS.iter().flat_map(|length| keys(*length).into_iter().take(1));
    let keys = of_all_lengths.chain(keys(LENGTHS[1]).into_iter().skip(1));
    for (id, key) in keys.enumerate() {
        // Zeros at the end of an id are left out of it.
        let mut robot = RawRobot::connect(id as u128 | 1 << 127, endpoint, tls);
        robot.say(kind, &key);
        assert!(robot.is_told_off(), "{kind:?} of {} bytes is taken", key.len());
    }
}

/// Over the socket of the server's own router, which its own user alone can reach.
#[test]
fn a_panic_inside_zenoh_ends_the_program_with_its_cause() {
    let (data, temporary) = (TempDir::new().expect("a folder"), TempDir::new().expect("a folder"));
    let mut command = Child::command(data.path(), &[]);
    let mut server = Child::start_from(command.stderr(Stdio::piped()).env("TMPDIR", temporary.path()));
    let mut log = server.stderr();
    let folders = fs::read_dir(temporary.path()).expect("read");
    let mut sockets = folders.map(|folder| folder.expect("a folder").path().join("router"));
    let socket = sockets.find(|socket| socket.exists()).expect("the router's socket");
    let key = format!("waymark/1/default/robot/{}/rpc/hello", "a".repeat(70_000));
    let mut hostile = RawRobot::connect_inside(1 << 127, &socket);
    hostile.say(Kind::AggregateInterest, &key);
    hostile.say(Kind::Queryable, &key);
    hostile.say(Kind::Put, &key);
    let mut other = RawRobot::connect_inside(1 << 127 | 1, &socket);
    other.say(Kind::Query, "waymark/1/default/robot/*/rpc/hello");
    let until = Instant::now() + SOON;
    let status = loop {
        if let Some(status) = server.ended() {
            break status;
        }
        assert!(Instant::now() < until, "it goes on: this version of zenoh sends such keys");
        thread::sleep(Duration::from_millis(20));
    };
    let mut said = String::new();
    log.read_to_string(&mut said).expect("a log");
    assert_eq!(status.code(), Some(1), "{said}");
    assert!(said.contains("zenoh_panicked"), "{said}");
}
