//! The committed Rust and descriptors of Foxglove's messages are what `foxglove.proto` gives. After
//! a change of the .proto run `WAYMARK_REFRESH=1 cargo test -p recordings --test generated`.

#![allow(clippy::disallowed_methods, reason = "the crate opens no files; this test writes some")]

use prost::Message as _;
use std::{fs, path::Path};

#[test]
fn committed_rust_matches_the_proto() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let out = tempfile::tempdir().unwrap();
    let messages = protox::compile(["foxglove/foxglove.proto"], [root]).unwrap();
    let mut described = messages.clone();
    described.file.iter_mut().for_each(|file| file.source_code_info = None);
    let mut config = prost_build::Config::new();
    config.out_dir(out.path()).bytes(["."]);
    config.extern_path(".google.protobuf.Timestamp", "crate::foxglove::Timestamp");
    config.compile_fds(messages).unwrap();
    let fresh = fs::read(out.path().join("foxglove.rs")).unwrap();
    is_committed("src/foxglove/generated.rs", &fresh);
    is_committed("src/foxglove/descriptors.binpb", &described.encode_to_vec());
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
        "{name} is stale: WAYMARK_REFRESH=1 cargo test -p recordings --test generated"
    );
}
