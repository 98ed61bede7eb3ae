//! Which settings are read, from where, and which are refused.

use super::*;
use std::collections::BTreeSet;

/// Paths of all keys, such as `limits.maps`. `algorithm` is one key: the method's pages list its parameters.
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

#[test]
fn plain_text_beyond_loopback_is_refused() {
    for (http, zenoh, ok) in [
        ("127.0.0.1:0", "tcp/[::1]:7447", true),
        ("127.9.9.9:80", "tcp/127.0.0.1:0", true),
        ("0.0.0.0:8080", "tcp/127.0.0.1:7447", false),
        ("[::]:8080", "tcp/127.0.0.1:7447", false),
        ("127.0.0.1:8080", "tcp/0.0.0.0:7447", false),
        ("127.0.0.1:8080", "tcp/192.168.1.4:7447", false),
    ] {
        let raw = RawConfig { http: http.into(), zenoh: zenoh.into(), ..RawConfig::default() };
        assert_eq!(Config::try_from(raw.clone()).is_ok(), ok, "{http} {zenoh}");
        assert!(Config::try_from(RawConfig { insecure: true, ..raw }).is_ok());
    }
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
fn a_file_of_an_earlier_build_reads() {
    let dir = tempfile::tempdir().unwrap();
    let file = |text: &str| {
        let path = dir.path().join("waymark.toml");
        std::fs::write(&path, text).unwrap();
        RawConfig::read(Some(&path)).unwrap()
    };
    let quads = "[algorithm.detect.quads]";
    let earlier = file(&format!(
        "{quads}
grouping = \"hypotheses\"
hypotheses.min_support = 0.25
"
    ));
    let now = file(&format!(
        "{quads}
grouping = \"proposals\"
proposals.min_support = 0.25
"
    ));
    assert_eq!(earlier, now);
    assert!((now.algorithm.detect.quads.proposals.min_support - 0.25).abs() < 1e-12);
}

#[test]
fn a_missing_file_and_an_unknown_setting_are_errors() {
    assert!(RawConfig::read(Some(Path::new("/nonexistent/waymark.toml"))).is_err());
    let unknown: Result<RawConfig, _> = Figment::from(Toml::string("colour = 3")).extract();
    assert!(unknown.is_err());
}
