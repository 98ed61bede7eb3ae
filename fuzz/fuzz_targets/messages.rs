//! Any bytes as a message of a robot, and any fields of one: what passes the checks is finite,
//! within its bounds and readable again; what does not is refused with a code and a field of the
//! message.
//!
//! The first byte chooses the message.

#![no_main]

use libfuzzer_sys::fuzz_target;
use protos::{
    CheckedFrame, Rejection,
    convert::{
        CheckedGaze, CheckedLocalise, CheckedOdometry, CheckedScan, Pixels,
        frame::{MAX_DEADLINE_MS, MAX_FRAME_IMAGE_BYTES, MAX_FRAME_PX},
        quads::MAX_FOUND_QUADS,
    },
    prost::Message,
    v1,
};

fuzz_target!(|data: &[u8]| {
    let Some((choice, bytes)) = data.split_first() else { return };
    match choice % 6 {
        0 => frame::<v1::Frame>(bytes),
        1 => frame::<v1::Quads>(bytes),
        2 => {
            let Some(Ok(odometry)) = checked::<v1::Odometry, CheckedOdometry>(bytes) else { return };
            assert!(finite(&odometry.odom_from_robot));
        }
        3 => {
            let Some(Ok(scan)) = checked::<v1::Scan, CheckedScan>(bytes) else { return };
            assert!(finite(&scan.odom_from_robot));
            assert!(!scan.scan.ranges_m().is_empty() && scan.scan.ranges_m().len() <= map::laser::MAX_BEAMS);
        }
        4 => drop(checked::<v1::GazeRequest, CheckedGaze>(bytes)),
        _ => drop(checked::<v1::LocaliseRequest, CheckedLocalise>(bytes)),
    }
});

/// The checked message of these bytes, where they are one. A message comes back from its own bytes,
/// and is judged as before.
fn checked<M, C>(bytes: &[u8]) -> Option<Result<C, Rejection>>
where
    M: Message + Default + Clone,
    C: TryFrom<M, Error = Rejection>,
{
    let message = M::decode(bytes).ok()?;
    let again = M::decode(&message.encode_to_vec()[..]).expect("what was written is read");
    let (first, second) = (C::try_from(message), C::try_from(again));
    match (&first, &second) {
        (Err(first), Err(second)) => {
            assert_eq!((first.code, &first.field), (second.code, &second.field));
            assert!(!first.field.is_empty() && first.field.len() < 200, "{first:?}");
        }
        (Ok(_), Ok(_)) => {}
        _ => panic!("the same message is accepted once and refused once"),
    }
    Some(first)
}

fn frame<M>(bytes: &[u8])
where
    M: Message + Default + Clone,
    CheckedFrame: TryFrom<M, Error = Rejection>,
{
    let Some(Ok(frame)) = checked::<M, CheckedFrame>(bytes) else { return };
    assert!(frame.width_px > 0 && frame.height_px > 0 && frame.width_px * frame.height_px <= MAX_FRAME_PX);
    assert!(frame.deadline_ms.is_none_or(|ms| (1..=MAX_DEADLINE_MS).contains(&ms)));
    assert!(frame.odometry.as_ref().is_none_or(finite));
    if let Some(prior) = &frame.prior {
        assert!(finite(&prior.pose) && prior.covariance.iter().all(|x| x.is_finite()));
    }
    if let Some(camera) = &frame.intrinsics {
        assert!(camera.matrix().iter().all(|x| x.is_finite()) && camera.fx_px > 0.0 && camera.fy_px > 0.0);
    }
    match &frame.pixels {
        Pixels::Image(image) => {
            assert!(!image.bytes.is_empty() && image.bytes.len() <= MAX_FRAME_IMAGE_BYTES)
        }
        Pixels::Quads(quads) => {
            assert!(quads.len() <= MAX_FOUND_QUADS);
            for found in quads {
                let patch = &found.patch;
                assert!(patch.left_px + patch.width_px <= frame.width_px);
                assert!(patch.top_px + patch.height_px <= frame.height_px);
                assert!(found.quad.corner_covariance_px2.iter().all(|c| c.iter().all(|x| x.is_finite())));
            }
        }
    }
}

fn finite(pose: &map::pose2::Pose2) -> bool {
    pose.position().iter().all(|x| x.is_finite()) && pose.theta_rad.is_finite()
}
