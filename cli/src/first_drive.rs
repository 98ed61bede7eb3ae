//! A first drive: a robot maps the walls by laser and takes frames of every poster from several
//! sides. In: stops, and the pose that it states at each. Out: walls, and views of each poster with
//! its detected quad. The demo teaches them to a server, an evaluation to itself.
//!
//! In the field a person gives the name of the poster and clicks on its quad; here the simulator's
//! truth replaces the click. Corners, places and sizes are measured, not taken from the truth.

use super::{screen, simulated_errors::SimulatedRobotErrors};
use map::{
    extrinsics::CameraExtrinsics,
    lines::{self, LineParams},
    place::LandmarkPlace,
    placement::{PlacementParams, PosedView, WallRectangle, placement, view_on_wall},
    pose2::Pose2Covariance,
    segments::LaserSegment,
    walls::{WallParams, Walls},
};
use nalgebra::{Matrix3, Vector3};
use sim::{
    lesson::Stop,
    robot::{Robot, SensorReadings},
};
use std::collections::BTreeMap;
use vision::{
    detect::{DetectParams, Quad, QuadKind, detect},
    frame::Intrinsics,
    geometry::polygon,
    trace::NoTrace,
};

/// The person clicks on the quad that is the poster.
const IOU_CLICKED: f64 = 0.7;

/// How well a robot with a known pose says to know it: standard deviations of x, y
/// (metres) and heading (radians).
const KNOWN_SIGMA: [f64; 3] = [0.01, 0.01, 0.002];

/// A frame in which a poster was found.
#[derive(Debug)]
pub struct FirstView {
    /// The poster's quad.
    pub quad: Quad,
    /// The frame, and the truth about it.
    pub readings: SensorReadings,
    // Pose and extrinsics as the robot states them.
    map_from_robot: Pose2Covariance,
    extrinsics: CameraExtrinsics,
}

/// What the robot gathered.
#[derive(Debug)]
pub struct FirstDrive {
    /// Walls from its laser.
    pub walls: Vec<LaserSegment>,
    /// Views by name of the poster.
    pub views: BTreeMap<String, Vec<FirstView>>,
    /// Frames of a poster in which the detector did not find it.
    pub missed: usize,
}

/// Stops with their true poses, as a robot states them that knows its pose.
pub fn known_poses(stops: Vec<Stop>) -> Vec<(Stop, Pose2Covariance)> {
    let sigmas = Vector3::from(KNOWN_SIGMA);
    let covariance = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
    let known = |stop: Stop| {
        let pose = stop.step.map_from_robot;
        (stop, Pose2Covariance { pose, covariance })
    };
    stops.into_iter().map(known).collect()
}

/// Drives to all stops, each with the pose that the robot states there. Errors: a scan or a pose is
/// out of range.
pub fn first_drive(
    mut robot: Robot,
    stops: &[(Stop, Pose2Covariance)],
    errors: &SimulatedRobotErrors,
    p: &DetectParams,
) -> anyhow::Result<FirstDrive> {
    let progress = screen::progress(stops.len(), "first drive");
    let mut walls = Walls::new(WallParams::default());
    let (mut views, mut missed) = (BTreeMap::<String, Vec<FirstView>>::new(), 0);
    for (stop, map_from_robot) in stops {
        let readings = robot.look(&stop.step);
        let extrinsics = errors.extrinsics(&readings.step.robot_from_camera)?;
        walls.add(map_from_robot, &lines::segments(&readings.scan, &LineParams::default()))?;
        match clicked(&readings, &stop.landmark, p) {
            Some(quad) => views.entry(stop.landmark.clone()).or_default().push(FirstView {
                quad,
                readings,
                map_from_robot: *map_from_robot,
                extrinsics,
            }),
            None => missed += 1,
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    Ok(FirstDrive { walls: walls.segments().cloned().collect(), views, missed })
}

/// The detected quad that a person would click on.
fn clicked(readings: &SensorReadings, name: &str, p: &DetectParams) -> Option<Quad> {
    let truth = readings.frame.truth.landmark(name)?;
    detect(&readings.frame.image, p, &mut NoTrace)
        .into_iter()
        .filter(|quad| quad.kind == QuadKind::Full)
        .find(|quad| polygon::iou(quad.corners_px.points(), truth.corners_px.points()) >= IOU_CLICKED)
}

/// The place of a poster by its views, and the indices of the views that agree with it. The others
/// show another border of the same object, or another object: their icons would not fit the model
/// (method 7, rectangle consistency).
pub fn place_on_walls(
    views: &[FirstView],
    walls: &[LaserSegment],
    camera: &Intrinsics,
) -> Option<(LandmarkPlace, Vec<usize>)> {
    let p = PlacementParams::default();
    let on_walls: Vec<(usize, WallRectangle)> = views
        .iter()
        .enumerate()
        .filter_map(|(i, view)| {
            let posed = PosedView {
                corners: &view.quad.corners_px,
                covariance_px2: &view.quad.believed_covariance_px2(),
                camera,
                map_from_robot: &view.map_from_robot,
                mounting: &view.extrinsics,
            };
            Some((i, view_on_wall(&posed, walls, &p).ok()?))
        })
        .collect();
    let rectangles: Vec<WallRectangle> = on_walls.iter().map(|(_, rectangle)| rectangle.clone()).collect();
    let placement = placement(&rectangles, walls, &p).ok()?;
    Some((placement.place, placement.used.iter().map(|&i| on_walls[i].0).collect()))
}
