//! Claim: a robot of ROS 2 is served on its own topics, without a bridge process or with
//! zenoh-bridge-ros2dds. Its images get the answers that a native robot gets for the same data;
//! poses and transforms come back as ROS has them; a publisher that waits for a subscriber is
//! woken; what is no message of the robot changes nothing and is counted.

mod encrypted;
mod run;

use map::pose2::Pose2;
use protos::v1;
use reqwest::Method;
use ros2::messages::{Detection2DArray, Message, PoseWithCovarianceStamped, TFMessage};
use run::{IMAGES, OPTICAL, RAW_IMAGES, Run, now_ns, odometry, pose2};
use server::config::{Config, RawConfig, RawRos2Camera};
use sim::{
    drive::DriveParams,
    robot::{Robot, RobotParams},
};
use tests::{
    documents::root,
    eventually,
    robots::{call, teach},
    ros::{
        COMPRESSED_IMAGE, DETECTIONS, IMAGE, ODOMETRY, POSE, RosRobot, Speech, TF_MESSAGE, encrypted_router,
    },
};

/// Frames with the landmark that are compared.
const FRAMES: usize = 5;
/// Largest difference between answers to the same data, metres, radians and pixels.
const SAME: f64 = 1e-6;

/// Both robots got the same answer.
fn compare(ros: &v1::Answer, native: &v1::Answer) {
    assert_eq!((ros.status(), &ros.rejection), (native.status(), &native.rejection));
    assert_eq!(ros.quads.len(), native.quads.len());
    for (ros, native) in ros.quads.iter().zip(&native.quads) {
        assert_eq!((&ros.landmark, ros.verdict), (&native.landmark, native.verdict));
        let corners = ros.corners.iter().zip(&native.corners);
        assert!(corners.clone().all(|(a, b)| (a.u_px - b.u_px).hypot(a.v_px - b.v_px) < SAME));
    }
    let fix = |answer: &v1::Answer| {
        answer.map_from_robot.clone().map(|fix| (fix.pose.expect("a pose"), fix.covariance))
    };
    match (fix(ros), fix(native)) {
        (Some((a, covariance)), Some((b, other))) => {
            let off = [a.x_m - b.x_m, a.y_m - b.y_m, a.theta_rad - b.theta_rad];
            assert!(off.iter().all(|d| d.abs() < SAME), "{off:?}");
            assert!(covariance.iter().zip(&other).all(|(a, b)| (a - b).abs() < SAME));
        }
        (None, None) => {}
        other => panic!("one robot has a fix: {other:?}"),
    }
}

/// Drives past the landmark; compares the answers of both robots. Capture times of the frames with
/// a fix, and the fixes.
async fn drive(run: &mut Run, suffixes: [&str; 2], with_raw: bool) -> Vec<(i64, v1::Pose2)> {
    let params = DriveParams { start_m: 9.0, ..DriveParams::default() };
    let mut robot =
        Robot::new(run.building.clone(), &RobotParams { drive: params, ..RobotParams::default() });
    let (mut shown, mut fixes) = (0, Vec::new());
    while shown < FRAMES {
        let step = robot.drive_mut().next().expect("a drive past the landmark");
        let is_aimed = step.target.as_deref() == Some("poster-0");
        let readings = robot.look(&step);
        let ns = run.show(&readings, suffixes[shown % 2], is_aimed).await;
        if !is_aimed {
            continue;
        }
        shown += 1;
        let (ros, native) =
            (run.native.seen.answer("r1", ns).await, run.native.seen.answer("native", ns).await);
        compare(&ros, &native);
        if let Some(pose) = ros.map_from_robot.and_then(|fix| fix.pose) {
            let truth = &readings.step.map_from_robot;
            assert!((pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m) < 0.5, "{pose:?} at {truth:?}");
            fixes.push((ns, pose));
        }
        if with_raw && shown == FRAMES {
            let ns = run.show(&readings, "", false).await;
            run.show_raw(&readings, ns).await;
            let (ros, native) =
                (run.native.seen.answer("r1", ns).await, run.native.seen.answer("native", ns).await);
            compare(&ros, &native);
            assert!(!ros.quads.is_empty(), "nothing to compare");
            fixes.extend(ros.map_from_robot.and_then(|fix| fix.pose).map(|pose| (ns, pose)));
        }
    }
    assert!(fixes.len() >= 2, "{} of {shown} frames gave a fix", fixes.len());
    fixes
}

/// The poses that the robot got, in order, by capture time.
async fn poses(ros: &RosRobot, topic: &str, count: usize) -> Vec<(i64, v1::Pose2)> {
    let heard = ros.hears(topic, count).await;
    let poses = heard.iter().map(|heard| {
        let message = PoseWithCovarianceStamped::decode(&heard.payload).expect("a pose");
        assert_eq!(message.header.frame_id, "map");
        assert!(message.pose.covariance[0] > 0.0 && message.pose.covariance[35] > 0.0);
        let (position, q) = (message.pose.pose.position, message.pose.pose.orientation);
        let pose = v1::Pose2 { x_m: position.x, y_m: position.y, theta_rad: 2.0 * q.z.atan2(q.w) };
        (message.header.stamp.to_ns(), pose)
    });
    poses.collect()
}

fn off_m(a: &v1::Pose2, b: &v1::Pose2) -> f64 {
    (a.x_m - b.x_m).hypot(a.y_m - b.y_m)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_with_rmw_zenoh_is_served_on_its_topics() {
    let mut run = Run::start(Speech::Rmw(7), |robot| {
        (robot.initial_pose, robot.map_to_odom) = ("/initialpose".into(), true);
        let raw = RawRos2Camera {
            name: "raw".into(),
            image: RAW_IMAGES.into(),
            compressed: false,
            ..RawRos2Camera::default()
        };
        robot.camera.push(raw);
    })
    .await;
    teach(&run.inside, &run.building, &["poster-0"], 6).await;
    run.announce().await;
    for (topic, kind) in
        [("/waymark/pose", POSE), ("/initialpose", POSE), ("/waymark/detections", DETECTIONS)]
    {
        run.ros.listen(topic, kind).await;
        run.ros.declare("MS", topic, kind).await;
    }
    // The camera begins when a subscription has its topic, type and hash.
    let image = format!("sensor_msgs::msg::dds_::CompressedImage_/{}", COMPRESSED_IMAGE.hash);
    let woken = run.ros.sees(&["/MS/", "%camera%image_raw%compressed", &image]).await;
    assert!(woken.ends_with("/backends:cpu:"), "{woken}");
    run.ros.sees(&["@ros2_lv/7/", "/NN/%/%/waymark_r1"]).await;
    run.ros.sees(&["/MP/%/%/waymark_r1/%tf/", TF_MESSAGE.hash]).await;
    run.ros.sees(&["/MP/", "/%initialpose/", POSE.hash]).await;
    run.ros.listen("/tf", TF_MESSAGE).await;

    let fixes = drive(&mut run, ["", "/_buf_cpu"], true).await;
    let sent = poses(&run.ros, "/waymark/pose", fixes.len()).await;
    assert_eq!(sent.len(), fixes.len());
    for ((ns, fix), (stamp_ns, pose)) in fixes.iter().zip(&sent) {
        assert!(ns == stamp_ns && off_m(fix, pose) < SAME, "{fix:?} {pose:?}");
    }
    for (i, heard) in run.ros.heard("/waymark/pose").iter().enumerate() {
        let attachment = heard.attachment.as_ref().expect("ROS drops messages without one");
        assert_eq!((attachment.len(), attachment[16]), (33, 16));
        assert_eq!(attachment[..8], (i as i64 + 1).to_le_bytes());
    }
    let detections = run.ros.hears("/waymark/detections", FRAMES).await;
    let named = detections.iter().any(|heard| {
        let message = Detection2DArray::decode(&heard.payload).expect("detections");
        assert_eq!(message.header.frame_id, OPTICAL);
        message.detections.iter().any(|d| d.results[0].class_id == "poster-0")
    });
    assert!(named);
    assert_eq!(poses(&run.ros, "/initialpose", 1).await.len(), 1, "once, for nothing jumped");
    check_transforms(&run).await;
    let status = run.status().await;
    assert_eq!(status.reasons.get("/scan"), None, "{status:?}");
    assert_eq!((status.sent["/waymark/pose"], status.sent["/initialpose"]), (fixes.len() as u64, 1));
    let (_, log) = call(&run.inside, Method::GET, "/robots/r1/corrections", None).await;
    assert!(log["totals"]["laser"].is_object(), "scans found the walls: {log}");
    run.stop().await;
}

/// Waits until a pose of the robot that is like this one was published for this time.
async fn was_published(run: &Run, ns: i64, pose: &v1::Pose2) {
    let found = || async {
        let published = run.native.seen.poses.lock().expect("not poisoned");
        let same = published.iter().filter(|(robot, p)| robot == "r1" && p.captured_ns == ns);
        let mut same = same.filter_map(|(_, p)| p.map_from_robot.as_ref()?.pose);
        same.any(|p| off_m(&p, pose) < SAME && (p.theta_rad - pose.theta_rad).abs() < SAME).then_some(())
    };
    eventually(&format!("{pose:?} is a fused pose"), found).await;
}

/// `map` to `odom`, with the odometry of its time, is a pose that Waymark published.
async fn check_transforms(run: &Run) {
    let mut last_ns = 0;
    let mut count = 0;
    for heard in run.ros.hears("/tf", 2).await {
        let message = TFMessage::decode(&heard.payload).expect("transforms");
        let sent = message.transforms[0];
        if sent.header.frame_id != "map" {
            continue;
        }
        assert_eq!((sent.child_frame_id, message.transforms.len()), ("odom", 1));
        let stamp_ns = sent.header.stamp.to_ns();
        assert!(stamp_ns > last_ns, "tf2 refuses a stamp twice");
        (last_ns, count) = (stamp_ns, count + 1);
        let captured_ns = stamp_ns - 1_000_000_000;
        let odometry =
            run.odometry.iter().find(|(ns, _)| *ns == captured_ns).expect("stamped by the odometry");
        let (t, q) = (sent.transform.translation, sent.transform.rotation);
        let map_from_odom = Pose2::new(t.x, t.y, 2.0 * q.z.atan2(q.w));
        was_published(run, captured_ns, &pose2(&map_from_odom.compose(&odometry.1))).await;
    }
    assert!(count >= 2, "{count} transforms");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_behind_a_dds_bridge_is_served_on_its_topics() {
    let mut run =
        Run::start(Speech::Bridge("bot1"), |robot| robot.pose_source = server::config::PoseSource::Fused)
            .await;
    teach(&run.inside, &run.building, &["poster-0"], 6).await;
    run.announce().await;
    run.ros.listen("/waymark/pose", POSE).await;
    // Present by its tokens, before any message.
    let is_there = || async {
        let (_, robot) = call(&run.inside, Method::GET, "/robots/r1", None).await;
        (robot["alive"] == true).then_some(())
    };
    eventually("the robot is there", is_there).await;
    run.is_heard().await;
    drive(&mut run, ["", ""], false).await;
    for (stamp_ns, pose) in poses(&run.ros, "/waymark/pose", 1).await {
        was_published(&run, stamp_ns, &pose).await;
    }
    assert!(run.ros.heard("/waymark/pose").iter().all(|heard| heard.attachment.is_none()));
    run.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_message_of_the_robot_changes_nothing() {
    let mut run = Run::start(Speech::Rmw(7), |_| ()).await;
    run.announce().await;
    run.ros.sees(&["/MS/", "%odom/"]).await;
    let good = odometry(now_ns(), &Pose2::default()).encode();
    let key = run.ros.key("/odom", ODOMETRY);
    let attachment = run.ros.attachment("/odom");
    run.ros.put_raw(&key, good[..good.len() - 9].to_vec(), attachment.clone()).await;
    run.ros.put_raw(&key, Vec::new(), attachment.clone()).await;
    run.ros.put_raw(&key, good.clone(), Some(vec![1, 2, 3])).await;
    let other_hash = key.replace("RIHS01_3cc9", "RIHS01_3cc8");
    run.ros.put_raw(&other_hash, good.clone(), attachment.clone()).await;
    // Not its topics: another domain, and another type on the same topic.
    run.ros.put_raw(&key.replacen('7', "8", 1), good.clone(), attachment.clone()).await;
    run.ros.put_raw(&run.ros.key("/odom", IMAGE), good.clone(), attachment.clone()).await;
    run.ros.put_raw(&run.ros.key(IMAGES, COMPRESSED_IMAGE), good.clone(), attachment.clone()).await;
    run.ros.declare("MP", "/scan", TF_MESSAGE).await;

    let counted = || async {
        let reasons = run.status().await.reasons;
        let of = |topic: &str, word: &str| reasons.get(topic)?.get(word).copied();
        let odometry = ["bad_payload", "bad_attachment", "other_definition"].map(|word| of("/odom", word));
        let others = [of(IMAGES, "bad_payload"), of("/scan", "other_type")];
        (odometry == [Some(2), Some(1), Some(1)] && others == [Some(1); 2]).then_some(())
    };
    eventually("every reason is counted", counted).await;
    let received = run.status().await.received;
    assert_eq!(received["/odom"], 4, "another domain and another type are not the robot's");
    assert_eq!(run.inside.server.slots.counts().received, 0);
    run.ros.put_raw(&key, good, attachment).await;
    let goes_on = || async { (run.status().await.received["/odom"] == 5).then_some(()) };
    eventually("good odometry is read", goes_on).await;
    assert_eq!(run.reasons("/odom", "bad_payload").await, 2);
    run.stop().await;
}

/// The settings that the guide shows are taken, by the server and by zenoh.
#[test]
fn settings_of_the_guide_are_understood() {
    let folder = tempfile::tempdir().expect("a folder");
    let guide = std::fs::read_to_string(root().join("docs/guides/ros2.md")).expect("the guide");
    let texts = guide.split("```toml").skip(1).filter_map(|rest| rest.split("```").next());
    let blocks = texts.filter_map(|text| Some(text.split_once('\n')?.1));
    let mut robots = 0;
    for block in blocks {
        let path = folder.path().join("waymark.toml");
        std::fs::write(&path, block).expect("written");
        let raw = RawConfig::read(Some(&path)).expect("settings");
        robots += Config::try_from(raw).expect("valid settings").ros2.len();
    }
    assert_eq!(robots, 3);
    let router = std::fs::read_to_string(root().join("client/ros2/router.json5")).expect("a file");
    let router = zenoh::Config::from_json5(&router).expect("settings of zenoh");
    assert!(router.get_json("connect/endpoints").expect("endpoints").contains("tcp/maps.example:7447"));
    let places = router.get_json("transport/link/tx/queue/size/interactive_high");
    assert_eq!(places.expect("room for the messages of a frame"), "8");
    // The encrypted one is the same otherwise; tests connect with it.
    let encrypted = encrypted_router("tls/127.0.0.1:1", "tcp/127.0.0.1:1", folder.path());
    for key in ["mode", "connect/exit_on_failure", "transport/link/tx/queue/size/interactive_high"] {
        assert_eq!(encrypted.get_json(key).expect(key), router.get_json(key).expect(key), "{key}");
    }
    assert_eq!(encrypted.get_json("transport/link/tls/enable_mtls").expect("a switch"), "true");
}
