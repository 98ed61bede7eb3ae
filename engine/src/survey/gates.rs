//! Which objects are landmarks, by their places and views. In: objects with the poses of their
//! views. Out: why one is none.

use super::surveyed::SurveyedObject;
use map::{place::LandmarkPlace, pose2::Pose2};
use nalgebra::Vector2;

/// Gates of an object: mean weight of its views, standard deviation of its centre (metres), angle
/// between its views (radians) or way between them (metres), and number of views.
const MIN_AGREEMENT: f64 = 0.5;
const MAX_SIGMA_M: f64 = 0.25;
const MIN_PARALLAX_RAD: f64 = 0.14;
const MIN_BASELINE_M: f64 = 0.5;
const MIN_VIEWS: usize = 4;
/// An object whose lower edge is below this height stands on the floor, metres.
const FLOOR_M: f64 = 0.15;
/// Nothing wider is a door, metres: the end of a corridor is, and its posters are no parts of it.
const MAX_DOOR_M: f64 = 2.4;

/// Why an object is no landmark by its own views.
pub(super) fn refusal(place: &LandmarkPlace, agreement: f64, poses: &[Pose2]) -> Option<String> {
    let centre = Vector2::new(place.x_m, place.y_m);
    let ways: Vec<Vector2<f64>> = poses.iter().map(|pose| pose.position() - centre).collect();
    let pairs = || ways.iter().enumerate().flat_map(|(i, a)| ways[i + 1..].iter().map(move |b| (a, b)));
    let parallax = pairs().map(|(a, b)| a.angle(b)).fold(0.0, f64::max);
    let baseline_m = pairs().map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    let sigma_m = (place.covariance[(0, 0)] + place.covariance[(1, 1)]).sqrt();
    if poses.len() < MIN_VIEWS {
        Some(format!("{} views, {MIN_VIEWS} needed", poses.len()))
    } else if parallax < MIN_PARALLAX_RAD && baseline_m < MIN_BASELINE_M {
        Some(format!("seen from one place only: {:.0} degrees, {baseline_m:.2} m", parallax.to_degrees()))
    } else if agreement < MIN_AGREEMENT {
        Some(format!("its views contradict each other: {:.0} % agree", 100.0 * agreement))
    } else if sigma_m > MAX_SIGMA_M {
        Some(format!("its place is known to {sigma_m:.2} m only"))
    } else if stands_on_floor(place) {
        Some("it stands on the floor, as doors do: they open, and look alike".to_owned())
    } else {
        None
    }
}

fn stands_on_floor(place: &LandmarkPlace) -> bool {
    place.z_m - 0.5 * place.size.height_m < FLOOR_M
}

fn is_door(place: &LandmarkPlace) -> bool {
    stands_on_floor(place) && place.size.width_m <= MAX_DOOR_M
}

/// Of objects at one place, that with most views stays: the others are its frame or its mat. Of a
/// door no part stays.
pub(super) fn refuse_twins(objects: &mut [SurveyedObject]) {
    let reach = |place: &LandmarkPlace| 0.5 * place.size.width_m.max(place.size.height_m);
    let at = |place: &LandmarkPlace| place.map_from_landmark().translation.vector;
    for i in 0..objects.len() {
        if objects[i].refused.is_some() {
            continue;
        }
        let why = (0..objects.len()).filter(|j| *j != i).find_map(|j| {
            let (own, other) = (&objects[i], &objects[j]);
            let apart = (at(&own.place) - at(&other.place)).norm();
            let is_near = apart < reach(&own.place).max(reach(&other.place));
            let more_views =
                (other.views.len(), std::cmp::Reverse(j)) > (own.views.len(), std::cmp::Reverse(i));
            if is_near && is_door(&other.place) {
                Some("it is a part of something that stands on the floor")
            } else if is_near && more_views && other.refused.is_none() {
                Some("another one with more views is at its place")
            } else {
                None
            }
        });
        objects[i].refused = why.map(str::to_owned);
    }
}

#[cfg(test)]
mod tests {
    use super::{super::objects::ObjectView, *};
    use map::place::PlaceSigmas;
    use nalgebra::{Point2, Vector3};
    use vision::{geometry::Corners, pose::LandmarkSize};

    fn place(x_m: f64, width_m: f64) -> LandmarkPlace {
        let size = LandmarkSize { width_m, height_m: 0.8 };
        LandmarkPlace::by_hand(Vector3::new(x_m, 0.0, 1.5), 0.0, size, PlaceSigmas::default()).unwrap()
    }

    fn object(x_m: f64, width_m: f64, views: usize) -> SurveyedObject {
        let corners = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]].map(Point2::from);
        let view = ObjectView {
            frame: 0,
            corners_px: Corners::new(corners).unwrap(),
            covariance_px2: [nalgebra::Matrix2::identity(); 4],
        };
        SurveyedObject { place: place(x_m, width_m), views: vec![view; views], refused: None }
    }

    #[test]
    fn an_object_needs_views_from_several_places_that_agree() {
        let poses = |ways: &[f64]| ways.iter().map(|y| Pose2::new(2.0, *y, 0.0)).collect::<Vec<_>>();
        let there = place(0.0, 0.6);
        let why = |agreement, poses: &[Pose2]| refusal(&there, agreement, poses).unwrap_or_default();
        assert_eq!(why(0.9, &poses(&[-0.5, 0.0, 0.5, 1.0])), "");
        assert_eq!(why(0.9, &poses(&[-0.5, 0.0, 0.5])), "3 views, 4 needed");
        assert!(why(0.9, &poses(&[0.0, 0.01, 0.02, 0.03])).contains("one place only: 1 degrees, 0.03 m"));
        assert!(why(0.4, &poses(&[-0.5, 0.0, 0.5, 1.0])).contains("40 % agree"));
        let mut vague = there;
        vague.covariance[(0, 0)] = 0.09;
        let why = refusal(&vague, 0.9, &poses(&[-0.5, 0.0, 0.5, 1.0])).unwrap();
        assert_eq!(why, "its place is known to 0.30 m only");
    }

    #[test]
    fn a_door_and_its_panels_are_no_landmarks() {
        let poses: Vec<Pose2> = [-0.5, 0.0, 0.5, 1.0].iter().map(|y| Pose2::new(2.0, *y, 0.0)).collect();
        let size = LandmarkSize { width_m: 0.9, height_m: 2.1 };
        let of = |z_m| LandmarkPlace { z_m, size, ..place(0.0, 0.9) };
        assert!(refusal(&of(1.1), 0.9, &poses).unwrap().contains("stands on the floor"));
        assert_eq!(refusal(&of(1.3), 0.9, &poses), None, "0.25 m above it");
        let door = SurveyedObject {
            place: of(1.1),
            refused: Some("3 views, 4 needed".into()),
            ..object(0.0, 0.9, 3)
        };
        let mut objects = vec![object(0.1, 0.4, 9), door, object(3.0, 0.6, 4)];
        refuse_twins(&mut objects);
        let refused: Vec<bool> = objects.iter().map(|object| object.refused.is_some()).collect();
        assert_eq!(refused, [true, true, false]);
    }

    #[test]
    fn a_poster_at_the_end_of_a_corridor_is_no_part_of_a_door() {
        let size = LandmarkSize { width_m: 2.6, height_m: 2.6 };
        let wall = LandmarkPlace { z_m: 1.4, size, ..place(0.0, 2.6) };
        let refused = Some("it stands on the floor".to_owned());
        let end = SurveyedObject { place: wall, refused, ..object(0.0, 2.6, 4) };
        let mut objects = vec![object(0.1, 0.6, 9), end];
        refuse_twins(&mut objects);
        assert_eq!(objects[0].refused, None);
        assert!(objects[1].refused.is_some(), "the wall itself is none");
    }

    #[test]
    fn of_a_picture_and_its_frame_the_one_with_most_views_stays() {
        let mut objects = vec![object(0.0, 0.6, 5), object(0.02, 0.7, 9), object(3.0, 0.6, 4)];
        refuse_twins(&mut objects);
        let refused: Vec<bool> = objects.iter().map(|object| object.refused.is_some()).collect();
        assert_eq!(refused, [true, false, false]);
        let mut equal = vec![object(0.0, 0.6, 5), object(0.02, 0.7, 5)];
        refuse_twins(&mut equal);
        assert_eq!(equal.iter().filter(|object| object.refused.is_some()).count(), 1, "one stays");
    }
}
