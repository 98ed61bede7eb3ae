//! `waymark-lab evaluate drawing` (E13, Fig. 6): the map that one drive makes of a rendered
//! corridor, drawn: walls by the laser, posters and windows by the detector's corners, doors with
//! the arc of their leaf.

use super::{
    experiment::{mixed, say, write_plot},
    statistics::median,
};
use cli::{
    first_drive::{first_drive, known_poses, place_on_walls},
    simulated_errors::SimulatedRobotErrors,
};
use formats::svg::{put, text};
use map::{place::LandmarkPlace, segments::LaserSegment};
use nalgebra::{Point2, Vector2, Vector3};
use serde::Serialize;
use sim::{
    building::{Building, LandmarkKind},
    lesson::{LessonParams, stops},
    robot::{Robot, RobotParams},
};
use std::{fmt::Write as _, path::PathBuf, sync::Arc};
use vision::detect::DetectParams;

/// Border of the picture, metres, and its scale.
const BORDER_M: f64 = 0.7;
const PX_PER_M: f64 = 50.0;
/// Height of the line of words below.
const WORDS_PX: f64 = 24.0;

/// `waymark-lab evaluate drawing`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Photographs of each landmark.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(2..=100))]
    views: u32,
    /// Seed of the building, the drive and its errors.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
    /// Write the map as an SVG picture.
    #[arg(long, value_name = "FILE")]
    draw: Option<PathBuf>,
}

#[derive(Debug, Serialize)]
struct Report {
    seed: u64,
    walls: usize,
    walls_m: f64,
    /// Posters and windows of the corridor, and those that were placed.
    landmarks: usize,
    placed: usize,
    doors: usize,
    doors_placed: usize,
    /// Distance of a placed centre from its true place.
    place_error_m: Option<f64>,
}

/// A landmark or door where the drive placed it.
struct Placed {
    kind: LandmarkKind,
    name: String,
    place: LandmarkPlace,
    error_m: f64,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let building = Arc::new(Building::corridor(args.seed));
    let robot = Robot::new(building.clone(), &RobotParams::default());
    let errors = SimulatedRobotErrors::drawn(robot.camera().intrinsics(), mixed(&[args.seed, 13]));
    let camera = errors.camera;
    let lesson = LessonParams {
        seed: args.seed,
        views: args.views as usize,
        fittings: true,
        ..LessonParams::default()
    };
    let stops = known_poses(stops(&building, &lesson));
    let driven = first_drive(robot, &stops, &errors, &DetectParams::default())?;
    let placed: Vec<Placed> = driven
        .views
        .iter()
        .filter_map(|(name, views)| {
            let (place, _) = place_on_walls(views, &driven.walls, &camera)?;
            let truth = building.landmark(name)?;
            let at = Vector3::new(place.x_m, place.y_m, place.z_m);
            let error_m = (truth.map_from_landmark.translation.vector - at).norm();
            Some(Placed { kind: truth.kind, name: name.clone(), place, error_m })
        })
        .collect();
    let report = report(args.seed, &building, &driven.walls, &placed);
    write_plot(args.draw.as_deref(), || svg(&driven.walls, &placed))?;
    say(args.json, &report, || {
        vec![format!(
            "drawing: seed {}; {} walls, {:.1} m; {} of {} posters and windows and {} of {} doors placed, {:.3} m off (median)",
            report.seed,
            report.walls,
            report.walls_m,
            report.placed,
            report.landmarks,
            report.doors_placed,
            report.doors,
            report.place_error_m.unwrap_or(f64::NAN)
        )]
    })
}

fn report(seed: u64, building: &Building, walls: &[LaserSegment], placed: &[Placed]) -> Report {
    let there = |doors: bool| {
        let kinds = building.landmarks().iter().map(|l| l.kind).filter(|kind| *kind != LandmarkKind::Lamp);
        kinds.filter(|kind| (*kind == LandmarkKind::Door) == doors).count()
    };
    let found = |doors: bool| placed.iter().filter(|p| (p.kind == LandmarkKind::Door) == doors).count();
    Report {
        seed,
        walls: walls.len(),
        walls_m: walls.iter().map(LaserSegment::length_m).sum(),
        landmarks: there(false),
        placed: found(false),
        doors: there(true),
        doors_placed: found(true),
        place_error_m: median(&mut placed.iter().map(|p| p.error_m).collect::<Vec<_>>()),
    }
}

/// The map from above, x to the right, y up.
fn svg(walls: &[LaserSegment], placed: &[Placed]) -> String {
    let ends: Vec<Point2<f64>> = walls.iter().flat_map(|w| [w.a, w.b]).collect();
    let bound = |k: usize, f: fn(f64, f64) -> f64, start: f64| ends.iter().map(|p| p[k]).fold(start, f);
    let (left, top) =
        (bound(0, f64::min, f64::INFINITY) - BORDER_M, bound(1, f64::max, f64::NEG_INFINITY) + BORDER_M);
    let (right, bottom) =
        (bound(0, f64::max, f64::NEG_INFINITY) + BORDER_M, bound(1, f64::min, f64::INFINITY) - BORDER_M);
    let at = |p: Point2<f64>| ((p.x - left) * PX_PER_M, (top - p.y) * PX_PER_M);
    let (width, height) = ((right - left) * PX_PER_M, (top - bottom) * PX_PER_M + WORDS_PX);
    let mut svg = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" font-family="sans-serif" font-size="12">"#
    );
    put(&mut svg, r#"<rect width="100%" height="100%" fill="white"/>"#);
    let line = |svg: &mut String, a: Point2<f64>, b: Point2<f64>, colour: &str, wide: f64| {
        let ((x1, y1), (x2, y2)) = (at(a), at(b));
        put(
            svg,
            &format!(
                r#"<line x1="{x1:.1}" y1="{y1:.1}" x2="{x2:.1}" y2="{y2:.1}" stroke="{colour}" stroke-width="{wide}"/>"#
            ),
        );
    };
    for wall in walls {
        line(&mut svg, wall.a, wall.b, "#333", 2.0);
    }
    for p in placed {
        let centre = Point2::new(p.place.x_m, p.place.y_m);
        let normal = Vector2::new(p.place.theta_rad.cos(), p.place.theta_rad.sin());
        let side = 0.5 * p.place.size.width_m * Vector2::new(-normal.y, normal.x);
        if p.kind == LandmarkKind::Door {
            // The leaf, open into the room, and the arc of its edge.
            let (hinge, edge) = (centre - side, centre + side);
            let open = hinge + 2.0 * side.norm() * normal;
            line(&mut svg, hinge, open, "#8c564b", 2.0);
            let ((x1, y1), (x2, y2), r) = (at(edge), at(open), 2.0 * side.norm() * PX_PER_M);
            put(
                &mut svg,
                &format!(
                    r##"<path d="M{x1:.1} {y1:.1}A{r:.1} {r:.1} 0 0 1 {x2:.1} {y2:.1}" fill="none" stroke="#8c564b"/>"##
                ),
            );
        } else {
            let colour = if p.kind == LandmarkKind::Window { "#1f77b4" } else { "#d62728" };
            line(&mut svg, centre - side, centre + side, colour, 6.0);
        }
        text(&mut svg, at(centre + 0.4 * normal), "middle", &p.name);
    }
    let legend = "black: walls; red: posters; blue: windows; brown arcs: doors";
    text(&mut svg, (0.5 * width, height - 8.0), "middle", legend);
    // Writing to a String cannot fail.
    write!(svg, "</svg>").ok();
    svg
}
