//! Predicted corners and their covariance against projection, finite differences and Monte Carlo;
//! what is in view.

use super::*;
use crate::visibility::{Obstacle, PanTiltCamera, VisibilityParams, visibility};
use vision::frame::IntrinsicsSigmas;

/// With a lens, and with stated errors: 1 % and 2 px.
fn lens_camera() -> Intrinsics {
    let lens = Distortion::PlumbBob([-0.28, 0.09, 1e-3, -5e-4, -0.01]);
    let camera = Intrinsics::new(512.0, 508.0, 318.0, 243.0, lens).unwrap();
    camera.with_sigmas(IntrinsicsSigmas { focal_px: 5.12, center_px: 2.0 }).unwrap()
}

fn level(pan_rad: f64) -> CameraExtrinsics {
    CameraExtrinsics::new(pan_tilt(pan_rad, 0.0, Vector3::new(0.0, 0.0, 1.0))).unwrap()
}

fn expected_by(
    prior: &Pose2Covariance,
    mounting: &CameraExtrinsics,
    camera: &Intrinsics,
    place: &LandmarkPlace,
    obstacles: &[Obstacle],
) -> Option<Expected> {
    let view = CameraView { mounting, intrinsics: camera, image_px: IMAGE_PX };
    let known = [KnownLandmark { landmark: LandmarkId(1), place, visible: None }];
    let made = super::super::expect(prior, &view, &known, obstacles, &ExpectParams::default()).unwrap();
    made.landmarks.into_iter().next()
}

/// Facing the robot at the origin from the wall x = `x_m`.
fn ahead(x_m: f64, y_m: f64, side_m: f64) -> LandmarkPlace {
    let size = LandmarkSize { width_m: side_m, height_m: side_m };
    let centre = Vector3::new(x_m, y_m, 1.0);
    LandmarkPlace::by_hand(centre, std::f64::consts::PI, size, PlaceSigmas::default()).unwrap()
}

#[test]
fn a_frontal_square_has_its_pinhole_corners() {
    let at = prior(Pose2::default(), 0.01, 0.1);
    let made = expected_by(&at, &level(0.0), &camera(), &ahead(4.0, 0.0, 1.0), &[]).unwrap();
    // 512 px * 0.5 m / 4 m = 64 px on either side of the principal point.
    let golden = [[255.5, 175.5], [383.5, 175.5], [383.5, 303.5], [255.5, 303.5]];
    for (px, golden) in made.corners_px.iter().zip(golden) {
        assert!((px - Point2::from(golden)).norm() < 1e-9, "{px}");
    }
    assert_eq!(made.view, InView::Full);
    assert!(made.is_sure && (made.side_px - 128.0).abs() < 1e-9 && (made.range_m - 4.0).abs() < 1e-12);
    assert!(made.incidence_rad < 1e-9);
}

#[test]
fn the_covariance_of_a_frontal_square_by_hand() {
    // Only the robot's position is uncertain: 1 cm aside moves every corner by 512 * 0.01 / 4 px; 1
    // cm ahead moves it from the centre by 64 * 0.01 / 4 px.
    let mut place = ahead(4.0, 0.0, 1.0);
    place.covariance = Matrix6::zeros();
    let mounting = CameraExtrinsics { covariance: Matrix6::zeros(), ..level(0.0) };
    let covariance = Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, 0.0));
    let at = Pose2Covariance::new(Pose2::default(), covariance).unwrap();
    let made = expected_by(&at, &mounting, &camera(), &place, &[]).unwrap();
    let (aside, ahead) = (1.28_f64.powi(2), 0.16_f64.powi(2));
    let close = |got: f64, want: f64| assert!((got - want).abs() < 1e-4 + 1e-3 * want.abs(), "{got} {want}");
    close(made.covariance_px2[(0, 0)], aside + ahead);
    close(made.covariance_px2[(1, 1)], ahead);
    // Left and right corners move the same way aside, and apart when the robot goes ahead.
    close(made.covariance_px2[(0, 2)], aside - ahead);
    let gate = made.gates[0];
    let half = gate.half_extent_px();
    close(half.x, (13.816 * (aside + ahead + 1.0)).sqrt());
    close(half.y, (13.816 * (ahead + 1.0)).sqrt());
    assert!(gate.contains(&(gate.center_px + Vector2::new(0.99 * half.x, 0.0))));
    assert!(!gate.contains(&(gate.center_px + Vector2::new(1.01 * half.x, 0.0))));
}

/// Mean NEES, 8 degrees of freedom, of corners drawn with every stated error.
fn mean_nees(sigma_m: f64, sigma_deg: f64, range_m: f64, camera: &Intrinsics, random: &mut Random) -> f64 {
    let place = on_wall(6.0, 1.3, 0.7, 0.9);
    let (mut sum, draws) = (0.0, 400);
    for _ in 0..draws {
        // A pose in front of it, aimed at it.
        let azimuth = random.range(-1.0, 1.0);
        let (x, y) = (6.0 + range_m * azimuth.sin(), WALL_M - range_m * azimuth.cos());
        let believed = Pose2::new(x, y, (WALL_M - y).atan2(6.0 - x) - 60.0_f64.to_radians());
        let at = prior(believed, sigma_m, sigma_deg);
        let truth = believed.plus(&draw3(&at.covariance, random));
        let made = expected_by(&at, &mounting(), camera, &place, &[]).unwrap();
        let e = camera.error_sigmas().map(|s| s * random.normal());
        let real = Intrinsics {
            fx_px: camera.fx_px * (1.0 + e.x),
            fy_px: camera.fy_px * (1.0 + e.x),
            cx_px: camera.cx_px + e.y,
            cy_px: camera.cy_px + e.z,
            ..*camera
        };
        let really = drawn_mounting(&mounting(), random);
        let px = project(&truth, &drawn_place(&place, random), &really, &real).unwrap();
        let noise = joint::CornerVector::from_fn(|_, _| CORNER_PX * random.normal());
        let innovation = projection::corner_vector(&px) + noise - projection::corner_vector(&made.corners_px);
        let covariance = made.covariance_px2 + joint::CornerMatrix::identity() * CORNER_PX.powi(2);
        sum += innovation.dot(&covariance.cholesky().unwrap().solve(&innovation));
    }
    sum / f64::from(draws)
}

#[test]
fn the_covariance_is_consistent_at_all_ranges_and_priors() {
    let mut random = Random::new(7);
    for lens in [camera(), lens_camera()] {
        for (sigma_m, sigma_deg, range_m) in [
            (0.02, 0.3, 2.5),
            (0.05, 1.0, 2.5),
            (0.05, 1.0, 5.0),
            (0.1, 2.0, 4.0),
            (0.2, 4.0, 6.0),
            (0.2, 4.0, 3.0),
        ] {
            let mean = mean_nees(sigma_m, sigma_deg, range_m, &lens, &mut random);
            println!("{sigma_m} m, {sigma_deg} deg at {range_m} m: mean NEES {mean:.2} of 8");
            // Standard deviation of the mean of 400 draws: 0.2. Non-linearity makes it larger,
            // never smaller.
            assert!((5.5..8.6).contains(&mean), "{sigma_m} {sigma_deg} {range_m}: {mean}");
        }
    }
}

#[test]
fn derivatives_are_the_finite_differences() {
    let (place, at, seat) = (on_wall(3.0, 1.4, 0.8, 0.6), Pose2::new(0.5, 0.3, 0.05), mounting());
    let camera = lens_camera();
    let view = CameraView { mounting: &seat, intrinsics: &camera, image_px: IMAGE_PX };
    let known = [KnownLandmark { landmark: LandmarkId(1), place: &place, visible: None }];
    let made =
        super::super::expect(&prior(at, 0.01, 0.1), &view, &known, &[], &ExpectParams::default()).unwrap();
    let (_, by_common) = joint::Prediction::at(&made.predicted(0), &joint::CommonVector::zeros()).unwrap();
    let h = 1e-6;
    for k in 0..joint::COMMON {
        let at_step = |step: f64| {
            let mut e = [0.0; joint::COMMON];
            e[k] = step;
            let pose = at.plus(&Vector3::new(e[0], e[1], e[2]));
            let (turn, shift) = (Vector3::new(e[3], e[4], e[5]), Vector3::new(e[6], e[7], e[8]));
            let moved = CameraExtrinsics {
                robot_from_camera: perturbed(&seat.robot_from_camera, &turn, &shift),
                ..seat.clone()
            };
            let real = Intrinsics {
                fx_px: camera.fx_px * (1.0 + e[9]),
                fy_px: camera.fy_px * (1.0 + e[9]),
                cx_px: camera.cx_px + e[10],
                cy_px: camera.cy_px + e[11],
                ..camera
            };
            projection::corner_vector(&project(&pose, &place, &moved, &real).unwrap())
        };
        let numeric = (at_step(h) - at_step(-h)) / (2.0 * h);
        let left = (numeric - by_common.column(k)).norm();
        assert!(left < 1e-4 * (1.0 + numeric.norm()), "{k}: {left}");
    }
}

#[test]
fn visibility_of_landmarks_is_reported() {
    let at = prior(Pose2::default(), 0.01, 0.1);
    let of = |place: &LandmarkPlace, obstacles: &[Obstacle]| {
        expected_by(&at, &level(0.0), &camera(), place, obstacles)
    };
    // The half beyond the left border: the landmark's middle on it.
    let half = of(&ahead(4.0, 4.0 * 320.0 / 512.0, 1.0), &[]).unwrap();
    let InView::Cut { visible_px, share } = &half.view else { panic!("{:?}", half.view) };
    assert!((share - 0.5).abs() < 1e-9 && visible_px.len() == 4 && !half.is_sure, "{share}");
    assert!(visible_px.iter().all(is_inside));
    assert!(half.view.is_searchable());
    // A corner alone is not enough.
    assert_eq!(of(&ahead(4.0, 4.0 * 320.0 / 512.0 + 0.45, 1.0), &[]), None);
    let small = of(&ahead(29.0, 0.0, 1.0), &[]).unwrap();
    assert!(matches!(small.view, InView::TooSmall { side_px } if (side_px - 512.0 / 29.0).abs() < 1e-9));
    assert_eq!(of(&ahead(31.0, 0.0, 1.0), &[]), None, "out of range");
    assert_eq!(of(&ahead(-4.0, 0.0, 1.0), &[]), None, "behind");
    let mut away = ahead(4.0, 0.0, 1.0);
    away.theta_rad = 0.0;
    assert_eq!(of(&away, &[]), None, "from behind its wall");
    away.theta_rad = std::f64::consts::PI - 80.0_f64.to_radians();
    let oblique = of(&away, &[]).unwrap();
    assert!(
        matches!(oblique.view, InView::TooOblique { incidence_rad } if (incidence_rad.to_degrees() - 80.0).abs() < 0.1),
        "{:?}",
        oblique.view
    );
    let wall = Obstacle { a: Point2::new(2.0, -2.0), b: Point2::new(2.0, 2.0), height_m: None };
    let hidden = of(&ahead(4.0, 0.0, 1.0), &[wall]).unwrap();
    assert_eq!(hidden.view, InView::Occluded { unoccluded_share: 0.0 });
    assert!(hidden.is_hidden && !hidden.is_sure);
    // A wall that ends where the line of sight to the middle runs: two columns of three are free,
    // and it is not surely in view.
    let beside = Obstacle { a: Point2::new(2.0, 0.02), b: Point2::new(2.0, 2.0), height_m: None };
    let partly = of(&ahead(4.0, 0.0, 1.0), &[beside]).unwrap();
    assert_eq!(partly.view, InView::Full);
    assert!((partly.unoccluded_share - 2.0 / 3.0).abs() < 1e-9 && !partly.is_sure && !partly.is_hidden);
    let unsure =
        expected_by(&prior(Pose2::default(), 0.5, 10.0), &level(0.0), &camera(), &ahead(4.0, 0.0, 1.0), &[]);
    assert!(matches!(unsure.unwrap().view, InView::TooUncertain { gate_px } if gate_px > 120.0));
}

#[test]
fn inside_its_visibility_area_no_line_of_sight_is_tested() {
    let place = ahead(4.0, 0.0, 1.0);
    let (viewer, limits) =
        (PanTiltCamera { camera_height_m: 1.0, ..PanTiltCamera::default() }, VisibilityParams::default());
    let area = visibility(&place, &[], &viewer, &limits).unwrap();
    let (seat, camera) = (level(0.0), camera());
    let view = CameraView { mounting: &seat, intrinsics: &camera, image_px: IMAGE_PX };
    // An obstacle that the area does not contain: the area decides inside of it, sight lines
    // elsewhere.
    let wall = [Obstacle { a: Point2::new(2.0, -2.0), b: Point2::new(2.0, 2.0), height_m: None }];
    let at = prior(Pose2::default(), 0.01, 0.1);
    let share = |visible| {
        let known = [KnownLandmark { landmark: LandmarkId(1), place: &place, visible }];
        let made = super::super::expect(&at, &view, &known, &wall, &ExpectParams::default()).unwrap();
        made.landmarks[0].unoccluded_share
    };
    assert!((share(Some(&area)) - 1.0).abs() < 1e-12);
    assert!(share(None).abs() < 1e-12);
}

#[test]
fn invalid_input_is_refused_with_its_field_and_extreme_input_gives_a_list() {
    let places = corridor(2.0);
    let (seat, camera) = (mounting(), camera());
    let view = CameraView { mounting: &seat, intrinsics: &camera, image_px: IMAGE_PX };
    let p = ExpectParams::default();
    let field = |error: GuidedError| match error {
        GuidedError::OutOfRange(e) => e.field,
        GuidedError::TooMany { field, .. } => field,
    };
    let good = prior(Pose2::default(), 0.1, 1.0);
    let mut bad = good;
    bad.covariance[(0, 0)] = f64::NAN;
    assert_eq!(field(super::super::expect(&bad, &view, &known(&places), &[], &p).unwrap_err()), "covariance");
    let no_image = CameraView { image_px: [0.0, 480.0], ..view };
    assert_eq!(field(super::super::expect(&good, &no_image, &[], &[], &p).unwrap_err()), "image_px");
    let mut nowhere = places[&POSTER];
    nowhere.z_m = f64::NAN;
    let list = [KnownLandmark { landmark: POSTER, place: &nowhere, visible: None }];
    assert_eq!(field(super::super::expect(&good, &view, &list, &[], &p).unwrap_err()), "z_m");
    let mut random = Random::new(3);
    for _ in 0..300 {
        let sigma = 10.0_f64.powf(random.range(-9.0, 5.0));
        let at = prior(
            Pose2::new(
                random.range(-1e5, 1e5) * random.unit().powi(9),
                random.range(-10.0, 10.0),
                random.range(-3.0, 3.0),
            ),
            sigma,
            sigma.min(1e3),
        );
        let place = on_wall(random.range(-5.0, 5.0), 1.0, 10.0_f64.powf(random.range(-2.0, 2.0)), 1.0);
        let known = [KnownLandmark { landmark: LandmarkId(1), place: &place, visible: None }];
        let made = super::super::expect(&at, &view, &known, &[], &p).unwrap();
        assert!(made.landmarks.iter().all(|e| e.covariance_px2.iter().all(|v| v.is_finite())));
    }
}

#[test]
fn the_list_is_bounded_the_largest_stay_and_the_order_given_does_not_matter() {
    let places: Vec<_> =
        (0..MAX_EXPECTED + 6).map(|i| on_wall(3.0, 1.0, 0.3 + 0.005 * i as f64, 0.4)).collect();
    let mut known: Vec<_> = places
        .iter()
        .enumerate()
        .map(|(i, place)| KnownLandmark { landmark: LandmarkId(i as u64), place, visible: None })
        .collect();
    let (seat, camera) = (mounting(), camera());
    let view = CameraView { mounting: &seat, intrinsics: &camera, image_px: IMAGE_PX };
    let at = prior(Pose2::default(), 0.05, 1.0);
    let of = |known: &[KnownLandmark<'_>]| {
        super::super::expect(&at, &view, known, &[], &ExpectParams::default()).unwrap()
    };
    let made = of(&known);
    let ids: Vec<u64> = made.landmarks.iter().map(|e| e.landmark.0).collect();
    assert_eq!(ids, (6..6 + MAX_EXPECTED as u64).collect::<Vec<_>>());
    assert!(made.of(LandmarkId(6)).is_some() && made.of(LandmarkId(5)).is_none());
    known.reverse();
    assert_eq!(of(&known), made);
    // The second of a number does not count.
    known.push(KnownLandmark { landmark: LandmarkId(6), place: &places[0], visible: None });
    assert_eq!(of(&known).landmarks.len(), MAX_EXPECTED);
}
