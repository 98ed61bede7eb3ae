//! Behind the encrypted endpoint: a robot of ROS is served below its prefix with its certificate,
//! and that of another robot reaches nothing there, kind of message by kind of message.

use super::{
    drive, poses,
    run::{IMAGES, Run, enrol},
};
use client::api::NewMap;
use server::config::{RawConfig, RawRos2, RawRos2Robot, RawTls};
use std::{
    collections::BTreeSet,
    sync::{Arc, Mutex},
    time::Duration,
};
use tempfile::TempDir;
use tests::{
    Inside, eventually,
    robots::{call, teach},
    ros::{COMPRESSED_IMAGE, POSE, encrypted_router, free_endpoint},
};
use zenoh::{Session, Wait};

/// What a robot's nodes call their namespace, and the server `key_prefix`.
const PREFIX: &str = "robots/r1";
/// Time after which what was sent has arrived, where it may: everything of one session goes one
/// way.
const ARRIVED: Duration = Duration::from_millis(500);

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_of_ros_with_a_certificate_is_served_below_its_prefix() {
    let mut run = Run::start_encrypted(7, PREFIX, |robot| robot.initial_pose = "/initialpose".into()).await;
    teach(&run.inside, &run.building, &["poster-0"], 6).await;
    run.announce().await;
    for topic in ["/waymark/pose", "/initialpose"] {
        run.ros.listen(topic, POSE).await;
        run.ros.declare("MS", topic, POSE).await;
    }
    // Its nodes see the server's, and know no prefix.
    let image = format!("sensor_msgs::msg::dds_::CompressedImage_/{}", COMPRESSED_IMAGE.hash);
    let woken = run.ros.sees(&["/MS/", &IMAGES.replace('/', "%"), &image]).await;
    assert!(woken.starts_with("@ros2_lv/7/"), "{woken}");
    run.ros.sees(&["@ros2_lv/7/", "/NN/%/%/waymark_r1"]).await;
    run.is_heard().await;
    let fixes = drive(&mut run, ["", ""], false).await;
    let sent = poses(&run.ros, "/waymark/pose", fixes.len()).await;
    let stamps = |all: &[(i64, protos::v1::Pose2)]| all.iter().map(|(ns, _)| *ns).collect::<Vec<_>>();
    assert_eq!(stamps(&sent), stamps(&fixes));
    assert_eq!(poses(&run.ros, "/initialpose", 1).await.len(), 1);
    // A certificate that is revoked ends it: what still arrives is not taken.
    let maps = run.inside.maps();
    let serial = maps.robot_certificates("r1").await.expect("certificates")[0].serial.clone();
    maps.revoke_robot_certificate("r1", &serial).await.expect("revoked");
    let gone = || async {
        let (_, robot) = call(&run.inside, reqwest::Method::GET, "/robots/r1", None).await;
        (robot["alive"] == false).then_some(())
    };
    eventually("the robot is gone", gone).await;
    assert!(run.certificates.is_some());
    run.stop().await;
}

/// Keys of ROS below a prefix, one of each kind: data, what keeps data, and the tokens of the
/// graph.
fn keys(prefix: &str) -> [String; 3] {
    let topic = "7/odom/nav_msgs::msg::dds_::Odometry_/RIHS01_3cc9";
    [
        format!("{prefix}/{topic}"),
        format!("{prefix}/{topic}/@adv/pub/abc/3/_"),
        format!(
            "{prefix}/@ros2_lv/7/abc/0/10/MP/%/%/robot/%odom/nav_msgs::msg::dds_::Odometry_/RIHS01_3cc9/::,10:,:,:,,"
        ),
    ]
}

/// A server with robots of ROS `r1` and `r2`, each below its prefix.
struct Two {
    inside: Inside,
    /// Hears and says everything.
    everything: Session,
    /// What the robot `r1` has: a router of its own.
    r1: Session,
    own: [String; 3],
    all: Vec<String>,
    _folders: TempDir,
}

impl Two {
    async fn start() -> Self {
        let local = free_endpoint();
        let robot = |name: &str| RawRos2Robot {
            robot: name.into(),
            domain: 7,
            key_prefix: format!("robots/{name}"),
            ..RawRos2Robot::default()
        };
        let raw = RawConfig {
            tls: RawTls { enabled: true, local_zenoh: local.clone(), ..RawTls::default() },
            ros2: RawRos2 { robot: vec![robot("r1"), robot("r2")] },
            ..RawConfig::default()
        };
        let inside = Inside::start_with(raw).await;
        let folders = TempDir::new().expect("a folder");
        inside.maps().create_map(&NewMap::new("hall")).await.expect("a map");
        for robot in ["r1", "r2"] {
            inside.maps().put_robot(robot, "hall").await.expect("a robot");
            enrol(&inside, robot, &folders);
        }
        let config = format!(
            r#"{{ mode: "client", connect: {{ endpoints: ["{local}"] }}, scouting: {{ multicast: {{ enabled: false }} }} }}"#
        );
        let everything =
            zenoh::open(zenoh::Config::from_json5(&config).expect("settings")).await.expect("a session");
        let folder = folders.path().join("r1");
        let settings = encrypted_router(&inside.server.zenoh_endpoint, &free_endpoint(), &folder);
        let r1 = zenoh::open(settings).await.expect("a session");
        let (own, foreign) = (keys("robots/r1"), keys("robots/r2"));
        // And where no prefix is: keys of robots of ROS without one, and of Waymark.
        let bare = keys("robots").into_iter().chain(["7/odom/x".to_owned(), "@ros2_lv/7/abc/x".to_owned()]);
        let all = own.iter().chain(&foreign).cloned().chain(bare).collect();
        Self { inside, everything, r1, own, all, _folders: folders }
    }

    async fn stop(self) {
        self.r1.close().await.expect("closed");
        self.everything.close().await.expect("closed");
        self.inside.server.stop().await;
    }
}

type Noted = Arc<Mutex<BTreeSet<String>>>;

fn seen(seen: &Noted) -> BTreeSet<String> {
    seen.lock().expect("not poisoned").clone()
}

/// What of these keys reaches `to`, when `from` says it again and again: puts, deletions and
/// tokens, by a subscriber of each. Each finding begins with its kind.
async fn passes(from: &Session, to: &Session, keys: &[String], enough: usize) -> BTreeSet<String> {
    let found = Noted::default();
    let mut held = Vec::new();
    for key in keys {
        let noted = found.clone();
        let note = move |sample: zenoh::sample::Sample| {
            let found = format!("{:?} {}", sample.kind(), sample.key_expr());
            noted.lock().expect("not poisoned").insert(found);
        };
        held.push(to.declare_subscriber(key).callback(note).await.expect("a subscriber"));
        let noted = found.clone();
        let note = move |sample: zenoh::sample::Sample| {
            let found = format!("token {}", sample.key_expr());
            noted.lock().expect("not poisoned").insert(found);
        };
        let tokens = to.liveliness().declare_subscriber(key).history(true).callback(note);
        held.push(tokens.await.expect("a subscriber of tokens"));
    }
    let mut tokens = Vec::new();
    for key in keys {
        tokens.push(from.liveliness().declare_token(key).await.expect("a token"));
    }
    let said = || async {
        for key in keys {
            from.put(key, "x").await.expect("put");
            from.delete(key).await.expect("delete");
        }
        (seen(&found).len() >= enough).then_some(())
    };
    eventually("what may pass", said).await;
    tokio::time::sleep(ARRIVED).await;
    seen(&found)
}

/// Puts, deletions and tokens of these keys.
fn all_kinds(keys: &[String]) -> BTreeSet<String> {
    let kinds = |key: &String| ["Put", "Delete", "token"].map(|kind| format!("{kind} {key}"));
    keys.iter().flat_map(kinds).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_of_ros_writes_and_reads_below_its_own_prefix_alone() {
    let two = Two::start().await;
    let own = all_kinds(&two.own);
    assert_eq!(passes(&two.r1, &two.everything, &two.all, own.len()).await, own, "what r1 writes");
    assert_eq!(passes(&two.everything, &two.r1, &two.all, own.len()).await, own, "what r1 reads");
    // Patterns over all robots give no more.
    for pattern in ["**", "robots/**", "robots/*/7/**", "robots/*/@ros2_lv/**", "@ros2_lv/**"] {
        let (found, noted) = (Noted::default(), Noted::default());
        let to = noted.clone();
        let subscriber = two.r1.declare_subscriber(pattern).callback(move |sample| {
            to.lock().expect("not poisoned").insert(sample.key_expr().as_str().to_owned());
        });
        let _subscriber = subscriber.await.expect("a subscriber");
        let to = found.clone();
        let tokens = two.r1.liveliness().declare_subscriber(pattern).history(true).callback(move |sample| {
            to.lock().expect("not poisoned").insert(sample.key_expr().as_str().to_owned());
        });
        let _tokens = tokens.await.expect("a subscriber of tokens");
        let _token = two.everything.liveliness().declare_token(&two.all[5]).await.expect("a token");
        for key in &two.all {
            two.everything.put(key, "x").await.expect("put");
        }
        tokio::time::sleep(ARRIVED).await;
        let others = |all: &Noted| {
            seen(all).into_iter().filter(|key| !key.starts_with("robots/r1/")).collect::<Vec<_>>()
        };
        assert_eq!((others(&noted), others(&found)), (Vec::new(), Vec::new()), "{pattern}");
    }
    two.stop().await;
}

async fn is_answered(asks: &Session, key: &str) -> bool {
    let replies = asks.get(key).timeout(Duration::from_secs(2)).await.expect("a query");
    replies.recv_async().await.is_ok_and(|reply| reply.result().is_ok())
}

/// Which of these keys `asks` gets an answer on, when `answers` has a queryable on each.
async fn answered(asks: &Session, answers: &Session, keys: &[String], own: &[String]) -> BTreeSet<String> {
    let mut held = Vec::new();
    for key in keys {
        let reply = key.clone();
        let queryable = answers.declare_queryable(key).callback(move |query| {
            // Refused where access control says so: that is what is counted on the other side.
            drop(query.reply(&reply, "x").wait());
        });
        held.push(queryable.await.expect("a queryable"));
    }
    // Once all of its own are answered, the others would be.
    for key in own {
        eventually(key, || async { is_answered(asks, key).await.then_some(()) }).await;
    }
    let mut found = BTreeSet::new();
    for key in keys {
        if is_answered(asks, key).await {
            found.insert(key.clone());
        }
    }
    found
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_of_ros_asks_and_answers_below_its_own_prefix_alone() {
    let two = Two::start().await;
    let own: BTreeSet<String> = two.own.iter().cloned().collect();
    assert_eq!(answered(&two.r1, &two.everything, &two.all, &two.own).await, own, "what r1 is answered");
    assert_eq!(answered(&two.everything, &two.r1, &two.all, &two.own).await, own, "what r1 answers");
    // Tokens are asked for, too.
    let mut held = Vec::new();
    for key in &two.all {
        held.push(two.everything.liveliness().declare_token(key).await.expect("a token"));
    }
    let there = || async {
        let mut there = BTreeSet::new();
        for key in &two.all {
            let replies =
                two.r1.liveliness().get(key).timeout(Duration::from_secs(2)).await.expect("a query");
            while let Ok(reply) = replies.recv_async().await {
                there.extend(reply.result().ok().map(|sample| sample.key_expr().as_str().to_owned()));
            }
        }
        (there.len() >= own.len()).then_some(there)
    };
    assert_eq!(eventually("tokens", there).await, own, "tokens that r1 is told of");
    drop(held);
    two.stop().await;
}
