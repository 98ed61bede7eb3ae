//! The committed Rust and descriptors of the messages are what `waymark.proto` gives. After a
//! change of the .proto run `WAYMARK_REFRESH=1 cargo test -p protos --test generated`.

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

/// Of these, what has no schema: the bodies of the HTTP interface that have them have other forms
/// or types.
const WITHOUT_SCHEMA: [&str; 4] = ["RobotPose", "MapChanged", "Odometry", "Scan"];
/// Enumerations that are words in these messages.
const WORDS: [&str; 5] = ["QuadKind", "Verdict", "Sighting", "FixQuantity", "PartAgreement"];

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
        if !WITHOUT_SCHEMA.contains(&message) {
            config.type_attribute(&path, "#[cfg_attr(feature = \"openapi\", derive(utoipa::ToSchema))]");
        }
    }
    for words in WORDS {
        let schema = "#[cfg_attr(feature = \"openapi\", derive(utoipa::ToSchema), schema(rename_all = \"snake_case\"))]";
        config.type_attribute(format!(".waymark.v1.{words}"), schema);
    }
    for (field, words) in [
        ("Answer.status", "crate::api::AnswerStatus"),
        ("QuadAnswer.kind", "QuadKind"),
        ("QuadAnswer.verdict", "Verdict"),
        ("QuadAnswer.sighting", "Sighting"),
        ("PoseRefusalCause.quantity", "FixQuantity"),
    ] {
        let schema = format!("schema(value_type = {words}, default = json!(\"unspecified\"))");
        let attribute = format!("#[cfg_attr(feature = \"openapi\", {schema})]");
        config.field_attribute(format!(".waymark.v1.{field}"), attribute);
    }
    config.field_attribute(
        ".waymark.v1.PointEvidence.agreement",
        "#[cfg_attr(feature = \"openapi\", schema(value_type = Vec<PartAgreement>))]",
    );
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

/// Checks a committed file of the crate against its fresh content; writes it first where that is
/// asked for.
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
