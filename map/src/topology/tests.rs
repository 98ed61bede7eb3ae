//! The topology of small maps by hand, against brute force, and at its bounds.

mod bounds;
mod brute_force;

use super::*;
use crate::{
    gaze::{GazeCandidate, GazeParams, PanTiltUnit, rank},
    map_links::{MapLink, MapLinks},
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance, wrap_rad},
    segments::LaserSegment,
    visibility::{Obstacle, PanTiltCamera, VisibilityMap, VisibilityParams, visibility},
};
use nalgebra::{Matrix3, Point2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use vision::{model::LandmarkId, pose::LandmarkSize};

const SIZE: LandmarkSize = LandmarkSize { width_m: 0.6, height_m: 0.84 };

/// Walls and posters: x, y, direction of the normal.
struct Plan {
    walls: Vec<LaserSegment>,
    posters: Vec<(LandmarkId, LandmarkPlace, VisibilityMap)>,
}

impl Plan {
    fn new(walls: &[[f64; 4]], posters: &[[f64; 3]]) -> Self {
        let walls: Vec<_> = walls.iter().map(|ends| LaserSegment::by_hand(ends).unwrap()).collect();
        let obstacles: Vec<Obstacle> = walls.iter().map(Obstacle::from).collect();
        let poster = |([x, y, theta], i): (&[f64; 3], u64)| {
            let centre = Vector3::new(*x, *y, 1.4);
            let place = LandmarkPlace::by_hand(centre, *theta, SIZE, PlaceSigmas::default()).unwrap();
            let viewer = PanTiltCamera { pan_rad: [-PI, PI], ..PanTiltCamera::default() };
            let area = visibility(&place, &obstacles, &viewer, &VisibilityParams::default()).unwrap();
            (LandmarkId(i), place, area)
        };
        Self { walls, posters: posters.iter().zip(1..).map(poster).collect() }
    }

    fn areas(&self) -> Vec<(LandmarkId, &VisibilityMap)> {
        self.posters.iter().map(|(id, _, area)| (*id, area)).collect()
    }

    fn topology(&self) -> MapTopology {
        map_topology(&self.walls, &self.areas()).unwrap()
    }

    fn candidates(&self) -> Vec<GazeCandidate<'_>> {
        self.posters
            .iter()
            .map(|(landmark, place, visible)| GazeCandidate {
                landmark: *landmark,
                place,
                visible,
                saliency: 0.8,
                v_c: 1.0,
            })
            .collect()
    }
}

/// A corridor of 12 x 2 m along x with two rooms of 6 x 4 m above it, each with a door of 0.9 m at
/// x = 3 and x = 9; a poster in the corridor under each door's middle between them, one in the left
/// room, none in the right one.
fn corridor() -> Plan {
    let walls = [
        [0.0, 0.0, 12.0, 0.0],
        [12.0, 0.0, 12.0, 6.0],
        [12.0, 6.0, 0.0, 6.0],
        [0.0, 6.0, 0.0, 0.0],
        [0.0, 2.0, 2.55, 2.0],
        [3.45, 2.0, 8.55, 2.0],
        [9.45, 2.0, 12.0, 2.0],
        [6.0, 2.0, 6.0, 6.0],
    ];
    Plan::new(&walls, &[[6.0, 0.001, FRAC_PI_2], [3.0, 5.999, -FRAC_PI_2]])
}

fn at(map: &str, place: usize) -> PlaceAt<&str> {
    PlaceAt { map, place }
}

fn site<'a>(
    plans: &'a [(&'static str, &'a Plan)],
    links: &MapLinks<&'static str>,
) -> SiteTopology<&'static str> {
    let maps = plans.iter().map(|(map, plan)| (*map, (plan.topology(), plan.areas()))).collect();
    SiteTopology::new(maps, links).unwrap()
}

#[test]
fn two_rooms_and_a_corridor_are_three_places_and_two_doorways() {
    let plan = corridor();
    let made = plan.topology();
    let places: Vec<usize> = [[6.0, 1.0], [3.0, 4.0], [9.0, 4.0]]
        .map(|[x, y]| made.place_at(&Point2::new(x, y)).unwrap())
        .to_vec();
    assert_eq!((places, made.places.len(), made.doorways.len()), (vec![0, 1, 2], 3, 2));
    for (doorway, (x, room)) in made.doorways.iter().zip([(3.0, 1), (9.0, 2)]) {
        assert_eq!(doorway.places, [0, room]);
        assert!((doorway.middle - Point2::new(x, 2.0)).norm() < 0.15, "{doorway:?}");
        assert!((doorway.width_m - 0.9).abs() < 0.11, "{doorway:?}");
        // Centres are (6, 1) and (x, 4): eight directions are at most 8 % longer than straight.
        for (way_m, straight_m) in doorway.ways_m.into_iter().zip([10.0_f64.sqrt(), 2.0]) {
            assert!((0.97..1.1).contains(&(way_m / straight_m)), "{doorway:?}");
        }
    }
    // Free floor is 0.25 m away from the walls.
    for (place, area_m2) in made.places.iter().zip([11.5 * 1.5, 5.5 * 3.5, 5.5 * 3.5]) {
        assert!((place.area_m2 / area_m2 - 1.0).abs() < 0.08, "{place:?}");
    }
    let seen = |place: usize| made.places[place].landmarks.iter().map(|s| s.landmark.0).collect::<Vec<_>>();
    assert_eq!(seen(0)[0], 1, "the poster of the corridor");
    assert_eq!(seen(1)[0], 2);
    assert!(!seen(2).contains(&2), "a wall hides it from the right room");
    assert!(made.doorways[0].landmarks.contains(&LandmarkId(2)), "{:?}", made.doorways[0]);
}

/// Shares are those of visible samples: against counting all points of a fine grid.
#[test]
fn shares_are_those_of_the_floor_from_which_a_landmark_is_seen() {
    let plan = corridor();
    let made = plan.topology();
    let (mut inside, mut seen) = (0, 0);
    for (i, j) in (0..240).flat_map(|i| (0..35).map(move |j| (i, j))) {
        let point = Point2::new(0.27 + 0.048 * f64::from(i), 0.27 + 0.042 * f64::from(j));
        if made.free_at(&point).is_some_and(|(place, _)| place == 0) {
            inside += 1;
            seen += i32::from(plan.posters[0].2.contains(&point));
        }
    }
    let counted = f64::from(seen) / f64::from(inside);
    let share = made.places[0].landmarks.iter().find(|s| s.landmark.0 == 1).unwrap().share;
    assert!(counted > 0.2 && (share - counted).abs() < 0.03, "{share} {counted}");
}

#[test]
fn a_route_goes_from_passage_to_passage_with_the_landmark_to_look_for() {
    let plan = corridor();
    let site = site(&[("hall", &plan)], &MapLinks::new());
    let start = Point2::new(1.0, 5.0);
    let legs = site.route(&at("hall", 1), Some(start), &at("hall", 2)).unwrap();
    let places: Vec<_> = legs.iter().map(|leg| (leg.place.place, leg.passage)).collect();
    assert_eq!(places, [(1, Some(0)), (0, Some(1)), (2, None)]);
    assert!((legs[0].length_m - 13.0_f64.sqrt()).abs() < 0.15, "{:?}", legs[0]);
    // From door to door, round two corners that are 0.25 m away from the wall.
    assert!((legs[1].length_m - 6.0).abs() < 0.25, "{:?}", legs[1]);
    assert_eq!(legs[1].path.first(), Some(&site.passages[0].middles[0]));
    let (viewer, head) = (PanTiltCamera::default(), PanTiltUnit::default());
    let candidates = plan.candidates();
    let next = next_landmark(&legs[1].path, &candidates, &viewer, &head).unwrap().unwrap();
    assert_eq!(next.target.landmark.0, 1, "the poster of the corridor");
    // The turn of the camera points at the poster; the ranking at that pose says the same.
    let pose = next.map_from_robot;
    let bearing = (0.001 - pose.y_m).atan2(6.0 - pose.x_m);
    assert!(wrap_rad(pose.theta_rad + next.target.pan_rad - bearing).abs() < 1e-9);
    let sure = Pose2Covariance { pose, covariance: Matrix3::zeros() };
    let ranked = rank(&sure, &candidates, &viewer, &head, &GazeParams::default()).unwrap();
    assert_eq!(ranked[0], next.target);
    assert!(next.along_m <= legs[1].length_m);
    let unsure: Vec<_> = candidates.iter().map(|c| GazeCandidate { v_c: 0.0, ..*c }).collect();
    let seen = next_landmark(&legs[1].path, &unsure, &viewer, &head).unwrap().unwrap();
    assert!(seen.target.landmark.0 == 1 && seen.target.utility.abs() < 1e-15 && seen.along_m <= next.along_m);
    assert_eq!(next_landmark(&legs[2].path, &candidates[1..], &viewer, &head).unwrap(), None);
    let stay = site.route(&at("hall", 1), None, &at("hall", 1)).unwrap();
    assert_eq!((stay.len(), stay[0].passage, stay[0].path.len()), (1, None, 1));
    assert!(next_landmark(&stay[0].path, &candidates, &viewer, &head).unwrap().is_some());
    assert_eq!(site.route(&at("hall", 1), None, &at("hall", 3)), None);
    assert_eq!(site.route(&at("yard", 0), None, &at("hall", 1)), None);
}

#[test]
fn floor_from_which_nothing_is_seen_counts_where_it_is_connected() {
    let mut walls = corridor().walls.iter().map(|w| [w.a.x, w.a.y, w.b.x, w.b.y]).collect::<Vec<_>>();
    let posters = [[6.0, 0.001, FRAC_PI_2]];
    let open = Plan::new(&walls, &posters).topology();
    assert_eq!(open.places.len(), 3, "rooms without landmarks are ways");
    // The right door is shut.
    walls.push([8.55, 2.0, 9.45, 2.0]);
    let shut = Plan::new(&walls, &posters).topology();
    assert_eq!((shut.places.len(), shut.doorways.len()), (2, 1));
    assert_eq!(shut.place_at(&Point2::new(9.0, 4.0)), None);
    let blind = Plan::new(&walls, &[]).topology();
    assert!(blind.places.is_empty() && blind.place_at(&Point2::new(6.0, 1.0)).is_none());
    assert!(map_topology(&[], &[]).unwrap().places.is_empty());
    // Without walls the floor is the box around what is seen.
    assert_eq!(Plan::new(&[], &posters).topology().places.len(), 1);
}

fn link(parent: &'static str, pose: Pose2, level_m: f64) -> MapLink<&'static str> {
    let parent_from_map = Pose2Covariance { pose, covariance: Matrix3::zeros() };
    MapLink { parent, parent_from_map, level_m }
}

/// A room with a poster; in its own frame from 0 to 4 m.
fn room() -> Plan {
    let walls = [[0.0, 0.0, 4.0, 0.0], [4.0, 0.0, 4.0, 4.0], [4.0, 4.0, 0.0, 4.0], [0.0, 4.0, 0.0, 0.0]];
    Plan::new(&walls, &[[2.0, 0.001, FRAC_PI_2]])
}

#[test]
fn a_link_joins_the_places_with_most_common_floor() {
    let (hall, room) = (corridor(), room());
    // The room is turned a quarter and lies over the right room of the hall: x 7 to 11, y 1.9 to
    // 5.9.
    let pose = Pose2::new(11.0, 1.9, FRAC_PI_2);
    let plans = [("hall", &hall), ("room", &room)];
    let both = site(&plans, &[("room", link("hall", pose, 3.0))].into());
    let passage = both.passages.last().unwrap();
    assert_eq!((both.passages.len(), &passage.places), (3, &[at("room", 0), at("hall", 2)]));
    assert!((pose.apply(&passage.middles[0]) - passage.middles[1]).norm() < 1e-9);
    assert!((passage.between_m - 3.0).abs() < 1e-12 && passage.width_m.is_none());
    let legs = both.route(&at("room", 0), None, &at("hall", 0)).unwrap();
    let maps: Vec<_> = legs.iter().map(|leg| leg.place.map).collect();
    assert_eq!(maps, ["room", "hall", "hall"]);
    let back = both.route(&at("hall", 0), None, &at("room", 0)).unwrap();
    let sum = |legs: &[Leg<&str>]| legs.iter().map(|leg| leg.length_m).sum::<f64>();
    assert!((sum(&legs) - sum(&back)).abs() < 0.1 && sum(&legs) > 3.0);
    // Beside one another: the nearest centres, (-3, 4) of the room and (3, 4) of the left room.
    let beside = site(&plans, &[("room", link("hall", Pose2::new(-5.0, 2.0, 0.0), 0.0))].into());
    let passage = beside.passages.last().unwrap();
    assert_eq!(passage.places, [at("room", 0), at("hall", 1)]);
    assert!((passage.length_m() - 6.0).abs() < 0.2, "{passage:?}");
    // Not linked, or linked to another map.
    assert_eq!(site(&plans, &MapLinks::new()).route(&at("room", 0), None, &at("hall", 0)), None);
    assert_eq!(site(&plans, &[("room", link("yard", pose, 0.0))].into()).passages.len(), 2);
}
