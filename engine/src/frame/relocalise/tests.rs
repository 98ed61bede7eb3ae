//! Relocalisation without images: three look-alike doors along a corridor, as in `sim`'s
//! look-alikes.

use super::*;
use crate::snapshot::LandmarkInfo;
use map::{
    place::{LandmarkPlace, PlaceSigmas},
    relocalise::RelativeObservation,
};
use std::f64::consts::FRAC_PI_2;
use vision::pose::LandmarkSize;

/// Along the corridor, all on its left side when looking east.
const DOORS: [f64; 3] = [6.0, 11.0, 18.0];

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn place(x: f64) -> LandmarkPlace {
    let size = LandmarkSize { width_m: 0.9, height_m: 2.0 };
    LandmarkPlace::by_hand(Vector3::new(x, 1.2, 1.0), -FRAC_PI_2, size, PlaceSigmas::default()).unwrap()
}

fn map() -> MapSnapshot {
    let landmarks = DOORS.iter().enumerate().map(|(i, x)| {
        let info =
            LandmarkInfo { name: format!("door-{i}"), place: Some(place(*x)), ..LandmarkInfo::default() };
        (LandmarkId(i as u64), info)
    });
    let wall = |ends| map::segments::LaserSegment::by_hand(&ends).unwrap();
    let walls = vec![wall([0.0, -1.2, 25.0, -1.2]), wall([25.0, 1.2, 0.0, 1.2])];
    MapSnapshot { landmarks: landmarks.collect(), walls: Arc::new(walls), ..MapSnapshot::empty("hall", 1) }
}

/// The observation of a door at `x` from a pose: it may be any of them.
fn observed(x: f64, from: &Pose2) -> Vec<AmbiguousObservation> {
    let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.005));
    let relative =
        RelativeObservation { robot_from_landmark: from.between(&on_floor(&place(x))), covariance };
    vec![(0..DOORS.len() as u64).map(|i| (LandmarkId(i), relative)).collect()]
}

/// Drives east from x = 4 and observes each of `doors` from 1 to 2 m before it. Gives the pose in
/// the end, and the most hypotheses at a time.
fn drive(doors: &[f64]) -> (Option<Pose2>, usize) {
    let (map, relocalisers) = (map(), Relocalisers::default());
    let (mut most, mut x) = (0, 4.0);
    while x < 20.0 {
        let truth = Pose2::new(x, 0.0, 0.0);
        // Odometry began elsewhere.
        let odometry = Pose2::new(100.0, 50.0, 1.0).compose(&Pose2::new(x, 0.0, 0.0));
        let ahead = doors.iter().find(|at| (1.0..2.0).contains(&(*at - x)));
        let observations = ahead.map_or_else(Vec::new, |at| observed(*at, &truth));
        let frame = RelocalisationInput { epoch: 1, map: &map, odometry, observations: &observations };
        if let Some(left) = relocalisers.update(&name("r1"), &frame) {
            most = most.max(left.hypotheses.iter().filter(|m| m.mass > 0.1).count());
            if let Some((pose, landmarks)) = left.pose {
                assert!(landmarks.len() >= MIN_LANDMARKS);
                assert!(pose.pose.minus(&truth).xy().norm() < 0.3, "{pose:?} for {truth:?}");
                return (Some(pose.pose), most);
            }
        }
        x += 0.35;
    }
    (None, most)
}

#[test]
fn one_place_is_left_when_the_distances_between_doors_say_so() {
    let (found, most) = drive(&DOORS);
    let at = found.expect("found");
    // The second door settles it: 5 m apart are only the first two.
    assert!((9.0..10.1).contains(&at.x_m) && most == 3, "{at:?} {most}");
}

#[test]
fn where_doors_hang_nearly_evenly_no_place_is_taken_for_the_only_one() {
    // The belief prefers the true pose: only the first two doors are 5.0 m apart. But 5.55 m are
    // within the errors.
    let place_of = |x: f64| LandmarkInfo { place: Some(place(x)), ..LandmarkInfo::default() };
    let mut map = map();
    map.landmarks.insert(LandmarkId(2), place_of(16.55));
    let relocalisers = Relocalisers::default();
    let mut missing = Vec::new();
    for x in [4.2, 4.6, 5.0, 9.2, 9.6, 10.0, 10.4] {
        let truth = Pose2::new(x, 0.0, 0.0);
        let observations = observed(if x < 6.0 { 6.0 } else { 11.0 }, &truth);
        let frame = RelocalisationInput { epoch: 1, map: &map, odometry: truth, observations: &observations };
        let left = relocalisers.update(&name("r1"), &frame).unwrap();
        assert!(left.pose.is_none(), "{x}: {left:?}");
        missing = relocalisers.progress(&name("r1")).unwrap().missing;
    }
    assert!(matches!(missing[..], [MissingCondition::NoRivalPose]), "{missing:?}");
}

#[test]
fn progress_says_how_far_a_relocalisation_has_come() {
    let (map, relocalisers) = (map(), Relocalisers::default());
    assert!(relocalisers.progress(&name("r1")).is_none(), "no observation yet");
    let frame_at = |x: f64| {
        let observations = observed(if x < 8.0 { 6.0 } else { 11.0 }, &Pose2::new(x, 0.0, 0.0));
        let odometry = Pose2::new(x, 0.0, 0.0);
        relocalisers
            .update(
                &name("r1"),
                &RelocalisationInput { epoch: 1, map: &map, odometry, observations: &observations },
            )
            .unwrap()
    };
    frame_at(4.5);
    let first = relocalisers.progress(&name("r1")).unwrap();
    assert_eq!(
        (first.observations, first.hypotheses.len(), &first.missing[..]),
        (1, 3, &[MissingCondition::HigherProbability][..])
    );
    assert!(first.hypotheses.iter().all(|m| (0.2..0.45).contains(&m.mass)) && first.landmarks.len() == 1);
    frame_at(9.5);
    let second = relocalisers.progress(&name("r1")).unwrap();
    assert_eq!((second.landmarks.len(), &second.missing[..]), (2, &[][..]), "{second:?}");
    assert!(second.entropy_nats < first.entropy_nats && second.map == "hall");
    relocalisers.stop(&name("r1"));
    assert!(relocalisers.progress(&name("r1")).is_none());
}

#[test]
fn one_door_alone_never_settles_it() {
    // Nor does a distractor, however often it is observed.
    assert_eq!(drive(&[6.0]), (None, 3));
    assert_eq!(drive(&[8.3]).0, None);
}

#[test]
fn an_object_that_could_only_be_one_door_settles_nothing_alone() {
    // From so far away, the robot would stand outside of the map for the other door. But the object
    // may be a distractor.
    let mut map = map();
    map.landmarks.remove(&LandmarkId(2));
    let relocalisers = Relocalisers::default();
    let mut sure = 0;
    for k in 0..4 {
        let at = Pose2::new(10.4 + 0.35 * f64::from(k), 0.0, 0.0);
        let observations = observed(19.0, &at);
        let frame = RelocalisationInput { epoch: 1, map: &map, odometry: at, observations: &observations };
        let left = relocalisers.update(&name("r1"), &frame).unwrap();
        sure += usize::from(left.hypotheses[0].mass > 0.95);
        assert!(left.pose.is_none(), "{left:?}");
    }
    assert!(sure > 0, "the belief is sure of the wrong pose");
}

#[test]
fn standing_before_a_door_tells_nothing_new() {
    let (map, relocalisers) = (map(), Relocalisers::default());
    let at = Pose2::new(4.5, 0.0, 0.0);
    let observations = observed(6.0, &at);
    let frame = RelocalisationInput { epoch: 1, map: &map, odometry: at, observations: &observations };
    let first = relocalisers.update(&name("r1"), &frame).unwrap().hypotheses;
    for _ in 0..50 {
        let again = relocalisers.update(&name("r1"), &frame).unwrap();
        assert!(again.pose.is_none() && again.hypotheses == first);
    }
    // Another epoch has another odometry.
    let anew = RelocalisationInput { epoch: 2, observations: &[], ..frame };
    assert!(relocalisers.update(&name("r1"), &anew).is_none());
}

#[test]
fn relocalisations_are_bounded_and_end() {
    let (map, relocalisers) = (map(), Relocalisers::default());
    let at = Pose2::new(4.5, 0.0, 0.0);
    let observations = observed(6.0, &at);
    let frame = RelocalisationInput { epoch: 1, map: &map, odometry: at, observations: &observations };
    let empty = RelocalisationInput { observations: &[], ..frame };
    assert!(relocalisers.update(&name("r0"), &empty).is_none(), "nothing begins without an observation");
    for r in 0..=MAX_RELOCALISERS {
        assert!(relocalisers.update(&name(&format!("r{r}")), &frame).is_some());
    }
    assert!(relocalisers.update(&name("r0"), &empty).is_none(), "the one with the oldest frame was replaced");
    relocalisers.stop(&name("r1"));
    assert!(relocalisers.update(&name("r1"), &empty).is_none());
    let far = MapSnapshot {
        walls: Arc::new(vec![map::segments::LaserSegment::by_hand(&[0.0, 0.0, 9000.0, 9000.0]).unwrap()]),
        ..map.clone()
    };
    assert!(
        relocalisers.update(&name("r9"), &RelocalisationInput { map: &far, ..frame }).is_none(),
        "too large a map"
    );
}
