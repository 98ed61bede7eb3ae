//! Which settings are read, from where, and which are refused.

use super::*;
use std::collections::BTreeSet;
use vision::model::MAX_LANDMARKS;

/// Paths of all keys, such as `limits.maps`. `algorithm` is one key: the method's pages list its
/// parameters.
fn keys(settings: &serde_json::Value, prefix: &str) -> BTreeSet<String> {
    let entries = settings.as_object().into_iter().flatten();
    let nested = |(name, value): (&String, &serde_json::Value)| {
        let path = format!("{prefix}{name}");
        if value.is_object() && path != "algorithm" {
            keys(value, &format!("{path}."))
        } else {
            BTreeSet::from([path])
        }
    };
    entries.flat_map(nested).collect()
}

#[test]
fn the_example_file_names_every_setting_with_its_default() {
    let example = || Figment::from(Toml::string(include_str!("../../config.example.toml")));
    let read: RawConfig = example().extract().unwrap();
    assert_eq!(read, RawConfig::default());
    let named: serde_json::Value = example().extract().unwrap();
    let all = serde_json::to_value(RawConfig::default()).unwrap();
    assert_eq!(keys(&named, ""), keys(&all, ""));
    assert!(keys(&all, "").len() > 30, "the settings are no longer read");
}

/// A preset is what `algorithm` changes: the file's values stay, all others are the preset's.
#[test]
fn a_preset_is_changed_by_what_the_file_names() {
    let read = |preset: Option<Preset>, text: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("waymark.toml");
        std::fs::write(&path, text).unwrap();
        RawConfig::read_over(preset, Some(&path))
    };
    assert_eq!(read(None, "").unwrap().algorithm, Params::default());
    let paper = read(None, "preset = \"paper\"\n").unwrap();
    assert_eq!((paper.preset, &paper.algorithm), (Preset::Paper, &Preset::Paper.params()));
    let changed = "preset = \"paper\"\n[algorithm.recognise.verdict]\nmargin = 0.5\n";
    let mut expected = Preset::Paper.params();
    expected.recognise.verdict.margin = 0.5;
    assert_eq!(read(None, changed).unwrap().algorithm, expected);
    assert_eq!(read(Some(Preset::Paper), "").unwrap().algorithm, Preset::Paper.params());
    assert_eq!(read(Some(Preset::Default), "preset = \"paper\"\n").unwrap().algorithm, Params::default());
    let error = read(None, "preset = \"papers\"\n").unwrap_err().to_string();
    assert!(error.contains("papers") && error.contains("preset"), "{error}");
}

#[test]
fn the_example_file_shows_every_setting_of_a_robot_of_ros_with_its_default() {
    let lines = include_str!("../../config.example.toml").lines();
    let shown = lines.skip_while(|line| *line != "# [[ros2.robot]]").take_while(|line| line.starts_with('#'));
    let shown: Vec<&str> = shown.map(|line| line.trim_start_matches(['#', ' '])).collect();
    let shown = shown.join("\n");
    let read: RawConfig = Figment::from(Toml::string(&shown)).extract().unwrap();
    assert_eq!(read.ros2.robot, [RawRos2Robot::default()]);
    let named: serde_json::Value = Figment::from(Toml::string(&shown)).extract().unwrap();
    let all = serde_json::to_value(RawRos2 { robot: vec![RawRos2Robot::default()] }).unwrap();
    for (named, all) in [
        (&named["ros2"]["robot"][0], &all["robot"][0]),
        (&named["ros2"]["robot"][0]["camera"][0], &all["robot"][0]["camera"][0]),
    ] {
        assert_eq!(keys(named, ""), keys(all, ""));
        assert!(keys(all, "").len() >= 7);
    }
}

/// The settings with one robot, changed.
fn with_robot(change: impl FnOnce(&mut RawRos2Robot)) -> RawConfig {
    let mut robot = RawRos2Robot { robot: "r1".into(), ..RawRos2Robot::default() };
    change(&mut robot);
    RawConfig { ros2: RawRos2 { robot: vec![robot] }, ..RawConfig::default() }
}

#[test]
fn a_robot_of_ros_gets_absolute_topics() {
    let raw = with_robot(|r| {
        (r.namespace, r.key_prefix, r.odometry) = ("/r1/".into(), "/robots/r1".into(), String::new());
        (r.domain, r.map_to_odom, r.transform_tolerance_s) = (7, true, 0.5);
    });
    let robots = Config::try_from(raw).unwrap().ros2;
    let [robot] = robots.as_slice() else { panic!("{robots:?}") };
    assert_eq!(
        (robot.middleware, robot.key_prefix.as_str()),
        (Middleware::RmwZenoh { domain: 7 }, "robots/r1")
    );
    assert_eq!(robot.inputs.cameras[0].image, "/r1/camera/image_raw/compressed");
    assert_eq!((robot.inputs.tf.as_str(), &robot.inputs.odometry), ("/tf", &None));
    let outputs = Ros2Outputs {
        pose: Some(("/r1/waymark/pose".into(), PoseSource::Fixes)),
        initial_pose: None,
        detections: Some("/r1/waymark/detections".into()),
        map_to_odom_ahead_ns: Some(500_000_000),
    };
    assert_eq!(robot.outputs, outputs);
}

#[test]
fn bad_settings_of_a_robot_of_ros_are_named() {
    type Change = fn(&mut RawRos2Robot);
    let cases: [(&str, Change); 13] = [
        ("robot", |r| r.robot.clear()),
        ("domain", |r| r.domain = MAX_DOMAIN + 1),
        ("key_prefix", |r| r.key_prefix = "a/*".into()),
        ("key_prefix", |r| r.key_prefix = "a".repeat(MAX_KEY_PREFIX_BYTES + 1)),
        ("namespace", |r| r.namespace = "/a b".into()),
        ("scan", |r| r.scan = "1".into()),
        ("tf", |r| r.tf.clear()),
        ("base_frame", |r| r.base_frame = "/base_link".into()),
        ("pose", |r| r.pose = "/odom".into()),
        ("detections", |r| r.detections = r.pose.clone()),
        ("transform_tolerance_s", |r| r.transform_tolerance_s = f64::NAN),
        ("camera[0].name", |r| r.camera[0].name = "Front".into()),
        ("camera[1].name", |r| r.camera = vec![RawRos2Camera::default(); 2]),
    ];
    for (named, change) in cases {
        match Config::try_from(with_robot(change)) {
            Err(ConfigError::Invalid { field, .. }) => assert_eq!(field, format!("ros2.robot[0].{named}")),
            other => panic!("{named}: {other:?}"),
        }
    }
    let robot = |name: &str, domain| RawRos2Robot { robot: name.into(), domain, ..RawRos2Robot::default() };
    let refused =
        |robot| match Config::try_from(RawConfig { ros2: RawRos2 { robot }, ..RawConfig::default() }) {
            Err(ConfigError::Invalid { field, .. }) => Some(field.into_owned()),
            _ => None,
        };
    assert_eq!(refused(vec![robot("a", 0), robot("b", 1)]), None);
    assert_eq!(refused(vec![robot("a", 0), robot("b", 0)]), Some("ros2.robot[1].odometry".into()));
    assert_eq!(refused(vec![robot("a", 0), robot("a", 1)]), Some("ros2.robot[1].robot".into()));
    let many = |count: u32| (0..count).map(|i| robot(&format!("r{i}"), i)).collect::<Vec<_>>();
    assert_eq!(refused(many(MAX_ROS2_ROBOTS as u32)), None);
    assert_eq!(refused(many(MAX_ROS2_ROBOTS as u32 + 1)), Some("ros2.robot".into()));
}

#[test]
fn plain_text_beyond_loopback_is_refused() {
    let cases: [(&str, &str, &[&str]); 6] = [
        ("127.0.0.1:0", "tcp/[::1]:7447", &[]),
        ("127.9.9.9:80", "tcp/127.0.0.1:0", &[]),
        ("0.0.0.0:8080", "tcp/127.0.0.1:7447", &["http"]),
        ("[::]:8080", "tcp/192.168.1.4:7447", &["http", "zenoh"]),
        ("127.0.0.1:8080", "tcp/0.0.0.0:7447", &["zenoh"]),
        ("127.0.0.1:8080", "tcp/192.168.1.4:7447", &["zenoh"]),
    ];
    for (http, zenoh, reachable) in cases {
        let raw = RawConfig { http: http.into(), zenoh: zenoh.into(), ..RawConfig::default() };
        assert_eq!(Config::try_from(raw.clone()).is_ok(), reachable.is_empty(), "{http} {zenoh}");
        let trusted = Config::try_from(RawConfig { insecure: true, ..raw }).unwrap();
        let found = trusted.plain_text_beyond_loopback();
        assert_eq!(
            found.iter().map(|(setting, _)| *setting).collect::<Vec<_>>(),
            reachable,
            "{http} {zenoh}"
        );
    }
}

#[test]
fn an_encrypted_endpoint_may_be_reached_from_everywhere() {
    let with = |enabled, zenoh: &str| {
        let tls = RawTls { enabled, ..RawTls::default() };
        let raw = RawConfig { zenoh: zenoh.into(), tls, ..RawConfig::default() };
        Config::try_from(raw).map(|config| config.zenoh_endpoint)
    };
    assert_eq!(with(false, "").unwrap(), "tcp/127.0.0.1:7447");
    assert_eq!(with(true, "").unwrap(), "tls/127.0.0.1:7447");
    assert_eq!(with(true, "tls/0.0.0.0:7447").unwrap(), "tls/0.0.0.0:7447");
    assert!(matches!(with(true, "tcp/0.0.0.0:7447"), Err(ConfigError::NotLoopback { .. })));
    assert!(matches!(with(false, "tls/127.0.0.1:7447"), Err(ConfigError::Invalid { .. })));
}

#[test]
#[expect(clippy::large_stack_arrays, reason = "cases of a test")]
fn bad_settings_are_named() {
    let limits = |f: fn(&mut Limits)| {
        let mut limits = Limits::default();
        f(&mut limits);
        RawConfig { limits, ..RawConfig::default() }
    };
    for (raw, named) in [
        (RawConfig { http: "localhost:80".into(), ..RawConfig::default() }, "http"),
        (RawConfig { zenoh: "tcp/robot-host:7447".into(), ..RawConfig::default() }, "zenoh"),
        (RawConfig { zenoh: "udp/127.0.0.1:7447".into(), ..RawConfig::default() }, "zenoh"),
        (RawConfig { fleet: "A/B".into(), ..RawConfig::default() }, "fleet"),
        (RawConfig { workers: MAX_WORKERS + 1, ..RawConfig::default() }, "workers"),
        (limits(|l| l.landmarks = MAX_LANDMARKS + 1), "limits.landmarks"),
        (limits(|l| l.views = 0), "limits.views"),
        (limits(|l| l.robot_bytes_per_s = 0), "limits.robot_bytes_per_s"),
        (limits(|l| l.waiting_frame_bytes = l.frame_bytes - 1), "limits.waiting_frame_bytes"),
        (limits(|l| l.disk_percent = 0), "limits.disk_percent"),
        (limits(|l| l.disk_percent = 101), "limits.disk_percent"),
        (limits(|l| l.upload_pixels = vision::frame::MAX_AREA_PX + 1), "limits.upload_pixels"),
    ] {
        match Config::try_from(raw) {
            Err(ConfigError::Invalid { field, .. }) => assert_eq!(field, named),
            other => panic!("{named}: {other:?}"),
        }
    }
    let at_limit = RawConfig { workers: MAX_WORKERS, ..RawConfig::default() };
    assert_eq!(Config::try_from(at_limit).unwrap().workers, MAX_WORKERS);
}

#[test]
fn a_missing_file_and_an_unknown_setting_are_errors() {
    assert!(RawConfig::read(Some(Path::new("/nonexistent/waymark.toml"))).is_err());
    let unknown: Result<RawConfig, _> = Figment::from(Toml::string("colour = 3")).extract();
    assert!(unknown.is_err());
}
