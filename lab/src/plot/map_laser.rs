//! A map of walls from scans: lines of one scan, a scan matched to the one before, and a loop of corridors by odometry
//! alone, before and after the loop is closed (method 17).

use super::map_plan::{ESTIMATE, FAINT, LANDMARK, ODOMETRY, Plan, Sign, TRUTH, legend, page, title};
use crate::evaluate::chart::COLOURS;
use anyhow::Context as _;
use map::{
    laser::Scan,
    lines::segments,
    pose2::{Pose2, wrap_rad},
    segments::LaserSegment,
    slam::{Slam, SlamMap, SlamParams},
};
use nalgebra::{Point2, Vector2};
use sim::{
    building::WallSegment,
    laser::{LaserParams, scan_among},
    odometry::{Odometry, OdometryParams},
};

/// Outer size of the loop of corridors, and their width.
const OUTER_M: [f64; 2] = [15.0, 10.0];
const CORRIDOR_M: f64 = 2.0;
const STEP_M: f64 = 0.25;
const SEED: u64 = 11;
/// One scan of so many is drawn, and of it one point of so many.
const DRAWN_SCANS: usize = 8;
const DRAWN_POINTS: usize = 4;
/// What odometry says of the motion between the two scans that are matched, and the motion itself.
const BY_ODOMETRY: Pose2 = Pose2 { x_m: 0.38, y_m: -0.1, theta_rad: 0.04 };
const REALLY: Pose2 = Pose2 { x_m: 0.5, y_m: 0.04, theta_rad: 0.18 };
const SECOND: &str = COLOURS[4];

fn laser() -> LaserParams {
    LaserParams {
        robot_from_laser: Pose2::default(),
        beams: 241,
        field_rad: 4.2,
        max_range_m: 7.0,
        range_sigma_m: 0.015,
    }
}

/// The four walls of a rectangle, seen from inside or from outside.
fn rectangle([x0, y0, x1, y1]: [f64; 4], inside: bool) -> Vec<WallSegment> {
    let c = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(Point2::from);
    let side = |i: usize| {
        let (a_m, b_m) = (c[i], c[(i + 1) % 4]);
        if inside { WallSegment { a_m, b_m } } else { WallSegment { a_m: b_m, b_m: a_m } }
    };
    (0..4).map(side).collect()
}

/// Corridors around a block, with pillars that make their places different.
fn corridors() -> Vec<WallSegment> {
    let ([w, h], c) = (OUTER_M, CORRIDOR_M);
    let mut walls = rectangle([0.0, 0.0, w, h], true);
    walls.extend(rectangle([c, c, w - c, h - c], false));
    for [x, y, width, height] in [
        [4.0, 0.0, 0.4, 0.4],
        [6.5, 0.0, 0.6, 0.3],
        [10.6, 0.0, 0.3, 0.5],
        [w - 0.4, 3.4, 0.4, 0.5],
        [w - 0.3, 6.5, 0.3, 0.8],
        [11.4, h - 0.4, 0.5, 0.4],
        [8.0, h - 0.5, 0.3, 0.5],
        [3.6, h - 0.3, 0.9, 0.3],
        [0.0, 6.4, 0.5, 0.4],
        [0.0, 3.2, 0.3, 0.7],
    ] {
        walls.extend(rectangle([x, y, x + width, y + height], false));
    }
    walls
}

/// Once around the middle of the corridors, and some way on.
fn path() -> Vec<Pose2> {
    let ([w, h], m) = (OUTER_M, 0.5 * CORRIDOR_M);
    let corners = [[m, m], [w - m, m], [w - m, h - m], [m, h - m], [m, m], [0.5 * w, m]].map(Vector2::from);
    let mut poses: Vec<Pose2> = Vec::new();
    for ends in corners.windows(2) {
        let d = ends[1] - ends[0];
        let heading = d.y.atan2(d.x);
        let before = poses.last().map_or(heading, |p| p.theta_rad);
        let turn = wrap_rad(heading - before);
        poses.extend((0..4).map(|k| Pose2::new(ends[0].x, ends[0].y, before + turn * f64::from(k) / 4.0)));
        let steps = (d.norm() / STEP_M).round() as usize;
        poses.extend((0..steps).map(|k| {
            let p = ends[0] + d * (k as f64 / steps as f64);
            Pose2::new(p.x, p.y, heading)
        }));
    }
    poses
}

/// A drive through the corridors, mapped.
struct Mapping {
    truth: Vec<Pose2>,
    odometry: Vec<Pose2>,
    scans: Vec<Scan>,
    /// Pose of each scan when it came.
    online: Vec<Pose2>,
    /// The first scan that closed a loop.
    closed: usize,
    map: SlamMap,
}

impl Mapping {
    fn new() -> anyhow::Result<Self> {
        let (walls, truth) = (corridors(), path());
        let wrong =
            OdometryParams { scale_error: 0.02, heading_bias_rad_per_m: -0.009, ..OdometryParams::default() };
        let mut wheels = Odometry::new(wrong, Pose2::default(), SEED);
        let still = [truth[0]];
        let before = still.iter().chain(&truth);
        let odometry: Vec<Pose2> = before.zip(&truth).map(|(a, b)| wheels.advance(&a.between(b))).collect();
        let scans: Vec<Scan> = truth
            .iter()
            .enumerate()
            .map(|(i, at)| scan_among(&walls, at, &laser(), SEED + i as u64))
            .collect();
        let mut slam = Slam::new(SlamParams::default());
        let online: Vec<Pose2> =
            odometry.iter().zip(&scans).map(|(odom, scan)| slam.add(odom, scan)).collect::<Result<_, _>>()?;
        let map = slam.finish()?;
        let closed = map.loops.iter().map(|l| map.keys[l.new].0).min().context("no loop was closed")?;
        Ok(Self { truth, odometry, scans, online, closed, map })
    }
}

fn points(scan: &Scan, at: &Pose2) -> impl Iterator<Item = Point2<f64>> {
    let map_from_laser = at.compose(scan.robot_from_laser());
    (0..scan.ranges_m().len()).filter_map(move |i| scan.point(i).map(|p| map_from_laser.apply(&p)))
}

/// The picture.
pub(super) fn svg() -> anyhow::Result<String> {
    let mapping = Mapping::new()?;
    page([1190.0, 760.0], |svg| {
        lines_of_a_scan(svg, &mapping);
        matching(svg)?;
        legend(
            svg,
            (840.0, 60.0),
            &[
                (Sign::Robot, TRUTH, "the robot with its laser"),
                (Sign::Dot, FAINT, "points of the first scan"),
                (Sign::Line, LANDMARK, "lines found in it; ticks: their free side"),
                (Sign::Dot, ODOMETRY, "the next scan where odometry puts it"),
                (Sign::Dot, ESTIMATE, "the same scan after matching"),
            ],
        );
        legend(
            svg,
            (840.0, 210.0),
            &[
                (Sign::Line, TRUTH, "true path"),
                (Sign::Line, ODOMETRY, "path by odometry alone"),
                (Sign::Line, ESTIMATE, "path by scan matching, then by the pose graph"),
                (Sign::Line, LANDMARK, "walls of the finished map"),
                (Sign::Dot, SECOND, "places that were met again: loop closures"),
            ],
        );
        around(svg, &mapping);
        Ok(())
    })
}

fn lines_of_a_scan(svg: &mut String, mapping: &Mapping) {
    title(svg, (30.0, 26.0), "Lines of one scan");
    let plan = Plan::new((30.0, 44.0), [[-1.7, -1.6], [8.2, 6.4]], 36.0);
    let scan = &mapping.scans[0];
    plan.dots(svg, points(scan, &Pose2::default()), (1.4, FAINT));
    for line in segments(scan, &SlamParams::default().lines) {
        draw_line(svg, &plan, &line);
    }
    plan.robot(svg, &Pose2::default(), TRUTH);
    plan.scale_bar(svg, 1.0);
}

fn draw_line(svg: &mut String, plan: &Plan, line: &LaserSegment) {
    plan.line(svg, [line.a, line.b], &format!(r#"stroke="{LANDMARK}" stroke-width="2.5""#));
    let middle = nalgebra::center(&line.a, &line.b);
    let tick = [middle, middle + line.facing() * 0.25];
    plan.line(svg, tick, &format!(r#"stroke="{LANDMARK}" stroke-width="1.5""#));
}

/// The next scan, before and after it is matched.
fn matching(svg: &mut String) -> anyhow::Result<()> {
    title(svg, (430.0, 26.0), "A scan is matched to those before");
    let walls = corridors();
    let first = path()[0];
    let second = first.compose(&REALLY);
    let scans = [first, second].map(|at| scan_among(&walls, &at, &laser(), SEED));
    let mut slam = Slam::new(SlamParams::default());
    slam.add(&Pose2::default(), &scans[0])?;
    let matched = slam.add(&BY_ODOMETRY, &scans[1])?;
    let plan = Plan::new((430.0, 44.0), [[-1.7, -1.6], [8.2, 6.4]], 36.0);
    plan.dots(svg, points(&scans[0], &Pose2::default()), (1.6, FAINT));
    for (pose, colour) in [(BY_ODOMETRY, ODOMETRY), (matched, ESTIMATE)] {
        plan.dots(svg, points(&scans[1], &pose), (1.4, colour));
        plan.robot(svg, &pose, colour);
    }
    let error = |pose: &Pose2| {
        let d = pose.minus(&REALLY);
        format!("{:.2} m, {:.1} deg", d.xy().norm(), d.z.abs().to_degrees())
    };
    let by_odometry = format!("error by odometry: {}", error(&BY_ODOMETRY));
    plan.label(svg, &Point2::new(2.2, 6.4), ("start", [0.0, 20.0]), &by_odometry);
    let words = format!("after matching: {}", error(&matched));
    plan.label(svg, &Point2::new(2.2, 6.4), ("start", [0.0, 39.0]), &words);
    plan.scale_bar(svg, 1.0);
    Ok(())
}

/// The whole drive three times.
fn around(svg: &mut String, mapping: &Mapping) {
    let Mapping { truth, odometry, scans, online, closed, map } = mapping;
    let before = &online[..*closed];
    let truth: Vec<Pose2> = truth.iter().map(|t| truth[0].between(t)).collect();
    let error_m = |path: &[Pose2]| {
        let last = path.len() - 1;
        (path[last].position() - truth[last].position()).norm()
    };
    let panels: [(&str, &[Pose2], &str); 3] = [
        ("Odometry alone", odometry, ODOMETRY),
        ("Scans matched, loop open", before, ESTIMATE),
        ("Loop closed, all fitted", &map.path, ESTIMATE),
    ];
    for (i, (words, path, colour)) in panels.into_iter().enumerate() {
        let left = 30.0 + 390.0 * i as f64;
        title(svg, (left, 430.0), &format!("{words}: {:.2} m off", error_m(path)));
        let plan = Plan::new((left, 446.0), [[-2.2, -2.4], [15.2, 11.0]], 20.5);
        let drawn = path.iter().zip(scans).step_by(DRAWN_SCANS);
        let dots = drawn.flat_map(|(at, scan)| points(scan, at).step_by(DRAWN_POINTS));
        plan.dots(svg, dots, (0.7, FAINT));
        let positions = |path: &[Pose2]| -> Vec<Point2<f64>> {
            path.iter().map(|p| Point2::from(p.position())).collect()
        };
        if i == 2 {
            for wall in &map.walls {
                plan.line(svg, [wall.a, wall.b], &format!(r#"stroke="{LANDMARK}" stroke-width="2""#));
            }
        }
        plan.line(svg, positions(&truth[..path.len()]), &format!(r#"stroke="{TRUTH}""#));
        plan.line(svg, positions(path), &format!(r#"stroke="{colour}" stroke-width="1.5""#));
        if i == 2 {
            let met = map.loops.iter().map(|l| Point2::from(map.keys[l.new].1.pose.position()));
            plan.dots(svg, met, (3.0, SECOND));
        }
        plan.scale_bar(svg, 2.0);
    }
}
