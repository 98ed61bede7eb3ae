//! The demo's first part: a surveying robot maps the walls by laser, looks at the posters from several sides, hangs
//! what the detector finds on the walls, and teaches it to the server over HTTP.
//!
//! What a person adds in the field is the name of the poster and a click on the right quad; here the simulator's truth
//! stands in for the click. Corners, places and sizes are measured, not taken from the truth.

use super::MAP;
use crate::{
    RunningServer,
    cli::{pictures, screen},
};
use client::{
    MapClient,
    lessons::{Job, Place, Size},
    map::Extent,
};
use map::{
    lines::{self, LineParams},
    mounting::Mounting,
    placing::{PlacingParams, PlacingView, ViewOnWall, placement, view_on_wall},
    pose2::Pose2Covariance,
    segments::LaserSegment,
    walls::{WallParams, Walls},
};
use nalgebra::{Matrix3, Vector3};
use sim::{
    building::Building,
    lesson::{LessonParams, Stop, stops},
    robot::{Robot, RobotParams, Sighting},
};
use std::{collections::BTreeMap, sync::Arc, time::Duration};
use vision::{
    detect::{
        detect,
        quads::{Quad, QuadKind},
    },
    frame::Intrinsics,
    geometry::polygon,
    params::DetectParams,
    trace::NoTrace,
};

/// How well the surveying robot knows its pose: standard deviations of x, y (metres) and heading (radians).
const SURVEY_SIGMA: [f64; 3] = [0.01, 0.01, 0.002];
/// The person clicks on the quad that is the poster.
const IOU_CLICKED: f64 = 0.7;
/// Longest wait for the lesson.
const LESSON_TIMEOUT: Duration = Duration::from_mins(10);

/// What was taught.
#[derive(Debug, Default)]
pub(super) struct Taught {
    pub(super) walls: usize,
    pub(super) landmarks: usize,
    pub(super) active: usize,
    pub(super) views: usize,
    /// Looks at a poster in which the detector did not find it.
    pub(super) views_missed: usize,
    /// Views whose rectangle on the wall disagrees with the others'.
    pub(super) views_left_out: usize,
}

/// One look at a poster in which it was found.
struct View {
    jpeg: Vec<u8>,
    quad: Quad,
    sighting: Sighting,
}

/// Maps, looks, places, teaches.
pub(super) async fn teach(
    building: &Arc<Building>,
    server: &RunningServer,
    seed: u64,
) -> anyhow::Result<Taught> {
    let maps = MapClient::new(&format!("http://{}", server.http_addr))?;
    maps.create_map(MAP, None).await?;
    let robot = Robot::new(building.clone(), &RobotParams::default());
    let camera = *robot.camera().intrinsics();
    let stops = stops(building, &LessonParams { seed, ..LessonParams::default() });
    let survey = tokio::task::spawn_blocking(move || survey(robot, &stops)).await??;

    let mut taught = Taught { walls: survey.walls.len(), views_missed: survey.missed, ..Taught::default() };
    let ends: Vec<[[f64; 2]; 2]> = survey.walls.iter().map(|w| [w.a.into(), w.b.into()]).collect();
    maps.set_laser(MAP, &ends).await?;
    let progress = screen::progress(survey.views.values().map(Vec::len).sum(), "teaching");
    for (name, views) in &survey.views {
        taught.landmarks += 1;
        let Some((place, size, agreed)) = hang(views, &survey.walls, &camera) else {
            screen::complain(&format!("{name} does not hang on a wall that the laser saw; it is left out"));
            continue;
        };
        maps.add_landmark(MAP, name, Some(size), Some(place)).await?;
        taught.views_left_out += views.len() - agreed.len();
        for view in agreed {
            let extent = Extent::Corners(view.quad.corners_px.into());
            maps.upload_view(MAP, name, view.jpeg.clone(), extent).await?;
            taught.views += 1;
            progress.inc(1);
        }
    }
    progress.finish_and_clear();
    let job = maps.learn(MAP, None, None).await?;
    let bar = screen::progress(1000, "learning");
    maps.wait_for_job(job, LESSON_TIMEOUT, |job: &Job| bar.set_position((job.progress * 1000.0) as u64))
        .await?;
    bar.finish_and_clear();
    for landmark in maps.landmarks(MAP).await? {
        if landmark.status == "active" {
            taught.active += 1;
        } else {
            let reasons: Vec<String> = landmark.reasons.iter().map(ToString::to_string).collect();
            screen::complain(&format!("{} is not in use: {}", landmark.name, reasons.join("; ")));
        }
    }
    Ok(taught)
}

/// What the surveying robot brought home.
struct Survey {
    walls: Vec<LaserSegment>,
    views: BTreeMap<String, Vec<View>>,
    missed: usize,
}

fn survey(mut robot: Robot, stops: &[Stop]) -> anyhow::Result<Survey> {
    let progress = screen::progress(stops.len(), "first drive");
    let mut walls = Walls::new(WallParams::default());
    let (mut views, mut missed) = (BTreeMap::<String, Vec<View>>::new(), 0);
    for stop in stops {
        let sighting = robot.look(&stop.step);
        walls.add(&surveyed(&sighting)?, &lines::segments(&sighting.scan, &LineParams::default()))?;
        match clicked(&sighting, &stop.landmark) {
            Some(quad) => {
                let jpeg = pictures::jpeg(&sighting.frame.image)?;
                views.entry(stop.landmark.clone()).or_default().push(View { jpeg, quad, sighting });
            }
            None => missed += 1,
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    Ok(Survey { walls: walls.segments().cloned().collect(), views, missed })
}

fn surveyed(sighting: &Sighting) -> Result<Pose2Covariance, map::check::OutOfRange> {
    let variances = Vector3::from(SURVEY_SIGMA.map(|sigma| sigma * sigma));
    Pose2Covariance::new(sighting.step.map_from_robot, Matrix3::from_diagonal(&variances))
}

/// The detected quad that a person would click on.
fn clicked(sighting: &Sighting, name: &str) -> Option<Quad> {
    let truth = sighting.frame.truth.landmark(name)?;
    detect(&sighting.frame.image, &DetectParams::default(), &mut NoTrace)
        .into_iter()
        .filter(|quad| quad.kind == QuadKind::Full)
        .find(|quad| polygon::iou(quad.corners_px.points(), truth.corners_px.points()) >= IOU_CLICKED)
}

/// Where the views say that it hangs, how large it is, and which views agree on that. The others saw another border of
/// the same thing, or something else: their icons would not fit the model (method 7, rectangle consistency).
fn hang<'a>(
    views: &'a [View],
    walls: &[LaserSegment],
    camera: &Intrinsics,
) -> Option<(Place, Size, Vec<&'a View>)> {
    let p = PlacingParams::default();
    let on_walls: Vec<(&View, ViewOnWall)> = views
        .iter()
        .filter_map(|view| {
            let look = PlacingView {
                corners: &view.quad.corners_px,
                covariance_px2: &view.quad.corner_covariance_px2,
                camera,
                map_from_robot: &surveyed(&view.sighting).ok()?,
                mounting: &Mounting::new(view.sighting.step.robot_from_camera).ok()?,
            };
            Some((view, view_on_wall(&look, walls, &p).ok()?))
        })
        .collect();
    let rectangles: Vec<ViewOnWall> = on_walls.iter().map(|(_, rectangle)| rectangle.clone()).collect();
    let placement = placement(&rectangles, walls, &p).ok()?;
    let place = placement.place;
    Some((
        Place { x_m: place.x_m, y_m: place.y_m, z_m: place.z_m, theta_rad: place.theta_rad },
        Size { width_m: place.size.width_m, height_m: place.size.height_m },
        placement.used.iter().map(|&i| on_walls[i].0).collect(),
    ))
}
