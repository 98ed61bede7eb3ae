//! `waymark-lab evaluate roll`: a camera mounted at twelve rolls, with the code of the server's
//! workers. Rendered frames of a corridor whose posters are taught from one level photograph each;
//! names and poses with the camera's mounting, names and camera poses without one, and expected
//! landmarks found without a detection.

use super::{
    experiment::{mixed, of_each, say},
    statistics::{median, quantile},
};
use engine::{
    analysis::{StageTimes, analyse_frame, frame_camera},
    context::FrameContext,
    fixes::{landmark_observations, photograph_pose, robot_fix, unique_landmarks},
    guided::recognise_guided,
    snapshot::{LandmarkInfo, MapSnapshot},
};
use map::{
    extrinsics::CameraExtrinsics,
    place::{LandmarkPlace, PlaceSigmas},
    pose2::Pose2Covariance,
};
use nalgebra::{Isometry3, Matrix3, Vector3};
use serde::Serialize;
use sim::{
    building::Building,
    corridor::CorridorParams,
    drive::Step,
    lesson::{LessonParams, Stop, stops},
    robot::{Robot, RobotParams, SensorReadings},
    truth::{FrameTruth, ViewState},
};
use std::{f64::consts::TAU, sync::Arc};
use vision::{
    frame::Intrinsics,
    geometry::polygon::iou,
    learn::{add_negatives, learn, synthesis},
    model::{LandmarkId, LandmarkModel, ModelSet},
    params::Params,
    pipeline::{FrameAnalysis, matched_border},
    points::taught::view_points,
    pose::LandmarkSize,
    recognise::{IconFeatures, Verdict, features},
};

/// Rolls of the camera.
const ROLLS: u32 = 12;
/// Views generated from each photograph, and how many of their icons are negatives of the other
/// landmarks.
const GENERATED: usize = 30;
const NEGATIVES: usize = 10;
/// A name is right if its border overlaps the landmark's by this much.
const IOU_TRUE: f64 = 0.5;
/// A landmark is to be named if it is wholly visible and each side is at least this long.
const MIN_SIDE_PX: f64 = 38.0;
/// Standard deviations of the pose by which landmarks are expected: metres and radians.
const PRIOR_SIGMA: [f64; 3] = [0.03, 0.03, 0.01];

/// `waymark-lab evaluate roll`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Posters in the corridor, each of them a landmark.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u32).range(2..=200))]
    posters: u32,
    /// Views of each at each roll.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=500))]
    views: u32,
    /// Seed of posters, views and noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Print one JSON object instead of a table.
    #[arg(long)]
    json: bool,
}

/// What one frame gave.
#[derive(Debug, Clone, Copy, Default)]
struct Frame {
    /// Landmarks to be named, named, and wrong names.
    shown: usize,
    named: usize,
    wrong: usize,
    /// Error of the robot's position, metres, and heading, radians.
    pose: Option<[f64; 2]>,
    /// The same without a mounting; of the camera's position and direction.
    named_unmounted: usize,
    wrong_unmounted: usize,
    camera_pose: Option<[f64; 2]>,
    /// Landmarks to be named that are found where they are expected, without a detection.
    expected: usize,
}

/// Errors of poses.
#[derive(Debug, Clone, Serialize)]
struct Errors {
    poses: usize,
    median_m: f64,
    p90_m: f64,
    worst_m: f64,
    worst_deg: f64,
}

/// All frames of one roll.
#[derive(Debug, Clone, Serialize)]
struct Row {
    roll_deg: f64,
    shown: usize,
    named: usize,
    wrong: usize,
    robot: Errors,
    named_unmounted: usize,
    wrong_unmounted: usize,
    camera_unmounted: Errors,
    expected: usize,
}

#[derive(Debug, Serialize)]
struct Report {
    posters: u32,
    landmarks: usize,
    frames_per_roll: usize,
    seed: u64,
    rolls: Vec<Row>,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let report = evaluated(args)?;
    say(args.json, &report, || table(&report))
}

fn evaluated(args: &Args) -> anyhow::Result<Report> {
    let corridor = CorridorParams {
        posters: args.posters as usize,
        length_m: 4.0 + 2.0 * f64::from(args.posters),
        first_poster: mixed(&[args.seed, 31]),
        ..CorridorParams::default()
    };
    let building = Arc::new(Building::corridor_with(&corridor, args.seed));
    let robot = Robot::new(building.clone(), &RobotParams::default());
    let map = taught(&building, &robot, args.seed)?;
    let lesson = LessonParams { seed: mixed(&[args.seed, 32]), ..near(args.views as usize) };
    let stops = stops(&building, &lesson);
    let rolls: Vec<u32> = (0..ROLLS).collect();
    let rolls = of_each(&rolls, "rolls", |_, roll| {
        let roll_rad = f64::from(*roll) * TAU / f64::from(ROLLS);
        let frames: Vec<Frame> = stops
            .iter()
            .map(|stop| rolled(&stop.step, roll_rad))
            .filter_map(|step| frame(&robot.clone().look(&step), *robot.camera().intrinsics(), &map))
            .collect();
        Row::of(roll_rad, &frames)
    });
    Ok(Report {
        posters: args.posters,
        landmarks: map.models.len(),
        frames_per_roll: stops.len(),
        seed: args.seed,
        rolls,
    })
}

/// Stops from which every poster is large enough.
fn near(views: usize) -> LessonParams {
    LessonParams { views, distance_m: [1.3, 3.0], max_view_angle_rad: 0.9, ..LessonParams::default() }
}

/// A step with its camera turned clockwise about its axis.
fn rolled(step: &Step, roll_rad: f64) -> Step {
    let mut step = step.clone();
    step.robot_from_camera *= Isometry3::rotation(Vector3::new(0.0, 0.0, roll_rad));
    step
}

/// Every poster, taught from one level photograph with its true corners, at its true place.
fn taught(building: &Building, robot: &Robot, seed: u64) -> anyhow::Result<MapSnapshot> {
    let p = Params::default();
    let lesson = LessonParams { max_view_angle_rad: 0.3, seed: mixed(&[seed, 33]), ..near(1) };
    let photographs = stops(building, &lesson);
    let lessons =
        of_each(&photographs, "views", |i, stop| lesson_of(stop, robot, mixed(&[seed, i as u64]), &p));
    let mut map = MapSnapshot::empty("corridor", 1);
    let mut models = Vec::new();
    for (i, (stop, lesson)) in photographs.iter().zip(&lessons).enumerate() {
        let (Some((model, _)), Some(truth)) = (lesson, building.landmark(&stop.landmark)) else { continue };
        let id = LandmarkId(i as u64 + 1);
        let others = lessons.iter().enumerate().filter(|(other, _)| *other != i);
        let negatives: Vec<IconFeatures> =
            others.filter_map(|(_, l)| l.as_ref()).flat_map(|l| l.1.clone()).collect();
        let model = LandmarkModel { id, ..model.clone() };
        models.push(Arc::new(add_negatives(&model, &negatives, &p)));
        let size = LandmarkSize { width_m: truth.width_m, height_m: truth.height_m };
        let normal = truth.map_from_landmark.rotation * Vector3::x();
        let centre_m = truth.map_from_landmark.translation.vector;
        let place = LandmarkPlace::by_hand(centre_m, normal.y.atan2(normal.x), size, PlaceSigmas::default())?;
        let name = stop.landmark.clone();
        map.sizes.insert(id, size);
        let info = LandmarkInfo { name, size: Some(size), place: Some(place), ..LandmarkInfo::default() };
        map.landmarks.insert(id, info);
    }
    map.models = ModelSet::in_use(models.into_iter(), &p)?;
    anyhow::ensure!(!map.models.is_empty(), "no landmark passed the quality gates; try another --seed");
    map.params = Arc::new(p);
    Ok(map)
}

/// A landmark from one photograph, and icons that are negatives of the others.
fn lesson_of(
    stop: &Stop,
    robot: &Robot,
    seed: u64,
    p: &Params,
) -> Option<(LandmarkModel, Vec<IconFeatures>)> {
    let readings = robot.clone().look(&stop.step);
    let (image, seen) = (&readings.frame.image, readings.frame.truth.landmark(&stop.landmark)?);
    let views = synthesis::views(image, &seen.corners_px, GENERATED, p, seed);
    let model =
        learn(LandmarkId(0), &views, &[], p).ok()?.with_points(&[view_points(image, &seen.corners_px)]);
    let each = views.iter().step_by(views.len().div_ceil(NEGATIVES).max(1));
    Some((model, each.map(|v| features(v.icon.clone(), &p.recognise)).collect()))
}

/// One frame: with its mounting, without, and by expectation. `None`: a mounting out of range.
fn frame(seen: &SensorReadings, camera: Intrinsics, map: &MapSnapshot) -> Option<Frame> {
    let (image, truth) = (&seen.frame.image, &seen.frame.truth);
    let extrinsics = CameraExtrinsics::new(seen.step.robot_from_camera).ok()?;
    let analysed = |mounting: Option<&CameraExtrinsics>| {
        analyse_frame(image, frame_camera(Some(&camera), mounting, map), map, &mut StageTimes::start())
    };
    let (mounted, unmounted) = (analysed(Some(&extrinsics)), analysed(None));
    let wanted: Vec<LandmarkId> =
        map.landmarks.iter().filter(|(_, l)| is_shown(truth, &l.name)).map(|(id, _)| *id).collect();
    let fix = landmark_observations(&mounted, map)
        .and_then(|o| robot_fix(&o, Some(&extrinsics), None, &map.poses.localise));
    let pose = fix.ok().map(|fix| {
        let error = seen.step.map_from_robot.inverse().compose(&fix.pose.pose);
        [error.x_m.hypot(error.y_m), error.theta_rad.abs()]
    });
    let camera_pose = photograph_pose(&unmounted, map).ok().map(|pose| {
        let error = truth.map_from_camera.inverse() * pose.map_from_camera;
        [error.translation.vector.norm(), error.rotation.angle()]
    });
    let nothing = FrameAnalysis { quads: Vec::new() };
    let context = FrameContext {
        analysis: &nothing,
        map,
        extrinsics: Some(&extrinsics),
        camera: Some(&camera),
        image_px: [image.width() as f64, image.height() as f64],
        is_whole: true,
        prior: None,
    };
    let covariance = Matrix3::from_diagonal(&Vector3::from(PRIOR_SIGMA).map(|s| s * s));
    let prior = Pose2Covariance { pose: seen.step.map_from_robot, covariance };
    let guided = recognise_guided(image, &context, &prior);
    Some(Frame {
        shown: wanted.len(),
        named: named(&mounted, &wanted),
        wrong: wrong(&mounted, truth, map),
        pose,
        named_unmounted: named(&unmounted, &wanted),
        wrong_unmounted: wrong(&unmounted, truth, map),
        camera_pose,
        expected: wanted.iter().filter(|id| guided.observations.iter().any(|o| o.landmark == **id)).count(),
    })
}

fn is_shown(truth: &FrameTruth, name: &str) -> bool {
    truth.landmark(name).is_some_and(|l| l.state == ViewState::Full && l.min_side_px() >= MIN_SIDE_PX)
}

/// How many of the landmarks have a name and a pose.
fn named(analysis: &FrameAnalysis, wanted: &[LandmarkId]) -> usize {
    let names = unique_landmarks(analysis);
    wanted.iter().filter(|id| names.iter().any(|(named, _)| named == *id)).count()
}

/// Names of what is not there.
fn wrong(analysis: &FrameAnalysis, truth: &FrameTruth, map: &MapSnapshot) -> usize {
    let is_wrong = |q: &&vision::pipeline::QuadAnalysis| {
        let Some(result) = &q.recognition else { return false };
        let Verdict::Unique(id) = result.verdict else { return false };
        let border = matched_border(&q.quad, result, &map.params);
        let shown = map.landmarks.get(&id).and_then(|info| truth.landmark(&info.name));
        !border.zip(shown).is_some_and(|(border, shown)| {
            iou(border.corners_px.points(), shown.corners_px.points()) >= IOU_TRUE
        })
    };
    analysis.quads.iter().filter(is_wrong).count()
}

impl Errors {
    fn of(errors: &[[f64; 2]]) -> Self {
        let mut metres: Vec<f64> = errors.iter().map(|e| e[0]).collect();
        Self {
            poses: errors.len(),
            median_m: median(&mut metres).unwrap_or(f64::NAN),
            p90_m: quantile(&mut metres, 0.9).unwrap_or(f64::NAN),
            worst_m: metres.last().copied().unwrap_or(f64::NAN),
            worst_deg: errors.iter().map(|e| e[1].to_degrees()).fold(0.0, f64::max),
        }
    }

    fn cells(&self) -> String {
        let cm = |m: f64| 100.0 * m;
        let Self { poses, median_m, p90_m, worst_m, worst_deg } = self;
        let (median, p90, worst) = (cm(*median_m), cm(*p90_m), cm(*worst_m));
        format!("{poses} | {median:.1}, {p90:.1}, {worst:.1} | {worst_deg:.1}")
    }
}

impl Row {
    fn of(roll_rad: f64, frames: &[Frame]) -> Self {
        let sum = |of: fn(&Frame) -> usize| frames.iter().map(of).sum();
        let errors = |of: fn(&Frame) -> Option<[f64; 2]>| {
            Errors::of(&frames.iter().filter_map(of).collect::<Vec<_>>())
        };
        Self {
            roll_deg: roll_rad.to_degrees().round(),
            shown: sum(|f| f.shown),
            named: sum(|f| f.named),
            wrong: sum(|f| f.wrong),
            robot: errors(|f| f.pose),
            named_unmounted: sum(|f| f.named_unmounted),
            wrong_unmounted: sum(|f| f.wrong_unmounted),
            camera_unmounted: errors(|f| f.camera_pose),
            expected: sum(|f| f.expected),
        }
    }
}

fn table(report: &Report) -> Vec<String> {
    let mut lines = vec![
        format!(
            "roll: seed {}, {} landmarks, {} frames a roll; with the mounting, without one, and expected by a pose",
            report.seed, report.landmarks, report.frames_per_roll
        ),
        "| roll, deg | shown | named | wrong | robot poses | median, 90 %, worst, cm | worst, deg | named without \
         mounting | wrong | camera poses | median, 90 %, worst, cm | worst, deg | expected: found |"
            .to_owned(),
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|".to_owned(),
    ];
    lines.extend(report.rolls.iter().map(|r| {
        format!(
            "| {:.0} | {} | {} | {} | {} | {} | {} | {} | {} |",
            r.roll_deg,
            r.shown,
            r.named,
            r.wrong,
            r.robot.cells(),
            r.named_unmounted,
            r.wrong_unmounted,
            r.camera_unmounted.cells(),
            r.expected
        )
    }));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_run_repeats_and_names_landmarks_at_every_roll() {
        let args = Args { posters: 3, views: 1, seed: 2, json: false };
        let report = evaluated(&args).unwrap();
        let text = |report: &Report| serde_json::to_string(report).unwrap();
        assert_eq!(text(&report), text(&evaluated(&args).unwrap()));
        assert_eq!(report.rolls.len(), ROLLS as usize);
        for row in &report.rolls {
            assert!(row.shown >= 2 && row.wrong + row.wrong_unmounted == 0, "{row:?}");
            assert!(row.named >= 2 && row.named_unmounted >= 2 && row.expected >= 2, "{row:?}");
            assert!(row.robot.poses >= 2 && row.robot.worst_m < 0.3, "{row:?}");
        }
        assert_eq!(table(&report).len(), 3 + ROLLS as usize);
    }
}
