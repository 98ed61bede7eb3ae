//! Any bytes as the JSON body of a request, with the checks that its numbers go through: what is
//! accepted is finite and reads back as itself; what is refused names its field.
//!
//! The first byte chooses the body.

#![no_main]

use formats::walls::Wall;
use libfuzzer_sys::fuzz_target;
use map::place::{LandmarkPlace, PlaceSigmas};
use nalgebra::Vector3;
use protos::{Name, api, convert::geometry, v1};
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Debug;
use vision::{geometry::Corners, pose::LandmarkSize};

fuzz_target!(|data: &[u8]| {
    let Some((choice, text)) = data.split_first() else { return };
    match choice % 14 {
        0 => {
            if let Some(new) = read::<api::NewLandmark>(text) {
                landmark(&new);
            }
        }
        1 => {
            let all = read::<api::NewLandmarks>(text).map(|all| all.landmarks).unwrap_or_default();
            all.iter().for_each(landmark);
        }
        2 => drop(read::<api::LandmarkPatch>(text)),
        3 => {
            if let Some(capture) = read::<api::CaptureMetadata>(text) {
                taken(&capture);
            }
        }
        4 => drop(read::<[[f64; 2]; 4]>(text).map(Corners::try_from)),
        5 => {
            for wall in read::<api::WallsBody>(text).unwrap_or_default().segments {
                if let Ok(segment) = Wall::between(wall.a, wall.b).segment() {
                    assert!(segment.length_m().is_finite());
                }
            }
        }
        6 => drop(read::<api::LandmarkLesson>(text)),
        7 => drop(read::<api::MapLesson>(text)),
        8 => drop(read::<api::NewGatheringBody>(text)),
        9 => drop(read::<api::AcceptRequest>(text)),
        10 => drop(read::<api::NewMap>(text)),
        11 => drop(read::<api::CalibrationRequest>(text)),
        12 => drop(read::<api::VisibleRequest>(text)),
        _ => drop(read::<api::CoverageRequest>(text)),
    }
});

/// The body, which reads back as itself.
fn read<T: DeserializeOwned + Serialize + PartialEq + Debug>(text: &[u8]) -> Option<T> {
    let mut reader = serde_json::Deserializer::from_slice(text);
    let body: T = match serde_path_to_error::deserialize(&mut reader) {
        Ok(body) => body,
        Err(error) => {
            // May be empty, for a field without a name: the server then says `body`.
            drop(error.path().to_string());
            return None;
        }
    };
    reader.end().ok()?;
    let written = serde_json::to_string(&body).expect("a body is written");
    assert_eq!(serde_json::from_str::<T>(&written).expect("what was written is read"), body, "{written}");
    Some(body)
}

fn landmark(new: &api::NewLandmark) {
    let name = Name::new(new.name.clone());
    assert_eq!(name.is_ok_and(|name| name.as_str() == new.name), Name::new(new.name.as_str()).is_ok());
    let (Some(size), Some(at)) = (new.size, new.place) else { return };
    let size = LandmarkSize { width_m: size.width_m, height_m: size.height_m };
    let centre = Vector3::new(at.x_m, at.y_m, at.z_m);
    match LandmarkPlace::by_hand(centre, at.theta_rad, size, PlaceSigmas::default()) {
        Ok(place) => {
            assert!([place.x_m, place.y_m, place.z_m, place.theta_rad].iter().all(|x| x.is_finite()))
        }
        Err(error) => assert!(!error.field.is_empty()),
    }
}

fn taken(capture: &api::CaptureMetadata) {
    for refusal in [
        geometry::intrinsics(&capture.intrinsics).err(),
        geometry::pose2_covariance(&capture.map_from_robot).err(),
        geometry::mounting(&capture.robot_from_camera).err(),
    ] {
        assert!(refusal.is_none_or(|refusal| !refusal.field.is_empty()));
    }
    let _: &v1::Intrinsics = &capture.intrinsics;
}
