//! Claim: the scans of other people's lasers are used, or refused with the name of the field.

use super::robot::{mountings, robot, scans, turn, wheels};
use protos::convert::CheckedScan;
use ros2::messages::{AnyMessage, LaserScan};

const HALF_TURN: f32 = std::f32::consts::PI;
const TURN: f32 = std::f32::consts::TAU;

type Change = fn(&mut LaserScan<'static>);

fn fan(scan: &mut LaserScan<'static>, first: f32, step: f32, rays: usize) {
    let last = first + step * (rays as f32 - 1.0);
    (scan.angle_min, scan.angle_max, scan.angle_increment) = (first, last, step);
    (scan.time_increment, scan.ranges) = (0.0, vec![1.0; rays]);
}

/// Rays used, and those with a return.
const USED: &[(&str, Change, (usize, usize))] = &[
    ("three rays, one too near", |_| {}, (3, 2)),
    ("LDS-01 in Gazebo", |s| fan(s, 0.0, 0.017_501_923, 360), (359, 359)),
    ("LDS-01", |s| fan(s, 0.0, 0.017_453_294, 360), (360, 360)),
    ("RPLIDAR A1", |s| fan(s, -HALF_TURN, TURN / 359.0, 360), (360, 360)),
    ("RPLIDAR S2", |s| fan(s, -HALF_TURN, TURN / 3239.0, 3240), (3240, 3240)),
    ("YDLIDAR X4, 2 % more rays than a turn", |s| fan(s, -HALF_TURN, TURN / 505.0, 515), (506, 506)),
    ("SICK TiM", |s| fan(s, -2.356_194_5, 0.005_817_764, 811), (811, 811)),
    ("UTM-30LX", |s| fan(s, -2.356_194_5, 0.004_363_323, 1081), (1081, 1081)),
    ("clockwise", |s| fan(s, HALF_TURN, -TURN / 359.0, 360), (360, 360)),
    ("clockwise from a whole turn", |s| fan(s, TURN, -0.017_453_294, 360), (360, 360)),
    ("clockwise, first ray repeated", |s| fan(s, TURN + 5e-6, -0.017_501_923, 360), (359, 359)),
    ("one ray", |s| fan(s, 0.0, 0.01, 1), (1, 1)),
    ("range_max infinite", |s| s.range_max = f32::INFINITY, (3, 2)),
    ("range_max the largest number", |s| s.range_max = f32::MAX, (3, 2)),
    ("range_max 0.2 km over the limit", |s| s.range_max = 1200.0, (3, 2)),
    ("range_min 0", |s| s.range_min = 0.0, (3, 3)),
    ("range_min negative", |s| s.range_min = -1.0, (3, 3)),
    ("no return as infinity", |s| s.ranges[2] = f32::INFINITY, (3, 1)),
    (
        "no return as infinity of no limit",
        |s| (s.range_max, s.ranges[2]) = (f32::INFINITY, f32::INFINITY),
        (3, 1),
    ),
    ("too near as minus infinity", |s| s.ranges[2] = f32::NEG_INFINITY, (3, 1)),
    ("no return as NaN", |s| s.ranges[2] = f32::NAN, (3, 1)),
    ("no return as 0", |s| s.ranges[2] = 0.0, (3, 1)),
    ("no return as range_max and more", |s| s.ranges[2] = 65.533, (3, 1)),
    ("no returns at all", |s| s.ranges = vec![f32::NAN; 3], (3, 0)),
    ("angle_max left out", |s| s.angle_max = 0.0, (3, 2)),
    ("angle_max NaN", |s| s.angle_max = f32::NAN, (3, 2)),
    ("scan_time left out", |s| s.scan_time = 0.0, (3, 2)),
    ("time_increment left out", |s| s.time_increment = 0.0, (3, 2)),
    (
        "most rays",
        |s| fan(s, 0.0, 1e-4, map::laser::MAX_BEAMS),
        (map::laser::MAX_BEAMS, map::laser::MAX_BEAMS),
    ),
];

/// Words of the refusal.
const REFUSED: &[(&str, Change, &str)] = &[
    ("no rays", |s| s.ranges.clear(), "without rays"),
    ("too many rays", |s| fan(s, 0.0, 1e-4, map::laser::MAX_BEAMS + 1), "16385 rays"),
    ("angles in degrees", |s| fan(s, -0.5, 1.0, 360), "`angle_increment` times the rays"),
    ("a turn and a quarter", |s| fan(s, 0.0, TURN / 360.0, 450), "`angle_increment` times the rays"),
    ("no angle_increment", |s| s.angle_increment = 0.0, "`angle_increment` of the scan is 0"),
    ("angle_increment NaN", |s| s.angle_increment = f32::NAN, "`angle_increment` of the scan is NaN"),
    (
        "angle_increment infinite",
        |s| s.angle_increment = f32::INFINITY,
        "`angle_increment` of the scan is inf",
    ),
    ("angle_increment tiny", |s| s.angle_increment = 1e-7, "`angle_increment` of the scan is 0.0000001"),
    ("angle_min in degrees", |s| s.angle_min = -180.0, "`angle_min` of the scan is -180"),
    ("angle_min NaN", |s| s.angle_min = f32::NAN, "`angle_min` of the scan is NaN"),
    ("range_max 0", |s| s.range_max = 0.0, "`range_max` of the scan is 0"),
    ("range_max NaN", |s| s.range_max = f32::NAN, "`range_max` of the scan is NaN"),
    ("range_max not over range_min", |s| s.range_max = s.range_min, "`range_max` of the scan is 0.1"),
    ("range_max minus infinity", |s| s.range_max = f32::NEG_INFINITY, "`range_max` of the scan is -inf"),
    ("range_min NaN", |s| s.range_min = f32::NAN, "`range_min` of the scan is NaN"),
    ("range_min infinite", |s| s.range_min = f32::INFINITY, "`range_min` of the scan is inf"),
    ("time_increment negative", |s| s.time_increment = -1e-4, "`time_increment` of the scan is -0.00009"),
    ("time_increment NaN", |s| s.time_increment = f32::NAN, "`time_increment` of the scan is NaN"),
    ("a scan that takes a minute", |s| s.time_increment = 30.0, "`time_increment` of the scan is 30"),
];

/// What the adapter makes of the scan, checked as the server checks it.
fn outcome(change: Change) -> Result<(usize, usize), String> {
    let mut robot = robot();
    robot.take("/tf_static", &mountings());
    robot.take("/odom", &wheels(1000, 1.0));
    robot.take("/odom", &wheels(2000, 3.0));
    let mut scan = turn(1490);
    change(&mut scan);
    let taken = robot.take("/scan", &AnyMessage::LaserScan(scan));
    if let [problem] = &taken.problems[..] {
        assert_eq!((problem.word(), scans(&taken).len()), ("bad_scan", 0));
        return Err(problem.to_string());
    }
    let checked =
        CheckedScan::try_from(scans(&taken)[0].clone()).map_err(|r| format!("by the server: {r}"))?;
    let rays = checked.scan.ranges_m().len();
    Ok((rays, (0..rays).filter(|i| checked.scan.point(*i).is_some()).count()))
}

#[test]
fn each_variant_is_used_or_refused_by_name() {
    for (name, change, expected) in USED {
        assert_eq!(outcome(*change), Ok(*expected), "{name}");
    }
    for (name, change, words) in REFUSED {
        let refusal = outcome(*change).expect_err(name);
        assert!(refusal.contains(words), "{name}: {refusal}");
    }
}
