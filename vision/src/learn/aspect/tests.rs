use super::*;
use crate::frame::Distortion;
use crate::random::Random;
use nalgebra::{Isometry3, Rotation3, Translation3};

const SIZE_PX: [usize; 2] = [3000, 4000];

fn camera(focal_px: f64) -> Intrinsics {
    Intrinsics::new(focal_px, focal_px, 1499.5, 1999.5, Distortion::None).unwrap()
}

/// A view from `yaw` and `pitch` degrees beside the normal, 1.6 m away; corners off by up to
/// `off_px`.
fn view(size: [f64; 2], [yaw, pitch]: [f64; 2], (focal_px, off_px, seed): (f64, f64, u64)) -> AspectView {
    let mut random = Random::new(seed);
    let turn = Rotation3::from_euler_angles(pitch.to_radians(), yaw.to_radians(), 0.0);
    let pose = Isometry3::from_parts(Translation3::new(0.02, -0.03, 1.6), turn.into());
    let [w, h] = size.map(|s| 0.5 * s);
    let camera = camera(focal_px);
    let corners = [[-w, -h], [w, -h], [w, h], [-w, h]].map(|[x, y]| {
        let p = camera.project(&(pose * nalgebra::Point3::new(x, y, 0.0)).coords);
        [p.x, p.y].map(|v| if off_px > 0.0 { v + random.range(-off_px, off_px) } else { v })
    });
    AspectView { corners_px: Corners::try_from(corners).unwrap(), size_px: SIZE_PX, camera: None }
}

const SIDES: [[f64; 2]; 3] = [[2.0, 1.0], [35.0, -4.0], [-33.0, 5.0]];

fn size(width_m: f64, height_m: f64) -> LandmarkSize {
    LandmarkSize { width_m, height_m }
}

#[test]
fn three_views_of_an_unknown_camera_tell_swapped_sides() {
    for (focal_px, seed) in [(2000.0, 1), (3004.0, 2), (3800.0, 3), (6000.0, 4)] {
        let views: Vec<_> =
            (0..3).map(|i| view([0.6, 0.679], SIDES[i], (focal_px, 3.0, seed + i as u64))).collect();
        let found = aspect(&views).unwrap();
        let off = (found.ratio / (0.6 / 0.679)).ln();
        assert!(off.abs() < 3.0 * found.sigma_log && found.sigma_log < SUFFICIENT, "{focal_px}: {found:?}");
        assert_eq!(found.agreement(size(0.6, 0.679)), AspectAgreement::Agrees, "{focal_px}");
        assert_eq!(
            found.agreement(size(0.679, 0.6)),
            AspectAgreement::Differs { swapped: true },
            "{focal_px}"
        );
        assert_eq!(found.agreement(size(0.6, 0.9)), AspectAgreement::Differs { swapped: false });
    }
}

#[test]
fn one_view_from_the_side_refuses_nothing_without_its_camera() {
    let one = view([0.6, 0.679], [50.0, 0.0], (3004.0, 0.0, 0));
    let unknown = aspect(std::slice::from_ref(&one)).unwrap();
    assert!(unknown.sigma_log > SUFFICIENT, "{unknown:?}");
    assert!(!matches!(unknown.agreement(size(0.679, 0.6)), AspectAgreement::Differs { .. }));
    assert_eq!(unknown.agreement(size(0.3, 0.9)), AspectAgreement::Doubtful);
    let known = aspect(&[AspectView { camera: Some(camera(3004.0)), ..one }]).unwrap();
    assert_eq!(known.agreement(size(0.679, 0.6)), AspectAgreement::Differs { swapped: true }, "{known:?}");
    // From the front the camera is no matter.
    let front = aspect(&[view([0.6, 0.679], [0.0, 0.0], (3004.0, 0.0, 0))]).unwrap();
    assert_eq!(front.agreement(size(0.679, 0.6)), AspectAgreement::Differs { swapped: true }, "{front:?}");
}

#[test]
fn the_deviation_is_that_of_the_errors() {
    let (mut chi2, count) = (0.0, 60);
    for seed in 0..count {
        let turned = |i: usize| [SIDES[i][0] + 0.2 * seed as f64 - 6.0, SIDES[i][1]];
        let views: Vec<_> =
            (0..3).map(|i| view([0.6, 0.84], turned(i), (3004.0, 6.0, 10 * seed + i as u64))).collect();
        let found = aspect(&views).unwrap();
        chi2 += ((found.ratio / (0.6 / 0.84)).ln() / found.sigma_log).powi(2) / f64::from(count as u32);
    }
    // The common part is not in these views.
    assert!((0.02..1.5).contains(&chi2), "{chi2}");
}

#[test]
fn cut_outs_say_nothing() {
    let corners = [[0.0, 0.0], [2999.0, 0.0], [2999.0, 3999.0], [0.0, 3999.0]];
    let whole =
        AspectView { corners_px: Corners::try_from(corners).unwrap(), size_px: SIZE_PX, camera: None };
    assert_eq!(aspect(&[whole]), None);
    assert_eq!(aspect(&[]), None);
}

#[test]
fn views_that_contradict_one_another_refuse_nothing() {
    // One outlines the poster, the other a door beside it.
    let views =
        [view([0.6, 0.84], SIDES[0], (3004.0, 0.0, 0)), view([0.9, 0.45], SIDES[0], (3004.0, 0.0, 0))];
    let found = aspect(&views).unwrap();
    assert!(!matches!(found.agreement(size(0.84, 0.6)), AspectAgreement::Differs { .. }), "{found:?}");
}
