//! Every list and size at its bound.

use super::*;

/// Rooms of 2 m side by side, joined by doors of 0.8 m; the first one has a poster.
fn many_rooms(columns: usize, rows: usize) -> Plan {
    const SIDE_M: f64 = 2.0;
    const JAMB_M: f64 = 0.6;
    let (width, height) = (columns as f64 * SIDE_M, rows as f64 * SIDE_M);
    let mut walls = vec![
        [0.0, 0.0, width, 0.0],
        [width, 0.0, width, height],
        [width, height, 0.0, height],
        [0.0, height, 0.0, 0.0],
    ];
    // A pier of both jambs at each corner leaves the doors between piers.
    for row in 0..rows {
        for column in 0..columns {
            let (x, y) = (column as f64 * SIDE_M, row as f64 * SIDE_M);
            if column > 0 {
                walls.push([x, (y - JAMB_M).max(0.0), x, y + JAMB_M]);
                walls.push([x, y + SIDE_M - JAMB_M, x, y + SIDE_M]);
            }
            if row > 0 {
                walls.push([(x - JAMB_M).max(0.0), y, x + JAMB_M, y]);
                walls.push([x + SIDE_M - JAMB_M, y, x + SIDE_M, y]);
            }
        }
    }
    Plan::new(&walls, &[[1.0, 0.001, FRAC_PI_2]])
}

#[test]
fn places_and_doorways_are_bounded() {
    let few = many_rooms(4, 3).topology();
    assert_eq!((few.places.len(), few.doorways.len()), (12, 17));
    let made = many_rooms(24, 22).topology();
    assert_eq!((made.places.len(), made.doorways.len()), (MAX_PLACES, MAX_DOORWAYS));
    assert!(made.doorways.windows(2).all(|w| w[0].places <= w[1].places));
}

#[test]
fn small_cores_are_no_places() {
    // A niche of 0.9 m beyond a door: its core is too small.
    let side = 1.1 + 0.5 * MIN_CORE_M2.sqrt();
    let walls = |depth: f64| {
        vec![
            [0.0, 0.0, 4.0, 0.0],
            [4.0, 0.0, 4.0, 4.0],
            [4.0, 4.0, 0.0, 4.0],
            [0.0, 4.0, 0.0, 2.7],
            [0.0, 1.8, 0.0, 0.0],
            [0.0, 2.7, 0.0, 2.25 + 0.5 * depth],
            [0.0, 1.8, 0.0, 2.25 - 0.5 * depth],
            [0.0, 2.25 + 0.5 * depth, -depth, 2.25 + 0.5 * depth],
            [0.0, 2.25 - 0.5 * depth, -depth, 2.25 - 0.5 * depth],
            [-depth, 2.25 + 0.5 * depth, -depth, 2.25 - 0.5 * depth],
        ]
    };
    let count = |depth: f64| Plan::new(&walls(depth), &[[2.0, 0.001, FRAC_PI_2]]).topology().places.len();
    assert_eq!((count(side), count(2.2)), (1, 2));
}

#[test]
fn landmarks_of_a_place_are_bounded() {
    let walls = [[0.0, 0.0, 30.0, 0.0], [30.0, 0.0, 30.0, 4.0], [30.0, 4.0, 0.0, 4.0], [0.0, 4.0, 0.0, 0.0]];
    let count = MAX_SEEN + 4;
    let posters: Vec<[f64; 3]> = (0..count).map(|i| [1.0 + 0.7 * i as f64, 0.001, FRAC_PI_2]).collect();
    let plan = Plan::new(&walls, &posters);
    let made = plan.topology();
    // By counting samples: shares fall, those of equals by number.
    let samples: Vec<_> = made.samples().map(|(point, ..)| point).collect();
    let seen_from = |area: &VisibilityMap| samples.iter().filter(|point| area.contains(point)).count();
    let mut all: Vec<_> = plan.areas().into_iter().map(|(id, area)| (seen_from(area), id)).collect();
    all.sort_by_key(|(count, id)| (std::cmp::Reverse(*count), *id));
    let named: Vec<_> = made.places[0].landmarks.iter().map(|seen| seen.landmark).collect();
    assert_eq!(named, all.into_iter().map(|(_, id)| id).take(MAX_SEEN).collect::<Vec<_>>());
    assert_eq!((named.len(), made.places.len()), (MAX_SEEN, 1));
}

#[test]
fn a_floor_that_is_too_large_is_refused() {
    let walls = |side_m: f64| [LaserSegment::by_hand(&[0.0, 0.0, side_m, side_m]).unwrap()];
    // 512 cells of 0.3 m in each direction.
    assert!(map_topology(&walls(153.2), &[]).is_ok());
    let refused = map_topology(&walls(153.7), &[]).unwrap_err();
    assert!(refused.width_m > 153.0 && refused.to_string().contains("154 x 154 m"), "{refused}");
    let far = LaserSegment::by_hand(&[0.0, 0.0, 1e5, 0.0]).unwrap();
    assert!(map_topology(&[far, walls(40.0)[0].clone()], &[]).is_err());
}

#[test]
fn maps_of_a_site_are_bounded() {
    let plan = room();
    let maps = |count: usize| {
        let one = |i: usize| (i, (plan.topology(), plan.areas()));
        SiteTopology::new((0..count).map(one).collect(), &MapLinks::new())
    };
    assert_eq!(maps(MAX_SITE_MAPS).unwrap().maps.len(), MAX_SITE_MAPS);
    assert_eq!(maps(MAX_SITE_MAPS + 1), Err(TooManyMaps(MAX_SITE_MAPS + 1)));
}

#[test]
fn a_point_near_free_floor_belongs_to_it() {
    let made = room().topology();
    // The first free column is 0.25 to 0.35 m from the wall.
    assert_eq!(made.place_at(&Point2::new(0.36 - NEAR_M, 2.0)), Some(0));
    assert_eq!(made.place_at(&Point2::new(0.24 - NEAR_M, 2.0)), None);
}
