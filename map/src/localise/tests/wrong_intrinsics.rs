//! A camera whose intrinsics are not those that it states: its fixes stay within three of their
//! standard deviations, or the monitor suspects it. Nothing in between is silent.

use super::{camera, mounting, nees, observation, observe_by, off, stated};
use crate::{
    localise::{
        LocaliseParams,
        fix::FixResult,
        intrinsics_monitor::{IntrinsicsMonitor, focal_evidence},
        robot_pose,
    },
    place::{LandmarkPlace, PlaceSigmas},
    pose2::Pose2,
};
use nalgebra::Vector3;
use vision::{frame::Intrinsics, random::Random};

/// Three standard deviations of three numbers: chi-square of 99.73 %.
const THREE_SIGMA: f64 = 14.16;
/// Share of fixes outside of it that an honest camera may have: ten times the nominal one.
const FEW: f64 = 0.03;
const FRAMES: usize = 240;

/// Share of the fixes that are outside of three sigma, how many fixes there are, and whether the
/// camera is suspect.
fn driven(real: &Intrinsics, said: &Intrinsics, seed: u64) -> (f64, usize, bool) {
    let mut random = Random::new(seed);
    let mut monitor = IntrinsicsMonitor::default();
    let places: Vec<_> = (0..6)
        .map(|i| {
            let centre = Vector3::new(4.0 * f64::from(i), 0.0, 1.5);
            LandmarkPlace::by_hand(centre, 1.6, super::SIZE, PlaceSigmas::default()).unwrap()
        })
        .collect();
    let (mut outside, mut fixes) = (0, 0);
    for frame in 0..FRAMES {
        let place = &places[frame % places.len()];
        let (d, psi) = (random.range(1.5, 4.0), random.range(-60.0, 60.0).to_radians());
        let a = place.theta_rad + psi;
        let truth = Pose2::new(place.x_m + d * a.cos(), place.y_m + d * a.sin(), a + std::f64::consts::PI);
        let view = mounting().robot_from_camera.inverse()
            * truth.to_isometry3().inverse()
            * place.map_from_landmark();
        let Some(seen) = observe_by(real, said, &view, place.size, 0.5, &mut random) else { continue };
        let observations = [observation(frame as u64 % 6, &seen, place)];
        match robot_pose(&observations, &mounting(), None, &LocaliseParams::default()).unwrap() {
            FixResult::Fixed(fix) => {
                (fixes, outside) = (fixes + 1, outside + usize::from(nees(&fix, &truth) > THREE_SIGMA));
                monitor.add_fix(&fix, focal_evidence(&observations, &mounting(), &fix.pose.pose));
            }
            FixResult::Ambiguous(_) => {}
            FixResult::Refused(_) => monitor.add_refusal(),
        }
    }
    (f64::from(outside as u32) / f64::from(fixes.max(1) as u32), fixes, monitor.state().suspicion.is_some())
}

#[test]
fn wrong_intrinsics_are_covered_or_suspected() {
    let swapped = Intrinsics { cx_px: camera().cy_px, cy_px: camera().cx_px, ..camera() };
    let mut cases = vec![("swapped size".to_owned(), swapped)];
    for percent in [-20.0, -5.0, -1.0, 1.0, 5.0, 20.0] {
        cases.push((format!("focal {percent} %"), off(&Vector3::new(percent / 100.0, 0.0, 0.0))));
    }
    let mut silent = Vec::new();
    for (what, real) in cases {
        for said in [camera(), stated()] {
            for seed in 0..4 {
                let (outside, fixes, is_suspect) = driven(&real, &said, seed);
                if outside > FEW && !is_suspect {
                    silent.push(format!("{what}, stated {:?}: {outside} of {fixes} fixes", said.sigmas));
                }
            }
        }
    }
    assert!(silent.is_empty(), "{}", silent.join("\n"));
    // The right camera is left in peace.
    let (outside, fixes, is_suspect) = driven(&camera(), &camera(), 9);
    assert!(outside <= FEW && fixes > 150 && !is_suspect, "{outside} of {fixes}, suspect: {is_suspect}");
}
