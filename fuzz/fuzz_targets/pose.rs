//! Any numbers as corners, covariances, size and camera: no panic, and a pose is finite, in front
//! of the camera, with a covariance that is symmetric and has no negative variance.

#![no_main]

use libfuzzer_sys::fuzz_target;
use nalgebra::{Matrix2, Point2};
use vision::{
    frame::{Distortion, Intrinsics},
    geometry::Corners,
    pose::{LandmarkSize, PoseSolution, landmark_pose},
};

/// Corners, covariances (uu, uv, vv), size, camera, distortion.
const NUMBERS: usize = 8 + 12 + 2 + 4 + 5;

fuzz_target!(|data: &[u8]| {
    let (words, _) = data.as_chunks::<8>();
    let mut given = words.iter().map(|word| f64::from_le_bytes(*word));
    let mut numbers = [0.0; NUMBERS];
    numbers[..USUAL.len()].copy_from_slice(&USUAL);
    numbers.iter_mut().for_each(|number| *number = given.next().unwrap_or(*number));
    let at = |i: usize| Point2::new(numbers[2 * i], numbers[2 * i + 1]);
    let corners_px = [at(0), at(1), at(2), at(3)];
    let Ok(corners) = Corners::new(corners_px).or_else(|_| Corners::from_unordered(corners_px)) else {
        return;
    };
    let [uu, uv, vv] = [0, 1, 2].map(|i| move |corner: usize| 8 + 3 * corner + i);
    let covariance: [Matrix2<f64>; 4] =
        std::array::from_fn(|c| Matrix2::new(numbers[uu(c)], numbers[uv(c)], numbers[uv(c)], numbers[vv(c)]));
    let size = LandmarkSize { width_m: numbers[20], height_m: numbers[21] };
    let [fx, fy, cx, cy] = [22, 23, 24, 25].map(|i| numbers[i]);
    let bent = [26, 27, 28, 29, 30].map(|i| numbers[i]);
    let distortion = if bent == [0.0; 5] { Distortion::None } else { Distortion::PlumbBob(bent) };
    let Ok(camera) = Intrinsics::new(fx, fy, cx, cy, distortion) else { return };
    let Ok(pose) = landmark_pose(&corners, &covariance, size, &camera) else { return };
    check(&pose.best);
    pose.second.iter().for_each(check);
});

/// Where an input is short: a poster 2 m ahead of a usual camera.
const USUAL: [f64; 26] = [
    240.0, 160.0, 400.0, 165.0, 398.0, 320.0, 242.0, 318.0, 0.25, 0.0, 0.25, 0.25, 0.0, 0.25, 0.25, 0.0,
    0.25, 0.25, 0.0, 0.25, 0.6, 0.6, 600.0, 600.0, 320.0, 240.0,
];

fn check(solution: &PoseSolution) {
    let at = &solution.camera_from_landmark;
    assert!(at.translation.vector.iter().all(|x| x.is_finite()) && at.translation.z > 0.0, "{at}");
    assert!(at.rotation.coords.iter().all(|x| x.is_finite()));
    let c = &solution.covariance;
    assert!(c.iter().all(|x| x.is_finite()), "{c}");
    assert!((0..c.nrows()).all(|i| c[(i, i)] >= 0.0), "{c}");
    assert!(solution.chi2 >= 0.0 && solution.reprojection_rms_px >= 0.0);
}
