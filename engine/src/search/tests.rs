//! Searches without pictures: three doors that look alike along a corridor, as in `sim`'s look-alikes.

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

/// A door at `x` seen from a pose: it may be any of them.
fn seen(x: f64, from: &Pose2) -> Vec<AmbiguousObservation> {
    let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.005));
    let glimpse = RelativeObservation { robot_from_landmark: from.between(&on_floor(&place(x))), covariance };
    vec![(0..DOORS.len() as u64).map(|i| (LandmarkId(i), glimpse)).collect()]
}

/// Drives east from x = 4, looking at the things at `things` when 1 to 2 m before them. What is left in the end, and the
/// most hypotheses at a time.
fn drive(things: &[f64]) -> (Option<Pose2>, usize) {
    let (map, searches) = (map(), Relocalisers::default());
    let (mut most, mut x) = (0, 4.0);
    while x < 20.0 {
        let truth = Pose2::new(x, 0.0, 0.0);
        // Odometry began elsewhere.
        let odometry = Pose2::new(100.0, 50.0, 1.0).compose(&Pose2::new(x, 0.0, 0.0));
        let ahead = things.iter().find(|at| (1.0..2.0).contains(&(*at - x)));
        let sighted = ahead.map_or_else(Vec::new, |at| seen(*at, &truth));
        let glance = RelocalisationInput { epoch: 1, map: &map, odometry, sighted: &sighted };
        if let Some(left) = searches.glance(&name("r1"), &glance) {
            most = most.max(left.modes.iter().filter(|m| m.mass > 0.1).count());
            if let Some((pose, landmarks)) = left.decided {
                assert!(landmarks.len() >= LEAST_LANDMARKS);
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
    // The belief prefers the true place: 5.0 m apart are only the first two. But 5.55 m are within what may be wrong.
    let place_of = |x: f64| LandmarkInfo { place: Some(place(x)), ..LandmarkInfo::default() };
    let mut map = map();
    map.landmarks.insert(LandmarkId(2), place_of(16.55));
    let searches = Relocalisers::default();
    let mut needed = Vec::new();
    for x in [4.2, 4.6, 5.0, 9.2, 9.6, 10.0, 10.4] {
        let truth = Pose2::new(x, 0.0, 0.0);
        let sighted = seen(if x < 6.0 { 6.0 } else { 11.0 }, &truth);
        let glance = RelocalisationInput { epoch: 1, map: &map, odometry: truth, sighted: &sighted };
        let left = searches.glance(&name("r1"), &glance).unwrap();
        assert!(left.decided.is_none(), "{x}: {left:?}");
        needed = searches.progress(&name("r1")).unwrap().needed;
    }
    assert!(matches!(needed[..], [MissingCondition::NoRivalPose]), "{needed:?}");
}

#[test]
fn how_far_a_search_has_come_is_told() {
    let (map, searches) = (map(), Relocalisers::default());
    assert!(searches.progress(&name("r1")).is_none(), "nothing was seen");
    let look = |x: f64| {
        let sighted = seen(if x < 8.0 { 6.0 } else { 11.0 }, &Pose2::new(x, 0.0, 0.0));
        let odometry = Pose2::new(x, 0.0, 0.0);
        searches
            .glance(&name("r1"), &RelocalisationInput { epoch: 1, map: &map, odometry, sighted: &sighted })
            .unwrap()
    };
    look(4.5);
    let first = searches.progress(&name("r1")).unwrap();
    assert_eq!(
        (first.sightings, first.modes.len(), &first.needed[..]),
        (1, 3, &[MissingCondition::HigherProbability][..])
    );
    assert!(first.modes.iter().all(|m| (0.2..0.45).contains(&m.mass)) && first.landmarks.len() == 1);
    look(9.5);
    let second = searches.progress(&name("r1")).unwrap();
    assert_eq!((second.landmarks.len(), &second.needed[..]), (2, &[][..]), "{second:?}");
    assert!(second.entropy_nats < first.entropy_nats && second.map == "hall");
    searches.end(&name("r1"));
    assert!(searches.progress(&name("r1")).is_none());
}

#[test]
fn one_door_alone_never_settles_it() {
    // Nor something that is on no map, however often it is seen.
    assert_eq!(drive(&[6.0]), (None, 3));
    assert_eq!(drive(&[8.3]).0, None);
}

#[test]
fn a_thing_that_could_only_be_one_door_settles_nothing_alone() {
    // Seen from so far that for the other door the robot would stand outside of the map; but it may be on no map.
    let mut map = map();
    map.landmarks.remove(&LandmarkId(2));
    let searches = Relocalisers::default();
    let mut sure = 0;
    for k in 0..4 {
        let at = Pose2::new(10.4 + 0.35 * f64::from(k), 0.0, 0.0);
        let sighted = seen(19.0, &at);
        let glance = RelocalisationInput { epoch: 1, map: &map, odometry: at, sighted: &sighted };
        let left = searches.glance(&name("r1"), &glance).unwrap();
        sure += usize::from(left.modes[0].mass > 0.95);
        assert!(left.decided.is_none(), "{left:?}");
    }
    assert!(sure > 0, "it would be sure of the wrong place");
}

#[test]
fn standing_before_a_door_tells_nothing_new() {
    let (map, searches) = (map(), Relocalisers::default());
    let at = Pose2::new(4.5, 0.0, 0.0);
    let sighted = seen(6.0, &at);
    let glance = RelocalisationInput { epoch: 1, map: &map, odometry: at, sighted: &sighted };
    let first = searches.glance(&name("r1"), &glance).unwrap().modes;
    for _ in 0..50 {
        let again = searches.glance(&name("r1"), &glance).unwrap();
        assert!(again.decided.is_none() && again.modes == first);
    }
    // Another start of its software is another odometry.
    let anew = RelocalisationInput { epoch: 2, sighted: &[], ..glance };
    assert!(searches.glance(&name("r1"), &anew).is_none());
}

#[test]
fn searches_are_bounded_and_end() {
    let (map, searches) = (map(), Relocalisers::default());
    let at = Pose2::new(4.5, 0.0, 0.0);
    let sighted = seen(6.0, &at);
    let glance = RelocalisationInput { epoch: 1, map: &map, odometry: at, sighted: &sighted };
    let unseen = RelocalisationInput { sighted: &[], ..glance };
    assert!(searches.glance(&name("r0"), &unseen).is_none(), "nothing begins without a sighting");
    for r in 0..=MAX_SEARCHES {
        assert!(searches.glance(&name(&format!("r{r}")), &glance).is_some());
    }
    assert!(searches.glance(&name("r0"), &unseen).is_none(), "the stalest has given way");
    searches.end(&name("r1"));
    assert!(searches.glance(&name("r1"), &unseen).is_none());
    let far = MapSnapshot {
        walls: Arc::new(vec![map::segments::LaserSegment::by_hand(&[0.0, 0.0, 9000.0, 9000.0]).unwrap()]),
        ..map.clone()
    };
    assert!(
        searches.glance(&name("r9"), &RelocalisationInput { map: &far, ..glance }).is_none(),
        "too large a map"
    );
}
