//! Any bytes as a stored model and as a stored visibility area: no panic, and a model that is read
//! is written to the same bytes. The digest at a model's end is corrected, so that inputs reach
//! what lies behind it. Bundles are tested with the server
//! (`any_bytes_as_a_bundle_are_refused_or_read`), which alone can read them.

#![no_main]

use libfuzzer_sys::fuzz_target;
use map::{
    place::{LandmarkPlace, PlaceSigmas},
    visibility::{VisibilityMap, VisibilitySettings},
};
use nalgebra::Vector3;
use std::sync::LazyLock;
use vision::{
    model::{LandmarkId, LandmarkModel, model_bytes},
    params::Params,
    pose::LandmarkSize,
};

static PARAMS: LazyLock<Params> = LazyLock::new(Params::default);

fuzz_target!(|data: &[u8]| {
    let Some((choice, rest)) = data.split_first() else { return };
    if choice % 8 == 0 {
        area(rest);
        return;
    }
    let mut bytes = rest.to_vec();
    // Magic, and the hash of the parameters in use: behind both lies all that is of interest.
    if choice % 2 == 0 && bytes.len() >= 22 {
        bytes[..4].copy_from_slice(b"WMLM");
        bytes[6..14].copy_from_slice(&PARAMS.distance_hash().to_le_bytes());
    }
    if bytes.len() >= 8 {
        let end = bytes.len() - 8;
        let sum = fnv(&bytes[..end]);
        bytes[end..].copy_from_slice(&sum.to_le_bytes());
    }
    if let Ok(model) = LandmarkModel::from_bytes(&bytes, &PARAMS) {
        let written = model.to_bytes();
        let again = LandmarkModel::from_bytes(&written, &PARAMS).expect("what was written is read");
        assert_eq!(again.to_bytes(), written);
    }
    if let Ok(other) = model_bytes::renumbered(&bytes, LandmarkId(7)) {
        assert_eq!(other.len(), bytes.len());
    }
});

/// FNV-1a, as in the format.
fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

fn area(bytes: &[u8]) {
    let size = LandmarkSize { width_m: 0.6, height_m: 0.8 };
    let place = LandmarkPlace::by_hand(Vector3::new(1.0, 2.0, 1.5), 0.4, size, PlaceSigmas::default());
    let (place, settings) = (place.expect("a place"), VisibilitySettings::default());
    if let Ok(area) = VisibilityMap::from_bytes(bytes, &place, Vec::new(), &settings) {
        let written = area.to_bytes();
        let again = VisibilityMap::from_bytes(&written, &place, Vec::new(), &settings);
        assert_eq!(again.expect("what was written is read").to_bytes(), written);
    }
}
