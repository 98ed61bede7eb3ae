//! The committed Rust and descriptors of the messages are what `waymark.proto` gives. After a change of the .proto run
//! `WAYMARK_REFRESH=1 cargo test -p protos --test generated`.

use prost::Message as _;
use std::{fs, path::Path};

/// Messages that also travel as JSON over HTTP.
const JSON: [&str; 20] = [
    "Hypothesis",
    "Pose3",
    "Pose2",
    "Pose2Covariance",
    "Rejection",
    "Point",
    "Candidate",
    "PointEvidence",
    "LandmarkPose",
    "CameraPose",
    "QuadAnswer",
    "StageTime",
    "PoseRefusalCause",
    "PoseRefusalDetail",
    "Answer",
    "RobotPose",
    "MapChanged",
    "Intrinsics",
    "Odometry",
    "Scan",
];

#[test]
fn committed_rust_matches_the_proto() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let out = tempfile::tempdir().unwrap();
    let messages = protox::compile(["waymark/v1/waymark.proto"], [root]).unwrap();
    let mut config = prost_build::Config::new();
    config.out_dir(out.path()).bytes(["."]);
    for message in JSON {
        let path = format!(".waymark.v1.{message}");
        config.type_attribute(&path, "#[derive(::serde::Serialize, ::serde::Deserialize)]");
        config.type_attribute(&path, "#[serde(default)]");
    }
    for (field, module) in [
        ("Answer.status", "status"),
        ("QuadAnswer.kind", "quad_kind"),
        ("QuadAnswer.verdict", "verdict"),
        ("QuadAnswer.sighting", "sighting"),
        ("RobotPose.trust", "pose_trust"),
        ("PointEvidence.agreement", "part_agreement"),
        ("PoseRefusalCause.quantity", "fix_quantity"),
    ] {
        let attribute = format!("#[serde(with = \"crate::json::{module}\")]");
        config.field_attribute(format!(".waymark.v1.{field}"), attribute);
    }
    // The comments are for people, not for programs that read a recording.
    let mut described = messages.clone();
    described.file.iter_mut().for_each(|file| file.source_code_info = None);
    config.compile_fds(messages).unwrap();
    let fresh = fs::read_to_string(out.path().join("waymark.v1.rs")).unwrap();
    is_committed("src/generated.rs", fresh.as_bytes());
    is_committed("src/descriptors.binpb", &described.encode_to_vec());
}

/// Checks a committed file of the crate against its fresh content; writes it first where that is asked for.
fn is_committed(name: &str, fresh: &[u8]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    if std::env::var_os("WAYMARK_REFRESH").is_some() {
        fs::write(&path, fresh).expect("written");
    }
    assert!(
        fs::read(&path).unwrap_or_default() == fresh,
        "{name} is stale: WAYMARK_REFRESH=1 cargo test -p protos --test generated"
    );
}
