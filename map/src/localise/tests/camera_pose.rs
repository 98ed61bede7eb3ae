//! The pose of a camera held in a hand: exact corners, honest covariance, the planar ambiguity,
//! refusals.

use super::*;
use crate::{
    localise::camera_pose::{CameraPose, CameraPoseRefusal, camera_pose},
    place::{SharedErrors, SurveyId},
};
use nalgebra::UnitQuaternion;

/// A camera at `d_m` and azimuth `psi_deg` from the landmark's normal, 1.6 m high, tilted and
/// rolled as hands do.
fn held(place: &LandmarkPlace, d_m: f64, psi_deg: f64) -> Isometry3<f64> {
    let robot = robot(place, d_m, psi_deg).to_isometry3();
    let roll = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.04);
    robot * pan_tilt(0.1, -0.08, Vector3::new(0.0, 0.0, 1.6)) * roll
}

fn photograph(
    place: &LandmarkPlace,
    map_from_camera: &Isometry3<f64>,
    sigma_px: f64,
    random: &mut Random,
) -> LandmarkPose {
    let camera_from_landmark = map_from_camera.inverse() * place.map_from_landmark();
    observe_by(&camera(), &camera(), &camera_from_landmark, place.size, sigma_px, random).unwrap()
}

fn seen<'a>(number: u64, seen: &'a LandmarkPose, place: &'a LandmarkPlace) -> LandmarkObservation<'a> {
    LandmarkObservation { landmark: LandmarkId(number), seen, place }
}

fn error(found: &CameraPose, truth: &Isometry3<f64>) -> Vector6<f64> {
    let rotation = (found.map_from_camera.rotation * truth.rotation.inverse()).scaled_axis();
    let position = found.map_from_camera.translation.vector - truth.translation.vector;
    Vector6::from_iterator(rotation.iter().chain(position.iter()).copied())
}

#[test]
fn exact_corners_give_the_exact_pose_of_a_camera_in_a_hand() {
    let (place, mut random) = (place(), Random::new(7));
    for psi_deg in [-50.0, -20.0, 35.0, 60.0] {
        let truth = held(&place, 1.5, psi_deg);
        let pose = photograph(&place, &truth, 0.0, &mut random);
        let found = camera_pose(&[seen(1, &pose, &place)]).unwrap().unwrap();
        assert!(error(&found, &truth).norm() < 1e-6, "{psi_deg}: {found:?}");
        assert_eq!(found.landmarks, [LandmarkId(1)]);
    }
}

#[test]
fn the_covariance_of_a_camera_in_a_hand_is_that_of_its_errors() {
    let (place, mut random) = (place(), Random::new(11));
    let (mut nees, mut count) = (0.0, 0);
    for trial in 0..600 {
        // The real place and size differ from the stated ones by their stated errors.
        let sigma = place.covariance.diagonal().map(f64::sqrt);
        let e = sigma.map(|s| s * random.normal());
        let mut real = place;
        (real.x_m, real.y_m, real.theta_rad, real.z_m) =
            (real.x_m + e[0], real.y_m + e[1], real.theta_rad + e[2], real.z_m + e[3]);
        (real.size.width_m, real.size.height_m) = (real.size.width_m + e[4], real.size.height_m + e[5]);
        let truth = held(&place, 1.2 + f64::from(trial % 4) * 0.4, 30.0 + f64::from(trial % 3) * 10.0);
        let pose = photograph(&real, &truth, 0.5, &mut random);
        let Ok(found) = camera_pose(&[seen(1, &pose, &place)]).unwrap() else { continue };
        let error = error(&found, &truth);
        nees += error.dot(&found.covariance.cholesky().unwrap().solve(&error));
        count += 1;
    }
    // 6 where the covariance is right; the mean of 500 has a standard deviation of 0.15.
    let mean = nees / f64::from(count);
    assert!(count > 500 && (5.0..7.2).contains(&mean), "mean {mean} of {count}");
}

#[test]
fn a_shift_that_two_places_share_stays_in_the_pose_of_the_camera() {
    let (first, mut random) = (place(), Random::new(5));
    let places = [first, beside(&first, 1.8)];
    let truth = held(&first, 2.5, 20.0);
    let [a, b] = places.map(|place| photograph(&place, &truth, 0.3, &mut random));
    let variance_x = |[first, second]: [LandmarkPlace; 2]| {
        camera_pose(&[seen(1, &a, &first), seen(2, &b, &second)]).unwrap().unwrap().covariance[(3, 3)]
    };
    let mut by = Matrix6::zeros();
    by[(0, 0)] = 0.05;
    let shared = Some(SharedErrors { survey: SurveyId(1), by });
    let shifted =
        |place: LandmarkPlace| LandmarkPlace { shared, covariance: place.covariance + by * by, ..place };
    let added = variance_x(places.map(shifted)) - variance_x(places);
    assert!((added / 0.0025 - 1.0).abs() < 0.02, "{added}");
}

#[test]
fn an_ambiguous_photograph_gives_no_pose_unless_another_landmark_decides() {
    let (place, mut random) = (place(), Random::new(3));
    let mut beside = place;
    beside.x_m += 1.2 * place.theta_rad.sin();
    beside.y_m -= 1.2 * place.theta_rad.cos();
    let (mut refused, mut decided) = (0, 0);
    for _ in 0..60 {
        let truth = held(&place, 8.0, 12.0);
        let (a, b) =
            (photograph(&place, &truth, 0.5, &mut random), photograph(&beside, &truth, 0.5, &mut random));
        if !a.ambiguous {
            continue;
        }
        refused +=
            usize::from(camera_pose(&[seen(1, &a, &place)]).unwrap() == Err(CameraPoseRefusal::Ambiguous));
        if let Ok(found) = camera_pose(&[seen(1, &a, &place), seen(2, &b, &beside)]).unwrap() {
            decided += 1;
            assert!(error(&found, &truth).rows(3, 3).norm() < 1.0, "{found:?}");
            assert_eq!(found.landmarks.len(), 2);
        }
    }
    assert!(refused > 20, "{refused} refused, {decided} decided");
}

#[test]
fn landmarks_that_contradict_one_another_and_impossible_heights_give_no_pose() {
    let (place, mut random) = (place(), Random::new(5));
    let truth = held(&place, 1.5, 40.0);
    let pose = photograph(&place, &truth, 0.3, &mut random);
    let mut elsewhere = place;
    elsewhere.x_m += 0.8;
    let both = [seen(1, &pose, &place), seen(2, &pose, &elsewhere)];
    assert_eq!(camera_pose(&both).unwrap(), Err(CameraPoseRefusal::Disagree));
    let mut low = place;
    low.z_m -= 3.0;
    assert_eq!(camera_pose(&[seen(1, &pose, &low)]).unwrap(), Err(CameraPoseRefusal::Height));
    assert_eq!(camera_pose(&[]).unwrap_err().field, "observations");
}

#[test]
fn a_photograph_from_afar_gives_no_pose_unless_several_landmarks_do() {
    let (place, mut random) = (place(), Random::new(19));
    let other = beside(&place, 2.0);
    let (mut near, mut imprecise, mut decided) = (0, 0, 0);
    for _ in 0..40 {
        let close = held(&place, 2.0, 35.0);
        let look = photograph(&place, &close, 0.3, &mut random);
        near += usize::from(camera_pose(&[seen(1, &look, &place)]).unwrap().is_ok());
        let afar = held(&place, 6.0, 15.0);
        let (a, b) =
            (photograph(&place, &afar, 0.3, &mut random), photograph(&other, &afar, 0.3, &mut random));
        if camera_pose(&[seen(1, &a, &place)]).unwrap() == Err(CameraPoseRefusal::Imprecise) {
            imprecise += 1;
            let both = camera_pose(&[seen(1, &a, &place), seen(2, &b, &other)]).unwrap();
            decided +=
                usize::from(both.is_ok_and(|found| error(&found, &afar).fixed_rows::<3>(3).norm() < 0.3));
        }
    }
    assert!(near == 40 && imprecise > 10 && decided > imprecise / 2, "{near} near, {imprecise}, {decided}");
}

/// The landmark `beside`, metres along its wall to the right.
fn beside(place: &LandmarkPlace, along_m: f64) -> LandmarkPlace {
    let mut other = *place;
    other.x_m += along_m * place.theta_rad.sin();
    other.y_m -= along_m * place.theta_rad.cos();
    other
}

/// `place` as it really is: off by its stated errors.
fn real(place: &LandmarkPlace, random: &mut Random) -> LandmarkPlace {
    let sigma = place.covariance.diagonal().map(f64::sqrt);
    let e = sigma.map(|s| s * random.normal());
    let mut real = *place;
    (real.x_m, real.y_m, real.theta_rad, real.z_m) =
        (real.x_m + e[0], real.y_m + e[1], real.theta_rad + e[2], real.z_m + e[3]);
    (real.size.width_m, real.size.height_m) = (real.size.width_m + e[4], real.size.height_m + e[5]);
    real
}

#[test]
fn two_landmarks_give_a_better_pose_than_one_with_the_covariance_of_its_errors() {
    let (place, mut random) = (place(), Random::new(13));
    let other = beside(&place, 1.8);
    let (mut nees, mut count, mut one_m, mut two_m) = (0.0, 0, 0.0, 0.0);
    for trial in 0..300 {
        let truth = held(&place, 2.5 + f64::from(trial % 4) * 0.4, 20.0 + f64::from(trial % 3) * 10.0);
        let a = photograph(&real(&place, &mut random), &truth, 0.5, &mut random);
        let b = photograph(&real(&other, &mut random), &truth, 0.5, &mut random);
        let Ok(alone) = camera_pose(&[seen(1, &a, &place)]).unwrap() else { continue };
        let Ok(both) = camera_pose(&[seen(1, &a, &place), seen(2, &b, &other)]).unwrap() else { continue };
        assert_eq!(both.landmarks.len(), 2);
        one_m += error(&alone, &truth).fixed_rows::<3>(3).norm();
        let error = error(&both, &truth);
        two_m += error.fixed_rows::<3>(3).norm();
        nees += error.dot(&both.covariance.cholesky().unwrap().solve(&error));
        count += 1;
    }
    let mean = nees / f64::from(count);
    assert!(count > 200 && (4.8..7.2).contains(&mean), "mean {mean} of {count}");
    assert!(two_m < 0.7 * one_m, "{two_m} with two, {one_m} with one");
}

#[test]
fn a_landmark_that_was_moved_is_outvoted_by_two_others() {
    let (place, mut random) = (place(), Random::new(17));
    let places = [place, beside(&place, 1.2), beside(&place, -1.3)];
    let truth = held(&place, 2.0, 20.0);
    let looks: Vec<LandmarkPose> = places.iter().map(|p| photograph(p, &truth, 0.3, &mut random)).collect();
    let mut stated = places;
    stated[0].x_m += 0.6;
    let all: Vec<_> =
        looks.iter().zip(&stated).zip(1..).map(|((look, place), i)| seen(i, look, place)).collect();
    let found = camera_pose(&all).unwrap().unwrap();
    assert!(!found.landmarks.contains(&LandmarkId(1)) && found.landmarks.len() == 2, "{:?}", found.landmarks);
    assert!(error(&found, &truth).fixed_rows::<3>(3).norm() < 0.05);
}
