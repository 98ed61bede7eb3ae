//! The committed Rust of the messages is what `waymark.proto` gives. After a change of the .proto run
//! `WAYMARK_REFRESH=1 cargo test -p protos --test generated`.

use std::{fs, path::Path};

/// Messages that also travel as JSON over HTTP.
const JSON: [&str; 19] = [
    "Hypothesis",
    "Pose3",
    "Pose2",
    "Pose2Covariance",
    "Rejection",
    "Point",
    "Candidate",
    "PointEvidence",
    "LandmarkPose",
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
    config.compile_fds(messages).unwrap();
    let fresh = fs::read_to_string(out.path().join("waymark.v1.rs")).unwrap();
    let committed = root.join("src/generated.rs");
    if std::env::var_os("WAYMARK_REFRESH").is_some() {
        fs::write(&committed, &fresh).unwrap();
    }
    let committed = fs::read_to_string(committed).unwrap();
    assert!(
        committed == fresh,
        "src/generated.rs is stale: WAYMARK_REFRESH=1 cargo test -p protos --test generated"
    );
}
