//! `waymark-lab evaluate visibility`: visibility areas in closed form against brute force, their
//! sizes against counting, and the time of areas and of gaze selection; for landmarks on walls and
//! for tilted ones. Needs neither server nor data.

use cli::{clock::Clock, screen};
use map::{
    gaze::{GazeCandidate, GazeParams, PanTiltUnit, rank},
    place::{LandmarkPlace, PlaceSigmas},
    pose2::{Pose2, Pose2Covariance},
    visibility::{Obstacle, PanTiltCamera, VisibilityMap, VisibilityParams, pointwise, visibility},
};
use nalgebra::{Matrix3, Point2, Rotation2, Vector2, Vector3};
use std::{f64::consts::FRAC_PI_2, path::PathBuf};
use vision::{model::LandmarkId, pose::LandmarkSize, random::Random};

/// Landmarks of the hall in which gaze selection is timed.
const HALL: usize = 1000;

/// `waymark-lab evaluate visibility`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Random maps: a landmark on its wall among a dozen obstacles; and as many with it under a
    /// ceiling, on the floor or leaning.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    maps: u32,
    /// Points compared, over all maps of a kind.
    #[arg(long, default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(100..=10_000_000))]
    points: u32,
    /// Seed of maps and points.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Prints one JSON object.
    #[arg(long)]
    json: bool,
    /// Draws the first maps of each kind as SVG.
    #[arg(long)]
    plot: Option<PathBuf>,
}

struct Plan {
    place: LandmarkPlace,
    obstacles: Vec<Obstacle>,
    viewer: PanTiltCamera,
}

/// Counts over maps of one kind.
#[derive(Debug, Default, serde::Serialize)]
struct Compared {
    maps: u32,
    /// Maps with an empty area: an obstacle cuts the landmark, or it is out of reach.
    empty: u32,
    points: u32,
    /// Points from which the landmark is visible by brute force.
    visible: u32,
    differ: u32,
    agreement: f64,
    /// Sum of areas over the sum counted on grids, less 1.
    area_error: f64,
    /// Median and worst milliseconds of processor time for one landmark.
    ms_per_landmark: [f64; 2],
}

#[derive(Debug, serde::Serialize)]
struct Figures {
    /// Landmarks on walls.
    #[serde(flatten)]
    upright: Compared,
    /// Under ceilings, on floors, leaning.
    tilted: Compared,
    /// Median and worst milliseconds of gaze selection among a thousand landmarks.
    gaze_ms: [f64; 2],
    gaze_in_sight: usize,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let mut drawn = String::new();
    let upright = compared(args, plan, (&mut drawn, 0))?;
    let tilted = compared(args, tilted_plan, (&mut drawn, DRAWN))?;
    let (gaze_ms, gaze_in_sight) = gaze_ms(args.seed)?;
    if let Some(path) = &args.plot {
        let svg = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="960" height="1280" viewBox="0 0 960 1280"><rect width="960" height="1280" fill="white"/>{drawn}</svg>"#
        );
        std::fs::write(path, svg)?;
    }
    show(&Figures { upright, tilted, gaze_ms, gaze_in_sight }, args.json)
}

/// Maps of each kind that are drawn.
const DRAWN: u32 = 6;

type Planner = fn(&mut Random) -> anyhow::Result<Plan>;

fn compared(args: &Args, plan: Planner, (drawn, place): (&mut String, u32)) -> anyhow::Result<Compared> {
    let p = VisibilityParams::default();
    let mut figures = Compared { maps: args.maps, points: args.points, ..Compared::default() };
    let (mut counted, mut area, mut times) = (0.0, 0.0, Vec::new());
    for m in 0..args.maps {
        let mut random = Random::new(args.seed.wrapping_mul(1_000_003) ^ u64::from(m));
        let plan = plan(&mut random)?;
        let clock = Clock::start();
        let map = visibility(&plan.place, &plan.obstacles, &plan.viewer, &p)?;
        times.push(clock.ms());
        figures.empty += u32::from(map.polygons().is_empty());
        // The points are dealt out evenly.
        let share = args.points / args.maps + u32::from(m < args.points % args.maps);
        let at = Point2::new(plan.place.x_m, plan.place.y_m);
        let reach = 1.05 * map.reach_m();
        for _ in 0..share {
            let q = at + Vector2::new(random.range(-reach, reach), random.range(-reach, reach));
            let visible = pointwise::sees(&plan.place, &plan.obstacles, &plan.viewer, &p, &q);
            let inside = map.polygons().iter().any(|polygon| polygon.contains(&q));
            figures.visible += u32::from(visible);
            figures.differ += u32::from(visible != inside);
        }
        counted += counted_m2(&plan, &p, map.reach_m());
        area += map.area_m2();
        if m < DRAWN {
            draw(drawn, place + m, &plan, &map);
        }
    }
    figures.agreement = 1.0 - f64::from(figures.differ) / f64::from(args.points);
    figures.area_error = area / counted - 1.0;
    figures.ms_per_landmark = middle_and_worst(times);
    Ok(figures)
}

fn show(f: &Figures, json: bool) -> anyhow::Result<()> {
    if json {
        screen::say(&serde_json::to_string(f)?);
        return Ok(());
    }
    for (kind, c) in [("on walls", &f.upright), ("tilted", &f.tilted)] {
        let [ms, worst] = c.ms_per_landmark;
        screen::say(&format!("maps, {kind:<9}           {} ({} with an empty area)", c.maps, c.empty));
        screen::say(&format!("points                    {} ({} inside by brute force)", c.points, c.visible));
        let agree = 100.0 * c.agreement;
        screen::say(&format!("polygons, brute force     {} differ, {agree:.3} % agree", c.differ));
        screen::say(&format!("areas against counting    {:+.3} %", 100.0 * c.area_error));
        screen::say(&format!("one landmark              {ms:.3} ms, at most {worst:.3}"));
    }
    let [gaze, slowest] = f.gaze_ms;
    screen::say(&format!(
        "gaze selection, {HALL}    {gaze:.3} ms, at most {slowest:.3} ({} in sight)",
        f.gaze_in_sight
    ));
    Ok(())
}

fn middle_and_worst(mut times: Vec<f64>) -> [f64; 2] {
    times.sort_by(f64::total_cmp);
    [times.get(times.len() / 2), times.last()].map(|t| t.copied().unwrap_or_default())
}

/// A landmark on its wall with long and short, near and far, high and low obstacles about it.
fn plan(random: &mut Random) -> anyhow::Result<Plan> {
    let theta = random.range(-3.1, 3.1);
    let size = LandmarkSize { width_m: random.range(0.2, 1.5), height_m: random.range(0.2, 1.5) };
    let centre = Vector3::new(random.range(-50.0, 50.0), random.range(-50.0, 50.0), random.range(0.8, 2.2));
    let place = LandmarkPlace::by_hand(centre, theta, size, PlaceSigmas::default())?;
    let (at, turn) = (Point2::from(centre.xy()), Rotation2::new(theta));
    let wall = |a: Vector2<f64>, b: Vector2<f64>, height_m| Obstacle {
        a: at + turn * a,
        b: at + turn * b,
        height_m,
    };
    let mut obstacles = vec![wall(Vector2::new(0.0, -5.0), Vector2::new(0.0, 5.0), None)];
    for i in 0..12 {
        let a = Vector2::new(random.range(0.3, 8.0), random.range(-6.0, 6.0));
        let long = Vector2::new(random.range(0.3, 8.0), random.range(-6.0, 6.0));
        let short = a + Vector2::new(random.range(-0.5, 0.5), random.range(-0.5, 0.5));
        let height_m = (i == 4).then(|| random.range(0.2, 1.6));
        obstacles.push(wall(a, if i < 4 { long } else { short }, height_m));
    }
    let viewer = PanTiltCamera {
        focal_px: random.range(400.0, 900.0),
        camera_height_m: random.range(0.5, 1.6),
        ..PanTiltCamera::default()
    };
    Ok(Plan { place, obstacles, viewer })
}

/// The same with the landmark under the ceiling, on the floor or leaning, off its wall, and a
/// camera that can be aimed at it.
fn tilted_plan(random: &mut Random) -> anyhow::Result<Plan> {
    let mut made = plan(random)?;
    let tilt_rad = match random.next_u64() % 4 {
        0 => FRAC_PI_2,
        1 => -FRAC_PI_2,
        _ => random.range(-FRAC_PI_2, FRAC_PI_2),
    };
    let rise = random.range(-0.3, 2.5);
    let z_m = made.viewer.camera_height_m + rise * tilt_rad.signum();
    made.place = LandmarkPlace { tilt_rad, z_m, ..made.place };
    made.viewer.tilt_rad = [random.range(-1.5, -0.6), random.range(0.6, 1.5)];
    made.obstacles.remove(0);
    Ok(made)
}

/// The area by counting the cells of a grid.
fn counted_m2(plan: &Plan, p: &VisibilityParams, reach_m: f64) -> f64 {
    const SIDE: i32 = 200;
    let cell = 2.0 * reach_m / f64::from(SIDE);
    let at = |i: i32| (f64::from(i) + 0.5) * cell - reach_m;
    let centre = Point2::new(plan.place.x_m, plan.place.y_m);
    let sees = |i: &i32| {
        let q = centre + Vector2::new(at(i / SIDE), at(i % SIDE));
        pointwise::sees(&plan.place, &plan.obstacles, &plan.viewer, p, &q)
    };
    (0..SIDE * SIDE).filter(sees).count() as f64 * cell * cell
}

/// A hall with a thousand landmarks in rows: median and worst milliseconds of gaze selection, and
/// landmarks in its result.
fn gaze_ms(seed: u64) -> anyhow::Result<([f64; 2], usize)> {
    let (viewer, p) = (PanTiltCamera::default(), VisibilityParams::default());
    let size = LandmarkSize { width_m: 0.6, height_m: 0.84 };
    let mut random = Random::new(seed);
    let mut hall = Vec::with_capacity(HALL);
    for i in 0..HALL {
        let (row, column) = ((i / 40) as f64, (i % 40) as f64);
        let theta = if i % 2 == 0 { 1.2 } else { -1.2 };
        let at = Vector3::new(1.5 * column, 4.0 * row, 1.5);
        let place = LandmarkPlace::by_hand(at, theta, size, PlaceSigmas::default())?;
        let map = visibility(&place, &[], &viewer, &p)?;
        hall.push((place, map));
    }
    let targets: Vec<GazeCandidate<'_>> = hall
        .iter()
        .enumerate()
        .map(|(i, (place, visible))| GazeCandidate {
            landmark: LandmarkId(i as u64),
            place,
            visible,
            saliency: 0.5,
            v_c: 1.0,
        })
        .collect();
    let (mut times, mut most) = (Vec::new(), 0);
    for _ in 0..200 {
        let pose = Pose2::new(random.range(5.0, 55.0), random.range(5.0, 90.0), random.range(-3.0, 3.0));
        let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.002));
        let clock = Clock::start();
        let found = rank(
            &Pose2Covariance { pose, covariance },
            &targets,
            &viewer,
            &PanTiltUnit::default(),
            &GazeParams::default(),
        )?;
        times.push(clock.ms());
        most = most.max(found.len());
    }
    Ok((middle_and_worst(times), most))
}

/// One map from above: area, obstacles, landmark.
fn draw(svg: &mut String, index: u32, plan: &Plan, map: &VisibilityMap) {
    let origin = [160.0 + 320.0 * f64::from(index % 3), 160.0 + 320.0 * f64::from(index / 3)];
    let at = |q: &Point2<f64>| {
        (origin[0] + 17.0 * (q.x - plan.place.x_m), origin[1] - 17.0 * (q.y - plan.place.y_m))
    };
    for polygon in map.polygons() {
        let ring = |corners: &[Point2<f64>]| {
            let corners: Vec<String> =
                corners.iter().map(at).map(|(u, v)| format!("{u:.1} {v:.1}")).collect();
            if corners.is_empty() { String::new() } else { format!("M{}Z", corners.join("L")) }
        };
        let rings = ring(&polygon.corners) + &ring(&polygon.hole);
        put(svg, &format!(r##"<path d="{rings}" fill="#9ecae1" fill-rule="evenodd" stroke="#3182bd"/>"##));
    }
    let mut line = |a: (f64, f64), b: (f64, f64), colour: &str, width: f64| {
        put(
            svg,
            &format!(
                r#"<path d="M{:.1} {:.1}L{:.1} {:.1}" stroke="{colour}" stroke-width="{width}"/>"#,
                a.0, a.1, b.0, b.1
            ),
        );
    };
    for o in &plan.obstacles {
        line(at(&o.a), at(&o.b), if o.height_m.is_some() { "#bbbbbb" } else { "#333333" }, 2.0);
    }
    let half = 0.5 * plan.place.size.width_m;
    let side = Vector2::new(-plan.place.theta_rad.sin(), plan.place.theta_rad.cos()) * half;
    let centre = Point2::new(plan.place.x_m, plan.place.y_m);
    line(at(&(centre - side)), at(&(centre + side)), "#d62728", 5.0);
}

fn put(svg: &mut String, element: &str) {
    svg.push_str(element);
    svg.push('\n');
}
