//! Where to look: the landmarks in sight of an uncertain pose, what a look at each would tell, and the choice by both
//! criteria (method 14).

use super::{
    map_plan::{ESTIMATE, FAINT, LANDMARK, Plan, Sign, TRUTH, WALL, legend, page, title},
    map_scene::{CAMERA, IMAGE_PX, SIGMA_PX, aimed, centre, look, poster, the_fix},
};
use crate::evaluate::chart::COLOURS;
use anyhow::Context as _;
use formats::svg::{put, text};
use map::{
    fuse::{FuseParams, Fuser},
    gaze::{Criterion, GazeCandidate, GazeParams, GazeTarget, PanTiltUnit, rank},
    localise::LandmarkObservation,
    place::LandmarkPlace,
    pose2::{Pose2, Pose2Covariance},
    segments::LaserSegment,
    visibility::{Obstacle, PanTiltCamera, VisibilityMap, VisibilityParams, visibility},
};
use nalgebra::{Matrix3, Point2};
use std::f64::consts::{FRAC_PI_2, PI};
use vision::{model::LandmarkId, random::Random};

/// x, y, direction of the normal.
const POSTERS: [[f64; 3]; 6] = [
    [3.1, 5.5, -FRAC_PI_2],
    [5.7, 5.5, -FRAC_PI_2],
    [8.5, 3.4, PI],
    [6.9, 0.0, FRAC_PI_2],
    [4.1, 0.0, FRAC_PI_2],
    [0.0, 3.0, 0.0],
];
const NAMES: [&str; 6] = ["A", "B", "C", "D", "E", "F"];
const COLOUR: [&str; 6] = COLOURS;
const SALIENCY: f64 = 0.8;
const V_C: f64 = 1.0;

struct Scene {
    walls: Vec<LaserSegment>,
    pose: Pose2Covariance,
    posters: Vec<(LandmarkPlace, VisibilityMap)>,
    /// Landmarks in sight by the product, and by the information.
    by_product: Vec<GazeTarget>,
    by_information: Vec<GazeTarget>,
}

impl Scene {
    fn new() -> anyhow::Result<Self> {
        let walls = [
            [0.0, 0.0, 8.5, 0.0],
            [8.5, 0.0, 8.5, 5.5],
            [8.5, 5.5, 0.0, 5.5],
            [0.0, 5.5, 0.0, 0.0],
            // A partition.
            [4.7, 1.7, 6.3, 1.7],
        ];
        let walls: Vec<LaserSegment> = walls.iter().map(LaserSegment::by_hand).collect::<Result<_, _>>()?;
        let obstacles: Vec<Obstacle> = walls.iter().map(Obstacle::from).collect();
        let (viewer, p) = (PanTiltCamera::default(), VisibilityParams::default());
        let posters = POSTERS
            .iter()
            .map(|&[x, y, theta]| {
                let place = poster(x, y, theta)?;
                Ok((place, visibility(&place, &obstacles, &viewer, &p)?))
            })
            .collect::<anyhow::Result<Vec<_>>>()?;
        // After a while along x by odometry: unsure of the heading, and with it across.
        let covariance = Matrix3::new(0.010, 0.004, 0.002, 0.004, 0.050, 0.010, 0.002, 0.010, 0.0036);
        let pose = Pose2Covariance::new(Pose2::new(4.9, 2.9, 0.75), covariance)?;
        let candidates: Vec<GazeCandidate<'_>> = posters
            .iter()
            .enumerate()
            .map(|(i, (place, visible))| GazeCandidate {
                landmark: LandmarkId(i as u64),
                place,
                visible,
                saliency: SALIENCY,
                v_c: V_C,
            })
            .collect();
        let ranked = |criterion| {
            let p = GazeParams { criterion, ..GazeParams::default() };
            rank(&pose, &candidates, &viewer, &PanTiltUnit::default(), &p)
        };
        let by_product = ranked(Criterion::Product)?;
        let by_information = ranked(Criterion::Information)?;
        Ok(Self { walls, pose, posters, by_product, by_information })
    }

    /// The pose after a look at a landmark of these corners, by the fusion.
    fn after(&self, target: &GazeTarget) -> anyhow::Result<Pose2Covariance> {
        let (place, _) = &self.posters[target.landmark.0 as usize];
        let mounting = aimed(&self.pose.pose, &centre(place))?;
        let mut random = Random::new(1);
        let seen = look(&self.pose.pose, &mounting, place, SIGMA_PX, &mut random).context("in the image")?;
        let observed = [LandmarkObservation { landmark: target.landmark, seen: &seen, place }];
        let fix = the_fix(&observed, &mounting, Some(&self.pose))?;
        let mut fuser = Fuser::new(FuseParams::default());
        fuser.apply_odometry(0, self.pose.pose)?;
        fuser.start(&self.pose)?;
        fuser.apply_fix(0, &fix)?;
        Ok(fuser.pose().context("a fused pose")?.pose)
    }
}

/// The picture.
pub(super) fn svg() -> anyhow::Result<String> {
    let scene = Scene::new()?;
    page([1180.0, 560.0], |svg| {
        from_above(svg, &scene)?;
        utilities(svg, &scene);
        gains(svg, &scene)?;
        legend(
            svg,
            (40.0, 470.0),
            &[
                (Sign::Robot, TRUTH, "the robot; ellipse: its pose before the look, 95 %"),
                (Sign::Dashed, FAINT, "visibility area of the chosen landmark"),
                (Sign::Landmark, LANDMARK, "posters; those that are not offered are grey"),
                (Sign::Line, TRUTH, "view of the camera, turned to the choice by the information"),
            ],
        );
        Ok(())
    })
}

fn from_above(svg: &mut String, scene: &Scene) -> anyhow::Result<()> {
    title(svg, (40.0, 26.0), "Candidates from an uncertain pose");
    let plan = Plan::new((40.0, 50.0), [[-0.3, -0.3], [8.8, 5.8]], 60.0);
    let best = scene.by_information.first().context("a choice")?;
    let (place, visible) = &scene.posters[best.landmark.0 as usize];
    for polygon in visible.polygons() {
        let style = format!(r##"fill="#eef3fb" stroke="{FAINT}" stroke-dasharray="5 3""##);
        plan.area(svg, polygon.corners.iter().copied(), &style);
    }
    plan.walls(svg, scene.walls.iter().map(|w| (&w.a, &w.b)));
    let robot = Point2::from(scene.pose.pose.position());
    // What the image covers once the camera is turned.
    let to = Point2::new(place.x_m, place.y_m) - robot;
    let (middle, half) = (to.y.atan2(to.x), (0.5 * IMAGE_PX[0] / CAMERA.fx_px).atan());
    let edge = |a: f64| robot + nalgebra::Vector2::new(a.cos(), a.sin()) * 1.6;
    plan.line(
        svg,
        [edge(middle - half), robot, edge(middle + half)],
        &format!(r#"stroke="{TRUTH}" stroke-width="2""#),
    );
    for (i, (place, _)) in scene.posters.iter().enumerate() {
        let at = Point2::new(place.x_m, place.y_m);
        let offered = scene.by_product.iter().find(|t| t.landmark.0 == i as u64);
        let colour = if offered.is_some() { COLOUR[i] } else { FAINT };
        plan.landmark(svg, place, colour);
        let behind = at - nalgebra::Vector2::new(place.theta_rad.cos(), place.theta_rad.sin()) * 0.18;
        plan.label(svg, &behind, ("middle", [0.0, 4.0]), NAMES[i]);
        if offered.is_some() {
            plan.line(svg, [robot, at], &format!(r#"stroke="{colour}" stroke-width="1.2""#));
        }
    }
    plan.pose_ellipse(svg, &scene.pose, TRUTH);
    plan.robot(svg, &scene.pose.pose, TRUTH);
    plan.scale_bar(svg, 1.0);
    Ok(())
}

/// A table with bars: what the criteria say of each candidate.
fn utilities(svg: &mut String, scene: &Scene) {
    let (x, y) = (630.0, 26.0);
    title(svg, (x, y), "What a look at each would be worth");
    let columns = [("", 0.0), ("visible", 50.0), ("margin", 110.0), ("angle", 170.0), ("gain", 230.0)];
    for (words, dx) in columns {
        text(svg, (x + dx, y + 28.0), "start", words);
    }
    text(svg, (x + 300.0, y + 28.0), "start", "product");
    text(svg, (x + 400.0, y + 28.0), "start", "information");
    let most = |all: &[GazeTarget]| all.first().map_or(1.0, |t| t.utility);
    let best = [most(&scene.by_product), most(&scene.by_information)];
    let mut offered: Vec<&GazeTarget> = scene.by_product.iter().collect();
    offered.sort_by_key(|t| t.landmark);
    for (row, target) in offered.iter().enumerate() {
        let (i, y) = (target.landmark.0 as usize, y + 52.0 + 24.0 * row as f64);
        let information =
            scene.by_information.iter().find(|t| t.landmark == target.landmark).map_or(0.0, |t| t.utility);
        let cells = [
            NAMES[i].to_owned(),
            format!("{:.0} %", 100.0 * target.probability),
            format!("{:.2} m", target.margin_m),
            format!("{:.0} deg", target.incidence_rad.to_degrees()),
            format!("{:.2} nats", target.gain_nats),
        ];
        for (words, (_, dx)) in cells.iter().zip(columns) {
            text(svg, (x + dx, y), "start", words);
        }
        for (dx, value, best) in [(300.0, target.utility, best[0]), (400.0, information, best[1])] {
            let is_best = value >= best;
            let colour = if is_best { ESTIMATE } else { WALL };
            put(
                svg,
                &format!(
                    r#"<rect x="{:.1}" y="{:.1}" width="{:.1}" height="12" fill="{colour}"/>"#,
                    x + dx,
                    y - 10.0,
                    50.0 * value / best
                ),
            );
            text(svg, (x + dx + 54.0, y), "start", &format!("{value:.2}"));
        }
    }
    let left: Vec<&str> = (0..NAMES.len())
        .filter(|i| offered.iter().all(|t| t.landmark.0 != *i as u64))
        .map(|i| NAMES[i])
        .collect();
    let words = format!("Not offered (hidden, too far, or beyond the pan range): {}", left.join(", "));
    text(svg, (x, y + 60.0 + 24.0 * offered.len() as f64), "start", &words);
}

/// The ellipse before, and after a look at each candidate.
fn gains(svg: &mut String, scene: &Scene) -> anyhow::Result<()> {
    let top = 240.0;
    title(svg, (630.0, top), "Position before, and after a fix on each candidate (95 %)");
    let p = scene.pose.pose;
    let corners = [[p.x_m - 0.9, p.y_m - 0.6], [p.x_m + 0.9, p.y_m + 0.6]];
    let plan = Plan::new((630.0, top + 16.0), corners, 200.0);
    plan.pose_ellipse(svg, &scene.pose, TRUTH);
    let mut entries = vec![(Sign::Ellipse, TRUTH, "before".to_owned())];
    let mut offered: Vec<&GazeTarget> = scene.by_product.iter().collect();
    offered.sort_by_key(|t| t.landmark);
    for target in offered {
        let (i, after) = (target.landmark.0 as usize, scene.after(target)?);
        plan.pose_ellipse(svg, &after, COLOUR[i]);
        let ratio = scene.pose.covariance.determinant() / after.covariance.determinant();
        entries.push((
            Sign::Ellipse,
            COLOUR[i],
            format!("{}: gained {:.2} nats", NAMES[i], 0.5 * ratio.ln()),
        ));
    }
    let entries: Vec<(Sign, &str, &str)> = entries.iter().map(|(s, c, w)| (*s, *c, w.as_str())).collect();
    legend(svg, (900.0, top + 150.0), &entries);
    plan.scale_bar(svg, 0.2);
    Ok(())
}
